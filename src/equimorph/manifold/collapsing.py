"""Fewer, better tetrahedra: vertices of poor ones are drawn into a neighbour.

Folds, constraints and the boundary keep their place: what a vertex lies on must go on along the
edge. The complex stays what it was (link condition [Dey1999]_), and nothing folds over, seen in the
tangent spaces at the corners of all tetrahedra around.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.manifold.fabric import Fabric, squared_sides
from equimorph.manifold.reconnection import POOR, dihedral_angles
from equimorph.manifold.topology import adjacency, distinct, keys_of, orientation

SHORT = 0.5
"""Edges of poor tetrahedra so much shorter than the longest one may go."""
LONGER = 1.5
"""How much longer than the longest edge around a vertex edges may get that replace them."""
WORSE = 0.7
"""Least share of the smallest angle around a vertex that must remain when it goes."""

Rows = Int[np.ndarray, " n"]
Values = Float[np.ndarray, " n"]
Moves = Int[np.ndarray, "m 2"]
"""Vertices that go, and into which neighbours."""


def collapse_edges(fabric: Fabric, cut: Int[np.ndarray, "m 2"]) -> Fabric:
    """Draw vertices of poor tetrahedra into a neighbour, where there are fewer poor ones then.

    `cut` are edges that were bisected, in the order of the vertices, the last ones, that were put
    on them: they do not come back as long as these vertices are there.
    """
    moves = _moves(fabric, cut)
    if len(moves) == 0:
        return fabric
    target = np.arange(len(fabric.vertices))
    target[moves[:, 0]] = moves[:, 1]
    cells, facets = target[fabric.cells], target[fabric.facets]
    kept, whole = _proper(cells), _proper(facets)
    return replace(
        fabric,
        cells=cells[kept],
        squared=squared_sides(fabric.vertices.place, cells[kept]),
        cell_index=fabric.cell_index[kept],
        facets=facets[whole],
        marks=fabric.marks[whole],
    )


def _proper(rows: Int[np.ndarray, "n k"]) -> Bool[np.ndarray, " n"]:
    """Which rows have different corners."""
    return np.asarray((np.diff(np.sort(rows, axis=1), axis=1) > 0).all(axis=1))


def _moves(fabric: Fabric, cut: Int[np.ndarray, "m 2"]) -> Moves:
    """Moves that help and keep clear of each other."""
    cells, base = fabric.cells, len(fabric.vertices)
    place = fabric.vertices.place
    sense = _Senses(fabric)
    angle = dihedral_angles(place, cells).min(axis=1, initial=np.pi)
    angle[sense.overturned] = -1.0
    poor = np.flatnonzero(angle < POOR)
    length = np.sqrt(fabric.squared[poor])
    short = length < SHORT * length.max(axis=1, initial=0.0)[:, None]
    cell, side = np.nonzero(short | (angle[poor] < 0.0)[:, None])
    pairs = np.array(list(combinations(range(4), 2)))
    ends = cells[poor[cell, None], pairs[side]]
    moves = np.unique(np.concatenate([ends, ends[:, ::-1]]), axis=0)
    moves = moves[_along(fabric, moves)]
    around = _Around(cells, base)
    moves = moves[_new(fabric, around, cut, moves)]
    moves = moves[_linked(fabric, around, moves)]
    gain = _gains(fabric, around, (angle, sense), moves)
    moves, gain = moves[gain > 0], gain[gain > 0]
    return _apart(cells, around, moves[np.argsort(-gain, kind="stable")])


class _Senses:
    """How cells look in the tangent spaces at their corners, oriented coherently.

    upright: the sense of most of what is around each vertex, by volume; overturned: cells that look
    the other way at most of their corners.
    """

    def __init__(self, fabric: Fabric) -> None:
        cells, base = fabric.cells, len(fabric.vertices)
        self._fabric = fabric
        self._signs, _ = orientation(cells, adjacency(cells))
        everything = np.arange(len(cells))
        seen = np.stack([self._seen(everything, cells, k) for k in range(4)], axis=1)
        around = np.bincount(cells.ravel(), weights=seen.ravel(), minlength=base)
        self._upright = np.where(around < 0.0, -1.0, 1.0)
        self.overturned = ((seen * self._upright[cells]) <= 0.0).sum(axis=1) > 2

    def _seen(self, owner: Rows, cells: Int[np.ndarray, "n 4"], corner: int) -> Values:
        """Signed volumes, times six, of cells in the place of others in tangent spaces."""
        store = self._fabric.vertices
        rows = store.rows[cells[:, corner]]
        sides = (store.place[cells[:, 1:]] - store.place[cells[:, :1]]) @ np.swapaxes(rows, 1, 2)
        volume = np.einsum("ni,ni->n", sides[:, 0], np.cross(sides[:, 1], sides[:, 2]))
        # tangent frames have no orientation of their own
        return np.asarray(volume * self._signs[owner])

    def turned(self, owner: Rows, cells: Int[np.ndarray, "n 4"]) -> Bool[np.ndarray, " n"]:
        """Whether cells in the place of others turn over in the tangent space at a corner."""
        out = np.zeros(len(cells), bool)
        for corner in range(4):
            upright = self._upright[cells[:, corner]]
            out |= self._seen(owner, cells, corner) * upright <= 0.0
        return out


class _Around:
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


def _new(
    fabric: Fabric, around: _Around, cut: Int[np.ndarray, "m 2"], moves: Moves
) -> Bool[np.ndarray, " m"]:
    """Whether no edge comes back on which there is a vertex."""
    base = len(fabric.vertices)
    on_edge = np.arange(base - len(cut), base)
    live = np.isin(on_edge, fabric.cells)
    keys, on_edge = keys_of(cut[live], base), on_edge[live]
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


def _linked(fabric: Fabric, around: _Around, moves: Moves) -> Bool[np.ndarray, " m"]:
    """Link condition, in the complex and in the surfaces of marked facets.

    What the links of both ends share is the link of the edge.
    """
    base = len(fabric.vertices)
    surfaces = _Around(fabric.facets, base)
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
        rest = own[~ends].reshape(len(own), -1)
        faces = [rest[:, list(each)] for each in combinations(range(rest.shape[1]), size)]
        keys = [face[:, 0] if size == 1 else keys_of(face, base) for face in faces]
        of_edge = distinct(np.tile(row, len(keys)) * base**size + np.concatenate(keys))
        good &= shared == np.bincount(of_edge // base**size, minlength=len(moves))
    return good


def _pairs(around: _Around, vertices: Rows, size: int, base: int) -> Rows:
    """Distinct faces in the links of vertices, with the vertices' rows, as one number each."""
    row, key = around.links(vertices, size, base)
    return distinct(row * base**size + key)


