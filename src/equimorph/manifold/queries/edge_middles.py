"""Exact states of a set next to the middles of the edges of its cells.

See docs/decisions.md, "States in the explorer lie on curved cells".
"""

from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Pairs
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.complex.marked_complex import edges_of
from equimorph.manifold.geometry.exact_points import correct_between
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.tangents import best_corners
from equimorph.structures import States, join_states

AT_ONCE = 16384
"""Edges that are worked on together."""


@dataclass(frozen=True, eq=False)
class EdgeMiddles:
    """Edges by the numbers of their ends, the lower first, and a state of each."""

    ends: Pairs
    states: States


def edge_middles(eset: EquilibriumSet) -> EdgeMiddles:
    """States in the normal spaces of planes of adjacent cells through the middles of edges.

    Each edge, of however many cells, has one. They may lie beyond constraints of the set, but not
    beyond what a structure can do; edges on which none is found are left out.
    """
    setting, points = replace(eset.setting, constraints=()), eset.points
    ends = edges_of(eset.cells, len(points))[0]
    place = embed(setting, points.z, points.p)
    rows = best_corners(setting, points.z, points.p, eset.cells)
    kept, parts = [], []
    for first in range(0, len(ends), AT_ONCE):
        some = ends[first : first + AT_ONCE]
        z, p = points.z[some].mean(axis=1), points.p[some].mean(axis=1)
        around = 0.5 * np.linalg.norm(place[some[:, 1]] - place[some[:, 0]], axis=1)
        middle = place[some].mean(axis=1)
        got = correct_between(setting, z, p, middle, rows[some[:, 0]], around)
        kept.append(some[got.found])
        parts.append(States(eset.structure, got.z[got.found], got.p[got.found]))
    return EdgeMiddles(np.concatenate([ends[:0], *kept]), join_states(eset.structure, parts))
