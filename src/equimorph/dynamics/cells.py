"""What the joints and links of a chain get of a rod: integrals over its cells, loads, supports."""

from collections.abc import Callable
from typing import Any

import numpy as np

from equimorph.array_types import Float
from equimorph.errors import MissingError
from equimorph.structures import LineLoad, PointForce, Rod, SpatialRod, Tendon
from equimorph.structures.rod.ends import FREE, HELD, Holding
from equimorph.structures.rod.profiles import LoadShape
from equimorph.structures.rod.rod_description import Construction
from equimorph.structures.spatial.model import direction_in_space

_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(6)

Function = Callable[[Float[np.ndarray, " points"]], Float[np.ndarray, " points"]]


def integrals(
    function: Function, edges: Float[np.ndarray, " edges"], breaks: Float[np.ndarray, " breaks"]
) -> Float[np.ndarray, " cells"]:
    """Integrals between successive edges, split where the function is not smooth."""
    inner = breaks[(breaks > edges[0]) & (breaks < edges[-1])]
    all_edges = np.unique(np.concatenate([edges, inner]))
    half = 0.5 * np.diff(all_edges)[:, None]
    points = all_edges[:-1, None] + half * (_GAUSS + 1.0)
    pieces = (half * _WEIGHTS * function(points.ravel()).reshape(points.shape)).sum(axis=1)
    cell = np.searchsorted(edges, 0.5 * (all_edges[1:] + all_edges[:-1]), side="right") - 1
    return np.bincount(cell, pieces, len(edges) - 1)


def between(s: np.ndarray, start: float, stop: float) -> np.ndarray:
    """1 on a stretch of the rod, 0 elsewhere."""
    return np.asarray(((s > start) & (s < stop)).astype(float))


def thrust(term: Tendon, axial: LoadShape) -> Function:
    """Strain by which a cable with the tension 1 shortens the rod."""
    return lambda s: between(s, term.start, term.stop) / axial.density(s)


def joint_forces(
    made: Construction[Any],
    nodes: Float[np.ndarray, " joints"],
    breaks: Float[np.ndarray, " breaks"],
) -> Float[np.ndarray, "joints 3 settings"]:
    """Dead forces on the joints, as tables of the settings."""
    links = len(nodes) - 1
    out = np.zeros((links + 1, 3, made.table.shape[1]))
    for name, terms in made.build.terms.items():
        for term in terms:
            if isinstance(term, LineLoad):
                weights = _hats(term.density().density, nodes, breaks)
            elif isinstance(term, PointForce):
                weights = shares(term.s * links, links + 1)
            else:
                continue
            out += np.einsum(
                "j,x,k->jxk", weights, direction_in_space(term.direction), made.row(name)
            )
    return out


def _hats(
    density: Function, nodes: Float[np.ndarray, " joints"], breaks: Float[np.ndarray, " breaks"]
) -> Float[np.ndarray, " joints"]:
    """Integrals of a density times the hat functions of the joints."""
    whole = integrals(density, nodes, breaks)
    moment = integrals(lambda s: s * density(s), nodes, breaks)
    right = (moment - nodes[:-1] * whole) * (len(nodes) - 1)
    out = np.zeros(len(nodes))
    out[1:] += right
    out[:-1] += whole - right
    return out


def shares(place: float, count: int) -> Float[np.ndarray, " count"]:
    """Weights of linear interpolation at a place counted in points."""
    at = float(np.clip(place, 0.0, count - 1.0))
    left = min(int(at), count - 2)
    out = np.zeros(count)
    out[left], out[left + 1] = 1.0 - (at - left), at - left
    return out


def holding_stiffness(holding: Holding) -> float:
    """Stiffness of a support: ∞ where it holds, 0 where it is free."""
    return {HELD: np.inf, FREE: 0.0}[holding] if isinstance(holding, str) else float(holding)


def time_of(rod: Rod | SpatialRod) -> float:
    """T = √(m L/λ_cr) in the rod's unit of time.

    Raises
    ------
    MissingError
        For a rod with units and without a mass.
    """
    unit = rod.units.time()
    if unit is None:
        raise MissingError(f"`structure` must have a mass; the rod has none. {rod.massless}")
    return unit
