"""Stars of edges and facets of tetrahedra, filled again between the same vertices [Freitag1997]_.

An edge inside has one polygon around it, which is filled by the best of all its triangulations. An
edge on a surface of marked facets has one polygon on each side, both closed by the chord that takes
the edge's place on the surface; on the boundary one side is missing. A facet between two cells
gives way to an edge through it.
"""

from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations

import numpy as np

from equimorph.arrays import (
    Bool,
    Cells,
    Edges,
    Float,
    Int,
    ItemFlags,
    Items,
    ItemValues,
    Pairs,
    VertexFlags,
)
from equimorph.columns import Columns
from equimorph.manifold.complex.marked_complex import CURVES, Fabric, FacetMark
from equimorph.manifold.complex.vertices import Vertices
from equimorph.manifold.geometry.simplices import squared_sides
from equimorph.manifold.geometry.topology import among, count_corners, distinct, keys_of, rows_of
from equimorph.manifold.refining.quality import POOR, determinants, smallest_angles
from equimorph.manifold.refining.stars import Kind, Refills, Rows

MOST = 7
"""Largest number of cells around an edge whose star is refilled."""
EDGES = (((0, 1), (2, 3)), ((0, 2), (3, 1)), ((0, 3), (1, 2)),
         ((1, 2), (0, 3)), ((1, 3), (2, 0)), ((2, 3), (0, 1)))  # fmt: skip
"""Edges of a tetrahedron, each with the opposite edge: even permutations of the corners."""

Keys = Int[np.ndarray, " keys"]
"""Keys of edges or facets, in order."""


def reconnections(
    fabric: Fabric, quality: Float[np.ndarray, " cells"], near: VertexFlags, but: Edges
) -> Refills:
    """Other cells around the edges and facets of poor ones with a corner near.

    Edges between the pairs of vertices `but` do not come into being.
    """
    base = len(fabric.vertices)
    poor = (quality < POOR[3]) & (count_corners(near, fabric.cells) > 0)
    beside = np.zeros(base, bool)
    beside[fabric.cells[poor]] = True
    around = np.flatnonzero(count_corners(beside, fabric.cells) > 1)
    barred, facets = _keys_of_cells(fabric, fabric.cells[around], but)
    sides = [fabric.cells[poor][:, list(k)] for k in combinations(range(4), 2)]
    edges = rows_of(distinct(np.concatenate([keys_of(side, base) for side in sides])), base, 2)
    # rings whose edge has an end that is not near are what they were
    #    edges = edges[near[edges].all(axis=1)]
    part = replace(fabric, cells=fabric.cells[around], cell_index=fabric.cell_index[around])
    rings = rings_around(part, edges)
    rings = replace(rings, cells=np.where(rings.cells < 0, -1, around[rings.cells]))
    rings = rings.take(_open_again(rings, near))
    return _without_edges(fabric, rings, barred, facets).join(
        _through_facets(fabric, poor, around, barred)
    )


def _open_again(rings: "Rings", near: VertexFlags) -> Bool[np.ndarray, " rings"]:
    """Which rings changed, or may be filled by a chord that was an edge elsewhere before."""
    polygons = np.concatenate([rings.first, rings.second], axis=1)
    corners = (near[polygons] & (polygons >= 0)).sum(axis=1)
    return np.asarray(near[rings.ends].all(axis=1) | (corners > 1))


def _keys_of_cells(fabric: Fabric, around: Cells, but: Edges) -> tuple[Keys, Keys]:
    """Keys of all edges and of all facets between corners of some cells; `but` count as edges."""
    base = len(fabric.vertices)
    near = np.zeros(base, bool)
    near[around] = True
    cells = fabric.cells[count_corners(near, fabric.cells) > 1]
    edges = [keys_of(cells[:, list(k)], base) for k in combinations(range(4), 2)]
    cells = cells[count_corners(near, cells) > 2]
    facets = [keys_of(cells[:, list(k)], base) for k in combinations(range(4), 3)]
    return distinct(np.concatenate([*edges, keys_of(but, base)])), distinct(np.concatenate(facets))


