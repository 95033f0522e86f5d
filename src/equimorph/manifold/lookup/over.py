"""The states of an equilibrium set over points: the cells above them, polished by Newton.

See docs/decisions.md, "Queries try only the cells that a point can lie over".
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from equimorph.arrays import (
    Bool,
    CellFlags,
    CellNumbers,
    Cells,
    Float,
    Int,
    Items,
    Lanes,
    Numbers,
    Some,
    VertexFlags,
)
from equimorph.linalg.lanes import in_background, threads
from equimorph.manifold.geometry.topology import Adjacency, senses
from equimorph.manifold.lookup.cell_index import NUDGE, CellIndex, Hits
from equimorph.manifold.lookup.exact_states import (
    CLOSEST,
    NEAREST,
    Found,
    Points,
    exact_states,
    first_of_same,
    in_order,
    lift_to,
    lifts_across_folds,
    nearest_pairs,
)
from equimorph.manifold.lookup.kernels import (
    balanced,
    guesses,
    longest_sides,
    one_of_each,
    worth_trying,
)
from equimorph.manifold.lookup.near_crossings import NearCrossings
from equimorph.manifold.lookup.near_cusps import NearCusps, united
from equimorph.manifold.lookup.rims import Rims, nearest_rims, ways_out
from equimorph.model import Constraint, are_feasible
from equimorph.structures import States, Structure
from equimorph.structures.metric import metric_length
from equimorph.tolerances import SAME_STATE

OVERHANG = 0.3
"""Barycentric tolerance for using a cell as an initial guess."""
PARTNERS = 3
"""Rounds in which states are looked for across folds, over points where some are missing. Of 15
first rounds 13 brought states, of two second ones none."""
CHUNK = 512
"""Points that are served together: their work arrays stay small."""

Guesses = Float[np.ndarray, "hits size"]
Chunk = tuple[Found, Hits | None, Found | None]
"""Certain states over some points, cells near undecided ones, and states beside cusps."""


@dataclass(frozen=True, eq=False)
class Sheets:
    """Cells of a set with their states, as the queries for states over points need them."""

    points: States
    """States of the vertices."""
    free: Int[np.ndarray, " d"]
    """Places of the free parameters."""
    cells: Cells
    cell_index: CellNumbers
    component: CellNumbers
    """Vertices of the cells, their index, and the pieces that they belong to."""
    whole: Adjacency
    """Facets of the cells, and how they hang together."""
    folded: VertexFlags
    capped: VertexFlags
    """Whether vertices lie on folds, and on constraints."""
    constraints: tuple[Constraint, ...]
    """Those that cut the set off."""
    crossings: NearCrossings | None = None
    cusps: NearCusps | None = None
    """Where sheets cross, and where folds turn back, if they do."""

    @property
    def structure(self) -> Structure:
        """To which the states belong."""
        return self.points.structure

    @cached_property
    def above(self) -> CellIndex:
        """Index of the cells."""
        overhang = np.where(self._at_an_edge, OVERHANG, 0.0)
        return CellIndex.of(self.points.p[:, self.free][self.cells], overhang)

    @cached_property
    def _brims(self) -> Bool[np.ndarray, "C corners"]:
        """Facets of cells, by the corner across, with all corners on folds or constraints."""
        on = (self.folded | self.capped)[self.cells]
        return np.asarray(on.sum(axis=1, keepdims=True) - on == on.shape[1] - 1)

    @cached_property
    def _at_an_edge(self) -> CellFlags:
        """Cells on folds or constraints, where straight cells miss the curved edge."""
        return np.asarray((self.folded | self.capped)[self.cells].any(axis=1))

    @cached_property
    def _unresolved(self) -> CellFlags:
        """Cells with a vertex that the discretisation does not resolve: so may states near them."""
        return np.asarray(~self.points.resolved[self.cells].all(axis=1))

    @cached_property
    def _of_cells(self) -> tuple[np.ndarray, ...]:
        """Sign by index; whether overturned, at an edge, at a constraint, there at no fold."""
        capped = np.asarray(self.capped[self.cells].any(axis=1))
        ended = capped & ~self.folded[self.cells].any(axis=1)
        return 1 - 2 * (self.cell_index % 2), self._overturned, self._at_an_edge, capped, ended

    @cached_property
    def _overturned(self) -> CellFlags:
        """Cells that project against the orientation that their index demands."""
        places = self.points.p[:, self.free]
        return senses(self.cells, self.cell_index, places, self.whole, self.component).overturned

    def over(self, p: Points) -> tuple[States, Items, Items]:
        """States over points (all parameters given), sorted by point; the points; the cells.

        Cells that contain a point, and those on folds and constraints that it just misses, are
        interpolated and corrected by Newton. Across folds states appear in pairs of opposite
        parity: where the sum of (−1)^index is not that of the cells above, states beyond
        constraints included, or a cell gives no state, all known equilibria nearby are lifted to
        the point instead.
        """
        certain, near, hidden = zip(*self._in_chunks(p), strict=True)
        parts = list(certain)
        if doubtful := [each for each in near if each is not None]:
            parts.extend(self._search(p, Hits.concatenate(doubtful)))
        if beside := [each for each in hidden if each is not None]:
            parts = united(self.structure, parts, beside)
        z, point, cell = parts[0] if len(parts) == 1 else in_order(parts)
        if self.crossings is not None:
            z, point, cell = self._beside_crossings(self.crossings, p, z, point, cell)
        return States(self.structure, z, p[point]), point, cell

    def _beside_cusps(self, p: Points, first: int) -> Found | None:
        """States over points that cells next to cusps hide, if any; `first` is added."""
        if self.cusps is None:
            return None
        z, point, cell = self.cusps.states(self.structure, p, p[:, self.free], self.cell_index)
        if len(point) == 0:
            return None
        good = self.structure.resolved(z, p[point]) & are_feasible(self.constraints, z, p[point])
        return (z[good], first + point[good], cell[good]) if good.any() else None

    def _beside_crossings(
        self, crossings: NearCrossings, p: Points, z: Lanes, point: Numbers, cell: Numbers
    ) -> Found:
        """States found over points, where these are close to crossings by the reduced equation."""
        near = self.above.near(p[:, self.free])
        close = crossings.close(near, p)
        if len(close) == 0:
            return z, point, cell
        centres = crossings.centres(close, p)
        branches, centres = crossings.branches(centres, p)
        own = np.isin(branches.index, self.cell_index)
        own &= are_feasible(self.constraints, branches.z, p[branches.point])
        of_own = (branches.z[own], branches.point[own], branches.index[own])
        kept = ~crossings.on_branches(centres, p, z, point)
        parts = [(z[kept], point[kept], cell[kept])]
        for number in np.unique(of_own[1]):
            here, index = (column[of_own[1] == number] for column in (of_own[0], of_own[2]))
            mine = near.take(near.point == number)
            there = self._nearest(here, index, self.guess(mine), mine)
            parts.append((here, np.full(len(here), number), there))
        z, point, cell = (np.concatenate(column) for column in zip(*parts, strict=True))
        order = np.lexsort((cell, point))
        return z[order], point[order], cell[order]

    def _in_chunks(self, p: Points) -> list[Chunk]:
        """States over points, chunk by chunk, on all threads."""
        starts = range(0, max(len(p), 1), CHUNK)
        out: dict[int, Chunk] = {}

        def serve(own: range) -> None:
            for at in own:
                some = p[at : at + CHUNK]
                out[at] = *self._some(some, at), self._beside_cusps(some, at)

        number = min(threads(), len(starts))
        if number < 2:
            serve(starts)
        else:
            for task in in_background([partial(serve, starts[k::number]) for k in range(number)]):
                task.result()
        return [out[at] for at in starts]

    def _some(self, p: Points, first: int) -> tuple[Found, Hits | None]:
        """Certain states over points, and the cells near undecided ones; `first` is added."""
        near = self.near(p[:, self.free])
        of_hits = near.cell, near.weights
        tried = worth_trying(of_hits, near.inside, self._brims, self.above.maps, NUDGE)
        if len(tried) == 0:
            return (np.zeros((0, self.points.z.shape[1])), tried, tried), None
        hits = near.take(tried)
        at, guess = p[hits.point], self.guess(hits)
        wanted, room = self.cell_index[hits.cell], self._room[hits.cell]
        z, good, index = exact_states(self.structure, guess, at, wanted)
        mass, converged = self.structure.mass, good.copy()
        good &= (index == wanted) & (self.structure.resolved(z, at) | self._unresolved[hits.cell])
        found = one_of_each((hits.point, hits.inside), (z, good), guess, room, mass, SAME_STATE)
        sure = balanced((hits.point, hits.cell, hits.inside), good, found, self._of_cells, len(p))
        # in a tongue or sliver all corners may be near its folds, and states there far from theirs;
        # beside a side of the box guesses may lead across the fold of a narrow strip
        sure[hits.point[converged & ~good & (hits.inside | (index == wanted))]] = False
        doubtful = None
        if not sure.all():
            found = found[sure[hits.point[found]]]
            doubtful = near.take(~sure[near.point])
            doubtful = replace(doubtful, point=first + doubtful.point)
        kept = found[are_feasible(self.constraints, z[found], at[found])]
        return (z[kept], first + hits.point[kept], hits.cell[kept]), doubtful

    def near(self, x: Float[np.ndarray, "points d"]) -> Hits:
        """Cells near points, including those at the rims whose bands contain the points."""
        near = self.above.near(x)
        point, cell = self._rims.near(x)
        if len(point) == 0:
            return near
        count = len(self.cells)
        new, old = np.unique(point * count + cell), near.point * count + near.cell  # both sorted
        place = np.searchsorted(old, new)
        new = new[np.append(old, -1)[place] != new]
        point, cell = np.divmod(new, count)
        more = Hits(point, cell, self.above.weights(x[point], cell), np.zeros(len(new), bool))
        return near.with_others(more)

    @cached_property
    def _rims(self) -> Rims:
        """Bands along folds and constraints, which straight cells miss."""
        whole, beside = self.whole, self.whole.beside
        on = (self.folded | self.capped)[whole.facets].all(axis=1)
        index = np.where(beside >= 0, self.cell_index[beside], self.cell_index[beside[:, :1]])
        on &= (whole.counts != 2) | (index != index[:, :1]).any(axis=1)
        return Rims.of(self.points.p[:, self.free], whole, np.flatnonzero(on))

    def guess(self, hits: Hits) -> Lanes:
        """Interpolation between the corners, at the nearest point of the cell.

        From a fold on, states move like the root of the way in the parameters.
        """
        of_hits = hits.cell, hits.weights
        return np.asarray(guesses(of_hits, self.cells, self.folded, self.points.z, CLOSEST))

    @cached_property
    def _room(self) -> Float[np.ndarray, " C"]:
        """How far states may be from their guess: twice the longest side from the first corner."""
        room = np.empty(len(self.cells))
        longest_sides(self.cells, self.points.z, self.structure.mass, room)
        return 2.0 * room + SAME_STATE

    def _search(self, p: Points, near: Hits) -> Iterator[Found]:
        """States over points by lifts and Newton from all regular vertices near each of them."""
        guess = self.guess(near)
        pairs = np.stack(
            [np.repeat(near.point, self.cells.shape[1]), self.cells[near.cell].ravel()]
        )
        owner, corner = np.unique(pairs[:, ~self.folded[pairs[1]]], axis=1)
        solved, of_solved = self._exact(
            np.concatenate([guess, self.points.z[corner]]),
            p,
            np.concatenate([near.point, owner]),
            near,
        )
        lifted, which = lift_to(self.points[corner], p[owner], self.constraints)
        # lifts that begin on a constraint do not end there
        good = are_feasible(self.constraints, lifted, p[owner[which]])
        z = np.concatenate([solved, lifted[good]])
        point = np.concatenate([of_solved, owner[which[good]]])
        numbers = np.unique(near.point)
        z, point, index = self._distinct(z, point, p)
        for _ in range(PARTNERS):
            more, of_more = self._partners(z, point, index, p, near)
            if len(more) == 0:
                break
            before = len(z)
            z, point, index = self._distinct(
                np.concatenate([z, more]), np.concatenate([point, of_more]), p
            )
            if len(z) == before:
                break
        for number in numbers:
            own, mine = point == number, near.point == number
            cell = self._nearest(z[own], index[own], guess[mine], near.take(mine))
            yield z[own], point[own], cell

    def _distinct(
        self, z: Lanes, point: Numbers, p: Points
    ) -> tuple[Float[np.ndarray, "m size"], Int[np.ndarray, " m"], Int[np.ndarray, " m"]]:
        """Different states over each point, those points, sorted, and the index."""
        lanes = [np.flatnonzero(point == number) for number in np.unique(point)]
        kept = np.concatenate(
            [own[first_of_same(self.structure, z[own])] for own in lanes] or [np.zeros(0, int)]
        )
        index = self.structure.index(z[kept], p[point[kept]])
        # lifts from parts of sets leave them across folds
        own = np.isin(index, self.cell_index)
        return z[kept[own]], point[kept[own]], index[own]

    def _partners(
        self, z: Lanes, point: Numbers, index: Numbers, p: Points, near: Hits
    ) -> tuple[Float[np.ndarray, "m size"], Int[np.ndarray, " m"]]:
        """States that meet known ones in folds nearby, where parity shows that some are missing.

        Out across the rims near the point, through the fold, and back.
        """
        inside, cell = near.inside, near.cell
        sign, overturned = self._of_cells[:2]
        above = np.where(overturned[cell], -sign[cell], sign[cell]) * inside
        surplus = np.bincount(point, 1.0 - 2.0 * (index % 2), len(p)) - np.bincount(
            near.point, above, len(p)
        )
        # cells without volume have no maps, and nothing is across from their corners
        missed = (surplus[near.point] != 0.0) & np.isfinite(self.above.maps[cell, 0, 0])
        hit, corner = nearest_rims(near, self._brims, missed, self.above)
        sides = self.points.p[:, self.free][self.cells[cell[hit]]]
        way = ways_out(cell[hit], corner, sides, self.above)
        first, last = (np.searchsorted(point, near.point[hit], side) for side in ("left", "right"))
        number = np.repeat(np.arange(len(hit)), last - first)
        state = np.concatenate([np.zeros(0, int), *map(np.arange, first, last)])
        guess, pairs = self.guess(near)[hit], np.stack([state, number])
        nearest = nearest_pairs(self.structure, z, guess, pairs, number, NEAREST)
        number, state = number[nearest], state[nearest]
        velocity = np.zeros((len(state), p.shape[1]))
        velocity[:, self.free] = way[number]
        found, which = lifts_across_folds(
            States(self.structure, z[state], p[point[state]]), velocity
        )
        found, of_found = self._exact(found, p, point[state[which]], near)
        return found, of_found

    def _exact(
        self, starts: Lanes, p: Points, owner: Numbers, near: Hits
    ) -> tuple[Float[np.ndarray, "some size"], Some]:
        """Admissible states to which Newton leads over the points of the starts; which points."""
        z, good, _ = exact_states(self.structure, starts, p[owner])
        z, owner = z[good], owner[good]
        unresolved = np.zeros(len(p), bool)
        unresolved[near.point[self._unresolved[near.cell]]] = True
        good = self.structure.resolved(z, p[owner]) | unresolved[owner]
        good &= are_feasible(self.constraints, z, p[owner])
        return z[good], owner[good]

    def _nearest(self, z: Lanes, index: Numbers, guess: Guesses, mine: Hits) -> Items:
        """Cell of the same index whose interpolation over the point is nearest to each state."""
        gap = metric_length(self.structure, z[:, None] - guess)
        gap[index[:, None] != self.cell_index[mine.cell][None]] = np.inf
        if len(guess) == 0:
            return np.full(len(z), -1)
        best = gap.argmin(axis=1)
        near = np.isfinite(gap[np.arange(len(z)), best])
        return np.where(near, mine.cell[best], -1)
