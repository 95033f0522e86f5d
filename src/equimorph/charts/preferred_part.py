"""The part of a set that a rule prefers, cut exactly where the preference changes."""

from itertools import permutations

import numpy as np

from equimorph.arrays import (
    Float,
    Int,
    ItemFlags,
    Items,
    VertexFlags,
)
from equimorph.charts.preference import Preference
from equimorph.charts.preference_changes import Straight, locate_changes
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.cuts import Ends, cut_between
from equimorph.manifold.complex.excerpts import changing_cells, excerpt_of
from equimorph.manifold.complex.marked_complex import Fabric, edges_of
from equimorph.manifold.complex.vertices import Vertices
from equimorph.manifold.geometry.points import VertexKind, are_singular, on_fold
from equimorph.manifold.geometry.topology import keys_of
from equimorph.manifold.queries.levels import part_of

BESIDE, MOVED = 0.02, 0.3
"""Distance from a fold, in lengths of edges, at which the preference is examined, and the largest
distance of its state there: at a cusp it is the cube root of the first."""


def preferred_part(preference: Preference) -> tuple[EquilibriumSet, VertexFlags, int]:
    """The preferred part of a set, which of its vertices lie on cuts, and edges without a cut."""
    eset = preference.cells.eset
    among = np.zeros(len(eset.cells), bool)
    among[preference.cells.numbers] = True
    values = _signs(preference)
    # only candidates are cut: their neighbours beyond folds play no part
    excerpt = excerpt_of(eset, among & changing_cells(eset.cells, values))
    own = values[excerpt.used]
    crossings = _Crossings(preference, excerpt.fabric, own)
    cut = cut_between(excerpt.fabric, own, crossings.between)
    recut = excerpt.put_back(cut.fabric)
    values = np.concatenate([values, cut.values[len(own) :]])
    inside = (values[recut.cells] <= 0.0).all(axis=1)
    inside[: len(among)] &= among
    used = np.unique(recut.cells[inside])
    return part_of(recut, inside, values == 0.0, cut.lost), values[used] == 0.0, cut.lost


class _Crossings:
    """Vertices at which the preference changes on edges, all found at once.

    Cuts lead from new vertices, on which the preference is neither, so that no edge is crossed that
    is not crossed before anything is cut.
    """

    def __init__(
        self, preference: Preference, fabric: Fabric, values: Float[np.ndarray, " V"]
    ) -> None:
        ends, of_cells = edges_of(fabric.cells, len(fabric.vertices))
        crossed = values[ends[:, 0]] * values[ends[:, 1]] < 0.0
        marks = fabric.edge_marks(ends)
        lowest = np.full(len(ends), np.iinfo(int).max)
        for side in of_cells.T:
            np.minimum.at(lowest, side, fabric.cell_index)
        self._base = len(fabric.vertices)
        way = Straight(fabric, ends[crossed], marks[crossed], lowest[crossed])
        done, self._found = locate_changes(preference, way, values[ends[crossed]])
        self._keys = keys_of(way.ends[done], self._base)

    def between(
        self, fabric: Fabric, ends: Ends, mark: int, index: Items, known: Float[np.ndarray, "n 2"]
    ) -> tuple[ItemFlags, Vertices]:
        """Those on some edges; see `cut_between`."""
        del fabric, mark, index, known
        wanted = keys_of(ends, self._base)
        done = np.isin(wanted, self._keys) & (ends < self._base).all(axis=1)
        order = np.argsort(self._keys)
        return done, self._found.take(order[np.searchsorted(self._keys[order], wanted[done])])


def _signs(preference: Preference) -> Float[np.ndarray, " V"]:
    """−1 at preferred vertices, 1 elsewhere."""
    eset, corners = preference.cells.eset, preference.cells.corners
    values = np.ones(len(eset.points))
    used = np.unique(corners)
    met = used[eset.kinds[used] == VertexKind.CROSSING]
    values[met] = np.where(_preferred_beside(preference, met), -1.0, 1.0)
    used = used[eset.kinds[used] != VertexKind.CROSSING]
    states, scored = eset.points[used], preference.choice.score is not None
    found = preference.cells.over_vertices[1] if scored else None
    values[used] = np.where(preference.prefers(states.z, states.p, found), -1.0, 1.0)
    folded = on_fold(eset.kinds)
    # paths to a fold end just before it or there: look a little way off
    doubtful = used[folded[used] & (values[used] > 0.0)]
    fold, other = _neighbours_off_folds(corners, doubtful, folded)
    points = preference.cells.values
    there = preference.over((1.0 - BESIDE) * points[fold] + BESIDE * points[other])
    n, mass = eset.structure.unknowns, eset.structure.mass
    z = eset.points.z[:, :n]
    far = (there.states.z[:, :n] - z[fold[there.point]]) ** 2 @ mass
    own = far < MOVED**2 * ((z[other[there.point]] - z[fold[there.point]]) ** 2 @ mass)
    values[fold[there.point[own]]] = -1.0
    return values


def _neighbours_off_folds(
    corners: Int[np.ndarray, "C corners"], some: Items, folded: VertexFlags
) -> tuple[Items, Items]:
    """Those of some vertices that have neighbours off folds, and the first of these of each."""
    wanted = np.zeros(len(folded), bool)
    wanted[some] = True
    corners = corners[wanted[corners].any(axis=1)]
    two = list(permutations(range(corners.shape[1]), 2))
    pairs = np.concatenate([corners[:, list(each)] for each in two])
    pairs = pairs[wanted[pairs[:, 0]] & ~folded[pairs[:, 1]]]
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    first = pairs[np.diff(pairs[:, 0], prepend=-1) > 0]
    return first[:, 0], first[:, 1]


def _preferred_beside(preference: Preference, met: Items) -> ItemFlags:
    """Whether the sheet of each vertex at a crossing is preferred next to that vertex."""
    eset, corners = preference.cells.eset, preference.cells.corners
    out = np.zeros(len(met), bool)
    two = list(permutations(range(corners.shape[1]), 2))
    pairs = np.concatenate([corners[:, list(each)] for each in two])
    cell = np.tile(preference.cells.numbers, len(two))
    regular = ~are_singular(eset.kinds)
    kept = np.flatnonzero(np.isin(pairs[:, 0], met) & regular[pairs[:, 1]])
    _, first = np.unique(pairs[kept, 0], return_index=True)
    vertex, other = pairs[kept[first]].T
    points = preference.cells.values
    there = preference.over((1.0 - BESIDE) * points[vertex] + BESIDE * points[other])
    own = eset.stratum[there.cell] == eset.stratum[cell[kept[first]][there.point]]
    out[np.searchsorted(met, vertex[there.point[own]])] = True
    return out
