"""Stars of vertices filled from another place: from a neighbour, or from where their vertex moves.

What a vertex lies on must go on along the edge that it is collapsed along, and the complex stays
what it was (link condition [Dey1999]_). A vertex that moves stays on its fold, constraint, sides of
the box, or where these meet.
"""

from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np

from equimorph.arrays import Bool, Edges, Float, Int, ItemFlags, Places, VertexFlags
from equimorph.manifold.complex.cuts import copies
from equimorph.manifold.complex.edge_points import chunks, of_index, on_curves, vertices_at
from equimorph.manifold.complex.marked_complex import (
    TRIANGLES,
    Fabric,
    FacetMark,
    edges_of,
    held_parameters,
)
from equimorph.manifold.complex.vertices import Vertices, free_vertices
from equimorph.manifold.geometry.exact_points import Corrected, Pinned, correct_between
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.simplices import squared_sides
from equimorph.manifold.geometry.tangents import split_step
from equimorph.manifold.geometry.topology import count_corners, distinct, keys_of, rows_of
from equimorph.manifold.refining.quality import POOR, SHARP, determinants, smallest_angles, worst
from equimorph.manifold.refining.stars import (
    Around,
    Kind,
    Pairs,
    Quality,
    Refills,
    Rows,
    hopeful,
    with_exact,
)

SHORT = 0.5
"""Edges of poor tetrahedra that are shorter than this share of the longest one may go."""
VERY_SHARP = np.radians(5.0)
"""Of tetrahedra with a smaller angle all edges may go."""
ROUNDS, FIRST = 8, 0.25
"""Steps of the search for a better place, and the length of the first relative to the star."""
LEAST = np.radians(0.2)
"""Least growth of the smallest angle around a vertex that moves."""
MOVABLE = FacetMark.FOLD | FacetMark.CAP | (63 * FacetMark.SIDE)
"""Marks of vertices that may move."""
TO_FRONT = {
    2: np.array([[0, 1, 2], [1, 2, 0], [2, 0, 1]]),
    3: np.array([[0, 1, 2, 3], [1, 0, 3, 2], [2, 0, 1, 3], [3, 0, 2, 1]]),
}
"""Even permutations that bring each corner of a cell to the front, by the dimension."""

Near = VertexFlags
Directions = Float[np.ndarray, "n k d"]


def collapses(fabric: Fabric, quality: Quality, near: Near, short: float = 0.0) -> Refills:
    """Collapses of the corners of poor cells with a corner near into their neighbours.

    Of triangles also of adjacent edges that are shorter than a share `short` of their neighbours.
    """
    cells, d = fabric.cells, fabric.dimension
    poor = np.flatnonzero((quality < POOR[d]) & (count_corners(near, cells) > 0))
    pairs = np.array(list(combinations(range(d + 1), 2)))
    length = np.sqrt(fabric.squared[poor])
    chosen = length < SHORT * length.max(axis=1, initial=0.0)[:, None]
    chosen |= (d == TRIANGLES) | (quality[poor] < VERY_SHARP)[:, None]
    cell, side = np.nonzero(chosen)
    ends = np.concatenate([cells[poor[cell, None], pairs[side]], short_edges(fabric, poor, short)])
    _, others = copies(fabric, ends)
    base = len(fabric.vertices)
    ends = rows_of(distinct(keys_of(np.concatenate([ends, others]), base)), base, 2)
    moves = np.concatenate([ends, ends[:, ::-1]])
    moves, row = in_all_sheets(fabric, moves[_goes_on(fabric, moves)])
    refills = collapse_into(fabric, moves, row)
    refills = replace(refills, kind=Kind.COLLAPSE, short=_short(refills, moves, row, short))
    # links cost more to look at than angles
    good = hopeful(refills, with_exact(refills, quality))
    moves, row = moves[good[row]], row[good[row]]
    good[row[~_meets_link_condition(fabric, moves)]] = False
    return refills.take(good)


def _short(refills: Refills, moves: Edges, row: Rows, short: float) -> Bool[np.ndarray, " refills"]:
    """Refills by moves that are shorter than a share `short` of what is around."""
    place, reach = refills.fabric.vertices.place, np.zeros(refills.count)
    sides = np.sqrt(refills.fabric.squared[refills.gone].max(axis=1, initial=0.0))
    np.maximum.at(reach, refills.gone_row, sides)
    length, out = np.linalg.norm(place[moves[:, 0]] - place[moves[:, 1]], axis=1), reach < 0.0
    out[row[length < short * reach[row]]] = True
    return out


