"""Stars of vertices and edges, and cells that could fill them instead."""

from dataclasses import dataclass
from enum import Enum
from itertools import combinations

import numpy as np

from equimorph.arrays import Bool, Cells, Edges, Float, Int, ItemFlags, Items
from equimorph.manifold.complex.marked_complex import TRIANGLES, Fabric
from equimorph.manifold.geometry.simplices import squared_sides
from equimorph.manifold.geometry.topology import among, count_corners, distinct, keys_of, runs
from equimorph.manifold.refining.quality import POOR, qualities, smallest_angles, worst

GAIN = np.radians(0.2) / np.pi
"""Least gain of a refill: poor cells fewer, and the growth of the worst quality relative to π."""
WORSE, MUCH_WORSE = 0.7, 0.2
"""Least share of the worst quality that must remain; and if a short edge goes."""
LONGER = 1.5
"""Largest ratio of the longest sides of the cells after and before."""

Rows = Items
"""Numbers of refills, vertices or cells."""
Pairs = tuple[Int[np.ndarray, " pairs"], Int[np.ndarray, " pairs"]]
"""Two numbers for each pair of things that belong together."""
Quality = Float[np.ndarray, " cells"]


class Kind(Enum):
    """Change of a star: its vertex goes or moves, or its vertices are connected differently."""

    COLLAPSE = "collapse"
    MOVE = "move"
    RECONNECTION = "reconnection"


class Around:
    """Cells, or facets, around some vertices."""

    def __init__(self, cells: Cells, vertices: Rows, base: int) -> None:
        near = np.zeros(base, bool)
        near[vertices] = True
        self._number = np.flatnonzero(count_corners(near, cells))
        self._cells, self._corners = cells[self._number], cells.shape[1]
        self._order = np.argsort(self._cells.ravel(), kind="stable")
        amount = np.bincount(self._cells.ravel(), minlength=base)
        self._starts = np.concatenate([[0], np.cumsum(amount)])

    def of(self, vertices: Rows) -> Pairs:
        """All pairs of a vertex, by its place in `vertices`, and a cell around it."""
        row, at = self._pairs(vertices)
        return row, self._number[at]

    def _pairs(self, vertices: Rows) -> Pairs:
        count = self._starts[vertices + 1] - self._starts[vertices]
        row, at = runs(self._starts[vertices], count)
        return row, self._order[at] // self._corners

    def links(self, vertices: Rows, size: int, base: int) -> Pairs:
        """All pairs of a vertex, by its place in `vertices`, and the key of a face in its link."""
        row, at = self._pairs(vertices)
        own = self._cells[at]
        at = np.argmax(own == vertices[row, None], axis=1)
        turn = (at[:, None] + np.arange(1, self._corners)) % self._corners
        return _faces(row, np.take_along_axis(own, turn, 1), size, base)

    def edge_links(self, edges: Edges, size: int, base: int) -> Pairs:
        """All pairs of an edge, by its place in `edges`, and the key of a face in its link."""
        row, at = self._pairs(edges[:, 0])
        own = self._cells[at]
        both = (own == edges[row, 1, None]).any(axis=1)
        row, own = row[both], own[both]
        ends = (own[:, :, None] == edges[row][:, None]).any(axis=2)
        return _faces(row, own[~ends].reshape(len(own), self._corners - 2), size, base)


def _faces(row: Rows, corners: Cells, size: int, base: int) -> Pairs:
    """Rows and keys of all faces of a size of simplices."""
    if corners.shape[1] < size:
        return row[:0], row[:0]
    chosen = list(combinations(range(corners.shape[1]), size))
    faces = [corners[:, list(each)] for each in chosen]
    keys = [face[:, 0] if size == 1 else keys_of(face, base) for face in faces]
    return np.tile(row, len(chosen)), np.concatenate(keys)


