"""A complex whose cells are being cut and rearranged: vertices with tangent frames, marked facets.

Marks say on what a facet lies: a fold, a constraint, sides of the box. Vertices that are added to
an edge must lie on what the edge lies on.
"""

from collections import deque
from dataclasses import dataclass, replace
from enum import IntFlag
from functools import partial
from itertools import combinations

import numpy as np

from equimorph.arrays import (
    CellFlags,
    CellNumbers,
    Cells,
    Float,
    Int,
    ItemFlags,
    Triples,
    VertexNumbers,
)
from equimorph.linalg.lanes import results_of
from equimorph.manifold.complex.description import Complex
from equimorph.manifold.complex.vertices import (
    Vertices,
)
from equimorph.manifold.geometry.kernels import cut_rows, look_back, number_edges
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.geometry.simplices import squared_sides
from equimorph.manifold.geometry.tangents import Ends
from equimorph.manifold.geometry.topology import count_corners, keys_of
from equimorph.structures import States


class FacetMark(IntFlag):
    """What a facet lies on: several at once, and nothing where cells continue beyond it."""

    FOLD = 1
    CAP = 2
    """A constraint that bounds the set."""
    SIDE = 4
    """The lower bound of the first free parameter; its upper bound and those of the other free
    parameters follow, one bit each."""
    CROSSING = 1 << 19
    """Another sheet crosses there."""
    HOLE = 1 << 20
    """A boundary that lies on nothing: the set is incomplete there."""
    RIM = 1 << 21
    """Cells beyond are set apart."""


CURVES = FacetMark.FOLD | FacetMark.CAP | FacetMark.CROSSING
"""Marks of curves on which vertices must stay."""
TRIANGLES, TETRAHEDRA = 2, 3
"""Dimension of their cells."""
AT_ONCE = 4096
"""Number of cells or edges in one task of a thread."""


@dataclass(frozen=True)
class Fabric:
    """Vertices, cells with their index, and marked facets.

    Where sheets cross, their parts have separate vertices (see `parted_sheets`).

    box: lower and upper bounds of the free parameters; squared: lengths of the sides of the cells,
    squared, in the order 01, 02, 12 and so on. Corners of triangles and tetrahedra are so ordered
    that all are oriented alike, and most project as the parity of their index says.
    """

    setting: Setting
    box: Float[np.ndarray, "2 d"]
    vertices: Vertices
    cells: Cells
    cell_index: CellNumbers
    facets: Int[np.ndarray, "F d"]
    marks: Int[np.ndarray, " F"]
    squared: Float[np.ndarray, "C sides"]

    @property
    def dimension(self) -> int:
        """Number of free parameters."""
        return len(self.setting.free)

    def edge_marks(self, edges: Int[np.ndarray, "E 2"]) -> Int[np.ndarray, " E"]:
        """All marks of the facets around each edge; `edges` with sorted ends."""
        base = len(self.vertices)
        pairs = combinations(range(self.facets.shape[1]), 2)
        own = [keys_of(self.facets[:, list(pair)], base) for pair in pairs]
        if len(self.facets) == 0 or not own:
            return np.zeros(len(edges), int)
        known, inverse = np.unique(np.concatenate(own), return_inverse=True)
        marks = np.zeros(len(known), int)
        np.bitwise_or.at(marks, inverse, np.tile(self.marks, len(own)))
        keys = keys_of(edges, base)
        at = np.minimum(np.searchsorted(known, keys), len(known) - 1)
        return np.where(known[at] == keys, marks[at], 0)

    @property
    def vertex_marks(self) -> VertexNumbers:
        """All marks of the facets around each vertex."""
        out = np.zeros(len(self.vertices), int)
        for column in self.facets.T:
            np.bitwise_or.at(out, column, self.marks)
        return out

    def end(self, edges: Int[np.ndarray, "edges 2"], side: int, mark: int) -> Ends:
        """One end of edges with a mark: its point, frame, and what stays zero along the edges."""
        store, d, at = self.vertices, self.dimension, edges[:, side]
        rows, slopes = store.rows[at], []
        if mark & FacetMark.FOLD:
            slopes.append(self._fold_slopes(edges, side))
        if mark & FacetMark.CAP:
            slopes.append(store.cap_slope[at])
        if mark & FacetMark.CROSSING:
            slopes.append(store.crossing_slope[at])
        slopes.extend(rows[:, :, rows.shape[2] - d + k] for k in held_parameters(mark, d))
        stacked = np.stack(slopes, axis=1) if slopes else np.zeros((len(at), 0, d))
        return Ends(store.place[at], rows, stacked)

    def _fold_slopes(
        self, edges: Int[np.ndarray, "edges 2"], side: int
    ) -> Float[np.ndarray, "edges d"]:
        """Slopes of what vanishes on folds; where a fold passes a crossing, across its edges.

        There the slope is zero, because it vanishes on the crossing, too.
        """
        store, at = self.vertices, edges[:, side]
        slopes = store.fold_slope[at]
        hub = np.flatnonzero(
            (store.kinds[at] == VertexKind.CROSSING) & (self.dimension == TRIANGLES)
        )
        if len(hub):
            chord = store.place[edges[hub, 1 - side]] - store.place[at[hub]]
            x, y = np.einsum("nkc,nc->kn", store.rows[at[hub]], chord)
            slopes[hub] = np.stack([-y, x], axis=1)
        return np.asarray(slopes)

    def only(self, cells: CellFlags) -> "Fabric":
        """Some of the cells, with all facets."""
        return replace(
            self,
            cells=self.cells[cells],
            cell_index=self.cell_index[cells],
            squared=self.squared[cells],
        )

    def looks_back(self, cells: Triples) -> ItemFlags:
        """Which triangles look backwards, on average, in the tangent planes at their corners."""
        cells, store = np.ascontiguousarray(cells), self.vertices
        total = np.empty(len(cells))
        tasks = [
            partial(look_back, store.place, store.rows, cells[at:stop], total[at:stop])
            for at, stop in shares(len(cells))
        ]
        deque(results_of(tasks), maxlen=0)
        return np.asarray(total <= 0.0)

    def bisect(self, edges: Int[np.ndarray, "E 2"], more: Vertices) -> "Fabric":
        """Cut edges at new vertices, and all cells and facets around them."""
        return self.cut(edges, self.vertices.join(more))

    def cut(self, edges: Int[np.ndarray, "E 2"], vertices: Vertices) -> "Fabric":
        """Cut edges, and all cells and facets around them, at vertices behind those there are.

        Cells with several of the edges are cut at the first of them first, so that neighbours agree
        on what they share.
        """
        base = len(self.vertices)
        cells, of_cells = _bisect(self.cells, edges, base)
        facets, of_facets = _bisect(self.facets, edges, base)
        squared = self.squared[of_cells]
        came = np.arange(len(vertices)) >= base
        changed = np.flatnonzero(count_corners(came, cells))
        squared[changed] = squared_sides(vertices.place, cells[changed])
        return replace(
            self,
            vertices=vertices,
            squared=squared,
            cells=cells,
            cell_index=self.cell_index[of_cells],
            facets=facets,
            marks=self.marks[of_facets],
        )

    @property
    def points(self) -> VertexNumbers:
        """For each vertex the first one that is the same point."""
        return first_copies_of(self.vertices.shared)

    @property
    def numbers(self) -> VertexNumbers:
        """Numbers of the vertices in the complex; −1 for those that it leaves out."""
        points = self.points
        used = np.zeros(len(points), bool)
        used[points[self.cells]] = True
        return np.asarray(np.where(used, np.cumsum(used) - 1, -1)[points])

    def complex(self) -> Complex:
        """Return what is needed to describe the set; vertices without cells are left out."""
        number = self.numbers
        _, used = np.unique(number, return_index=True)
        own, used = self.vertices, used[number[used] >= 0]
        facets = [
            number[self.facets[(self.marks & m) > 0]]
            for m in (FacetMark.FOLD, FacetMark.CAP, FacetMark.CROSSING)
        ]
        folds, caps, crossings = (each[(each >= 0).all(axis=1)] for each in facets)
        return Complex(
            States(self.setting.structure, own.z[used], own.p[used]),
            own.kinds[used],
            own.index[used],
            own.grid_vertex[used],
            number[self.cells],
            self.cell_index,
            folds,
            caps,
            crossings,
        )


