"""Extrema along rods: of sampled functions, of curvature, of norms of vectors in elements."""

from functools import lru_cache

import numpy as np
from numpy.polynomial import legendre

from equimorph.arrays import Float, Int, Lanes, Parameters
from equimorph.linalg.lanes import over_lanes
from equimorph.structures.rod.discretisation import Mesh, reference_element
from equimorph.structures.rod.mechanics import PlanarMechanics
from equimorph.structures.rod.norm_kernels import largest_norms_lanes

Columns = tuple[Float[np.ndarray, "lanes m"], Float[np.ndarray, "lanes m"]]

HALF = 4
"""Half the degree of the polynomials through neighbouring samples."""
INTERVALS = 16
"""Equal intervals of each piece."""
NEWTON = 5
"""Newton iterations towards the maximum of a polynomial."""
FINE = 4
"""Places in each element, per degree, among which an extremum of the curvature is sought."""


def stations(breaks: Float[np.ndarray, " ends"]) -> Float[np.ndarray, " samples"]:
    """Places at which `peaks` wants the samples: each piece between breaks in equal intervals."""
    share = np.arange(INTERVALS) / INTERVALS
    inner = breaks[:-1, None] + np.diff(breaks)[:, None] * share
    return np.append(inner.ravel(), breaks[-1])


def peaks(values: Float[np.ndarray, "lanes samples"], at: Float[np.ndarray, " samples"]) -> Columns:
    """Local maxima of functions sampled at `stations`, ends included.

    Returned are their values, −∞ in the unused columns of a lane, and their places. Polynomials
    of degree 8 never cross the ends of pieces.
    """
    low = np.full((len(values), 1), -np.inf)
    left = np.concatenate([low, values[:, :-1]], axis=1)
    right = np.concatenate([values[:, 1:], low], axis=1)
    lane, sample = np.nonzero((values >= left) & (values > right))
    height, place = _polish(values, at, lane, sample)
    number = np.arange(len(lane)) - np.searchsorted(lane, lane)
    most = int(number.max(initial=0)) + 1
    out, places = np.full((len(values), most), -np.inf), np.zeros((len(values), most))
    out[lane, number], places[lane, number] = height, place
    return out, places


@lru_cache(maxsize=1)
def _inverse() -> Float[np.ndarray, "powers samples"]:
    """Coefficients of the polynomial through samples at −HALF … HALF."""
    return np.asarray(np.linalg.inv(np.vander(np.arange(-HALF, HALF + 1.0), increasing=True)))


