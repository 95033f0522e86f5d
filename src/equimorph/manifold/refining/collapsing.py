"""Fewer, better tetrahedra: vertices of poor ones are drawn into a neighbour.

Folds, constraints and the boundary keep their place: what a vertex lies on must go on along the
edge. The complex stays what it was (link condition [Dey1999]_), and nothing folds over, seen in the
tangent spaces at the corners of all tetrahedra around.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.manifold.complex.marked_complex import Fabric, squared_sides
from equimorph.manifold.geometry.topology import distinct, keys_of
from equimorph.manifold.refining.deviations import deviations
from equimorph.manifold.refining.tetrahedra import POOR, Judge, beside, smallest_angles

SHORT = 0.5
"""Edges of poor tetrahedra so much shorter than the longest one may go."""
LONGER = 1.5
"""How much longer than the longest edge around a vertex edges may get that replace them."""
SHARP = np.radians(5.0)
"""Of tetrahedra with smaller angles, and overturned ones, all edges may go."""
WORSE = 0.7
"""Least share of the smallest angle around a vertex that must remain when it goes."""

Rows = Int[np.ndarray, " n"]
Values = Float[np.ndarray, " n"]
Moves = Int[np.ndarray, "m 2"]
"""Vertices that go, and into which neighbours."""
Near = Bool[np.ndarray, " V"]
Cut = tuple[Int[np.ndarray, "n 2"], Int[np.ndarray, " n"]]
"""Edges that were bisected, and the vertices on them."""


def collapse_edges(fabric: Fabric, judge: Judge, near: Near, cut: Cut, limit: float) -> Fabric:
    """Draw corners of poor tetrahedra near into a neighbour, where there are fewer poor ones then.

    `cut` are edges that were bisected, and the vertices put on them: they do not come back as long
    as these are there. Nor do edges come that deviate from the set by more than `limit`.
    """
    moves = _moves(fabric, (judge, near), cut, limit)
    if len(moves) == 0:
        return fabric
    target = np.arange(len(fabric.vertices))
    target[moves[:, 0]] = moves[:, 1]
    cells, facets = target[fabric.cells], target[fabric.facets]
    kept, whole = _proper(cells), _proper(facets)
    new = kept & (cells != fabric.cells).any(axis=1)
    squared = fabric.squared.copy()
    squared[new] = squared_sides(fabric.vertices.place, cells[new])
    return replace(
        fabric,
        cells=cells[kept],
        squared=squared[kept],
        cell_index=fabric.cell_index[kept],
        facets=facets[whole],
        marks=fabric.marks[whole],
    )


def _proper(rows: Int[np.ndarray, "n k"]) -> Bool[np.ndarray, " n"]:
    """Which rows have different corners."""
    return np.asarray((np.diff(np.sort(rows, axis=1), axis=1) > 0).all(axis=1))


def _moves(fabric: Fabric, where: tuple[Judge, Near], cut: Cut, limit: float) -> Moves:
    """Moves that help and keep clear of each other."""
    cells, base = fabric.cells, len(fabric.vertices)
    judge, near = where
    quality = judge.of(fabric, beside(cells, near))
    poor = np.flatnonzero((quality < POOR) & near[cells].any(axis=1))
    length = np.sqrt(fabric.squared[poor])
    short = length < SHORT * length.max(axis=1, initial=0.0)[:, None]
    cell, side = np.nonzero(short | (quality[poor] < SHARP)[:, None])
    pairs = np.array(list(combinations(range(4), 2)))
    ends = cells[poor[cell, None], pairs[side]]
    moves = np.unique(np.concatenate([ends, ends[:, ::-1]]), axis=0)
    moves = moves[_along(fabric, moves)]
    around = Around(cells, base)
    moves = moves[_new(fabric, around, cut, moves)]
    moves = moves[_linked(fabric, around, moves)]
    if len(moves) == 0:
        return np.zeros((0, 2), int)
    gain = _gains(fabric, around, (judge, quality), moves)
    moves, gain = moves[gain > 0], gain[gain > 0]
    close = _within(fabric, around, moves, limit)
    moves, gain = moves[close], gain[close]
    return _apart(cells, around, moves[np.argsort(-gain, kind="stable")])


class Around:
    """Cells, or facets, around every vertex."""

    def __init__(self, cells: Int[np.ndarray, "C corners"], base: int) -> None:
        self.cells = cells
        self._corners = cells.shape[1]
        self._order = np.argsort(cells.ravel(), kind="stable")
        amount = np.bincount(cells.ravel(), minlength=base)
        self._starts = np.concatenate([[0], np.cumsum(amount)])

    def of(self, vertices: Rows) -> tuple[Rows, Rows]:
        """Which of the vertices, and a cell around it: all pairs."""
        count = self._starts[vertices + 1] - self._starts[vertices]
        row = np.repeat(np.arange(len(vertices)), count)
        offset = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
        return row, self._order[self._starts[vertices][row] + offset] // self._corners

    def links(self, vertices: Rows, size: int, base: int) -> tuple[Rows, Rows]:
        """Faces of some size opposite to vertices: all pairs of a vertex's row and a face's key."""
        row, cell = self.of(vertices)
        own = self.cells[cell]
        at = np.argmax(own == vertices[row, None], axis=1)
        rest = np.take_along_axis(
            own, (at[:, None] + np.arange(1, self._corners)) % self._corners, 1
        )
        chosen = list(combinations(range(self._corners - 1), size))
        faces = [rest[:, list(each)] for each in chosen]
        keys = [face[:, 0] if size == 1 else keys_of(face, base) for face in faces]
        return np.tile(row, len(chosen)), np.concatenate(keys)


def _along(fabric: Fabric, moves: Moves) -> Bool[np.ndarray, " m"]:
    """Whether what the vertex lies on goes on along the edge."""
    own = fabric.vertex_marks[moves[:, 0]]
    alone = fabric.vertices.shared[moves[:, 0]] < 0
    return np.asarray(alone & (own == fabric.edge_marks(np.sort(moves, axis=1))))


def _new(fabric: Fabric, around: Around, cut: Cut, moves: Moves) -> Bool[np.ndarray, " m"]:
    """Whether no edge comes back on which there is a vertex."""
    base = len(fabric.vertices)
    keys, on_edge = keys_of(cut[0], base), cut[1]
    good = np.ones(len(moves), bool)
    if len(keys) == 0:
        return good
    order = np.argsort(keys)
    row, end = around.links(moves[:, 0], 1, base)
    own = keys_of(np.stack([moves[row, 1], end], axis=1), base)
    at = order[np.minimum(np.searchsorted(keys[order], own), len(keys) - 1)]
    back = (keys[at] == own) & (on_edge[at] != moves[row, 0])
    good[row[back]] = False
    return good


def _linked(fabric: Fabric, around: Around, moves: Moves) -> Bool[np.ndarray, " m"]:
    """Link condition, in the complex and in the surfaces of marked facets.

    What the links of both ends share is the link of the edge.
    """
    base = len(fabric.vertices)
    surfaces = Around(fabric.facets, base)
    good = np.ones(len(moves), bool)
    for complex_, size in ((around, 1), (around, 2), (surfaces, 1)):
        first, second = (_pairs(complex_, moves[:, k], size, base) for k in range(2))
        common = np.intersect1d(first, second, assume_unique=True) // base**size
        shared = np.bincount(common, minlength=len(moves))
        row, cell = complex_.of(moves[:, 0])
        own = complex_.cells[cell]
        both = (own == moves[row, 1, None]).any(axis=1)
        row, own = row[both], own[both]
        ends = (own[:, :, None] == moves[row][:, None]).any(axis=2)
        rest = own[~ends].reshape(len(own), complex_.cells.shape[1] - 2)
        faces = [rest[:, list(each)] for each in combinations(range(rest.shape[1]), size)]
        keys = [face[:, 0] if size == 1 else keys_of(face, base) for face in faces]
        of_edge = distinct(np.tile(row, len(keys)) * base**size + np.concatenate(keys))
        good &= shared == np.bincount(of_edge // base**size, minlength=len(moves))
    return good


def _pairs(around: Around, vertices: Rows, size: int, base: int) -> Rows:
    """Distinct faces in the links of vertices, with the vertices' rows, as one number each."""
    row, key = around.links(vertices, size, base)
    return distinct(row * base**size + key)


