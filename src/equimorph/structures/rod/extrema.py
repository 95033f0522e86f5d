"""Local extrema of the curvature along rods, of which the largest is one."""

import numpy as np
from jaxtyping import Float, Int
from numpy.polynomial import legendre

from equimorph.arrays import Lanes, Parameters
from equimorph.structures.rod.discretisation import Mesh, reference_element
from equimorph.structures.rod.interface import Mechanics

Sizes = Float[np.ndarray, "lanes nodes"]
Nodes = Int[np.ndarray, "lanes places"]

DEGREE = 16
"""Of the interpolants of κ in the elements: they miss it by 1e-12 where |κ| ≤ 20."""
REFINING = 5
"""Newton steps from the largest value at a node to the extremum of the interpolant."""


def extreme_curvatures(
    mechanics: Mechanics, z: Lanes, p: Parameters, near: Float[np.ndarray, "lanes places"]
) -> Float[np.ndarray, "lanes places"]:
    """|κ| at its local extrema nearest to some arclengths of each lane, ends included."""
    mesh = Mesh(mechanics.mesh.breaks, reference_element(DEGREE))
    kappa = mechanics.fields(z, p, mesh.nodes)[:, :, 1]
    tops = _nearest_peaks(mesh, np.abs(kappa), near)
    # a vertex belongs to two elements, and the extremum lies in one of them
    sides = [np.clip((tops - back) // DEGREE, 0, mesh.elements - 1) for back in (1, 0)]
    left, right = (_refined(mesh, kappa, tops, element) for element in sides)
    return np.asarray(np.maximum(left, right))


def _nearest_peaks(mesh: Mesh, sizes: Sizes, near: Float[np.ndarray, "lanes places"]) -> Nodes:
    """Nodes at which |κ| is largest among their neighbours, nearest to some arclengths."""
    low = np.full((len(sizes), 1), -np.inf)
    before, after = np.hstack([low, sizes[:, :-1]]), np.hstack([sizes[:, 1:], low])
    peaks = (sizes > before) & (sizes >= after)
    away = np.abs(mesh.nodes - near[:, :, None])
    return np.asarray(np.where(peaks[:, None], away, np.inf).argmin(axis=2))


def _refined(
    mesh: Mesh,
    kappa: Sizes,
    tops: Nodes,
    element: Nodes,
) -> Float[np.ndarray, "lanes places"]:
    """Extrema of the interpolants in some elements next to their nodes; else values there.

    Of κ with the sign that it has at the node: |κ| is not smooth where κ vanishes.
    """
    nodes = 2.0 * mesh.reference.nodes - 1.0
    rows = np.arange(len(kappa))[:, None, None]
    at_top = kappa[rows[:, 0], tops]
    local = np.sign(at_top)[:, :, None] * kappa[rows, mesh.element_nodes[element]]
    series = np.moveaxis(local @ mesh.reference.to_legendre.T, -1, 0)
    slope, bend = legendre.legder(series), legendre.legder(series, 2)
    own = tops - mesh.degree * element
    inside = np.clip(own, 0, mesh.degree)
    x = nodes[inside]
    low, high = (nodes[np.clip(inside + k, 0, mesh.degree)] for k in (-1, 1))
    for _ in range(REFINING):
        turn, rate = (legendre.legval(x, part, tensor=False) for part in (slope, bend))
        with np.errstate(divide="ignore", invalid="ignore"):
            moved = x - turn / rate
        x = np.where((moved >= low) & (moved <= high), moved, x)
    return np.asarray(np.maximum(legendre.legval(x, series, tensor=False), np.abs(at_top)))
