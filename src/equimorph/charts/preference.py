"""The choice of a rule over points and at states, and the part of a set that it prefers."""

from dataclasses import dataclass
from functools import cached_property
from itertools import permutations

import numpy as np

from equimorph.arrays import (
    Bool,
    Flags,
    Float,
    Int,
    ItemFlags,
    Items,
    ItemValues,
    Lanes,
    Parameters,
    Points,
    Values,
    VertexFlags,
)
from equimorph.charts.location import Cells, Found
from equimorph.charts.rules import Choice
from equimorph.charts.score_changes import changes_by_score
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.cuts import Ends, cut_between
from equimorph.manifold.complex.edge_points import Places, on_edges
from equimorph.manifold.complex.excerpts import changing_cells, excerpt_of
from equimorph.manifold.complex.marked_complex import Fabric, FacetMark, edges_of
from equimorph.manifold.complex.vertices import Vertices, vertices_of
from equimorph.manifold.geometry.points import VertexKind, are_singular, on_fold
from equimorph.manifold.geometry.topology import keys_of
from equimorph.manifold.lookup.exact_states import exact_states, root_weights
from equimorph.manifold.queries.levels import part_of
from equimorph.structures import States, join_states

DIFFERENT = 1e-4
"""Distance in the metric from which on two states over a point are different ones."""
BESIDE, MOVED = 0.02, 0.3
"""Distance from a fold, in lengths of edges, at which the preference is examined, and the largest
distance of its state there: at a cusp it is the cube root of the first."""
PARTS, BATCH, ROUNDS, LOCATED = (3, 64), 800, 24, 3.0**-16
"""Fewest and most parts into which an edge is divided in a round, and states that are examined in
one: few take nearly as long as many. Rounds, and the share of an edge, 2e-8, to which the change is
located."""
GUESSES = 2
"""Every so many rounds edges are divided on both sides of places that the rule knows."""
GRADED = np.concatenate([0.1 ** np.arange(7, 0, -1), [0.5], 1.0 - 0.1 ** np.arange(1, 8)])
"""Shares at which edges without such a place are divided then."""
OFF_FOLD = 1e-3
"""Share of an edge next to an end on a fold, where F_z is singular, in which no rule is asked."""
ASIDE, APART = 1e-4, 0.4
"""Distances from such a place at which it is confirmed: shares of the edge, and of the distance
from the next place. Closer to a cusp paths tell two folds from one that they touch less well."""

Solved = tuple[Lanes, Parameters, ItemFlags]


@dataclass(frozen=True, eq=False)
class Preference:
    """A rule and the cells among which it chooses."""

    cells: Cells
    choice: Choice

    def over(self, points: Points) -> Found:
        """Preferred states over points."""
        found = self.cells.find(points)
        return found.take(self.choice.choose(found, points))

    def prefers(self, z: Lanes, p: Parameters, found: Found | None = None) -> Flags:
        """Whether states of the set are the preferred ones over their points.

        `found`: all states over these points, if they are known.
        """
        both, points = self._with_others(z, p, found)
        return self.choice.choose(both, points)[len(both.point) - len(z) :]

    def excess(self, z: Lanes, p: Parameters) -> Values:
        """Function that is positive where another state is preferred.

        The score less that of the best other state, which is smooth where the preference changes;
        −1 where no other state exists. ±1 for rules without a score.
        """
        if self.choice.score is None:
            return np.where(self.prefers(z, p), -1.0, 1.0)
        both, _ = self._with_others(z, p)
        others = len(both.point) - len(z)
        score, best = self.choice.score(both), np.full(len(z), np.inf)
        np.minimum.at(best, both.point[:others], score[:others])
        alone = ~np.isfinite(best)
        return np.where(alone, -1.0, score[others:] - np.where(alone, 0.0, best))

    def changes(self, start: States, stop: States) -> Float[np.ndarray, "lanes k"]:
        """Shares of straight ways at which the choice may change; see `Changes`.

        `start`, `stop`: the same states at both ends of the ways, not preferred and preferred.
        """
        choice, constraints = self.choice, self.cells.eset.constraints
        if choice.changes is not None:
            return choice.changes(start.p, stop.p - start.p)
        if choice.score is None:
            return np.zeros((len(start), 0))
        both, _ = self._with_others(start.z, start.p)
        return changes_by_score(choice.score, both, stop, constraints)

    def _with_others(
        self, z: Lanes, p: Parameters, found: Found | None = None
    ) -> tuple[Found, Points]:
        """Other states over the points of states, then these; and the points.

        A rule without a score names one state, whatever others there are: they are left out.
        """
        structure = self.cells.eset.structure
        points, n = self.cells.coordinates(z, p), structure.unknowns
        if found is None:
            found = self.cells.find(points if self.choice.score is not None else points[:0])
        gap = (found.states.z - z[found.point])[:, :n] ** 2 @ structure.mass
        own = np.sqrt(gap) < DIFFERENT
        # the state itself takes part as it is: at a fold no search would find it
        cell = np.full(len(z), -1)
        cell[found.point[own]] = found.cell[own]
        others = found.take(~own)
        states = join_states(structure, [others.states, States(structure, z, p)])
        itself = np.arange(len(z))
        both = Found(
            states,
            np.concatenate([others.point, itself]),
            np.concatenate([others.cell, cell]),
            np.concatenate([others.inside, np.ones(len(z), bool)]),
        )
        return both, points


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
        way = _Straight(fabric, ends[crossed], marks[crossed], lowest[crossed])
        done, self._found = _locate_changes(preference, way, values[ends[crossed]])
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


