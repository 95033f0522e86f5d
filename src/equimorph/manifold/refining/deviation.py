"""Edges of a complex during refinement: their deviations, and those to bisect."""

from collections import deque
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from equimorph.arrays import EdgeFlags, Float, Int, Items, ItemValues, Pairs, VertexFlags
from equimorph.linalg.lanes import results_of
from equimorph.manifold.complex.edge_points import chunks
from equimorph.manifold.complex.marked_complex import (
    CURVES,
    TRIANGLES,
    Fabric,
    FacetMark,
    edges_of,
    shares,
)
from equimorph.manifold.geometry.kernels import measure_edges
from equimorph.manifold.geometry.tangents import S_SHAPE, Cubics
from equimorph.manifold.geometry.topology import count_corners, keys_of

PREFERENCE = 1.6
"""How much longer an edge must be than those that deviate to be bisected before them."""
COARSE = 4.0
"""Deviation, in tolerances, of edges whose halves are likely to deviate too much as well."""
BULGE = 0.5
"""How long edges on folds may be, relative to edges at their ends that could not be bisected."""
OBTUSE = float(np.cos(np.radians(120.0)))
"""Cosine of the largest angle opposite to an edge on a crossing."""
UNEVEN = 4.0
"""How much longer than an edge on a crossing those of the same triangle may be."""
SIX = 6
"""Edges of a tetrahedron."""
FEW = 50
"""Reciprocal share of edges to bisect below which all of them are bisected at once."""


@dataclass(frozen=True)
class Edges:
    """Edges of a fabric, those of each cell, their marks, length and deviation from the set.

    stuck: cannot be bisected; pressing: must be, for any deviation; uneven: should be in the
    end, because they are much longer than an edge on a crossing in the same triangle.
    """

    ends: Int[np.ndarray, "E 2"]
    of_cells: Int[np.ndarray, "C sides"]
    marks: Int[np.ndarray, " E"]
    length: Float[np.ndarray, " E"]
    error: Float[np.ndarray, " E"]
    stuck: EdgeFlags
    pressing: EdgeFlags
    uneven: EdgeFlags

    def deviating(self, tolerance: float) -> EdgeFlags:
        """Edges that should be bisected now, and can be.

        Folds and constraints come first: they bulge out between their vertices, and adjacent edges
        would cross them. Of tetrahedra the curves in which these surfaces and the sides of the box
        meet come before all else, and then surfaces that bulge far out.
        """
        first = (self.error > tolerance) & ((self.marks & CURVES) > 0)
        if self.of_cells.shape[1] == SIX:
            on = self.marks & ~(FacetMark.HOLE | FacetMark.RIM)
            corners = (self.error > tolerance) & (on & (on - 1) > 0) & ~self.stuck
            if corners.any():
                return np.asarray(corners)
            first &= self.error > COARSE * tolerance
        for wanted in (first | self.pressing, self.error > tolerance, self.uneven):
            own = wanted & ~self.stuck
            if own.any():
                break
        return np.asarray(own)