def _gains(
    fabric: Fabric, around: _Around, known: tuple[Values, _Senses], moves: Moves
) -> Float[np.ndarray, " m"]:
    """How many poor tetrahedra fewer there are if a vertex is drawn into a neighbour.

    And, less than one, by how much the smallest angle around it grows. Minus one where one would
    fold over, get much poorer or much longer.
    """
    angle, sense = known
    place, count = fabric.vertices.place, len(moves)
    row, cell = around.of(moves[:, 0])
    old = fabric.cells[cell]
    new = np.where(old == moves[row, 0][:, None], moves[row, 1][:, None], old)
    stays = _proper(new)
    before, after = np.full(count, np.inf), np.full(count, np.inf)
    new_angle = dihedral_angles(place, new[stays]).min(axis=1, initial=np.pi)
    np.minimum.at(before, row, angle[cell])
    np.minimum.at(after, row[stays], new_angle)
    fewer = np.bincount(row[angle[cell] < POOR], minlength=count)
    fewer -= np.bincount(row[stays][new_angle < POOR], minlength=count)
    reach, longest = np.zeros(count), np.zeros(count)
    np.maximum.at(reach, row, fabric.squared[cell].max(axis=1, initial=0.0))
    np.maximum.at(longest, row[stays], squared_sides(place, new[stays]).max(axis=1, initial=0.0))
    good = (longest <= LONGER**2 * reach) & np.isfinite(after) & (after >= WORSE * before)
    gain = np.where(good, fewer + (after - before) / np.pi, -1.0)
    maybe = (gain > 0)[row] & stays
    turned = sense.turned(cell[maybe], new[maybe])
    gain[row[maybe][turned]] = -1.0
    return np.asarray(gain)


def _apart(cells: Int[np.ndarray, "C 4"], around: _Around, moves: Moves) -> Moves:
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