def _without_edges(fabric: Fabric, rings: "Rings", barred: Keys, facets: Keys) -> Refills:
    """Refills that take edges out."""
    base = len(fabric.vertices)
    # on surfaces the other diagonal is new, unless one side of the edge has a single cell
    flat = ((rings.first >= 0).sum(axis=1) == 2) | ((rings.second >= 0).sum(axis=1) == 2)
    rings = rings.take((rings.mark == 0) | flat | ~among(keys_of(rings.chord, base), barred))
    fillings = [
        fill(fabric.vertices, rings.ends, each, barred) for each in (rings.first, rings.second)
    ]
    good = (fillings[0].quality > 0.0) & (fillings[1].quality > 0.0)
    come = np.concatenate([each.cells for each in fillings], axis=1)
    index = np.repeat(rings.index, fillings[0].cells.shape[1], axis=1)
    chord, on = rings.chord, rings.mark > 0
    new = np.stack([np.column_stack([rings.ends[:, k], chord]) for k in (0, 1)], axis=1)
    between = come[:, :, 1:].reshape(-1, 3)
    old = among(keys_of(between, base), facets) & (between[:, 0] >= 0)
    good &= ~old.reshape(come.shape[:2]).any(axis=1)
    marked = np.argsort(keys_of(fabric.facets, base))
    known = keys_of(fabric.facets, base)[marked]
    good &= ~(among(keys_of(new.reshape(-1, 3), base), known).reshape(-1, 2).any(axis=1) & on)
    lost = np.stack([np.column_stack([rings.ends, chord[:, k]]) for k in (0, 1)], axis=1)
    number = np.arange(len(on))
    gone_row, gone_at = np.nonzero(rings.cells >= 0)
    come_row, come_at = np.nonzero(come[:, :, 0] >= 0)
    on_row = np.repeat(number[on], 2)
    at = np.searchsorted(known, keys_of(lost[on].reshape(-1, 3), base))
    return Refills(
        fabric, len(on), rings.cells[gone_row, gone_at], gone_row,
        come[come_row, come_at], index[come_row, come_at], come_row,
        marked[at], on_row, new[on].reshape(-1, 3), np.repeat(rings.mark[on], 2), on_row,
        Kind.RECONNECTION, np.zeros(len(on), bool),
    ).take(good)  # fmt: skip


def _through_facets(
    fabric: Fabric, poor: Bool[np.ndarray, " cells"], around: Rows, barred: Keys
) -> Refills:
    """Refills that put edges through facets: two cells become three."""
    base, own = len(fabric.vertices), fabric.cells[around]
    # facets so ordered that the corner opposite sees them turn to the left
    order = ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))
    facets = np.concatenate([own[:, list(each)] for each in order])
    tips, owner = np.concatenate(list(own.T)), np.tile(around, 4)
    keys = keys_of(facets, base)
    by_key = np.argsort(keys, kind="stable")
    same = np.flatnonzero(keys[by_key[1:]] == keys[by_key[:-1]])
    one, other = by_key[same], by_key[same + 1]
    new = keys_of(np.stack([tips[one], tips[other]], axis=1), base)
    good = (poor[owner[one]] | poor[owner[other]]) & ~among(new, barred)
    good &= ~among(keys[one], np.sort(keys_of(fabric.facets, base)))
    good &= fabric.cell_index[owner[one]] == fabric.cell_index[owner[other]]
    one, other = one[good], other[good]
    (i, j, k), low, high = facets[one].T, tips[one], tips[other]
    come = np.stack(
        [np.stack([low, high, *pair], axis=1) for pair in ((i, j), (j, k), (k, i))], axis=1
    ).reshape(-1, 4)
    number, none = np.arange(len(one)), np.zeros(0, int)
    gone = np.stack([owner[one], owner[other]], axis=1).ravel()
    index = np.repeat(fabric.cell_index[owner[one]], 3)
    return Refills(
        fabric, len(one), gone, np.repeat(number, 2), come, index, np.repeat(number, 3),
        none, none, np.zeros((0, 3), int), none, none, Kind.RECONNECTION, np.zeros(len(one), bool),
    )  # fmt: skip