@dataclass
class Memory:
    """Deviations of edges that were measured before, and edges that could not be bisected."""

    keys: Items = field(default_factory=lambda: np.zeros(0, int))
    """Of the edges whose deviation is known, in order: lower ends in the upper half of the bits."""
    error: ItemValues = field(default_factory=lambda: np.zeros(0))
    stuck: set[tuple[int, int]] = field(default_factory=set)
    cut: Int[np.ndarray, "m 2"] = field(default_factory=lambda: np.zeros((0, 2), int))
    """Edges that were bisected: flips must not bring them back."""
    put: Int[np.ndarray, " m"] = field(default_factory=lambda: np.zeros(0, int))
    """The vertices that were put on them."""
    failures: int = 0
    lost: set[tuple[int, int]] = field(default_factory=set)
    """Edges on curves that do not lead from one end to the other: something is hidden there."""

    def forget(self, touched: VertexFlags) -> None:
        """Forget edges between some vertices: those that now lie on a fold deviate otherwise."""
        kept = ~(touched[self.keys >> 32] & touched[self.keys & 0xFFFFFFFF])
        self.keys, self.error = self.keys[kept], self.error[kept]

    def past_edges(self, fabric: Fabric, near: VertexFlags | None = None) -> tuple[Pairs, Items]:
        """Edges that were bisected, with the vertices on them, where these are there.

        `near`: vertices that both ends are among; else all.
        """
        own = slice(None) if near is None else near[self.cut[:, 0]] & near[self.cut[:, 1]]
        cut, put, live = self.cut[own], self.put[own], np.zeros(len(fabric.vertices), bool)
        live[fabric.cells] = True
        return cut[live[put]], put[live[put]]

    def among(self, inside: VertexFlags) -> "Memory":
        """The part of the memory for edges between flagged vertices, with all deviations."""
        stuck = {(a, b) for a, b in self.stuck if inside[a] and inside[b]}
        own = inside[self.cut].all(axis=1)
        cut, put, lost = self.cut[own], self.put[own], set(self.lost)
        return Memory(self.keys, self.error, stuck, cut, put, lost=lost)

    def copy(self) -> "Memory":
        """What is remembered by now."""
        return replace(self, stuck=set(self.stuck), lost=set(self.lost))

    def learn(self, inner: "Memory", inside: VertexFlags) -> None:
        """Take over what was learned among flagged vertices, and those added since."""
        keys, at = np.unique(np.concatenate([inner.keys, self.keys]), return_index=True)
        self.keys, self.error = keys, np.concatenate([inner.error, self.error])[at]
        beyond = {(a, b) for a, b in self.stuck if not (inside[a] and inside[b])}
        self.stuck = beyond | inner.stuck
        kept = ~inside[self.cut].all(axis=1)
        self.cut = np.concatenate([self.cut[kept], inner.cut])
        self.put = np.concatenate([self.put[kept], inner.put])
        self.failures += inner.failures
        self.lost |= inner.lost


def update_edges(fabric: Fabric, memory: Memory) -> Edges:
    """Edges with their deviations; only those that are new are measured."""
    base = len(fabric.vertices)
    ends, of_cells = edges_of(fabric.cells, base)
    marks = fabric.edge_marks(ends)
    keys = ends[:, 0] << 32 | ends[:, 1]
    at = np.minimum(np.searchsorted(memory.keys, keys), max(len(memory.keys) - 1, 0))
    old = memory.keys[at] == keys if len(memory.keys) else np.zeros(len(keys), bool)
    error = np.empty(len(keys))
    error[old] = memory.error[at[old]]
    new = np.flatnonzero(~old)
    error[new] = deviations(fabric, ends[new], marks[new])
    memory.keys, memory.error = keys, error
    length = np.empty(len(ends))
    length[of_cells] = np.sqrt(fabric.squared)
    stuck = (marks & (FacetMark.HOLE | FacetMark.RIM)) > 0
    failed = np.zeros(len(ends), bool)
    if memory.stuck:
        refused = np.array(sorted(memory.stuck))
        failed = np.isin(keys_of(ends, base), keys_of(refused, base))
    obtuse, uneven = _beside_crossings(fabric, of_cells, marks)
    pressing = _pressing(ends, marks, length, failed) | obtuse
    if memory.lost:
        stuck |= near_lost(fabric, memory)[ends].any(axis=1)
    return Edges(ends, of_cells, marks, length, error, stuck | failed, pressing, uneven)


def near_lost(fabric: Fabric, memory: Memory) -> VertexFlags:
    """Vertices that are as near to edges that are lost as these are long."""
    place = fabric.vertices.place
    out = np.zeros(len(place), bool)
    for a, b in sorted(memory.lost):
        away = np.linalg.norm(place - 0.5 * (place[a] + place[b]), axis=1)
        out |= away <= np.linalg.norm(place[a] - place[b])
    return out


def _pressing(
    ends: Int[np.ndarray, "E 2"],
    marks: Int[np.ndarray, " E"],
    length: Float[np.ndarray, " E"],
    failed: EdgeFlags,
) -> EdgeFlags:
    """Longer edges on folds and constraints next to edges that could not be bisected.

    Those may cross a fold that bulges out between its vertices.
    """
    if not failed.any():
        return failed
    reach = np.full(int(ends.max(initial=0)) + 1, np.inf)
    for side in range(2):
        np.minimum.at(reach, ends[failed, side], length[failed])
    short = np.minimum(reach[ends[:, 0]], reach[ends[:, 1]])
    return np.asarray(((marks & CURVES) > 0) & (length > BULGE * short))


