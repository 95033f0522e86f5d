"""Starts beside dips of kinked objectives that are narrower than a cell, found by their slopes.

The largest of several functions may fall and rise again between two vertices neither of which is
lower than its neighbours. At one end the slope then falls into the edge, and at the other it does
not fall out of it.
"""

import numpy as np

from equimorph.arrays import Bool, Float, Int, Items, Some
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.kept_tables import places_of
from equimorph.manifold.queries.nearest import points_at_vertices
from equimorph.tasks.optimising.programme import DIFFERENCE, Programme
from equimorph.tasks.optimising.tangent_steps import step_along, tangents_at
from equimorph.tasks.stable_part import stable_edges

MOST = 96
"""Edges whose slopes are computed, the most promising first."""
DIPS = 8
"""Further starts."""
DEEP = 1e-4
"""Depth of a dip, relative to the range of the values, that counts."""
LEVEL = 1e-2
"""Slope at the other end, relative to that which falls into an edge, that is none."""


def vertices_beside_dips(
    eset: EquilibriumSet,
    programme: Programme,
    allowed: Bool[np.ndarray, " V"],
    value: Float[np.ndarray, " V"],
    known: Some,
) -> Int[np.ndarray, " dips"]:
    """Vertices from which an edge may fall below all vertices by its slopes, the deepest first.

    Edges into which a known start falls are left out. First, slopes are estimated by the
    differences along the edges around.
    """
    finite = allowed & np.isfinite(value)
    if not finite.any():
        return np.zeros(0, int)
    level = value[finite].min() - DEEP * np.ptp(value[finite])
    edges = stable_edges(eset)
    edges = edges[finite[edges].all(axis=1)]
    edges = _promising(edges, places_of(eset), value, level)
    if not len(edges):
        return np.zeros(0, int)
    ends, place = np.unique(edges, return_inverse=True)
    inward = _inward_slopes(eset, programme, ends, place.reshape(edges.shape))
    bottom = _bottoms(value[edges], inward)
    own = np.argmin(np.nan_to_num(inward, nan=np.inf), axis=1)
    start = edges[np.arange(len(edges)), own]
    falls = np.isin(edges, known) & (value[edges] + inward < level)
    kept = (bottom < level) & ~falls.any(axis=1)
    order = np.flatnonzero(kept)[np.argsort(bottom[kept], kind="stable")]
    first = np.sort(np.unique(start[order], return_index=True)[1])
    return np.asarray(start[order][first][:DIPS])


def _promising(
    edges: Int[np.ndarray, "edges 2"],
    places: Float[np.ndarray, "V full"],
    value: Float[np.ndarray, " V"],
    level: float,
) -> Int[np.ndarray, "some 2"]:
    """Edges that may fall below a level with the steepest slopes of the edges around."""
    length = np.linalg.norm(places[edges[:, 1]] - places[edges[:, 0]], axis=1)
    slope = np.abs(np.diff(value[edges], axis=1)[:, 0]) / np.maximum(length, 1e-300)
    steep = np.zeros(len(value))
    for end in edges.T:
        np.maximum.at(steep, end, slope)
    low = value[edges].mean(axis=1) - 0.5 * length * steep[edges].max(axis=1)
    order = np.argsort(low, kind="stable")
    return np.asarray(edges[order[low[order] < level][:MOST]])


def _inward_slopes(
    eset: EquilibriumSet, programme: Programme, ends: Items, edges: Int[np.ndarray, "edges 2"]
) -> Float[np.ndarray, "edges 2"]:
    """Changes over the whole edge by the slopes at its ends, from each end into the edge."""
    setting = programme.setting
    frames, at = tangents_at(setting, points_at_vertices(eset, ends))
    d = frames.shape[1]
    steps = DIFFERENCE * np.concatenate([np.eye(d), -np.eye(d)])
    many = at.take(np.repeat(np.arange(len(at)), 2 * d))
    own = np.repeat(frames, 2 * d, axis=0)
    z, p = step_along(setting, many, own, np.tile(steps, (len(at), 1)))
    with np.errstate(invalid="ignore"):
        values = programme.objective.values(z, p).reshape(len(at), 2, d)
        slopes = (values[:, 0] - values[:, 1]) / (2.0 * DIFFERENCE)
    way = np.diff(places_of(eset)[ends][edges], axis=1)[:, 0]
    changes = [
        sign * np.einsum("ed,edf,ef->e", slopes[end], at.rows[end], way)
        for end, sign in zip(edges.T, (1.0, -1.0), strict=True)
    ]
    return np.stack(changes, axis=1)


def _bottoms(
    value: Float[np.ndarray, "edges 2"], inward: Float[np.ndarray, "edges 2"]
) -> Float[np.ndarray, " edges"]:
    """Least value that the steeper slope of both ends allows; ∞ where the edge falls one way.

    Tangents that meet bound convex functions alone: a peak in the box of errors that leaves it on
    the way is constant at one end, and falls behind it.
    """
    with np.errstate(invalid="ignore"):
        bottom = value.mean(axis=1) + 0.5 * inward.min(axis=1)
        level = -LEVEL * inward.min(axis=1)
        return np.where((inward < level[:, None]).all(axis=1), bottom, np.inf)