@dataclass(frozen=True)
class Rings(Columns):
    """Edges with the cells around them.

    cells: around each edge, −1 where there are fewer; first, second: polygons around it that turn
    to the right about it, with their number of corners, −1 beyond; second is empty but for edges on
    surfaces inside. mark: of the edges; index: of the cells at first and second.
    """

    ends: Edges
    mark: Items
    cells: Int[np.ndarray, "n ring"]
    first: Int[np.ndarray, "n corners"]
    second: Int[np.ndarray, "n corners"]
    index: Pairs

    @property
    def chord(self) -> Edges:
        """What takes the place of edges on surfaces."""
        last = (self.first >= 0).sum(axis=1) - 1
        return np.stack([self.first[:, 0], self.first[np.arange(len(last)), last]], axis=1)


def rings_around(fabric: Fabric, ends: Edges) -> Rings:
    """Rings around edges, sorted ends each, that can be removed; further edges are omitted."""
    base, mark = len(fabric.vertices), fabric.edge_marks(ends)
    ends, mark = ends[_single(mark)], mark[_single(mark)]
    keys = keys_of(ends, base)
    order = np.argsort(keys)
    ends, mark, keys = ends[order], mark[order], keys[order]
    edge, cell, arc = _arcs(fabric, keys)
    count = np.bincount(edge, minlength=len(ends))
    few = (count <= MOST)[edge]
    edge, cell, arc = edge[few], cell[few], arc[few]
    order = np.argsort(edge, kind="stable")
    edge, cell, arc = edge[order], cell[order], arc[order]
    starts = np.searchsorted(edge, np.arange(len(ends)))
    place = np.arange(len(edge)) - starts[edge]
    table = np.full((len(ends), MOST, 3), -1)
    table[edge, place] = np.concatenate([cell[:, None], arc], axis=1)
    kept = (count > 0) & (count <= MOST)
    return _order(fabric, ends[kept], mark[kept], count[kept], table[kept])


def _single(mark: Items) -> ItemFlags:
    """Which edges lie inside, or on one surface whose facets may be exchanged."""
    allowed = (CURVES & ~FacetMark.CROSSING) | (63 * FacetMark.SIDE)
    return np.asarray((mark & (mark - 1) == 0) & (mark & ~allowed == 0))


def _arcs(
    fabric: Fabric, keys: Items
) -> tuple[Int[np.ndarray, " a"], Int[np.ndarray, " a"], Edges]:
    """Cells around edges: the edge, the cell, and its other side, turning to the right."""
    base = len(fabric.vertices)
    edges, owners, arcs = [], [], []
    for (i, j), rest in EDGES:
        pair = fabric.cells[:, [i, j]]
        own = keys_of(pair, base)
        at = np.minimum(np.searchsorted(keys, own), max(len(keys) - 1, 0))
        found = np.flatnonzero(keys[at] == own) if len(keys) else np.zeros(0, int)
        arc = fabric.cells[found][:, list(rest)]
        turned = pair[found, 0] > pair[found, 1]
        arcs.append(np.where(turned[:, None], arc[:, ::-1], arc))
        edges.append(at[found])
        owners.append(found)
    return np.concatenate(edges), np.concatenate(owners), np.concatenate(arcs)