def _within(fabric: Fabric, around: Around, moves: Moves, limit: float) -> Bool[np.ndarray, " m"]:
    """Whether no edge that comes deviates by more than a limit."""
    good = np.ones(len(moves), bool)
    if not np.isfinite(limit):
        return good
    base = len(fabric.vertices)
    row, end = around.links(moves[:, 0], 1, base)
    row, end = np.divmod(distinct(row * base + end), base)
    row, end = row[end != moves[row, 1]], end[end != moves[row, 1]]
    marks = fabric.edge_marks(np.sort(np.stack([moves[row, 0], end], axis=1), axis=1))
    new = np.sort(np.stack([moves[row, 1], end], axis=1), axis=1)
    good[row[deviations(fabric, new, marks) > limit]] = False
    return good


def _gains(
    fabric: Fabric, around: Around, known: tuple[Judge, Values], moves: Moves
) -> Float[np.ndarray, " m"]:
    """How many poor tetrahedra fewer there are if a vertex is drawn into a neighbour.

    And, less than one, by how much the worst around it gets better. Minus one where one would
    fold over, get much poorer or much longer.
    """
    (judge, quality), count = known, len(moves)
    row, cell = around.of(moves[:, 0])
    old = fabric.cells[cell]
    new = np.where(old == moves[row, 0][:, None], moves[row, 1][:, None], old)
    stays = _proper(new)
    squared = squared_sides(judge.place, new[stays])
    angle = smallest_angles(squared)
    before, after = np.full(count, np.inf), np.full(count, np.inf)
    np.minimum.at(before, row, quality[cell])
    np.minimum.at(after, row[stays], angle)
    reach, longest = np.zeros(count), np.zeros(count)
    np.maximum.at(reach, row, fabric.squared[cell].max(axis=1, initial=0.0))
    np.maximum.at(longest, row[stays], squared.max(axis=1, initial=0.0))
    fewer = np.bincount(row[quality[cell] < POOR], minlength=count)
    fewer -= np.bincount(row[stays][angle < POOR], minlength=count)
    maybe = (longest <= LONGER**2 * reach) & np.isfinite(after) & (after >= WORSE * before)
    maybe &= fewer + (after - before) / np.pi > 0.0
    looked = maybe[row] & stays
    actual = judge.qualities(new[looked], fabric.cell_index[cell[looked]])
    np.minimum.at(after, row[looked], actual)
    fewer -= np.bincount(row[looked][(actual < POOR)], minlength=count)
    fewer += np.bincount(row[looked][angle[maybe[row][stays]] < POOR], minlength=count)
    good = maybe & (after >= np.where(before > 0.0, WORSE, 1.0) * before)
    return np.where(good, fewer + (after - before) / np.pi, -1.0)


def _apart(cells: Int[np.ndarray, "C 4"], around: Around, moves: Moves) -> Moves:
    """Moves in order, without those that touch the star of an earlier one."""
    row, cell = around.of(moves[:, 0])
    ends = np.searchsorted(row, np.arange(len(moves) + 1))
    touched = np.zeros(int(cells.max(initial=0)) + 1, bool)
    kept = []
    for number in range(len(moves)):
        star = cells[cell[ends[number] : ends[number + 1]]].ravel()
        if not touched[star].any():
            touched[star] = True
            kept.append(number)
    chosen: Moves = moves[np.array(kept, int)]
    return chosen