@dataclass(frozen=True)
class Refills:
    """Cells that could go and cells that could replace them, refill by refill.

    gone: numbers of cells, and gone_row: the refill that each belongs to; so for cells that come,
    with their index, and for marked facets that go and come, with their marks. short: whether an
    edge goes that is much shorter than its neighbours.
    """

    fabric: Fabric
    count: int
    gone: Int[np.ndarray, " gone"]
    gone_row: Int[np.ndarray, " gone"]
    come: Int[np.ndarray, "come corners"]
    index: Int[np.ndarray, " come"]
    come_row: Int[np.ndarray, " come"]
    lost: Int[np.ndarray, " lost"]
    lost_row: Int[np.ndarray, " lost"]
    new: Int[np.ndarray, "new ends"]
    marks: Int[np.ndarray, " new"]
    new_row: Int[np.ndarray, " new"]
    kind: Kind
    short: Bool[np.ndarray, " refills"]

    def take(self, kept: Bool[np.ndarray, " refills"]) -> "Refills":
        """Return a selection of the refills."""
        if kept.all():
            return self
        number = np.cumsum(kept) - 1
        gone, come = kept[self.gone_row], kept[self.come_row]
        lost, new = kept[self.lost_row], kept[self.new_row]
        return Refills(
            self.fabric,
            int(kept.sum()),
            self.gone[gone],
            number[self.gone_row[gone]],
            self.come[come],
            self.index[come],
            number[self.come_row[come]],
            self.lost[lost],
            number[self.lost_row[lost]],
            self.new[new],
            self.marks[new],
            number[self.new_row[new]],
            self.kind,
            self.short[kept],
        )

    def join(self, more: "Refills") -> "Refills":
        """Return these refills and more of the same fabric."""
        count = self.count
        return Refills(
            self.fabric,
            count + more.count,
            np.concatenate([self.gone, more.gone]),
            np.concatenate([self.gone_row, more.gone_row + count]),
            np.concatenate([self.come, more.come]),
            np.concatenate([self.index, more.index]),
            np.concatenate([self.come_row, more.come_row + count]),
            np.concatenate([self.lost, more.lost]),
            np.concatenate([self.lost_row, more.lost_row + count]),
            np.concatenate([self.new, more.new]),
            np.concatenate([self.marks, more.marks]),
            np.concatenate([self.new_row, more.new_row + count]),
            self.kind,
            np.concatenate([self.short, more.short]),
        )

    @property
    def squared(self) -> Float[np.ndarray, "cells sides"]:
        """Squared sides of the cells that come."""
        return squared_sides(self.fabric.vertices.place, self.come)

    @property
    def new_edges(self) -> tuple[Rows, Rows]:
        """Edges that come, by the refill, and their keys, all pairs in order."""
        base = len(self.fabric.vertices)
        before, after = (
            distinct(row * base**2 + key)
            for row, key in (
                _faces(self.gone_row, self.fabric.cells[self.gone], 2, base),
                _faces(self.come_row, self.come, 2, base),
            )
        )
        row, key = np.divmod(np.setdiff1d(after, before, assume_unique=True), base**2)
        return row, key

    def edge_marks(self, row: Rows, key: Rows) -> Rows:
        """Marks of edges that come: of all facets around them that do."""
        base, out = len(self.fabric.vertices), np.zeros(len(row), int)
        own, keys = _faces(self.new_row, self.new, 2, base)
        if len(own) == 0 or len(row) == 0:
            return out
        marks = np.tile(self.marks, len(own) // max(len(self.new), 1))
        wanted = row * base**2 + key
        have = own * base**2 + keys
        at = np.minimum(np.searchsorted(wanted, have), len(wanted) - 1)
        np.bitwise_or.at(out, at[wanted[at] == have], marks[wanted[at] == have])
        return out

    def vanishes(self, row: Rows, vertex: Rows) -> ItemFlags:
        """Whether vertices lose all their cells by a refill each."""
        base = len(self.fabric.vertices)
        wanted = row * base + vertex
        gone, come = (
            distinct((own[:, None] * base + cells).ravel())
            for own, cells in (
                (self.gone_row, self.fabric.cells[self.gone]),
                (self.come_row, self.come),
            )
        )
        return np.asarray(among(wanted, gone) & ~among(wanted, come))

    @property
    def claims(self) -> tuple[Rows, Rows]:
        """Refills and numbers of what each touches, so that those without common ones may be done.

        All vertices of the star where one goes or moves. Else the cells that go and edges that
        come; if none does, the facets that come.
        """
        base, cells = len(self.fabric.vertices), len(self.fabric.cells)
        if self.kind is not Kind.RECONNECTION:
            corners = self.fabric.cells[self.gone]
            return np.repeat(self.gone_row, corners.shape[1]), corners.ravel()
        row, key = self.new_edges
        bare = np.ones(self.count, bool)
        bare[row] = False
        own = bare[self.come_row]
        facet_row, facet = _faces(self.come_row[own], self.come[own], 3, base)
        rows = np.concatenate([self.gone_row, row, facet_row])
        return rows, np.concatenate([self.gone, cells + key, cells + base**2 + facet])


def hopeful(refills: Refills, quality: Quality) -> Bool[np.ndarray, " refills"]:
    """Which refills may help, by the angles of the cells that come: these are no less good."""
    return np.asarray(gains(refills, quality, smallest_angles(refills.squared)) > GAIN)


def with_exact(refills: Refills, quality: Quality) -> Quality:
    """Qualities with those of the triangles that go put right.

    `qualities_near` looks at triangles on average over their corners only.
    """
    fabric, gone = refills.fabric, refills.gone
    if fabric.dimension != TRIANGLES:
        return quality
    quality = quality.copy()
    quality[gone] = qualities(fabric.vertices, fabric.cells[gone], fabric.cell_index[gone])
    return quality


def gains(
    refills: Refills, quality: Quality, come: Float[np.ndarray, " come"]
) -> Float[np.ndarray, " refills"]:
    """Number of poor cells fewer, and growth of the worst quality relative to π, if some come.

    Minus one where cells get much poorer, or much longer.
    """
    count, poor = refills.count, POOR[refills.fabric.dimension]
    old = quality[refills.gone]
    before = worst(old, refills.gone_row, count)
    after = worst(come, refills.come_row, count)
    fewer = np.bincount(refills.gone_row[old < poor], minlength=count)
    fewer -= np.bincount(refills.come_row[come < poor], minlength=count)
    reach, longest = np.zeros(count), np.zeros(count)
    sides = refills.fabric.squared[refills.gone]
    np.maximum.at(reach, refills.gone_row, sides.max(axis=1, initial=0.0))
    np.maximum.at(longest, refills.come_row, refills.squared.max(axis=1, initial=0.0))
    collapse = refills.kind is Kind.COLLAPSE
    vertices_go = np.where(refills.short, MUCH_WORSE, WORSE)
    least = np.where((before > 0.0) & collapse, vertices_go, 1.0) * before
    good = (after >= least) & (longest <= LONGER**2 * reach)
    # vertices may go to have fewer poor cells; the same vertices must have a better worst one
    fewer = collapse * (fewer + refills.short)
    return np.where(good, fewer + (after - before) / np.pi, -1.0)
