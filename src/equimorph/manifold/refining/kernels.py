"""Compiled flips of the edges of triangles."""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import SUMS
from equimorph.linalg.row_kernels import with_room
from equimorph.manifold.geometry.kernels import sort_sides


@njit(nogil=True)
def _linked(cells, pairs, index, facets, base):
    """Edges of triangles: where those of each lower end begin, their upper ends, and counts.

    That is how many triangles have them; facets count as three. And the cells across the sides
    opposite to each corner, the `pairs` of the others; −1 where none may be flipped.
    """
    count = 3 * cells.shape[0]
    entries, starts = sort_sides(cells, pairs, facets, base)
    first, upper = np.empty(base + 1, np.int64), np.empty(entries.shape[0], np.int64)
    counts = np.zeros(entries.shape[0], np.int8)
    across = np.full(cells.shape, -1)
    edges = 0
    for v in range(base):
        first[v] = edges
        at = starts[v]
        while at < starts[v + 1]:
            high = entries[at] >> 32
            stop, sides = at, 0
            while stop < starts[v + 1] and entries[stop] >> 32 == high:
                sides += 1 if entries[stop] & 0xFFFFFFFF < count else 3
                stop += 1
            upper[edges], counts[edges] = high, min(sides, 3)
            if sides == 2:
                t, u = entries[at] & 0xFFFFFFFF, entries[at + 1] & 0xFFFFFFFF
                if index[t // 3] == index[u // 3]:
                    across[t // 3, t % 3], across[u // 3, u % 3] = u // 3, t // 3
            edges += 1
            at = stop
    first[base] = edges
    return first, upper[:edges], counts[:edges], across


@njit(nogil=True)
def _edge_at(first, upper, head, following, a, b):
    """Number of an edge: of those that there were, or of those that came since; −1 for others."""
    low, high = min(a, b), max(a, b)
    for at in range(first[low], first[low + 1]):
        if upper[at] == high:
            return at
    at = head[low]
    while at >= 0 and upper[at] != high:
        at = following[at]
    return at


@njit(nogil=True)
def _cotangent(squared, corner):
    """Cotangent of the angle at a corner of a triangle with squared sides 01, 02, 12."""
    total = squared[0] + squared[1] + squared[2]
    area = total**2 - 2.0 * (squared[0] ** 2 + squared[1] ** 2 + squared[2] ** 2)
    return (total - 2.0 * squared[2 - corner]) / np.sqrt(max(area, 1e-28 * total**2))


@njit(nogil=True, fastmath=SUMS)
def _stays_up(place, rows, a, b, c, d):
    """Whether adc and dbc look the same way as abc and bad did, in the planes at all corners."""
    width = place.shape[1]
    flat = np.empty((3, 2))
    for plane in (a, b, c, d):
        for i in range(2):
            x, y, z = 0.0, 0.0, 0.0
            for k in range(width):
                x += rows[plane, i, k] * (place[b, k] - place[a, k])
                y += rows[plane, i, k] * (place[c, k] - place[a, k])
                z += rows[plane, i, k] * (place[d, k] - place[a, k])
            flat[0, i], flat[1, i], flat[2, i] = x, y, z
        whole = flat[0, 0] * (flat[1, 1] - flat[2, 1]) - flat[0, 1] * (flat[1, 0] - flat[2, 0])
        near = flat[2, 0] * flat[1, 1] - flat[2, 1] * flat[1, 0]
        far = whole - near
        # slivers may look either way
        if min(near * np.sign(whole), far * np.sign(whole)) <= 1e-3 * abs(whole):
            return False
    return True


@njit(nogil=True)
def _overturned_area(flat, a, b, c, sense):
    """Area, twice, of a triangle in the parameters, if it is overturned; else zero."""
    area = (flat[b, 0] - flat[a, 0]) * (flat[c, 1] - flat[a, 1])
    area -= (flat[b, 1] - flat[a, 1]) * (flat[c, 0] - flat[a, 0])
    return max(-area * sense, 0.0)


@njit(nogil=True)
def _worth(flat, squared, sense, corners, pair, least):
    """Whether to flip: what is overturned counts first, then what the angles gain.

    corners: a, b, c, d of triangles t, abc, and u, bad; pair: t, k, u, j, c being corner k of t and
    d corner j of u.
    """
    a, b, c, d = corners
    t, k, u, j = pair
    own = sense[t]
    before = _overturned_area(flat, a, b, c, own) + _overturned_area(flat, b, a, d, own)
    after = _overturned_area(flat, a, d, c, own) + _overturned_area(flat, d, b, c, own)
    if abs(before - after) > 1e-9 * max(before, after):
        return after < before
    return -_cotangent(squared[t], k) - _cotangent(squared[u], j) > least


@njit(nogil=True)
def flip_edges(cells, squared, index, sense, facets, place, rows, flat, pairs, least, since):
    """Flip edges of triangles whose opposite angles add up to more than π; return how many.

    Changes cells (T, 3), the squares of their sides 01, 02, 12, and their sense (T,): the sign of
    their area in the parameters, if they are not overturned. Edges between triangles of different
    index, `facets` (F, 2), and edges of other than two triangles stay. A flip must gain `least`:
    minus the sum of the cotangents of both angles; or leave less area overturned, never more.
    Nothing may fold over in the tangent planes, spanned by rows (V, 2, coordinates), at all four
    corners. flat (V, 2): the vertices in the parameters; pairs: corners 12, 20, 01. Only around
    vertices from the number `since` on, the edges are looked at that are there.
    """
    base, count = place.shape[0], cells.shape[0]
    first, upper, counts, across = _linked(cells, pairs, index, facets, base)
    head, following = np.full(base, -1), np.full(upper.shape[0], -1)
    edges = upper.shape[0]
    most = count
    stack = np.empty(3 * count + 4 * most, np.int64)
    top = 0
    for side in range(3 * count - 1, -1, -1):
        t, k = divmod(side, 3)
        u = across[t, k]
        if (
            u > t
            and max(cells[t, 0], cells[t, 1], cells[t, 2], cells[u, 0], cells[u, 1], cells[u, 2])
            >= since
        ):
            stack[top] = side
            top += 1
    flips = 0
    while top > 0 and flips < most:
        top -= 1
        t, k = divmod(stack[top], 3)
        u = across[t, k]
        if u < 0:
            continue
        c, a, b = cells[t, k], cells[t, (k + 1) % 3], cells[t, (k + 2) % 3]
        j = _corner_apart(cells, u, a, b)
        d = cells[u, j]
        if not _worth(flat, squared, sense, (a, b, c, d), (t, k, u, j), least):
            continue
        new = _edge_at(first, upper, head, following, c, d)
        if new >= 0 and counts[new] > 0:
            continue
        if not _stays_up(place, rows, a, b, c, d):
            continue
        gap = 0.0
        for i in range(place.shape[1]):
            gap += (place[c, i] - place[d, i]) ** 2
        ac, bc = squared[t, 2 - (k + 2) % 3], squared[t, 2 - (k + 1) % 3]
        at_a = _corner_apart(cells, u, b, d)
        at_b = 3 - at_a - j
        ad, bd = squared[u, 2 - at_b], squared[u, 2 - at_a]
        beside_ac, beside_bc = across[t, (k + 2) % 3], across[t, (k + 1) % 3]
        beside_ad, beside_bd = across[u, at_b], across[u, at_a]
        counts[_edge_at(first, upper, head, following, a, b)] = 0
        if new < 0:
            new, edges = edges, edges + 1
            if new == upper.shape[0]:
                upper, following, counts = (
                    with_room(upper, new + 1),
                    with_room(following, new + 1),
                    with_room(counts, new + 1),
                )
            low = min(c, d)
            upper[new], following[new], head[low] = max(c, d), head[low], new
        counts[new] = 2
        cells[t, 0], cells[t, 1], cells[t, 2] = a, d, c
        squared[t, 0], squared[t, 1], squared[t, 2] = ad, ac, gap
        across[t, 0], across[t, 1], across[t, 2] = u, beside_ac, beside_ad
        cells[u, 0], cells[u, 1], cells[u, 2] = d, b, c
        sense[u] = sense[t]
        squared[u, 0], squared[u, 1], squared[u, 2] = bd, gap, bc
        across[u, 0], across[u, 1], across[u, 2] = beside_bc, t, beside_bd
        if beside_bc >= 0:
            across[beside_bc, _corner_apart(cells, beside_bc, b, c)] = u
        if beside_ad >= 0:
            across[beside_ad, _corner_apart(cells, beside_ad, a, d)] = t
        flips += 1
        stack[top], stack[top + 1] = 3 * t + 1, 3 * t + 2
        stack[top + 2], stack[top + 3] = 3 * u, 3 * u + 2
        top += 4
    return flips


@njit(nogil=True)
def _corner_apart(cells, t, a, b):
    """Corner of a triangle that is neither a nor b."""
    for k in range(2):
        if cells[t, k] != a and cells[t, k] != b:
            return k
    return 2


@njit(nogil=True, fastmath=SUMS)
def see_volumes(place, rows, cells, out):
    """Areas, twice, or volumes, six times, of cells as seen from their corners: (cells, corners).

    In the tangent spaces, spanned by rows (V, d, coordinates), at places (V, coordinates).
    """
    width, d = place.shape[1], rows.shape[1]
    sides, flat = np.empty((d, width)), np.zeros((3, 3))
    flat[2, 2] = 1.0
    for t in range(cells.shape[0]):
        for i in range(d):
            for c in range(width):
                sides[i, c] = place[cells[t, 1 + i], c] - place[cells[t, 0], c]
        for corner in range(d + 1):
            for i in range(d):
                for k in range(d):
                    share = 0.0
                    for c in range(width):
                        share += sides[i, c] * rows[cells[t, corner], k, c]
                    flat[i, k] = share
            total = 0.0
            for k in range(3):
                one, other = (k + 1) % 3, (k + 2) % 3
                minor = flat[1, one] * flat[2, other] - flat[1, other] * flat[2, one]
                total += flat[0, k] * minor
            out[t, corner] = total