def _beside_crossings(
    fabric: Fabric, of_cells: Int[np.ndarray, "C sides"], marks: Int[np.ndarray, " E"]
) -> tuple[EdgeFlags, EdgeFlags]:
    """Edges on crossings opposite to a too obtuse angle, and edges much longer than neighbours.

    A sheet may be bent strongly across a straight crossing, and another one be flat: both share the
    edges there, which no flip takes away [Ruppert1995]_. Triangles between a crossing and another
    curve are left alone: where these meet at a small angle, cuts would go on and on.
    """
    obtuse, long = np.zeros(len(marks), bool), np.zeros(len(marks), bool)
    if fabric.dimension != TRIANGLES or not (fabric.marks & FacetMark.CROSSING).any():
        return obtuse, long
    cell, side = np.nonzero((marks[of_cells] & FacetMark.CROSSING) > 0)
    # sides 01, 02, 12 are opposite to corners 2, 1, 0
    free = (fabric.vertex_marks[fabric.cells[cell, 2 - side]] & CURVES) == 0
    cell, side = cell[free], side[free]
    squared, row = fabric.squared[cell], np.arange(len(cell))
    own, first, second = (squared[row, (side + k) % 3] for k in range(3))
    wide = first + second - own < 2.0 * OBTUSE * np.sqrt(first * second)
    obtuse[of_cells[cell[wide], side[wide]]] = True
    far = squared.max(axis=1, initial=0.0) > UNEVEN**2 * own
    long[of_cells[cell[far], squared[far].argmax(axis=1)]] = True
    return obtuse, long


def deviations(
    fabric: Fabric, ends: Int[np.ndarray, "E 2"], marks: Int[np.ndarray, " E"]
) -> Float[np.ndarray, " E"]:
    """How far the set is from straight edges."""

    def of(own: Items) -> ItemValues:
        first, second = (fabric.end(ends[own], side, int(marks[own[0]])) for side in range(2))
        return Cubics(first, second).error

    out = np.zeros(len(ends))
    parts = chunks(np.flatnonzero(marks), marks)
    for own, error in zip(parts, results_of([partial(of, own) for own in parts]), strict=True):
        out[own] = error
    plain, store = np.flatnonzero(marks == 0), fabric.vertices
    free, found = ends[plain], np.empty(len(plain))
    tasks = [
        partial(measure_edges, store.place, store.rows, free[at:stop], S_SHAPE, found[at:stop])
        for at, stop in shares(len(plain))
    ]
    deque(results_of(tasks), maxlen=0)
    out[plain] = found
    return out


def choose_edges(edges: Edges, tolerance: float) -> Items:
    """Edges to be bisected now, those first that cells with several are to be cut at first.

    Those that deviate so much that their halves may, too; of the others, those that all cells
    around them want to be cut at first: the rest may then be within the tolerance, or flipped.
    """
    deviating = edges.deviating(tolerance)
    few = np.count_nonzero(deviating) * FEW < len(deviating) and not deviating[edges.uneven].any()
    coarse, _ = _close(edges, deviating & (few | (edges.error > COARSE * tolerance)))
    wanted, weight = _close(edges, coarse | deviating)
    longest = _first_cuts(edges, wanted, weight)
    around = np.bincount(edges.of_cells.ravel(), minlength=len(weight))
    agreed = np.bincount(longest, minlength=len(weight)) == around
    out = np.flatnonzero(coarse | (agreed & wanted))
    return out[np.argsort(-weight[out], kind="stable")]


def _close(edges: Edges, wanted: EdgeFlags) -> tuple[EdgeFlags, Float[np.ndarray, " E"]]:
    """Wanted edges and what follows; and by how much cells prefer to be cut at each edge.

    In every cell with a chosen edge the longest edge is chosen, too, if it is longer by more than
    `PREFERENCE`.
    """
    wanted = wanted & ~edges.stuck
    weight = np.where(wanted, PREFERENCE, 1.0) * edges.length
    weight[edges.stuck] = -1.0
    while True:
        longest = _first_cuts(edges, wanted, weight)
        more = longest[~wanted[longest]]
        if len(more) == 0:
            return wanted, weight
        wanted[more] = True
        weight[more] = PREFERENCE * edges.length[more]


def _first_cuts(
    edges: Edges, wanted: EdgeFlags, weight: Float[np.ndarray, " E"]
) -> Int[np.ndarray, " cells"]:
    """Edge that each cell with a chosen edge prefers to be cut at, side by side of the cells."""
    cells = edges.of_cells[count_corners(wanted, edges.of_cells) > 0]
    first, most = cells[:, 0], weight[cells[:, 0]]
    for side in cells.T[1:]:
        own = weight[side]
        first, most = np.where(own > most, side, first), np.maximum(own, most)
    return np.asarray(first)
