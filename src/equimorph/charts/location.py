"""The states of some cells of a set that have given coordinates."""

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from equimorph.arrays import (
    Bool,
    Facets,
    Flags,
    Float,
    Int,
    Items,
    Lanes,
    Numbers,
    Parameters,
    Place,
    Points,
    Some,
    VertexFlags,
)
from equimorph.charts.coordinates import Coordinates
from equimorph.charts.preparation import on_box
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.kept_tables import places_of
from equimorph.manifold.geometry.points import VertexKind, are_singular, on_fold
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.simplices import longest_sides, middles, sizes_of, volumes
from equimorph.manifold.geometry.topology import (
    Adjacency,
    adjacency,
    facets_of,
    flags_of,
    orientation,
    runs,
)
from equimorph.manifold.lookup.cell_index import CellIndex, Hits
from equimorph.model import are_feasible
from equimorph.structures import States, join_states
from equimorph.tolerances import SAME_STATE

Guess = tuple[Float[np.ndarray, "hits size"], Float[np.ndarray, "hits parameters"]]

WIDE = 1.0
"""How far beyond a cell at an edge, in barycentric coordinates, a point may lie to be tried."""
CHUNK = 4096
"""Points whose states are found at once."""
SLACK = 1e-9
"""Largest excess over the box or a constraint, in their units, that counts as none."""


class EdgeKind(StrEnum):
    """What a piece of the boundary of a chart, or a barrier, lies on; equal to its text."""

    FOLD = "fold"
    CROSSING = "crossing"
    CAP = "cap"
    BOX = "box"
    CUT = "cut"
    HOLE = "hole"
    SINGULAR = "singular"
    TIE = "tie"

    def __repr__(self) -> str:
        """Return the text in quotes, as that of any other word."""
        return repr(self.value)


@dataclass(frozen=True, eq=False)
class Found:
    """States that have the coordinates of points, sorted by point, and cells that they lie on.

    inside: whether that cell contains the point.
    """

    states: States
    point: Int[np.ndarray, " found"]
    cell: Int[np.ndarray, " found"]
    inside: Bool[np.ndarray, " found"]

    def take(self, some: Bool[np.ndarray, " found"] | Some) -> "Found":
        """Some of the states."""
        return Found(self.states[some], self.point[some], self.cell[some], self.inside[some])