def short_edges(fabric: Fabric, cells: Rows, short: float) -> Edges:
    """Edges at given cells that are shorter than a share `short` of others at their ends.

    Two vertices of a fold or constraint so close may be necessary to represent a third one near
    them.
    """
    if short == 0.0 or len(cells) == 0:
        return np.zeros((0, 2), int)
    beside = np.zeros(len(fabric.vertices), bool)
    beside[fabric.cells[cells]] = True
    own = count_corners(beside, fabric.cells) > 0
    edges, of_cells = edges_of(fabric.cells[own], len(beside))
    length, reach = np.empty(len(edges)), np.zeros(len(beside))
    length[of_cells] = np.sqrt(fabric.squared[own])
    for end in edges.T:
        np.maximum.at(reach, end, length)
    return np.asarray(edges[length < short * reach[edges].max(axis=1)])


def _goes_on(fabric: Fabric, moves: Edges) -> Bool[np.ndarray, " m"]:
    """Whether what the vertex lies on goes on along the edge; nothing is drawn from or to a rim."""
    marks, gone = fabric.vertex_marks, moves[:, 0]
    good = (marks[gone] == fabric.edge_marks(np.sort(moves, axis=1))) & ~(
        marks[moves] & FacetMark.RIM
    ).any(axis=1)
    if fabric.dimension != TRIANGLES:
        return np.asarray(good & (fabric.vertices.shared[gone] < 0))
    # where curves of one kind meet, they end
    ends = np.bincount(fabric.facets.ravel(), minlength=len(fabric.vertices))[gone]
    return np.asarray(good & ((ends == 0) | (ends == 2)))


def _meets_link_condition(fabric: Fabric, moves: Edges) -> Bool[np.ndarray, " m"]:
    """Link condition, in the complex and in what the marked facets form.

    What the links of both ends share is the link of the edge.
    """
    base, d = len(fabric.vertices), fabric.dimension
    whole, marked = (Around(each, moves.ravel(), base) for each in (fabric.cells, fabric.facets))
    good = np.ones(len(moves), bool)
    sizes = [(whole, size) for size in range(1, d)]
    for around, size in (*sizes, (marked, 1)):
        own, other = (_distinct(around.links(moves[:, k], size, base), base**size) for k in (0, 1))
        common = np.intersect1d(own, other, assume_unique=True) // base**size
        of_edge = _distinct(around.edge_links(moves, size, base), base**size) // base**size
        shared, needed = (np.bincount(each, minlength=len(moves)) for each in (common, of_edge))
        good &= shared == needed
    return good


def _distinct(pairs: Pairs, base: int) -> Int[np.ndarray, " keys"]:
    """Distinct pairs of a row and a key, as one number each."""
    return distinct(pairs[0] * base + pairs[1])


def in_all_sheets(
    fabric: Fabric, moves: Edges
) -> tuple[Int[np.ndarray, "moves 2"], Int[np.ndarray, " moves"]]:
    """Moves with the refill that each belongs to: along crossings one refill of all sheets.

    Left out are moves along crossings that some sheet does not allow.
    """
    shared, row = fabric.vertices.shared, np.arange(len(moves))
    own = np.flatnonzero(shared[moves[:, 0]] >= 0)
    if len(own) == 0:
        return moves, row
    at = shared[moves[own]]
    keys = at[:, 0] * (shared.max() + 2) + at[:, 1] + 1
    _, first, label, counts = np.unique(
        keys, return_index=True, return_inverse=True, return_counts=True
    )
    used = np.unique(fabric.cells)
    sheets = np.bincount(shared[used][shared[used] >= 0], minlength=shared.max() + 1)
    row[own] = own[first[label]]
    whole = np.ones(len(moves), bool)
    whole[own] = counts[label] == sheets[at[:, 0]]
    return moves[whole], np.unique(row[whole], return_inverse=True)[1]


