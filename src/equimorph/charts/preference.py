"""The choice of a rule over points and at states, and the part of a set that it prefers."""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import permutations

import numpy as np

from equimorph.arrays import (
    Bool,
    CellFlags,
    Flags,
    Float,
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
from equimorph.manifold.complex.marked_complex import (
    Fabric,
    FacetMark,
    edges_of,
    ends_of_changes,
    fabric_of,
)
from equimorph.manifold.complex.vertices import Vertices, vertices_of
from equimorph.manifold.geometry.points import VertexKind, are_singular, on_fold
from equimorph.manifold.geometry.topology import adjacency, flags_of, keys_of
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
GUESSES = 4
"""Every so many rounds edges are divided on both sides of places that the rule knows."""
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

    def over_vertices(self, some: Items) -> Found:
        """States over vertices of the set: vertices, over the grid; elsewhere they are found."""
        grid, corners = self.cells.eset.grid_vertex, self.cells.corners
        away = np.flatnonzero(grid[some] < 0)
        found = self.cells.find(self.cells.values[some[away]])
        vertex, first = np.unique(corners, return_index=True)
        cell = self.cells.numbers[first // corners.shape[1]]
        order = np.argsort(grid[vertex], kind="stable")
        own = np.flatnonzero(grid[some] >= 0)
        low, high = (
            np.searchsorted(grid[vertex[order]], grid[some[own]], side)
            for side in ("left", "right")
        )
        count = high - low
        among = order[np.repeat(low - np.cumsum(count) + count, count) + np.arange(count.sum())]
        states = self.cells.eset.points[vertex[among]]
        point = np.concatenate([away[found.point], np.repeat(own, count)])
        both = Found(
            join_states(states.structure, [found.states, states]),
            point,
            np.concatenate([found.cell, cell[among]]),
            np.concatenate([found.inside, np.ones(len(among), bool)]),
        )
        return both.take(np.argsort(point, kind="stable"))

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
    fabric = fabric_of(eset, ends_of_changes(preference.cells.corners, values))
    # only candidates are cut: their neighbours beyond folds play no part
    fabric = _only(fabric, among)
    crossings = _Crossings(preference, fabric, values)
    cut = cut_between(fabric, values, crossings.between)
    inside = (cut.values[cut.fabric.cells] <= 0.0).all(axis=1)
    used = np.unique(cut.fabric.cells[inside])
    chosen = part_of(eset, cut.fabric, inside, cut.on_level, cut.lost)
    return chosen, cut.on_level[used], cut.lost


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


def _only(fabric: Fabric, cells: CellFlags) -> Fabric:
    """Some cells of a fabric, with their facets."""
    own = flags_of(fabric.facets, adjacency(fabric.cells[cells]).facets)
    return replace(fabric.only(cells), facets=fabric.facets[own], marks=fabric.marks[own])


def _signs(preference: Preference) -> Float[np.ndarray, " V"]:
    """−1 at preferred vertices, 1 elsewhere."""
    eset, corners = preference.cells.eset, preference.cells.corners
    values = np.ones(len(eset.points))
    used = np.unique(corners)
    met = used[eset.kinds[used] == VertexKind.CROSSING]
    values[met] = np.where(_preferred_beside(preference, met), -1.0, 1.0)
    used = used[eset.kinds[used] != VertexKind.CROSSING]
    states, scored = eset.points[used], preference.choice.score is not None
    found = preference.over_vertices(used) if scored else None
    values[used] = np.where(preference.prefers(states.z, states.p, found), -1.0, 1.0)
    folded = on_fold(eset.kinds)
    # paths to a fold end just before it or there: look a little way off
    doubtful = used[folded[used] & (values[used] > 0.0)]
    pairs = np.unique(
        np.concatenate([corners[:, list(two)] for two in permutations(range(corners.shape[1]), 2)]),
        axis=0,
    )
    pairs = pairs[np.isin(pairs[:, 0], doubtful) & ~folded[pairs[:, 1]]]
    fold, other = pairs[np.diff(pairs[:, 0], prepend=-1) > 0].T
    points = preference.cells.values
    there = preference.over((1.0 - BESIDE) * points[fold] + BESIDE * points[other])
    n, mass = eset.structure.unknowns, eset.structure.mass
    z = eset.points.z[:, :n]
    far = (there.states.z[:, :n] - z[fold[there.point]]) ** 2 @ mass
    own = far < MOVED**2 * ((z[other[there.point]] - z[fold[there.point]]) ** 2 @ mass)
    values[fold[there.point[own]]] = -1.0
    return values


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
        guessed = number % GUESSES == 0
        parts = PARTS[0] if guessed else int(np.clip(BATCH // len(wide), *PARTS))
        cuts = low[wide, None] + (high - low)[wide, None] * np.arange(parts + 1) / parts
        exact: ItemValues = np.full(len(wide), np.nan)
        if guessed:
            span = cuts[:, [0, -1]]
            exact = _enclose(cuts, way.changes(preference, wide, span, first[wide]))
        at, lanes = cuts[:, 1:-1], np.repeat(wide, parts - 1)
        z, p, good = way.states(lanes, at.ravel())
        same: ItemFlags = np.zeros(len(lanes), bool)
        same[good] = preference.prefers(z[good], p[good]) == first[lanes[good]]
        good, same = good.reshape(at.shape), np.reshape(same, at.shape)
        passed = np.where(same.all(axis=1), parts - 1, same.argmin(axis=1))
        every: Items = np.arange(len(wide))
        low[wide], high[wide] = cuts[every, passed], cuts[every, passed + 1]
        sure = (passed == 1) & np.isfinite(exact)
        low[wide[sure]] = high[wide[sure]] = exact[sure]
        unknown = ~good[every, np.minimum(passed, parts - 2)]
        todo = np.setdiff1d(todo, wide[unknown])
    done = np.zeros(len(way.ends), bool)
    z, p, good = way.states(todo, 0.5 * (low + high)[todo])
    done[todo[good]] = True
    own = way.ends[done], way.index[done]
    return done, _vertices(way.fabric, *own, z[good], p[good])


def _enclose(cuts: Float[np.ndarray, "n cuts"], shares: Float[np.ndarray, "n k"]) -> ItemValues:
    """Put the inner cuts of edges on both sides of the first known share inside; the shares."""
    shares = np.column_stack([shares, np.full(len(cuts), np.nan)])
    low, high = cuts[:, :1] + LOCATED, cuts[:, -1:] - LOCATED
    shares[~((shares > low) & (shares < high))] = np.nan
    share = shares[np.arange(len(cuts)), np.isfinite(shares).argmax(axis=1)]
    gap = np.abs(np.column_stack([shares, cuts[:, [0, -1]]]) - share[:, None])
    room = np.minimum(ASIDE, APART * np.where(gap > LOCATED, gap, np.inf).min(axis=1))
    known = np.isfinite(share)
    cuts[known, 1], cuts[known, -2] = (share - room)[known], (share + room)[known]
    return np.asarray(share)


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

    def changes(
        self, preference: Preference, lanes: Items, span: Float[np.ndarray, "n 2"], first: ItemFlags
    ) -> Float[np.ndarray, "n k"]:
        """Shares at which the choice may change between two shares of some edges.

        `first`: at which of the two shares the states are preferred.
        """
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
        bent = (marks & (FacetMark.CAP | FacetMark.FOLD) != 0) | folded.all(axis=1)
        plain = np.flatnonzero(~bent)
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
