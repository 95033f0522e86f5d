"""Least-squares fits to too many targets, and families of solutions of too few."""

import numpy as np
from scipy.spatial import cKDTree

from equimorph.array_types import Bool, Float
from equimorph.arrays import Edges
from equimorph.manifold import Level, level_set
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.topology import pieces
from equimorph.manifold.queries.nearest import SetPoints, local_minima, points_at_vertices
from equimorph.model import Constraint, function_of
from equimorph.structures import States, join_states
from equimorph.tasks.optimising.programme import Objective, Programme
from equimorph.tasks.optimising.sqp import descend
from equimorph.tasks.shapes.prediction import Predictor, states_with_values
from equimorph.tolerances import FEASIBLE

STARTS = 12
"""Local minima over the vertices from which fits are searched."""

NEAR = 1.0
"""Farthest way from the prediction, in lengths of the edge, of a state that belongs to it."""


def best_fits(
    known: Predictor,
    targets: Float[np.ndarray, " k"],
    within: tuple[Constraint, ...],
    allowed: Bool[np.ndarray, " V"] | None = None,
) -> tuple[States, Float[np.ndarray, " fits"]]:
    """Local minima of ``Σ ((S − S*)/range)²``, the best first, and the roots of these sums.

    Minima at the sides of the box and on constraints count, too.

    Parameters
    ----------
    within
        Constraints, those of the set among them.
    allowed
        Vertices from which to search; all if None.
    """
    eset, spread = known.eset, known.spread
    squares = function_of(
        "misfit",
        lambda *each: sum(
            ((value - target) / unit) ** 2
            for value, target, unit in zip(each, targets, spread, strict=True)
        ),
        *known.descriptors,
    )
    edges, value = known.edges, known.misfits(targets)
    if allowed is not None:
        edges = edges[allowed[edges].all(axis=1)]
    starts = local_minima(edges, value)[:STARTS]
    programme = Programme.over(eset, Objective(squares, 1.0), within)
    ends = [
        end
        for end in descend(programme, points_at_vertices(eset, starts))
        if end.expansion.g.max(initial=-1.0) <= FEASIBLE
    ]
    ends.sort(key=lambda end: float(end.expansion.f.max()))
    misfit = np.sqrt(np.maximum([float(end.expansion.f.max()) for end in ends], 0.0))
    return join_states(eset.structure, [end.point for end in ends]), misfit


def solution_family(known: Predictor, targets: Float[np.ndarray, " k"]) -> Level:
    """Level set of one descriptor, or of two over three parameters: curves.

    Of two, curves run on the surface on which the first has its value, through the edges at whose
    ends the second lies on both sides of its own. `lost` counts edges without such a state, and
    triangles that curves do not just pass.
    """
    level = level_set(known.eset, known.descriptors[0], float(targets[0]))
    if len(targets) == 1 or not level.pieces:
        return level
    triangles = np.sort(np.concatenate(level.pieces), axis=1)
    sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [0, 2]], triangles[:, [1, 2]]])
    edges, number = np.unique(sides, axis=0, return_inverse=True)
    rest = known.descriptors[1](level.states) - targets[1]
    crossed = np.flatnonzero(rest[edges[:, 0]] * rest[edges[:, 1]] < 0.0)
    if len(crossed) == 0:
        return Level(level.states[:0], (), level.lost)
    states, found = _exact(known, level.states, edges[crossed], rest, targets)
    place = np.full(len(edges), -1)
    place[crossed[found]] = np.flatnonzero(found)
    ends = place[number.reshape(3, -1).T]
    hits = (ends >= 0).sum(axis=1)
    links = np.array([row[row >= 0] for row in ends[hits == 2]], int).reshape(-1, 2)
    lost = level.lost + int((~found).sum()) + int(np.isin(hits, (1, 3)).sum())
    return Level(states, tuple(pieces(links)) if len(links) else (), lost)


def _exact(
    known: Predictor,
    surface: States,
    edges: Edges,
    rest: Float[np.ndarray, " states"],
    targets: Float[np.ndarray, " k"],
) -> tuple[States, Bool[np.ndarray, " edges"]]:
    """Exact states near linear predictions on edges, and which of them were found."""
    structure, setting = known.eset.structure, known.setting
    first, last = edges.T
    share = (rest[first] / (rest[first] - rest[last]))[:, None]
    z = (1.0 - share) * surface.z[first] + share * surface.z[last]
    p = (1.0 - share) * surface.p[first] + share * surface.p[last]
    points = known.eset.points
    vertex = cKDTree(embed(setting, points.z, points.p)).query(embed(setting, z, p))[1]
    used, own = np.unique(vertex, return_inverse=True)
    rows = points_at_vertices(known.eset, used).rows[own]
    many = np.tile(targets, (len(edges), 1))
    exact = states_with_values(setting, SetPoints(z, p, rows), known.descriptors, many)
    z_end, p_end, found = exact.z, exact.p, exact.found
    gaps = (
        np.linalg.norm(embed(setting, *one) - embed(setting, *other), axis=1)
        for one, other in (
            ((z_end, p_end), (z, p)),
            ((surface.z[first], surface.p[first]), (surface.z[last], surface.p[last])),
        )
    )
    found &= next(gaps) <= NEAR * next(gaps) + 1e-6
    return States(structure, z_end, p_end), found