def _locate_changes(
    preference: Preference, way: "_Straight", values: Float[np.ndarray, "n 2"]
) -> tuple[ItemFlags, Vertices]:
    """Vertices on edges where the preference changes first on the way from their first ends.

    All edges are divided together: a batch of paths takes less than several small ones.
    """
    low, high = np.zeros(len(way.ends)), np.ones(len(way.ends))
    first: ItemFlags = values[:, 0] < 0.0
    todo: Items = np.arange(len(way.ends))
    for number in range(ROUNDS):
        wide = todo[high[todo] - low[todo] > LOCATED]
        if len(wide) == 0:
            break
        span = np.stack([low[wide], high[wide]], axis=1)
        exact: ItemValues = np.full(len(wide), np.nan)
        if number % GUESSES == 0:
            shares = way.changes(preference, wide, span, first[wide])
            cuts, exact = _enclose(span, shares)
        else:
            parts = int(np.clip(BATCH // len(wide), *PARTS))
            cuts = span[:, :1] + np.diff(span, axis=1) * np.arange(parts + 1) / parts
        good, same = _compare(preference, way, wide, cuts, first[wide])
        passed = np.where(same.all(axis=1), same.shape[1], same.argmin(axis=1))
        every: Items = np.arange(len(wide))
        low[wide], high[wide] = cuts[every, passed], cuts[every, passed + 1]
        sure = (passed == 1) & np.isfinite(exact)
        low[wide[sure]] = high[wide[sure]] = exact[sure]
        unknown = ~good[every, np.minimum(passed, good.shape[1] - 1)]
        todo = np.setdiff1d(todo, wide[unknown])
    done = np.zeros(len(way.ends), bool)
    z, p, good = way.states(todo, 0.5 * (low + high)[todo])
    done[todo[good]] = True
    own = way.ends[done], way.index[done]
    return done, _vertices(way.fabric, *own, z[good], p[good])


def _compare(
    preference: Preference,
    way: "_Straight",
    wide: Items,
    cuts: Float[np.ndarray, "n cuts"],
    first: ItemFlags,
) -> tuple[Bool[np.ndarray, "n inner"], Bool[np.ndarray, "n inner"]]:
    """At which inner cuts of edges states are known, and where they are preferred as at the start.

    Cuts at the ends of edges are those that some have less than others.
    """
    at = cuts[:, 1:-1]
    row, column = np.nonzero((at > cuts[:, :1]) & (at < cuts[:, -1:]))
    z, p, found = way.states(wide[row], at[row, column])
    good, same = np.ones(at.shape, bool), np.zeros(at.shape, bool)
    good[row, column] = found
    row, column = row[found], column[found]
    same[row, column] = preference.prefers(z[found], p[found]) == first[row]
    return good, same


def _enclose(
    span: Float[np.ndarray, "n 2"], shares: Float[np.ndarray, "n k"]
) -> tuple[Float[np.ndarray, "n cuts"], ItemValues]:
    """Cuts on both sides of the first known share inside each edge; and these shares.

    Edges without one are divided ever more finely towards their ends: most changes that no rule
    knows lie next to cusps.
    """
    shares = np.column_stack([shares, np.full(len(span), np.nan)])
    low, high = span[:, :1] + LOCATED, span[:, 1:] - LOCATED
    shares[~((shares > low) & (shares < high))] = np.nan
    share = shares[np.arange(len(span)), np.isfinite(shares).argmax(axis=1)]
    gap = np.abs(np.column_stack([shares, span]) - share[:, None])
    room = np.minimum(ASIDE, APART * np.where(gap > LOCATED, gap, np.inf).min(axis=1))
    known = np.isfinite(share)
    inner = GRADED if 0 < np.count_nonzero(~known) * len(GRADED) <= BATCH else GRADED[[0, -1]]
    parts = np.concatenate([[0.0], inner, [1.0]])
    cuts = span[:, :1] + np.diff(span, axis=1) * parts
    cuts[known, 1:] = span[known, 1:]
    cuts[known, 1], cuts[known, 2] = (share - room)[known], (share + room)[known]
    return cuts, np.asarray(share)


@dataclass(frozen=True)
class _Straight:
    """States over straight lines between the ends of edges; those on constraints stay on them.

    marks, index: the facet marks of the edges, and the index of the states between their ends.
    """

    fabric: Fabric
    ends: Ends
    marks: Items
    index: Items

    @cached_property
    def _folded(self) -> Bool[np.ndarray, "edges 2"]:
        """Which ends lie on folds."""
        return on_fold(self.fabric.vertices.kinds[self.ends])

    @cached_property
    def _bent(self) -> ItemFlags:
        """Which edges lie on folds or constraints."""
        curves = FacetMark.CAP | FacetMark.FOLD
        return np.asarray((self.marks & curves != 0) | self._folded.all(axis=1))

    def changes(
        self, preference: Preference, lanes: Items, span: Float[np.ndarray, "n 2"], first: ItemFlags
    ) -> Float[np.ndarray, "n k"]:
        """Shares at which the choice may change between two shares of some edges.

        `first`: at which of the two shares the states are preferred.
        """
        at_fold = self._folded[lanes] & ~self._bent[lanes, None] & (span == np.arange(2.0))
        span = np.where(at_fold, np.clip(span, OFF_FOLD, 1.0 - OFF_FOLD), span)
        start, stop = np.where(first, span.T[::-1], span.T)
        ends = [self.states(lanes, share) for share in (start, stop)]
        good = np.flatnonzero(ends[0][2] & ends[1][2])
        structure = self.fabric.setting.structure
        found = preference.changes(*(States(structure, z[good], p[good]) for z, p, _ in ends))
        out = np.full((len(lanes), found.shape[1]), np.nan)
        out[good] = start[good, None] + found * (stop - start)[good, None]
        return out

    def states(self, lanes: Items, t: ItemValues) -> Solved:
        """States at shares t of some edges, their parameters, and whether they were found."""
        store, ends = self.fabric.vertices, self.ends[lanes]
        folded, marks = self._folded[lanes], self.marks[lanes]
        weights = np.stack([1.0 - t, t], axis=1)
        p = np.einsum("nk,nkp->np", weights, store.p[ends])
        some = np.flatnonzero(folded.any(axis=1) & ~folded.all(axis=1))
        weights[some] = root_weights(weights[some], folded[some])
        z = np.einsum("nk,nki->ni", weights, store.z[ends])
        good = np.zeros(len(lanes), bool)
        plain = np.flatnonzero(~self._bent[lanes])
        structure = self.fabric.setting.structure
        z[plain], good[plain], index = exact_states(structure, z[plain], p[plain])
        good[plain] &= index == self.index[lanes[plain]]
        left = ~good
        for mark in np.unique(marks[left]).tolist():
            rest = np.flatnonzero(left & (marks == mark))
            places = Places(ends[rest], mark, self.index[lanes[rest]], t[rest])
            found, at = on_edges(self.fabric, places)
            z[rest[found]], p[rest[found]], good[rest] = at.z, at.p, found
        return z, p, good


def _vertices(fabric: Fabric, ends: Ends, index: Items, z: Lanes, p: Parameters) -> Vertices:
    """Vertices on edges, on the same folds and caps as both ends."""
    store = fabric.vertices
    kinds = store.kinds[ends]
    folded = on_fold(kinds).all(axis=1)
    on_cap = np.isin(kinds, (VertexKind.CAP, VertexKind.CORNER)).all(axis=1)
    kind = np.select(
        [folded & on_cap, folded, on_cap],
        [VertexKind.CORNER, VertexKind.FOLD, VertexKind.CAP],
        VertexKind.REFINED,
    )
    plain = on_fold(kinds[:, 0]).astype(int)
    rows = store.rows[ends[np.arange(len(ends)), plain]]
    rows, nowhere = np.ascontiguousarray(rows), np.full(len(ends), -1)
    return vertices_of(fabric.setting, z, p, kind, index, nowhere, rows)