def _polish(
    values: Float[np.ndarray, "lanes samples"],
    at: Float[np.ndarray, " samples"],
    lane: Int[np.ndarray, " n"],
    sample: Int[np.ndarray, " n"],
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Heights and places of maxima near samples, from the pieces on both sides."""
    height, place = values[lane, sample], at[sample]
    pieces = (values.shape[1] - 1) // INTERVALS
    for side in (-1, 0):
        piece = np.clip((sample + side) // INTERVALS, 0, pieces - 1)
        first = piece * INTERVALS
        middle = np.clip(sample, first + HALF, first + INTERVALS - HALF)
        window = values[lane[:, None], middle[:, None] + np.arange(-HALF, HALF + 1)]
        powers, start = window @ _inverse().T, (sample - middle).astype(float)
        low = np.maximum(start - 1.0, first - middle)
        high = np.minimum(start + 1.0, first + INTERVALS - middle)
        x = _maximise(powers, start, low, high)
        better = _value(powers, x) > height
        width = at[first + 1] - at[first]
        height = np.where(better, _value(powers, x), height)
        place = np.where(better, at[middle] + x * width, place)
    return height, place


def _maximise(
    powers: Float[np.ndarray, "n terms"],
    x: Float[np.ndarray, " n"],
    low: Float[np.ndarray, " n"],
    high: Float[np.ndarray, " n"],
) -> Float[np.ndarray, " n"]:
    """Maxima of polynomials between bounds, by Newton's method."""
    slope = powers[:, 1:] * np.arange(1, powers.shape[1])
    bend = slope[:, 1:] * np.arange(1, slope.shape[1])
    for _ in range(NEWTON):
        second = _value(bend, x)
        concave = second < 0.0
        step = np.where(concave, -_value(slope, x) / np.where(concave, second, 1.0), 0.0)
        x = np.clip(x + step, low, high)
    return x


def _value(
    powers: Float[np.ndarray, "n terms"], x: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    total = np.zeros(len(x))
    for column in powers.T[::-1]:
        total = total * x + column
    return total


Sizes = Float[np.ndarray, "lanes nodes"]
Nodes = Int[np.ndarray, "lanes places"]

DEGREE = 16
"""Of the interpolants of κ in the elements: they miss it by 1e-12 where |κ| ≤ 20."""
REFINING = 5
"""Newton steps from the largest value at a node to the extremum of the interpolant."""


def extreme_curvatures(
    mechanics: PlanarMechanics, z: Lanes, p: Parameters, near: Float[np.ndarray, "lanes places"]
) -> Float[np.ndarray, "lanes places"]:
    """|κ| at its local extrema nearest to some arclengths of each lane, ends included."""
    mesh = Mesh(mechanics.mesh.breaks, reference_element(DEGREE))
    kappa = mechanics.fields(z, p, mesh.nodes)[:, :, 1]
    tops = _nearest_peaks(mesh, np.abs(kappa), near)
    # a vertex belongs to two elements, and the extremum lies in one of them
    sides = [np.clip((tops - back) // DEGREE, 0, mesh.elements - 1) for back in (1, 0)]
    left, right = (_extrema_of_interpolants(mesh, kappa, tops, element) for element in sides)
    return np.asarray(np.maximum(left, right))


def _nearest_peaks(mesh: Mesh, sizes: Sizes, near: Float[np.ndarray, "lanes places"]) -> Nodes:
    """Nodes at which |κ| is largest among their neighbours, nearest to some arclengths."""
    low = np.full((len(sizes), 1), -np.inf)
    before, after = np.hstack([low, sizes[:, :-1]]), np.hstack([sizes[:, 1:], low])
    peaks = (sizes > before) & (sizes >= after)
    away = np.abs(mesh.nodes - near[:, :, None])
    return np.asarray(np.where(peaks[:, None], away, np.inf).argmin(axis=2))


def _extrema_of_interpolants(
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


@lru_cache
def _fine_grid(
    degree: int,
) -> tuple[Float[np.ndarray, " places"], Float[np.ndarray, "places n"], Float[np.ndarray, "n n"]]:
    """Places in an element, Legendre polynomials there, and the matrix of their derivatives."""
    grid = np.cos(np.linspace(np.pi, 0.0, FINE * degree + 1))
    slope = np.pad(legendre.legder(np.eye(degree + 1)), ((0, 1), (0, 0)))
    return grid, legendre.legvander(grid, degree), slope


def largest_norms(
    mesh: Mesh, values: Float[np.ndarray, "lanes elements order components"]
) -> Float[np.ndarray, "lanes elements"]:
    """Largest norm of a vector given at the nodes, in each element: that of its highest peak.

    The square of the norm is a polynomial in cos ϑ. A maximum M of one of degree m is at least
    M cos(m ϑ) within an angle of ϑ < π/m (M. Riesz), so that a peak of the grid lies near it
    and is not lower than `norm_kernels.LOWEST` of the highest; each of those is polished.
    Polishing the best place of the grid alone gives values that jump, and bounds that are located
    at the jump.
    """
    largest = np.empty(values.shape[:2])
    tables = (mesh.reference.to_legendre, *_fine_grid(mesh.degree))
    given = [np.ascontiguousarray(each) for each in (*tables, values)]
    if largest.size:
        over_lanes(largest_norms_lanes, tuple(given[:-1]), given[-1:], [largest])
    return largest
