"""Where along edges of a set the preference of a rule changes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from equimorph.arrays import (
    Bool,
    Float,
    ItemFlags,
    Items,
    ItemValues,
    Lanes,
    Parameters,
)
from equimorph.charts.preference import Preference
from equimorph.manifold.complex.cuts import Ends
from equimorph.manifold.complex.edge_points import Places, on_edges
from equimorph.manifold.complex.marked_complex import Fabric, FacetMark
from equimorph.manifold.complex.vertices import Vertices, vertices_of
from equimorph.manifold.geometry.points import VertexKind, on_fold
from equimorph.manifold.lookup.exact_states import exact_states, root_weights
from equimorph.structures import States

PARTS, BATCH, ROUNDS, LOCATED = (3, 64), 100, 24, 3.0**-16
"""Fewest and most parts into which an edge is divided in a round, and states that are examined in
one: few take nearly as long as many. Rounds, and the share of an edge, 2e-8, to which the change is
located."""
GUESSES = 2
"""Every so many rounds edges are divided on both sides of places that the rule knows."""
GRADED = np.concatenate([0.1 ** np.arange(7, 0, -1), [0.5], 1.0 - 0.1 ** np.arange(1, 8)])
"""Shares at which edges without such a place are divided then."""
AT_CUSP = 1e-3
"""Length, in those of typical edges, next to an end of an edge along a fold in which rules choose
at random: there a cusp is near, at which the states that they tell apart are one."""
OFF_FOLD = 1e-3
"""Share of an edge next to an end on a fold, where F_z is singular, in which no rule is asked."""
ASIDE, APART = 1e-4, 0.4
"""Distances from such a place at which it is confirmed: shares of the edge, and of the distance
from the next place. Closer to a cusp paths tell two folds from one that they touch less well."""

Solved = tuple[Lanes, Parameters, ItemFlags]


@dataclass(frozen=True)
class Straight:
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

    @property
    def on_folds(self) -> ItemFlags:
        """Which edges lie along folds."""
        return np.asarray(self.marks & FacetMark.FOLD != 0)

    @cached_property
    def _at_cusp(self) -> ItemValues:
        """Shares of edges along folds next to their ends in which rules choose at random."""
        free, place = self.fabric.setting.free, self.fabric.vertices.p
        lengths = np.linalg.norm((place[self.ends[:, 0]] - place[self.ends[:, 1]])[:, free], axis=1)
        typical = np.median(lengths) if len(lengths) else 0.0
        return np.asarray(AT_CUSP * typical / np.maximum(lengths, 1e-300))

    def precision(self, low: ItemValues, high: ItemValues) -> ItemValues:
        """Shares to which changes between two shares of the edges must be known."""
        beside = np.minimum(high, 1.0 - low) <= 1.01 * self._at_cusp
        return np.where(self.on_folds & beside, self._at_cusp, LOCATED)

    def ends_at_cusps(self, share: ItemValues) -> Items:
        """Which end of each edge, 0 or 1, a change on a fold is no farther from than a cusp; or −1.

        At the cusp itself the states that rules tell apart are one.
        """
        near = np.minimum(share, 1.0 - share) <= 1.01 * self._at_cusp
        return np.where(self.on_folds & near, np.rint(share).astype(int), -1)

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


def locate_changes(
    preference: Preference, way: Straight, values: Float[np.ndarray, "n 2"]
) -> tuple[ItemFlags, Vertices, Items]:
    """Vertices on edges where the preference changes first on the way from their first ends.

    Changes at cusps have no vertices of their own: for these edges the end that is the cusp is
    told, −1 for others. All edges are divided together: a batch of paths takes less than several
    small ones.
    """
    low, high = np.zeros(len(way.ends)), np.ones(len(way.ends))
    first: ItemFlags = values[:, 0] < 0.0
    todo: Items = np.arange(len(way.ends))
    for number in range(ROUNDS):
        wide = todo[high[todo] - low[todo] > way.precision(low, high)[todo]]
        if len(wide) == 0:
            break
        span = np.stack([low[wide], high[wide]], axis=1)
        exact: ItemValues = np.full(len(wide), np.nan)
        if number % GUESSES == 0:
            shares = way.changes(preference, wide, span, first[wide])
            cuts, exact = _enclose(span, shares, way.on_folds[wide])
        else:
            parts = int(np.clip(BATCH // len(wide), *PARTS))
            cuts = span[:, :1] + np.diff(span, axis=1) * np.arange(parts + 1) / parts
        good, same = _compare(preference, way, wide, cuts, first[wide])
        passed = np.where(same.all(axis=1), same.shape[1], same.argmin(axis=1))
        every: Items = np.arange(len(wide))
        low[wide], high[wide] = cuts[every, passed], cuts[every, passed + 1]
        sure = (exact > cuts[every, passed]) & (exact < cuts[every, passed + 1])
        low[wide[sure]] = high[wide[sure]] = exact[sure]
        unknown = ~good[every, np.minimum(passed, good.shape[1] - 1)]
        todo = np.setdiff1d(todo, wide[unknown])
    share, done = 0.5 * (low + high), np.zeros(len(way.ends), bool)
    at_cusp = np.full(len(way.ends), -1)
    at_cusp[todo] = way.ends_at_cusps(share)[todo]
    todo = todo[at_cusp[todo] < 0]
    z, p, good = way.states(todo, share[todo])
    done[todo[good]] = True
    own = way.ends[done], way.index[done]
    return done, _vertices(way.fabric, *own, z[good], p[good]), at_cusp


def _compare(
    preference: Preference,
    way: Straight,
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
    span: Float[np.ndarray, "n 2"], shares: Float[np.ndarray, "n k"], on_folds: ItemFlags
) -> tuple[Float[np.ndarray, "n cuts"], ItemValues]:
    """Cuts on both sides of the first known share inside each edge; and these shares.

    Edges without one, and those on folds, are divided ever more finely towards their ends: most
    changes that no rule knows lie next to cusps.
    """
    shares = np.column_stack([shares, np.full(len(span), np.nan)])
    low, high = span[:, :1] + LOCATED, span[:, 1:] - LOCATED
    shares[~((shares > low) & (shares < high))] = np.nan
    share = shares[np.arange(len(span)), np.isfinite(shares).argmax(axis=1)]
    gap = np.abs(np.column_stack([shares, span]) - share[:, None])
    room = np.minimum(ASIDE, APART * np.where(gap > LOCATED, gap, np.inf).min(axis=1))
    graded = np.isnan(share) | on_folds
    inner = GRADED if np.count_nonzero(graded) * len(GRADED) <= BATCH else GRADED[[0, -1]]
    between = span[:, :1] + np.diff(span, axis=1) * inner
    between[~graded] = span[~graded, 1:]
    beside = np.stack([share - room, share + room], axis=1)
    beside[np.isnan(share)] = span[np.isnan(share), 1:]
    cuts = np.column_stack([span, between, beside])
    cuts.sort(axis=1)
    return cuts, np.asarray(share)


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