def first_copies_of(shared: VertexNumbers) -> VertexNumbers:
    """For each vertex the first one that is the same point, by their common numbers."""
    own = np.arange(len(shared))
    copies = np.flatnonzero(shared >= 0)
    if len(copies):
        _, first, inverse = np.unique(shared[copies], return_index=True, return_inverse=True)
        own[copies] = copies[first[inverse]]
    return own


def shares(count: int) -> list[tuple[int, int]]:
    """First and last numbers of the chunks that `count` items are divided into for threads."""
    return [(at, min(at + AT_ONCE, count)) for at in range(0, count, AT_ONCE)]


def held_parameters(mark: int, dimension: int) -> list[int]:
    """Free parameters that sides of the box hold."""
    return [k for k in range(dimension) if mark & (3 * FacetMark.SIDE << 2 * k)]


def _bisect(
    rows: Int[np.ndarray, "n k"], edges: Int[np.ndarray, "E 2"], base: int
) -> tuple[Int[np.ndarray, "m k"], Int[np.ndarray, " m"]]:
    """Rows cut at vertices ``base + e`` on edges e that they hold, and the rows they come from."""
    cut, owner = cut_rows(np.ascontiguousarray(rows), np.ascontiguousarray(edges), base)
    return cut, owner


def edges_of(cells: Cells, base: int) -> tuple[Int[np.ndarray, "E 2"], Int[np.ndarray, "C sides"]]:
    """All edges, sorted, and the numbers of those of each cell (pairs 01, 02, 12 and so on)."""
    pairs = np.array(list(combinations(range(cells.shape[1]), 2)))
    ends = np.empty((cells.shape[0] * len(pairs), 2), int)
    of_cells = np.empty((len(cells), len(pairs)), int)
    count = number_edges(np.ascontiguousarray(cells), pairs, base, ends, of_cells)
    return ends[:count].copy(), of_cells