def _order(
    fabric: Fabric, ends: Edges, mark: Items, count: Items, table: Int[np.ndarray, "n ring 3"]
) -> Rings:
    """Rings with their cells one after the other, parted where facets are marked."""
    base, rows = len(fabric.vertices), np.arange(len(ends))
    known = np.sort(keys_of(fabric.facets, base))
    marked = np.zeros((len(ends), MOST), bool)
    for k in range(MOST):
        facet = np.concatenate([ends, table[:, k, 1:2]], axis=1)
        marked[:, k] = among(keys_of(facet, base), known) & (k < count)
    at = marked.argmax(axis=1)
    cells, corners = np.full((len(ends), MOST), -1), np.full((len(ends), MOST + 1), -1)
    parted, good = np.zeros((len(ends), MOST), bool), np.ones(len(ends), bool)
    seen = np.zeros((len(ends), MOST), bool)
    for k in range(MOST):
        live = k < count
        good &= ~(live & seen[rows, at])
        seen[rows, at] |= live
        cells[live, k], corners[live, k] = table[rows, at, 0][live], table[rows, at, 1][live]
        parted[live, k] = marked[rows, at][live]
        after = table[rows, at, 2]
        corners[live, k + 1] = after[live]
        match = table[:, :, 1] == after[:, None]
        good &= ~live | match.any(axis=1) | (k == count - 1)
        at = match.argmax(axis=1)
    last = corners[rows, count]
    closed = last == corners[:, 0]
    corners[rows[closed], count[closed]] = -1
    walls = parted.sum(axis=1)
    inside = closed & (walls == 0) & (mark == 0)
    surface = closed & (walls == 2) & (mark > 0) & parted[:, 0]
    boundary = ~closed & (walls == 1) & (mark > 0) & parted[:, 0]
    second = np.where(surface, np.where(parted, np.arange(MOST), -1).max(axis=1), 0)
    first, other = _polygons(corners, count, second)
    index = fabric.cell_index[cells[rows[:, None], np.stack([rows * 0, second], axis=1)]]
    at_second = (np.arange(MOST) >= second[:, None]) & surface[:, None]
    same = fabric.cell_index[cells] == index[rows[:, None], at_second.astype(int)]
    good &= (same | (cells < 0)).all(axis=1) & (inside | surface | boundary)
    return Rings(ends, mark, cells, first, other, index).take(good)


def _polygons(
    corners: Int[np.ndarray, "n ring"], count: Items, second: Items
) -> tuple[Int[np.ndarray, "n ring"], Int[np.ndarray, "n ring"]]:
    """Polygons up to a place and from it on, back to the beginning; one alone if it is zero."""
    two, number = (second > 0)[:, None], np.arange(corners.shape[1])
    first = np.where(two & (number > second[:, None]), -1, corners)
    at = number + second[:, None]
    other = np.take_along_axis(corners, np.minimum(at, MOST), axis=1)
    other = np.where(at == count[:, None], corners[:, :1], other)
    return first, np.where(two & (at <= count[:, None]), other, -1)


@dataclass(frozen=True)
class Filling:
    """Best tetrahedra between polygons and the ends of the edges that they turn about.

    quality: smallest angle, minus infinity where there is no filling; cells: −1 beyond; chords: of
    the polygons, −1 beyond.
    """

    quality: ItemValues
    cells: Int[np.ndarray, "n come 4"]
    chords: Int[np.ndarray, "n chords 2"]


