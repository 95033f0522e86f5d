"""Better triangles with the same vertices or fewer: flips of edges, and collapses of short ones.

Angles are measured in the embedding. Nothing may fold over: seen in the tangent planes of all
vertices involved, new triangles keep the orientation of those that they replace.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.manifold.complex.marked_complex import RIM, Fabric, edges_of, squared_sides
from equimorph.manifold.complex.shared_edges import copies
from equimorph.manifold.geometry.topology import keys_of
from equimorph.manifold.refining.kernels import flip_edges

SLENDER = np.radians(20.0)
"""Triangles with a smaller angle lose an edge, if that helps, and overturned ones."""
GAIN = 1e-3
"""Least gain of a flip: minus the sum of the cotangents of both opposite angles."""
LONGER = 1.5
"""How much longer than the longest edge around a vertex edges may get that replace them."""
SHORT = 0.05
"""Edges shorter than this share of the longest one around a vertex are worth losing."""
WORSE, MUCH_WORSE = 0.7, 0.2
"""Least share of the smallest angle around a vertex that must remain when it goes; and when it goes
a short way."""
OPPOSITE = np.array([[1, 2], [2, 0], [0, 1]])
"""The other corners of triangles."""

Triangles = Int[np.ndarray, "T 3"]


def smallest_angle(fabric: Fabric) -> float:
    """Smallest angle of all triangles, in degrees; 0 where there are none."""
    if fabric.dimension == 1:
        return 0.0
    if fabric.dimension == 2:
        return float(np.degrees(_smallest(fabric.squared).min(initial=np.inf)))
    angles = [
        _angles(fabric, fabric.cells[:, list(chosen)]).min()
        for chosen in combinations(range(fabric.cells.shape[1]), 3)
    ]
    return float(np.degrees(min(angles)))


def angles(fabric: Fabric) -> Float[np.ndarray, " C"]:
    """Smallest angle of each triangle."""
    return _smallest(fabric.squared)


def flip(fabric: Fabric, but: Int[np.ndarray, "m 2"] | None = None, since: int = 0) -> Fabric:
    """Flip edges whose opposite angles add up to more than π, as far as nothing folds over.

    And those whose flip leaves fewer cells overturned, whatever the angles.
    Edges between the pairs of vertices `but` do not come into being. Where nothing was left to be
    flipped before the vertices from the number `since` on were added, only their surroundings are
    looked at.
    """
    cells, squared, sense = fabric.cells.copy(), fabric.squared.copy(), fabric.sense.copy()
    fixed = fabric.facets
    if but is not None:
        near = np.zeros(len(fabric.vertices), bool)
        near[cells] = True
        fixed = np.concatenate([fixed, but[near[but[:, 0]] & near[but[:, 1]]]])
    place, rows = fabric.vertices.place, fabric.vertices.rows
    flat = np.ascontiguousarray(place[:, -fabric.dimension :])
    parts = (fabric.cell_index, sense, np.ascontiguousarray(fixed), place, rows, flat, OPPOSITE)
    count = flip_edges(cells, squared, *parts, GAIN, since)
    return replace(fabric, cells=cells, squared=squared, sense=sense) if count else fabric


def _cotangents(squared: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T 3"]:
    """Cotangents of the angles at the corners of triangles, from their squared sides."""
    total = squared.sum(axis=1)
    area = total**2 - 2.0 * (squared**2).sum(axis=1)
    four_areas = np.sqrt(np.maximum(area, 1e-28 * total**2))
    # the side opposite to corner 0 comes last
    return np.asarray((total[:, None] - 2.0 * squared[:, ::-1]) / four_areas[:, None])


def _area(
    fabric: Fabric, plane: Int[np.ndarray, " n"], triangle: tuple[Int[np.ndarray, " n"], ...]
) -> Float[np.ndarray, " n"]:
    """Signed area of triangles, twice, in the tangent planes at vertices."""
    place, rows = fabric.vertices.place, fabric.vertices.rows[plane]
    a, b, c = (
        np.einsum("ndc,nc->nd", rows, place[corner] - place[triangle[0]]) for corner in triangle
    )
    del a
    return np.asarray(b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])


def _angles(fabric: Fabric, triangles: Triangles) -> Float[np.ndarray, " T"]:
    """Smallest angle of triangles."""
    return _smallest(squared_sides(fabric.vertices.place, triangles))


def _smallest(squared: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, " T"]:
    largest = _cotangents(squared).max(axis=1, initial=-np.inf)
    return np.asarray(np.arctan2(1.0, largest))


def collapse(fabric: Fabric, passes: int, short: float = 0.0) -> Fabric:
    """Draw vertices of slender triangles into a neighbour, where all angles around get larger.

    Edges shorter than a share `short` of the longest one around count as one bad triangle.
    """
    for _ in range(passes):
        moves = _moves(fabric, short)
        if len(moves) == 0:
            break
        fabric = moved(fabric, moves)
    return fabric


def moved(fabric: Fabric, moves: Int[np.ndarray, "m 2"]) -> Fabric:
    """Replace vertices by others; triangles that vanish are left out."""
    target = np.arange(len(fabric.vertices))
    target[moves[:, 0]] = moves[:, 1]
    cells, facets = target[fabric.cells], target[fabric.facets]
    kept, whole = _proper(cells), _proper(facets)
    changed, squared = kept & (cells != fabric.cells).any(axis=1), fabric.squared.copy()
    squared[changed] = squared_sides(fabric.vertices.place, cells[changed])
    return replace(
        fabric,
        cells=cells[kept],
        squared=squared[kept],
        cell_index=fabric.cell_index[kept],
        sense=fabric.sense[kept],
        facets=facets[whole],
        marks=fabric.marks[whole],
    )


def _proper(rows: Int[np.ndarray, "n k"]) -> Bool[np.ndarray, " n"]:
    """Which rows have different corners."""
    return np.asarray((np.diff(np.sort(rows, axis=1), axis=1) > 0).all(axis=1))


def _moves(fabric: Fabric, short: float) -> Int[np.ndarray, "m 2"]:
    """Vertices that go, and into which neighbours; stars of those that go do not overlap."""
    cells, base = fabric.cells, len(fabric.vertices)
    corners = cells[(_smallest(fabric.squared) < SLENDER) | fabric.overturned(cells, fabric.sense)]
    if len(corners) == 0:
        return np.zeros((0, 2), int)
    around = [corners[:, [i, j]] for i in range(3) for j in range(3) if i != j]
    moves = np.concatenate([*around, _short_ways(fabric, corners, short)])
    _, others = copies(fabric, moves)
    moves = np.unique(np.concatenate([moves, others, others[:, ::-1]]), axis=0)
    near = np.zeros(base, bool)
    near[moves] = True
    # all cells around the ends of moves
    edges, _ = edges_of(cells[near[cells].any(axis=1)], base)
    moves = moves[_free_to_move(fabric, moves, edges)]
    return best_apart(fabric, moves, edges, short)


def _short_ways(
    fabric: Fabric, corners: Int[np.ndarray, "n 3"], short: float
) -> Int[np.ndarray, "m 2"]:
    """Edges, both ways, beside triangles that are much shorter than others at their ends.

    Two vertices of a fold or constraint so close may be what keeps a third one beside them.
    """
    if short == 0.0:
        return np.zeros((0, 2), int)
    beside = np.zeros(len(fabric.vertices), bool)
    beside[corners] = True
    own = beside[fabric.cells].any(axis=1)
    edges, of_cells = edges_of(fabric.cells[own], len(beside))
    length, reach = np.empty(len(edges)), np.zeros(len(beside))
    length[of_cells] = np.sqrt(fabric.squared[own])
    for end in edges.T:
        np.maximum.at(reach, end, length)
    chosen = edges[length < short * reach[edges].max(axis=1)]
    return np.concatenate([chosen, chosen[:, ::-1]])


def best_apart(
    fabric: Fabric,
    moves: Int[np.ndarray, "m 2"],
    edges: Int[np.ndarray, "E 2"],
    short: float = 0.0,
) -> Int[np.ndarray, "k 2"]:
    """Moves that better the triangles around, the best first, with stars that do not overlap.

    Ways shorter than that share of the longest edge around are worth one bad triangle less.
    """
    gain, bundle = _in_all_sheets(fabric, moves, _gains(fabric, moves, short))
    order = np.lexsort((bundle, -gain))
    order = order[gain[order] > 0]
    return _apart(moves[order], bundle[order], edges, len(fabric.vertices))


def _in_all_sheets(
    fabric: Fabric, moves: Int[np.ndarray, "m 2"], gain: Float[np.ndarray, " m"]
) -> tuple[Float[np.ndarray, " m"], Int[np.ndarray, " m"]]:
    """Gains of moves along crossings, in all sheets at once; and which moves go together.

    Minus infinity where one is not possible on each of them.
    """
    shared, gain, bundle = fabric.vertices.shared, gain.copy(), np.arange(len(moves))
    own = np.flatnonzero(shared[moves[:, 0]] >= 0)
    if len(own) == 0:
        return gain, bundle
    at = shared[moves[own]]
    keys = at[:, 0] * (shared.max() + 2) + at[:, 1] + 1
    _, first, label, counts = np.unique(
        keys, return_index=True, return_inverse=True, return_counts=True
    )
    used = np.unique(fabric.cells)
    copies_of = np.bincount(shared[used][shared[used] >= 0], minlength=shared.max() + 1)
    total = np.bincount(label, weights=gain[own])
    whole = counts[label] == copies_of[at[:, 0]]
    gain[own] = np.where(whole, total[label], -np.inf)
    bundle[own] = own[first[label]]
    return gain, bundle


def _free_to_move(
    fabric: Fabric, moves: Int[np.ndarray, "m 2"], edges: Int[np.ndarray, "E 2"]
) -> Bool[np.ndarray, " m"]:
    """Whether what the vertex lies on goes on along the edge, and the surface stays one."""
    base = len(fabric.vertices)
    keys = keys_of(edges, base)
    marks = fabric.vertex_marks
    own = marks[moves[:, 0]]
    along = fabric.edge_marks(np.sort(moves, axis=1))
    ends = np.bincount(fabric.facets.ravel(), minlength=base)[moves[:, 0]]
    good = (own == along) & ((own == 0) | (ends == 2)) & ~(marks[moves] & RIM).any(axis=1)
    # common neighbours of both ends: only those across the triangles beside the edge
    starts, around = _neighbours(edges, base)
    row, at = _spread(starts, moves[:, 0])
    other = around[at]
    common = np.isin(keys_of(np.stack([moves[row, 1], other], axis=1), base), keys)
    common &= other != moves[row, 1]
    shared = np.bincount(row[common], minlength=len(moves))
    return np.asarray(good & (shared == np.where(own == 0, 2, np.where(own == 1, 2, 1))))


def _neighbours(
    edges: Int[np.ndarray, "E 2"], base: int
) -> tuple[Int[np.ndarray, " starts"], Int[np.ndarray, " ends"]]:
    both = np.concatenate([edges, edges[:, ::-1]])
    order = np.argsort(both[:, 0], kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(both[:, 0], minlength=base))])
    return starts, both[order, 1]


def _spread(
    starts: Int[np.ndarray, " starts"], chosen: Int[np.ndarray, " m"]
) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " n"]]:
    """Rows and places of all entries of the chosen lists."""
    count = starts[chosen + 1] - starts[chosen]
    row = np.repeat(np.arange(len(chosen)), count)
    offset = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    return row, starts[chosen][row] + offset


def _gains(fabric: Fabric, moves: Int[np.ndarray, "m 2"], short: float) -> Float[np.ndarray, " m"]:
    """How many slender or overturned triangles fewer there are if vertices go into neighbours.

    Overturned over the parameters or as the tangent planes see them.

    And, less than one, by how much the smallest angle around it grows. Minus infinity where a
    triangle would fold over, get much more slender or much longer.
    """
    base = len(fabric.vertices)
    going = np.zeros(base, bool)
    going[moves[:, 0]] = True
    chosen = going[fabric.cells].any(axis=1)
    cells, sense, parity = fabric.cells[chosen], fabric.sense[chosen], fabric.parity[chosen]
    order = np.argsort(cells.ravel(), kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(cells.ravel(), minlength=base))])
    row, at = _spread(starts, moves[:, 0])
    old = cells[order[at] // 3]
    gone, into = moves[row, 0][:, None], moves[row, 1][:, None]
    new = np.where(old == gone, into, old)
    stays = _proper(new)
    before, after = np.full(len(moves), np.inf), np.full(len(moves), np.inf)
    old_angle, new_angle = _angles(fabric, old), _angles(fabric, new[stays])
    np.minimum.at(before, row, old_angle)
    np.minimum.at(after, row[stays], new_angle)
    sense, parity = sense[order[at] // 3], parity[order[at] // 3]
    old_over, new_over = (
        fabric.overturned(each, sense[own]) | fabric.backward(each, parity[own])
        for each, own in ((old, np.ones(len(old), bool)), (new[stays], stays))
    )
    fewer = np.bincount(row[(old_angle < SLENDER) | old_over], minlength=len(moves))
    fewer -= np.bincount(row[stays][(new_angle < SLENDER) | new_over], minlength=len(moves))
    reach, longest = np.zeros(len(moves)), np.zeros(len(moves))
    np.maximum.at(reach, row, _longest(fabric, old))
    np.maximum.at(longest, row[stays], _longest(fabric, new[stays]))
    place = fabric.vertices.place
    tiny = np.linalg.norm(place[moves[:, 0]] - place[moves[:, 1]], axis=1) < short * reach
    good = (longest <= LONGER * reach) & np.isfinite(after)
    good &= after >= np.where(tiny, MUCH_WORSE, WORSE) * before
    good[row[stays][new_over & ~old_over[stays]]] = False
    gain = np.where(good, fewer + tiny + (after - before) / np.pi, -np.inf)
    # looked at last, and only where that matters: copies of a move count together
    wanted = good & ((gain > 0.0) | (fabric.vertices.shared[moves[:, 0]] >= 0))
    some = np.flatnonzero(stays & wanted[row])
    gain[row[some[_turned(fabric, old[some], new[some])]]] = -np.inf
    return gain


def _turned(fabric: Fabric, old: Triangles, new: Triangles) -> Bool[np.ndarray, " n"]:
    """Whether triangles turn over in the tangent plane at a corner of the new one."""
    out = np.zeros(len(old), bool)
    for corner in range(3):
        plane = new[:, corner]
        before = _area(fabric, plane, (old[:, 0], old[:, 1], old[:, 2]))
        after = _area(fabric, plane, (new[:, 0], new[:, 1], new[:, 2]))
        out |= before * after <= 0.0
    return out


def _longest(fabric: Fabric, triangles: Triangles) -> Float[np.ndarray, " T"]:
    return np.asarray(np.sqrt(squared_sides(fabric.vertices.place, triangles).max(axis=1)))


def _apart(
    moves: Int[np.ndarray, "m 2"],
    bundle: Int[np.ndarray, " m"],
    edges: Int[np.ndarray, "E 2"],
    base: int,
) -> Int[np.ndarray, "k 2"]:
    """Moves in order, without those that touch the star of an earlier one; bundles as a whole."""
    starts, around = _neighbours(edges, base)
    touched = np.zeros(base, bool)
    kept = []
    first = np.flatnonzero(np.diff(bundle, prepend=-1))
    for own in np.split(moves, first[1:]) if len(moves) else ():
        stars = [around[starts[gone] : starts[gone + 1]] for gone in own[:, 0]]
        taken = np.concatenate([own[:, 0], *stars])
        if touched[taken].any():
            continue
        touched[taken] = True
        kept.append(own)
    return np.concatenate([np.zeros((0, 2), int), *kept])