@dataclass(frozen=True, eq=False)
class Cells:
    """Some cells of a set in the space of coordinates."""

    eset: EquilibriumSet
    """The set."""
    coordinates: Coordinates
    """The coordinates."""
    numbers: Int[np.ndarray, " own"]
    """Which of its cells."""
    cut: VertexFlags | None = None
    """Vertices along which the set itself was cut off."""

    @cached_property
    def values(self) -> Float[np.ndarray, "V d"]:
        """Coordinates of all vertices of the set."""
        return self.coordinates(self.eset.points.z, self.eset.points.p)

    @cached_property
    def corners(self) -> Int[np.ndarray, "own corners"]:
        """Vertices of the cells."""
        return np.asarray(self.eset.cells[self.numbers])

    @cached_property
    def extent(self) -> Place:
        """Median extent of the cells along each coordinate."""
        corners = self.values.T[:, self.corners.T]
        extent = corners.max(axis=1) - corners.min(axis=1)
        return np.asarray(np.maximum(np.median(extent, axis=1), 1e-300))

    @cached_property
    def whole(self) -> Adjacency:
        """Which cells share facets."""
        every = len(self.numbers) == len(self.eset.cells)
        return self.eset.adjacency if every else adjacency(self.corners)

    @cached_property
    def turn(self) -> Float[np.ndarray, " own"]:
        """Volumes in the space of coordinates; their signs change where the coordinates fold."""
        signs, _ = orientation(self.corners, self.whole)
        return np.asarray(volumes(self.values[self.corners]) * signs)

    @cached_property
    def turning(self) -> Bool[np.ndarray, " F"]:
        """Facets of `whole` between cells whose volumes have different signs."""
        flags = np.zeros(len(self.whole.facets), bool)
        a, b = self.whole.links.T
        flags[self.whole.across[self.turn[a] * self.turn[b] < 0.0]] = True
        return flags

    @cached_property
    def _edge(self) -> Bool[np.ndarray, " own"]:
        """Cells at the boundary or at a fold of the coordinates: straight, they miss the curves."""
        at = np.zeros(len(self.eset.points), bool)
        at[self.whole.facets[(self.whole.counts == 1) | self.turning]] = True
        return np.asarray(at[self.corners].any(axis=1))

    @cached_property
    def _index(self) -> CellIndex:
        overhang = np.where(self._edge, WIDE, 0.0)
        return CellIndex.of(self.values[self.corners], overhang)

    @cached_property
    def _indices(self) -> tuple[Int[np.ndarray, " own"], Int[np.ndarray, " own"]]:
        """Least and largest index that a state found from each cell may have.

        Next to a fold inside the chart that of the cells beyond it, too.
        """
        own = self.eset.cell_index[self.numbers]
        if self.coordinates.projecting:
            return own, own
        around = np.tile([[np.iinfo(int).max], [np.iinfo(int).min]], len(self.eset.points))
        for corner in self.corners.T:
            np.minimum.at(around[0], corner, own)
            np.maximum.at(around[1], corner, own)
        return around[0][self.corners].min(axis=1), around[1][self.corners].max(axis=1)

    @cached_property
    def _at_fold(self) -> Bool[np.ndarray, " own"]:
        return np.asarray(are_singular(self.eset.kinds)[self.corners].any(axis=1))

    def find(self, points: Points) -> Found:
        """States of the cells that have the coordinates of points."""
        if self.coordinates.projecting:
            return self._over(points)
        parts = [self._some(points[at : at + CHUNK], at) for at in range(0, len(points), CHUNK)]
        if not parts:
            nothing = np.zeros(0, int)
            return Found(self.eset.points[nothing], nothing, nothing, nothing > 0)
        z, p, point, cell, inside = (np.concatenate(column) for column in zip(*parts, strict=True))
        return Found(States(self.eset.structure, z, p), point, cell, inside)

    def _over(self, points: Points) -> Found:
        """States over points of the box: those that the set has there and that lie on the cells."""
        eset, setting = self.eset, self.coordinates.setting
        p = np.repeat(eset.points.p[:1], len(points), axis=0)
        p[:, self.coordinates.places] = points
        within = np.flatnonzero(eset.box.holds(p[:, setting.free], slack=SLACK))
        states, point, cell = eset.sheets.over(p[within])
        own = np.zeros(len(eset.cells) + 1, bool)
        own[self.numbers] = True
        kept = np.flatnonzero(own[cell])
        return Found(states[kept], within[point[kept]], cell[kept], np.ones(len(kept), bool))

    @cached_property
    def over_vertices(self) -> tuple[Some, Found]:
        """Vertices of the cells off crossings, and all states over each of them.

        Over the grid these are vertices; elsewhere they are found.
        """
        eset, corners = self.eset, self.corners
        grid = eset.grid_vertex
        vertex, first = np.unique(corners, return_index=True)
        cell = self.numbers[first // corners.shape[1]]
        some = vertex[eset.kinds[vertex] != VertexKind.CROSSING]
        away, own = np.flatnonzero(grid[some] < 0), np.flatnonzero(grid[some] >= 0)
        found = self.find(self.values[some[away]])
        order = np.argsort(grid[vertex], kind="stable")
        low, high = (
            np.searchsorted(grid[vertex[order]], grid[some[own]], side)
            for side in ("left", "right")
        )
        count = high - low
        among = order[runs(low, count)[1]]
        states = eset.points[vertex[among]]
        point = np.concatenate([away[found.point], np.repeat(own, count)])
        both = Found(
            join_states(states.structure, [found.states, states]),
            point,
            np.concatenate([found.cell, cell[among]]),
            np.concatenate([found.inside, np.ones(len(among), bool)]),
        )
        return some, both.take(np.argsort(point, kind="stable"))

    def _some(self, points: Points, first: int) -> tuple[np.ndarray, ...]:
        hits = self._index.near(points)
        hits = hits.take(hits.inside | self._edge[hits.cell])
        z, p, good = self._polish(*self._guess(hits), hits, points[hits.point])
        again = self._doubtful(hits, good, len(points))
        z, p, good = self._again(hits, z, p, good, again, points)
        kept = good.nonzero()[0]
        kept = kept[self.one_of_each(z[kept], p[kept], hits.take(kept))]
        hits = hits.take(kept)
        return z[kept], p[kept], first + hits.point, self.numbers[hits.cell], hits.inside

    def _guess(self, hits: Hits) -> Guess:
        """Interpolation between the corners, at the nearest point of the cell."""
        weights = np.maximum(hits.weights, 0.0)
        weights /= weights.sum(axis=1, keepdims=True)
        corners = self.corners[hits.cell]
        z, p = (
            np.einsum("hk,hki->hi", weights, column[corners])
            for column in (self.eset.points.z, self.eset.points.p)
        )
        return z, p

    def _polish(
        self, guess_z: Lanes, guess_p: Parameters, hits: Hits, wanted: Float[np.ndarray, "hits d"]
    ) -> tuple[Lanes, Parameters, Flags]:
        """Exact states near guesses, where there are any that the cells may have."""
        folded = self._at_fold[hits.cell]
        z, p, good, index = self.coordinates.solve_states(
            guess_z, guess_p, wanted, lambda lanes: self.planes(hits.cell[lanes]), folded
        )
        setting = self.coordinates.setting
        some = good.nonzero()[0]
        moved = np.linalg.norm(
            embed(setting, z[some], p[some]) - embed(setting, guess_z[some], guess_p[some]),
            axis=1,
        )
        good[some] = moved <= 2.0 * self.sizes[hits.cell[some]] + SAME_STATE
        return z, p, self._in_cells(z, p, good, index, hits.cell)

    def hold(self, states: States, index: Items, cell: Items) -> Flags:
        """Whether states of some indices may lie on cells, given by their places among these."""
        return self._in_cells(states.z, states.p, np.ones(len(states), bool), index, cell)

    def _in_cells(
        self, z: Lanes, p: Parameters, good: Flags, index: Numbers, cell: Numbers
    ) -> Flags:
        low, high = self._indices
        good = good & (index >= low[cell]) & (index <= high[cell])
        good &= self.eset.box.holds(p[:, self.coordinates.setting.free], slack=SLACK)
        good[good] = are_feasible(self.eset.constraints, z[good], p[good], SLACK)
        return good

    @cached_property
    def sizes(self) -> Float[np.ndarray, " own"]:
        """Longest sides from the first corners of the cells, in the metric."""
        return longest_sides(places_of(self.eset), self.corners)

    @cached_property
    def extents(self) -> Float[np.ndarray, " own"]:
        """Lengths, areas or volumes of the cells in the metric."""
        return sizes_of(places_of(self.eset), self.corners)

    @cached_property
    def ranges(self) -> Place:
        """Ranges of the coordinates over the set."""
        return np.asarray(np.maximum(np.ptp(self.values, axis=0), 1e-300))

    @cached_property
    def tree(self) -> cKDTree:
        """The middles of the cells in the metric."""
        return cKDTree(middles(places_of(self.eset), self.corners))

    def nearest(self, states: States) -> Items:
        """Places, among these, of the cells whose middles are nearest to states."""
        place = embed(self.coordinates.setting, states.z, states.p)
        return np.asarray(self.tree.query(place)[1])

    def planes(self, cell: Int[np.ndarray, " hits"]) -> Float[np.ndarray, "hits d coordinates"]:
        """Orthonormal bases of the planes of cells."""
        some, back = np.unique(cell, return_inverse=True)
        place, corners = places_of(self.eset), self.corners[some]
        sides = place[corners[:, 1:]] - place[corners[:, :1]]
        basis = np.linalg.qr(np.swapaxes(sides, 1, 2))[0]
        return np.ascontiguousarray(np.swapaxes(basis, 1, 2)[back])

    def _doubtful(self, hits: Hits, good: Bool[np.ndarray, " hits"], count: int) -> Items:
        """Failed hits of cells that contain the point, or of points without a state."""
        states = np.bincount(hits.point[good], minlength=count)
        wanted = np.bincount(hits.point[hits.inside], minlength=count)
        return np.asarray((~good & (states < np.maximum(wanted, 1))[hits.point]).nonzero()[0])

    def _again(
        self, hits: Hits, z: Lanes, p: Parameters, good: Flags, again: Items, points: Points
    ) -> tuple[Lanes, Parameters, Flags]:
        """Try undecided hits from regular corners of their cells.

        From the nearest one; if the cell contains the point, from all.
        """
        if len(again) == 0:
            return z, p, good
        z, p, good = z.copy(), p.copy(), good.copy()
        far = are_singular(self.eset.kinds)[self.corners[hits.cell[again]]]
        nearest = np.argsort(1e9 * far - hits.weights[again], axis=1)
        for k, place in enumerate(nearest.T):
            open_ = ~good[again] & ~far[np.arange(len(again)), place]
            if k > 0:
                open_ &= hits.inside[again]
            lanes = again[open_]
            if len(lanes) == 0:
                continue
            corner = self.corners[hits.cell[lanes], place[open_]]
            found = self._from_corners(corner, points[hits.point[lanes]], hits.take(lanes))
            z[lanes], p[lanes], good[lanes] = found
        return z, p, good

    def _from_corners(
        self, corner: Numbers, wanted: Float[np.ndarray, "lanes d"], hits: Hits
    ) -> tuple[Lanes, Parameters, Flags]:
        start = self.eset.points[corner]
        return self._polish(start.z, start.p, hits, wanted)

    def one_of_each(self, z: Lanes, p: Parameters, hits: Hits) -> Int[np.ndarray, " kept"]:
        """One of the equal states over each point, rather from a cell that contains the point.

        Equal states have equal products with any vector, so that they are neighbours in its order.
        """
        if len(z) < 2:
            return np.arange(len(z))
        place = embed(self.coordinates.setting, z, p)
        product = place @ np.cos(1.0 + np.arange(place.shape[1]))
        order = np.lexsort((product, hits.point))
        new = np.ones(len(z), bool)
        new[1:] = np.linalg.norm(np.diff(place[order], axis=0), axis=1) > SAME_STATE
        new[1:] |= np.diff(hits.point[order]) > 0
        group = np.empty(len(z), int)
        group[order] = np.cumsum(new)
        order = np.lexsort((hits.cell, ~hits.inside, group))
        first = np.ones(len(z), bool)
        first[1:] = np.diff(group[order]) > 0
        return np.sort(order[first])


def facet_kinds(cells: Cells) -> tuple[Facets, np.ndarray]:
    """Facets where the cells end or the coordinates fold, and what they lie on.

    "fold" of the set, "crossing" of other sheets, "cap" (a constraint), "box", "cut" (other cells
    of the set follow), or "singular" where the coordinates turn back without a fold.
    """
    eset, whole = cells.eset, cells.whole
    some = np.flatnonzero((whole.counts == 1) | cells.turning)
    facets = whole.facets[some]
    folds = facets_of(eset.folds, facets.shape[1])
    all_of_them = eset.adjacency
    outer = flags_of(facets, all_of_them.facets[all_of_them.counts == 1])
    capped = np.isin(eset.kinds, (VertexKind.CAP, VertexKind.CORNER))[facets].all(axis=1)
    met = (eset.kinds == VertexKind.CROSSING)[facets].all(axis=1)
    ended = whole.counts[some] == 1
    if cells.cut is not None:
        capped &= ~cells.cut[facets].all(axis=1)
    cut = np.ones(len(facets), bool)
    if cells.cut is not None:  # where an edge could not be cut, whole cells are left out
        cut = (cells.cut | on_fold(eset.kinds))[facets].all(axis=1)
    kinds = np.select(
        [flags_of(facets, folds), ended & on_box(eset, facets) & outer, ended & met & outer,
         ended & capped & outer, ended & cut, ended],
        [EdgeKind.FOLD, EdgeKind.BOX, EdgeKind.CROSSING, EdgeKind.CAP, EdgeKind.CUT, EdgeKind.HOLE],
        EdgeKind.SINGULAR,
    )  # fmt: skip
    return facets, kinds