def fill(
    vertices: Vertices,
    ends: Edges,
    polygons: Int[np.ndarray, "n ring"],
    barred: Int[np.ndarray, " m"],
) -> Filling:
    """Fill polygons with the triangles that give the largest smallest angle.

    `barred` are the keys, in order, of edges that may not be chords. Tetrahedra must look the right
    way in the tangent spaces at both ends.
    """
    size = (polygons >= 0).sum(axis=1)
    quality = np.where(size == 2, np.inf, -np.inf)
    quality[size == 0] = np.inf
    cells = np.full((len(ends), 2 * (MOST - 2), 4), -1)
    chords = np.full((len(ends), MOST - 3, 2), -1)
    for m in range(3, MOST + 1):
        own = np.flatnonzero(size == m)
        if len(own) == 0:
            continue
        ring = polygons[own, :m]
        values = _triangles(vertices, ends[own], ring, barred)
        of, within = _triangulations(m)
        each = values[:, of].min(axis=2)
        best = each.argmax(axis=1)
        quality[own] = each[np.arange(len(own)), best]
        corners = ring[:, _corners(m)][np.arange(len(own))[:, None], of[best]]
        for side, order in ((0, (0, 1, 2)), (1, (0, 2, 1))):
            end = np.repeat(ends[own, side, None, None], m - 2, axis=1)
            both = np.concatenate([end, corners[:, :, list(order)]], axis=2)
            cells[own, side * (m - 2) : (side + 1) * (m - 2)] = both
        if m > 3:
            chords[own, : m - 3] = ring[np.arange(len(own))[:, None, None], within[best]]
    return Filling(quality, cells, chords)


def _triangles(
    vertices: Vertices, ends: Edges, ring: Int[np.ndarray, "n m"], barred: Int[np.ndarray, " b"]
) -> Float[np.ndarray, "n triangles"]:
    """Smallest angle of the two tetrahedra over each triangle of polygons."""
    m, base = ring.shape[1], len(vertices)
    chosen = _corners(m)
    corners = ring[:, chosen].reshape(-1, 3)
    out = np.full(len(corners), np.inf)
    for side, order in ((0, [0, 1, 2]), (1, [0, 2, 1])):
        end = np.repeat(ends[:, side], len(chosen))
        cells = np.concatenate([end[:, None], corners[:, order]], axis=1)
        # most are never wanted: the tangent space at the end will do
        away = vertices.place[ring] - vertices.place[ends[:, side]][:, None]
        flat = (away @ np.swapaxes(vertices.rows[ends[:, side]], 1, 2))[:, chosen[:, order]]
        upright = determinants(flat.reshape(-1, 3, 3)) > 0.0
        out[~upright] = -np.inf
        looked = np.flatnonzero(out > -np.inf)
        angle = smallest_angles(squared_sides(vertices.place, cells[looked]))
        out[looked] = np.minimum(out[looked], angle)
    each = out.reshape(len(ring), -1)
    for i, j in combinations(range(m), 2):
        if j - i in {1, m - 1}:
            continue
        bad = among(keys_of(ring[:, [i, j]], base), barred)
        held = (chosen == i).any(axis=1) & (chosen == j).any(axis=1)
        each[bad[:, None] & held] = -np.inf
    return each


@cache
def _corners(m: int) -> Int[np.ndarray, "triangles 3"]:
    """Corners of all triangles of a polygon."""
    return np.array(list(combinations(range(m), 3)))


@cache
def _triangulations(
    m: int,
) -> tuple[Int[np.ndarray, "ways triangles"], Int[np.ndarray, "ways chords 2"]]:
    """All ways to cut a polygon into triangles: numbers of these, and the chords."""
    number = {tuple(each): k for k, each in enumerate(_corners(m).tolist())}
    ways = _ways(0, m - 1)
    chords = []
    for way in ways:
        sides = {pair for each in way for pair in combinations(each, 2)}
        chords.append(sorted(pair for pair in sides if 1 < pair[1] - pair[0] < m - 1))
    of = np.array([[number[each] for each in way] for way in ways])
    return of, np.array(chords, int).reshape(len(ways), m - 3, 2)


def _ways(i: int, j: int) -> list[tuple[tuple[int, int, int], ...]]:
    """All ways to cut the part of a polygon from corner i to corner j."""
    if j - i < 2:
        return [()]
    return [
        ((i, k, j), *left, *right)
        for k in range(i + 1, j)
        for left in _ways(i, k)
        for right in _ways(k, j)
    ]