def collapse_into(fabric: Fabric, moves: Edges, row: Rows) -> Refills:
    """Refills that collapse vertices into others, without the cells that vanish."""
    base = len(fabric.vertices)
    columns = []
    for simplices in (fabric.cells, fabric.facets):
        move, at = Around(simplices, moves[:, 0], base).of(moves[:, 0])
        old = simplices[at]
        new = np.where(old == moves[move, 0][:, None], moves[move, 1][:, None], old)
        stays = (np.diff(np.sort(new, axis=1), axis=1) > 0).all(axis=1)
        columns.append((at, row[move], new[stays], at[stays], row[move][stays]))
    (gone, gone_row, come, kept, come_row), (lost, lost_row, new, left, new_row) = columns
    count, index, marks = int(row.max(initial=-1)) + 1, fabric.cell_index[kept], fabric.marks[left]
    return Refills(
        fabric, count, gone, gone_row, come, index, come_row,
        lost, lost_row, new, marks, new_row, Kind.MOVE, np.zeros(count, bool),
    )  # fmt: skip


def moves(fabric: Fabric, quality: Quality, near: Near, sharp: float = SHARP) -> Refills:
    """Moves of the corners of sharp cells with a corner near to where the worst around is best."""
    own = (quality < sharp) & (count_corners(near, fabric.cells) > 0)
    chosen = np.unique(fabric.cells[own])
    marks = fabric.vertex_marks[chosen]
    free = (marks & ~MOVABLE == 0) & (fabric.vertices.shared[chosen] < 0)
    chosen, marks = chosen[free], marks[free]
    base = len(fabric.vertices)
    around = Around(fabric.cells, chosen, base)
    old, parts = [chosen[:0]], []
    for own in chunks(np.arange(len(chosen)), marks):
        found, vertices = _at_better_places(fabric, around, chosen[own], int(marks[own[0]]))
        old.append(chosen[own[found]])
        parts.append(vertices)
    gone = np.concatenate(old)
    if len(gone) == 0:
        return collapse_into(fabric, np.zeros((0, 2), int), gone)
    more = replace(fabric, vertices=fabric.vertices.join(*parts))
    number = np.arange(len(gone))
    return collapse_into(more, np.stack([gone, base + number], axis=1), number)


def _at_better_places(
    fabric: Fabric, around: Around, chosen: Rows, mark: int
) -> tuple[ItemFlags, Vertices]:
    """Vertices with a mark after their moves, and for which of them these were found.

    The place is searched for in the tangent space and corrected orthogonally to it.
    """
    setting, store = fabric.setting, fabric.vertices
    none = np.zeros(len(chosen), bool)
    end = fabric.end(np.repeat(chosen[:, None], 2, axis=1), 0, mark)
    directions = np.swapaxes(end.allowed, 1, 2)
    if directions.shape[1] == 0:
        return none, store.take(chosen[none])
    step = _best_steps(_stars(fabric, around, chosen, directions), len(chosen))
    far = np.linalg.norm(step, axis=1) > 0.0
    chosen, directions, step, end = chosen[far], directions[far], step[far], end.take(far)
    along = np.einsum("nk,nkd->nd", step, directions)
    dz, dp = split_step(setting, np.einsum("nd,ndf->nf", along, store.frame[chosen]))
    z, p = store.z[chosen] + dz, store.p[chosen] + dp
    for k in held_parameters(mark, fabric.dimension):
        p[:, setting.free[k]] = store.p[chosen, setting.free[k]]
    planes, length = store.rows[chosen], np.linalg.norm(step, axis=1)
    near, index = (z, p, embed(setting, z, p), planes, length), store.index[chosen]
    at: Corrected | Pinned
    at = on_curves(fabric, mark, *near, end) if mark else correct_between(setting, *near)
    free = at.p[:, setting.free]
    found = at.found & ((free >= fabric.box[0]) & (free <= fabric.box[1])).all(axis=1)
    if isinstance(at, Corrected):
        found &= at.index == index
    else:
        found = of_index(fabric, mark, at, found, index)
    none[np.flatnonzero(far)[found]] = True
    if isinstance(at, Corrected):
        return none, free_vertices(setting, at.take(found))
    return none, vertices_at(fabric, mark, at, found, index, planes)


