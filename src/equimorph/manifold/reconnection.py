"""Better tetrahedra between the same vertices: two become three, or three become two.

Dihedral angles are measured in the embedding. Nothing may fold over: in the tangent spaces at all
five vertices, new tetrahedra look the same way as what they replace [Freitag1997]_. Facets on
folds, on constraints and on the boundary stay.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.manifold.fabric import Fabric, squared_sides
from equimorph.manifold.topology import distinct, keys_of

POOR = np.radians(18.0)
"""Tetrahedra with a smaller dihedral angle are taken apart, if that helps."""
GAIN = np.radians(0.2)
"""Least gain of the smallest angle."""
FLAT = 1e-3
"""Least volume of a new tetrahedron in a tangent space, relative to all that replace the old."""
PASSES = 12

Tetrahedra = Int[np.ndarray, "T 4"]


@dataclass(frozen=True)
class _Moves:
    """Cells that go (−1: none), those that come, and the edge or facet that comes with them."""

    gone: Int[np.ndarray, "n 3"]
    come: Int[np.ndarray, "n 3 4"]
    """With a first corner of −1 where there is none."""
    gain: Float[np.ndarray, " n"]
    key: Int[np.ndarray, " n"]

    def take(self, some: Int[np.ndarray, " k"] | Bool[np.ndarray, " n"]) -> "_Moves":
        """Return some of the moves."""
        return _Moves(*(column[some] for column in vars(self).values()))


def dihedral_angles(
    place: Float[np.ndarray, "V coordinates"], cells: Tetrahedra
) -> Float[np.ndarray, "T 6"]:
    """Angles between the facets of tetrahedra: opposite to corners 0 and 1, 0 and 2, and so on.

    From the products of the gradients of the barycentric coordinates.
    """
    sides = place[cells[:, 1:]] - place[cells[:, :1]]
    gram = sides @ np.swapaxes(sides, 1, 2)
    products = np.empty((len(cells), 4, 4))
    for i in range(3):
        a, b = (k for k in range(3) if k != i)
        for j in range(3):
            c, d = (k for k in range(3) if k != j)
            minor = gram[:, a, c] * gram[:, b, d] - gram[:, a, d] * gram[:, b, c]
            products[:, i + 1, j + 1] = (-1.0) ** (i + j) * minor
    products[:, 0, 1:] = products[:, 1:, 0] = -products[:, 1:, 1:].sum(axis=1)
    products[:, 0, 0] = -products[:, 0, 1:].sum(axis=1)
    size = np.sqrt(np.maximum(np.einsum("nii->ni", products), 1e-300))
    cosines = [-products[:, i, j] / (size[:, i] * size[:, j]) for i, j in combinations(range(4), 2)]
    return np.asarray(np.arccos(np.clip(np.stack(cosines, axis=1), -1.0, 1.0)))


def smallest_dihedral(fabric: Fabric) -> float:
    """Smallest dihedral angle of all tetrahedra, in degrees; 0 where there are none."""
    if fabric.dimension < 3:
        return 0.0
    return float(np.degrees(_smallest(fabric, fabric.cells).min(initial=np.pi)))


def reconnect(fabric: Fabric, but: Int[np.ndarray, "m 2"]) -> Fabric:
    """Reconnect vertices as long as the smallest angles of poor tetrahedra grow.

    Edges between the pairs of vertices `but` do not come into being.
    """
    cells, index = fabric.cells.copy(), fabric.cell_index.copy()
    angle = _smallest(fabric, cells)
    for _ in range(PASSES):
        moves = _apart(_moves(fabric, cells, index, angle, but), len(cells))
        if len(moves.gain) == 0:
            break
        gone = moves.gone[moves.gone >= 0]
        row, column = np.nonzero(moves.come[:, :, 0] >= 0)
        come = moves.come[row, column]
        kept = np.delete(np.arange(len(cells)), gone)
        index = np.concatenate([index[kept], index[moves.gone[row, 0]]])
        cells = np.concatenate([cells[kept], come])
        angle = np.concatenate([angle[kept], _smallest(fabric, come)])
    squared = squared_sides(fabric.vertices.place, cells)
    return replace(fabric, cells=cells, cell_index=index, squared=squared)


def _smallest(fabric: Fabric, cells: Tetrahedra) -> Float[np.ndarray, " T"]:
    return np.asarray(dihedral_angles(fabric.vertices.place, cells).min(axis=1, initial=np.pi))


def _moves(
    fabric: Fabric,
    cells: Tetrahedra,
    index: Int[np.ndarray, " T"],
    angle: Float[np.ndarray, " T"],
    but: Int[np.ndarray, "m 2"],
) -> _Moves:
    """All moves that take poor cells apart and let angles grow."""
    base = len(fabric.vertices)
    poor = angle < POOR
    near = np.zeros(base, bool)
    near[cells[poor]] = True
    around = np.flatnonzero(near[cells].any(axis=1))
    sides = [cells[around][:, list(k)] for k in combinations(range(4), 2)]
    known = distinct(np.concatenate([keys_of(side, base) for side in (*sides, but)]))
    both = [
        _two_to_three(fabric, cells, around, known),
        _three_to_two(fabric, cells, around),
    ]
    moves = _Moves(
        *(np.concatenate([getattr(each, name) for each in both]) for name in vars(both[0]))
    )
    held = moves.gone >= 0
    helps = (poor[moves.gone] & held).any(axis=1)
    one = (index[moves.gone] == index[moves.gone[:, :1]]) | ~held
    moves = moves.take(helps & one.all(axis=1))
    before = np.where(moves.gone >= 0, angle[moves.gone], np.pi).min(axis=1, initial=np.pi)
    after = _smallest(fabric, moves.come.reshape(-1, 4)).reshape(-1, 3)
    after = np.where(moves.come[:, :, 0] >= 0, after, np.pi).min(axis=1, initial=np.pi)
    moves = replace(moves, gain=after - before)
    moves = moves.take(moves.gain > GAIN)
    return moves.take(_stays_up(fabric, cells, moves))


def _two_to_three(
    fabric: Fabric,
    cells: Tetrahedra,
    around: Int[np.ndarray, " n"],
    known: Int[np.ndarray, " edges"],
) -> _Moves:
    """Pairs of cells on both sides of a facet, and three around the new edge through it."""
    base = len(fabric.vertices)
    facets = np.concatenate([np.delete(cells[around], k, axis=1) for k in range(4)])
    tips = np.concatenate([cells[around, k] for k in range(4)])
    owner = np.tile(around, 4)
    keys = keys_of(facets, base)
    order = np.argsort(keys, kind="stable")
    same = np.flatnonzero(keys[order[1:]] == keys[order[:-1]])
    one, other = order[same], order[same + 1]
    new = keys_of(np.stack([tips[one], tips[other]], axis=1), base)
    free = ~np.isin(new, known) & ~np.isin(keys[one], keys_of(fabric.facets, base))
    one, other, new = one[free], other[free], new[free]
    (a, b, c), d, e = facets[one].T, tips[one], tips[other]
    come = np.stack([np.stack(k, axis=1) for k in ((a, b, d, e), (b, c, d, e), (c, a, d, e))], 1)
    gone = np.stack([owner[one], owner[other], np.full(len(one), -1)], axis=1)
    return _Moves(gone, come, np.zeros(len(new)), new)


def _three_to_two(fabric: Fabric, cells: Tetrahedra, around: Int[np.ndarray, " n"]) -> _Moves:
    """Triples of cells around an edge, and two on both sides of the facet between the others."""
    base = len(fabric.vertices)
    pairs = list(combinations(range(4), 2))
    edges = np.concatenate([cells[around][:, list(pair)] for pair in pairs])
    rest = [tuple(k for k in range(4) if k not in pair) for pair in pairs]
    others = np.concatenate([cells[around][:, list(pair)] for pair in rest])
    owner = np.tile(around, 6)
    keys = keys_of(edges, base)
    order = np.argsort(keys, kind="stable")
    _, first, counts = np.unique(keys[order], return_index=True, return_counts=True)
    rows = order[first[counts == 3, None] + np.arange(3)]
    ring = np.sort(others[rows].reshape(-1, 6), axis=1)
    closed = (ring[:, ::2] == ring[:, 1::2]).all(axis=1)
    rows, ring = rows[closed], ring[closed, ::2]
    facets = np.concatenate([np.delete(cells[around], k, axis=1) for k in range(4)])
    new = keys_of(ring, base)
    free = ~np.isin(new, keys_of(facets, base))
    rows, ring, new = rows[free], ring[free], new[free]
    ends = edges[rows[:, 0]]
    come = np.full((len(ring), 3, 4), -1)
    for side in range(2):
        come[:, side] = np.concatenate([ring, ends[:, side, None]], axis=1)
    return _Moves(owner[rows], come, np.zeros(len(ring)), new)


def _stays_up(fabric: Fabric, cells: Tetrahedra, moves: _Moves) -> Bool[np.ndarray, " n"]:
    """Whether what comes fills what goes without folding over, in all tangent spaces around."""
    store = fabric.vertices
    # all five vertices are corners of the first two cells that come, or of all three
    vertices = np.sort(moves.come.reshape(-1, 12), axis=1)
    distinct = (np.diff(vertices, axis=1, prepend=-1) > 0) & (vertices >= 0)
    five = vertices[distinct].reshape(-1, 5)
    local = np.argmax(five[:, None, None] == moves.come[:, :, :, None], axis=3)
    gone = np.where(moves.gone[:, :, None] >= 0, cells[moves.gone], -1)
    local_gone = np.argmax(five[:, None, None] == gone[:, :, :, None], axis=3)
    away = store.place[five] - store.place[five[:, :1]]
    good, real = np.ones(len(five), bool), moves.come[:, :, 0] >= 0
    for plane in range(5):
        flat = np.einsum("nic,nkc->nki", store.rows[five[:, plane]], away)
        whole = np.abs(_volumes(flat, local_gone, gone)).sum(axis=1)
        new = np.abs(_volumes(flat, local, moves.come))
        good &= (~real | (new >= FLAT * whole[:, None])).all(axis=1)
        # those that fold over add up to more than what they fill
        good &= new.sum(axis=1) <= (1.0 + 1e-9) * whole
    return good


def _volumes(
    flat: Float[np.ndarray, "n 5 3"],
    local: Int[np.ndarray, "n 3 4"],
    cells: Int[np.ndarray, "n 3 4"],
) -> Float[np.ndarray, "n 3"]:
    """Volumes, times six, of cells in a tangent space; zero where there is none."""
    corners = flat[np.arange(len(flat))[:, None, None], local]
    sides = corners[:, :, 1:] - corners[:, :, :1]
    volume = np.einsum("nki,nki->nk", sides[:, :, 0], np.cross(sides[:, :, 1], sides[:, :, 2]))
    return np.where(cells[:, :, 0] >= 0, volume, 0.0)


def _apart(moves: _Moves, count: int) -> _Moves:
    """Moves, best first, that neither share a cell nor make the same edge or facet."""
    order = np.argsort(-moves.gain, kind="stable")
    moves = moves.take(order)
    taken, made, kept = np.zeros(count + 1, bool), set(), []
    for number, (gone, key) in enumerate(zip(moves.gone.tolist(), moves.key.tolist(), strict=True)):
        own = [cell for cell in gone if cell >= 0]
        if taken[own].any() or key in made:
            continue
        taken[own] = True
        made.add(key)
        kept.append(number)
    return moves.take(np.array(kept, int))
