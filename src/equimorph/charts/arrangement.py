"""Cut directed plane edges, across which a count jumps, where they cross or touch each other.

All places are whole multiples of a small grid spacing (snap rounding): what coincides, coincides
exactly. An edge that passes a vertex within one spacing is bent to pass through it.
"""

import numpy as np

from equimorph.arrays import Bool, Edges, Float, Int, ItemFlags, ItemValues

Places = Float[np.ndarray, "places 2"]
Jumps = Int[np.ndarray, " edges"]
Drawing = tuple[Places, Edges, Jumps]
# Before merging and cutting, places differ in number and position.
OldPlaces = Float[np.ndarray, "old_places 2"]
OldEdges = Int[np.ndarray, "old_edges 2"]
OldJumps = Int[np.ndarray, " old_edges"]

CHUNK = 4_000_000
"""Elements of a temporary table of edges against edges."""
TOUCH = 0.75
"""Distance at which an edge touches a vertex, in grid spacings: rounding moves one by √½."""
ROUNDS = 12
"""Most rounds of cutting: every cut is rounded, which may make new crossings."""


def outline(
    coordinates: OldPlaces,
    cells: Int[np.ndarray, "cells 3"],
    overturned: Bool[np.ndarray, " cells"] | None = None,
) -> tuple[Edges, Jumps]:
    """Sum of the directed edges of all triangles, each of them turned counter-clockwise.

    Edges between neighbours that lie side by side cancel. Flat triangles cover nothing, overturned
    ones cover minus one time.

    Returns vertex pairs, and for each the count on its left less the count on its right.
    """
    a, b, c = (coordinates[cells[:, k]] for k in range(3))
    turn = cross(b - a, c - a)
    upright = turn > 0 if overturned is None else (turn > 0) != overturned
    ordered = np.where(upright[:, None], cells, cells[:, ::-1])[turn != 0]
    edges = np.concatenate([ordered[:, [0, 1]], ordered[:, [1, 2]], ordered[:, [2, 0]]])
    return _merge(edges, np.ones(len(edges), int))


def arrange(places: OldPlaces, edges: OldEdges, jump: OldJumps) -> Drawing:
    """Edges that meet nowhere but at their ends, with the same jumps as the given ones.

    Places are in units of the grid spacing, not yet rounded; those of the drawing are rounded.
    """
    places, edges, jump = _weld(places, edges, jump)
    for _ in range(ROUNDS):
        if not len(edges):
            break
        start, along = places[edges[:, 0]], places[edges[:, 1]] - places[edges[:, 0]]
        owner, fraction, place = _cuts(start, along)
        if not len(owner):
            break
        # Every edge keeps its ends as cuts 0 and 1; sorted by (edge, fraction) they list pieces.
        number = np.arange(len(edges))
        owner = np.concatenate([number, number, owner])
        fraction = np.concatenate([np.zeros(len(edges)), np.ones(len(edges)), fraction])
        place = np.concatenate([start, start + along, place])
        order = np.lexsort((fraction, owner))
        owner, place = owner[order], place[order]
        first = np.flatnonzero(owner[:-1] == owner[1:])
        places, edges, jump = _weld(place, np.stack([first, first + 1], axis=1), jump[owner[first]])
    return places, edges, jump


def sides(ends: Float[np.ndarray, "edges 2 2"], jump: Jumps) -> tuple[Jumps, Jumps]:
    """Count on the left and on the right of every arranged edge, by a ray from its middle."""
    along = ends[:, 1] - ends[:, 0]
    flat = np.abs(along[:, 0]) > np.abs(along[:, 1])
    # The ray runs across the edge, not along it: flat edges are treated with x and y exchanged,
    # which also exchanges left and right.
    right = np.where(
        flat,
        _right_of(ends[..., ::-1], -jump, flat) - jump,
        _right_of(ends, jump, ~flat),
    )
    return right + jump, right