@dataclass(frozen=True)
class _Stars:
    """Cells around vertices as seen from there.

    row: the vertex; squared: lengths of the d sides from it to the others; across: of the others,
    squared, which stay; along: the d sides in the k directions that it may take; volume: in its
    tangent space, times d!; slope: by how much that shrinks in the k directions.
    """

    row: Rows
    squared: Float[np.ndarray, "d cells"]
    across: Float[np.ndarray, "others cells"]
    along: Float[np.ndarray, "d k cells"]
    volume: Float[np.ndarray, " cells"]
    slope: Float[np.ndarray, "k cells"]


def _stars(fabric: Fabric, around: Around, chosen: Rows, directions: Directions) -> _Stars:
    """Cells around vertices that may move in some directions of their tangent spaces."""
    row, cell = around.of(chosen)
    cells = fabric.cells[cell]
    at = np.argmax(cells == chosen[row, None], axis=1)
    cells = np.take_along_axis(cells, TO_FRONT[fabric.dimension][at], axis=1)
    place, rows = fabric.vertices.place, fabric.vertices.rows[chosen]
    d, lengths = fabric.dimension, squared_sides(place, cells).T
    flat = (place[cells[:, 1:]] - place[cells[:, :1]]) @ np.swapaxes(rows[row], 1, 2)
    along = np.einsum("nid,nkd->ikn", flat, directions[row])
    # a volume is linear in each side, and all sides from the vertex get shorter by its step
    ones = np.swapaxes(directions[row], 0, 1)
    slope = sum(
        np.stack([determinants(_with_side(flat, i, one)) for one in ones]) for i in range(d)
    )
    return _Stars(
        row, lengths[:d], lengths[d:], along,
        determinants(flat), np.asarray(slope),
    )  # fmt: skip


def _with_side(
    sides: Float[np.ndarray, "n d d"], number: int, side: Places
) -> Float[np.ndarray, "n d d"]:
    """Sides with another one in place of one of them."""
    out = sides.copy()
    out[:, number] = side
    return out


def _best_steps(stars: _Stars, count: int) -> Float[np.ndarray, "n k"]:
    """Steps after which the worst cell around each vertex is best, as far as a search finds it."""
    k = len(stars.slope)
    ways = np.array([way for way in product((-1, 0, 1), repeat=k) if any(way)], float)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    if k == 3:
        ways = ways[np.abs(ways).max(axis=1) != np.sqrt(0.5)]
    longest = np.full(count, np.inf)
    np.minimum.at(longest, stars.row, stars.squared.max(axis=0, initial=0.0))
    reach, step = FIRST * np.sqrt(longest), np.zeros((count, k))
    first = best = worst(_after_steps(stars, step[None])[0], stars.row, count)
    for _ in range(ROUNDS):
        trials = step + reach[:, None] * ways[:, None]
        found = np.stack([worst(q, stars.row, count) for q in _after_steps(stars, trials)])
        own = found.argmax(axis=0)
        better = found.max(axis=0) > best
        best = np.where(better, found.max(axis=0), best)
        step = np.where(better[:, None], step + reach[:, None] * ways[own], step)
        reach = np.where(better, reach, 0.5 * reach)
    # not worth the correction onto the set
    step[best - first <= LEAST] = 0.0
    return step


def _after_steps(
    stars: _Stars, steps: Float[np.ndarray, "ways n k"]
) -> Float[np.ndarray, "ways cells"]:
    """Smallest angle of each cell after steps of the vertices; if turned, how far, negative.

    As the volume relative to that of sides at right angles.
    """
    ways, d, cells = len(steps), len(stars.squared), len(stars.row)
    s = np.moveaxis(steps[:, stars.row], 2, 0)
    squared = np.empty((d + len(stars.across), ways, cells))
    squared[:d] = stars.squared[:, None] - 2.0 * np.einsum("ikn,kwn->iwn", stars.along, s)
    squared[:d] += (s * s).sum(axis=0)
    squared[d:] = stars.across[:, None]
    angle = smallest_angles(squared.reshape(len(squared), -1).T).reshape(ways, cells)
    volume = stars.volume - np.einsum("kn,kwn->wn", stars.slope, s)
    volume /= np.sqrt(np.maximum(np.prod(squared[:d], axis=0), 1e-300))
    return np.where(volume > 0.0, angle, volume)