def winding(
    places: Places,
    ends: Float[np.ndarray, "edges 2 2"],
    jump: Jumps,
    skip: Int[np.ndarray, " places"] | None = None,
) -> Int[np.ndarray, " places"]:
    """Sum of the jumps that a ray in +x meets from each place.

    The edges are those of closed curves; the ray of a place does not see the edge numbered in
    `skip`.
    """
    count = np.empty(len(places), int)
    (xa, ya), (xb, yb) = ends[:, 0].T, ends[:, 1].T
    slope = (xb - xa) / np.where(yb == ya, 1.0, yb - ya)
    step = max(1, CHUNK // max(1, len(jump)))
    for first in range(0, len(places), step):
        block = slice(first, first + step)
        x, y = places[block, :1], places[block, 1:]
        upward, downward = (ya <= y) & (y < yb), (yb <= y) & (y < ya)
        ahead = xa + (y - ya) * slope > x
        if skip is not None:
            ahead[np.arange(len(x)), skip[block]] = False
        count[block] = ((upward & ahead).astype(np.int64) - (downward & ahead)) @ jump
    return count


def winding_raster(
    x: Float[np.ndarray, " columns"],
    y: Float[np.ndarray, " rows"],
    ends: Float[np.ndarray, "edges 2 2"],
    jump: Jumps,
) -> Int[np.ndarray, "rows columns"]:
    """`winding` at all crossings of grid lines x (rising) and y, a whole row at a time."""
    (xa, ya), (xb, yb) = ends[:, 0].T, ends[:, 1].T
    slope = (xb - xa) / np.where(yb == ya, 1.0, yb - ya)
    level = y[:, None]
    sign = ((ya <= level) & (level < yb)).astype(np.int64) - ((yb <= level) & (level < ya))
    row, edge = np.nonzero(sign)
    meets = xa[edge] + (y[row] - ya[edge]) * slope[edge]
    # What a ray meets beyond column k counts for all columns up to k.
    steps = np.zeros((len(y), len(x) + 1), int)
    np.add.at(steps, (row, np.searchsorted(x, meets)), (sign * jump)[row, edge])
    return np.asarray(steps[:, :0:-1].cumsum(axis=1)[:, ::-1])


def cross(a: Float[np.ndarray, "*n 2"], b: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n"]:
    """Signed area of the parallelogram of two plane vectors."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _merge(edges: OldEdges, jump: OldJumps) -> tuple[Edges, Jumps]:
    """Add up the jumps of equal edges, whichever way they run; drop those that cancel."""
    sign = np.where(edges[:, 0] < edges[:, 1], 1, -1)
    unique, inverse = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    total = np.zeros(len(unique), int)
    np.add.at(total, inverse.reshape(-1), sign * jump)
    keep = (total != 0) & (unique[:, 0] != unique[:, 1])
    return unique[keep], total[keep]


def _weld(places: OldPlaces, edges: OldEdges, jump: OldJumps) -> Drawing:
    """Unite vertices that coincide in the plane: equilibria of several sheets over one p."""
    used, local = np.unique(edges, return_inverse=True)
    unique, inverse = np.unique(np.rint(places[used]), axis=0, return_inverse=True)
    return unique, *_merge(inverse.reshape(-1)[local.reshape(-1, 2)], jump)


def _cuts(
    start: Places, along: Places
) -> tuple[Int[np.ndarray, " cuts"], Float[np.ndarray, " cuts"], Float[np.ndarray, "cuts 2"]]:
    """Interior places of edges that another edge crosses, or at which another one ends."""
    first, second = _near_pairs(start, along)
    d, e = along[first], along[second]
    offset = start[second] - start[first]
    across = cross(d, e)
    proper = across != 0
    safe = np.where(proper, across, 1.0)
    s, t = cross(offset, e) / safe, cross(offset, d) / safe
    proper &= _interior(s, d) & _interior(t, e)
    point = start[first] + s[:, None] * d
    owner = [first[proper], second[proper]]
    fraction = [s[proper], t[proper]]
    place = [point[proper], point[proper]]
    for mine, other in ((first, second), (second, first)):
        for end in (start[other], start[other] + along[other]):
            length = np.hypot(*along[mine].T)
            reach = end - start[mine]
            at = (reach * along[mine]).sum(axis=1) / length**2
            beside = np.abs(cross(along[mine], reach)) / length
            touching = (beside < TOUCH) & _interior(at, along[mine])
            touching &= (end != start[mine]).any(axis=1)
            touching &= (end != start[mine] + along[mine]).any(axis=1)
            owner.append(mine[touching])
            fraction.append(at[touching])
            place.append(end[touching])
    return np.concatenate(owner), np.concatenate(fraction), np.concatenate(place)


def _near_pairs(
    start: Places, along: Places
) -> tuple[Int[np.ndarray, " pairs"], Int[np.ndarray, " pairs"]]:
    """Pairs of edges whose bounding boxes meet, each pair once."""
    low = np.minimum(start, start + along) - 1
    high = np.maximum(start, start + along) + 1
    pairs = []
    step = max(1, CHUNK // max(1, len(start)))
    for block in range(0, len(start), step):
        mine = slice(block, block + step)
        meet = ((low[mine, None] <= high) & (low <= high[mine, None])).all(axis=-1)
        first, second = np.nonzero(meet)
        pairs.append(np.stack([first + block, second]))
    first, second = np.concatenate(pairs, axis=1)
    keep = first < second
    return first[keep], second[keep]


def _interior(fraction: ItemValues, along: Float[np.ndarray, "n 2"]) -> ItemFlags:
    """Whether a place on an edge lies off both ends by more than rounding."""
    return np.asarray(np.minimum(fraction, 1 - fraction) * np.hypot(*along.T) > 0.5)


def _right_of(
    ends: Float[np.ndarray, "edges 2 2"], jump: Jumps, chosen: Bool[np.ndarray, " edges"]
) -> Jumps:
    """Count on the right of the chosen edges, none of which is flat; elsewhere 0."""
    own = np.flatnonzero(chosen)
    right = np.zeros(len(jump), int)
    beyond = winding(ends[own].mean(axis=1), ends, jump, skip=own)
    upward = ends[own, 1, 1] > ends[own, 0, 1]
    right[own] = np.where(upward, beyond, beyond - jump[own])
    return right
