"""Compiled kernels of the manifold layer."""

import numpy as np

from equimorph.linalg.compiled import njit


@njit(nogil=True)
def match_or_add(vertices, z, mass, same, head, following, stored, count, ids, new):
    """Find each point among the known ones over its vertex, or add it.

    head (vertices,) and following (capacity,) are linked lists of known points; stored
    (capacity, size). Fills ids and new; returns the new count. Points are the same if closer than
    `same` in the metric.
    """
    n = mass.shape[0]
    for i in range(vertices.shape[0]):
        best, nearest = -1, same * same
        node = head[vertices[i]]
        while node >= 0:
            distance = 0.0
            for j in range(n):
                distance += mass[j] * (stored[node, j] - z[i, j]) ** 2
                if distance > nearest:
                    break
            if distance < nearest:
                best, nearest = node, distance
            node = following[node]
        new[i] = best < 0
        if best < 0:
            best = count
            for j in range(z.shape[1]):
                stored[best, j] = z[i, j]
            following[best] = head[vertices[i]]
            head[vertices[i]] = best
            count += 1
        ids[i] = best
    return count


@njit(nogil=True)
def orient(cells, starts, neighbours, edge_in_cell, signs):
    """Give every cell a sign so that neighbours agree; return the number of contradictions.

    CSR adjacency: neighbours of cell c at starts[c] … starts[c + 1]; edge_in_cell is +1 where the
    shared edge runs in opposite directions in both (already coherent), −1 where not.
    """
    contradictions = 0
    stack = np.empty(cells, np.int64)
    for seed in range(cells):
        if signs[seed] != 0:
            continue
        signs[seed], top = 1, 1
        stack[0] = seed
        while top > 0:
            top -= 1
            cell = stack[top]
            for k in range(starts[cell], starts[cell + 1]):
                other, wanted = neighbours[k], signs[cell] * edge_in_cell[k]
                if signs[other] == 0:
                    signs[other] = wanted
                    stack[top] = other
                    top += 1
                elif signs[other] != wanted:
                    contradictions += 1
    return contradictions


@njit(nogil=True)
def _slot(keys, key):
    """Place of a key in a hash table, or the empty place (−1) where it would go."""
    mask = keys.shape[0] - 1
    at = ((key * -7046029254386353131) >> 20) & mask
    while keys[at] != -1 and keys[at] != key:
        at = (at + 1) & mask
    return at


@njit(nogil=True)
def _edge_key(a, b, base):
    return a * base + b if a < b else b * base + a


@njit(nogil=True)
def _linked(cells, index, facets, base, keys, counts):
    """Cells across the sides opposite to each corner of triangles; −1 where none may be flipped.

    Fills the hash table of edges: how many triangles have each; facets count as three.
    """
    slots = np.empty(cells.shape, np.int64)
    for i in range(facets.shape[0]):
        at = _slot(keys, _edge_key(facets[i, 0], facets[i, 1], base))
        keys[at] = _edge_key(facets[i, 0], facets[i, 1], base)
        counts[at] = 3
    for t in range(cells.shape[0]):
        for k in range(3):
            key = _edge_key(cells[t, (k + 1) % 3], cells[t, (k + 2) % 3], base)
            at = _slot(keys, key)
            keys[at] = key
            counts[at] = min(counts[at] + 1, 3)
            slots[t, k] = at
    first = np.full(keys.shape[0], -1)
    across = np.full(cells.shape, -1)
    for t in range(cells.shape[0]):
        for k in range(3):
            at = slots[t, k]
            if counts[at] != 2:
                continue
            if first[at] < 0:
                first[at] = 3 * t + k
                continue
            other, corner = divmod(first[at], 3)
            if index[other] == index[t]:
                across[t, k], across[other, corner] = other, t
    return across


@njit(nogil=True)
def _cotangent(squared, corner):
    """Cotangent of the angle at a corner of a triangle with squared sides 01, 02, 12."""
    total = squared[0] + squared[1] + squared[2]
    area = total**2 - 2.0 * (squared[0] ** 2 + squared[1] ** 2 + squared[2] ** 2)
    return (total - 2.0 * squared[2 - corner]) / np.sqrt(max(area, 1e-28 * total**2))


@njit(nogil=True)
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
def _overturned_area(place, a, b, c, sense):
    """Area, twice, of a triangle in the last two coordinates, the parameters, if it is overturned.

    Else zero.
    """
    x, y = place.shape[1] - 2, place.shape[1] - 1
    area = (place[b, x] - place[a, x]) * (place[c, y] - place[a, y])
    area -= (place[b, y] - place[a, y]) * (place[c, x] - place[a, x])
    return max(-area * sense, 0.0)


@njit(nogil=True)
def _worth(place, squared, sense, corners, pair, least):
    """Whether to flip: what is overturned counts first, then what the angles gain.

    corners: a, b, c, d of triangles t, abc, and u, bad; pair: t, k, u, j, c being corner k of t and
    d corner j of u.
    """
    a, b, c, d = corners
    t, k, u, j = pair
    own = sense[t]
    before = _overturned_area(place, a, b, c, own) + _overturned_area(place, b, a, d, own)
    after = _overturned_area(place, a, d, c, own) + _overturned_area(place, d, b, c, own)
    if abs(before - after) > 1e-9 * max(before, after):
        return after < before
    return -_cotangent(squared[t], k) - _cotangent(squared[u], j) > least


@njit(nogil=True)
def flip_edges(cells, squared, index, sense, facets, place, rows, least):
    """Flip edges of triangles whose opposite angles add up to more than π; return how many.

    Changes cells (T, 3), the squares of their sides 01, 02, 12, and their sense (T,): the sign of
    their area in the parameters, if they are not overturned. Edges between triangles of different
    index, `facets` (F, 2), and edges of other than two triangles stay. A flip must gain `least`:
    minus the sum of the cotangents of both angles; or leave less area overturned, never more.
    Nothing may fold over in the tangent planes, spanned by rows (V, 2, coordinates), at all four
    corners.
    """
    base, count = place.shape[0], cells.shape[0]
    size = 16
    while size < 4 * count + 2 * facets.shape[0]:
        size *= 2
    keys, counts = np.full(size, -1), np.zeros(size, np.int8)
    across = _linked(cells, index, facets, base, keys, counts)
    most = count
    stack = np.empty(3 * count + 4 * most, np.int64)
    top = 0
    for side in range(3 * count - 1, -1, -1):
        if across[side // 3, side % 3] > side // 3:
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
        if not _worth(place, squared, sense, (a, b, c, d), (t, k, u, j), least):
            continue
        new = _slot(keys, _edge_key(c, d, base))
        if counts[new] > 0 or not _stays_up(place, rows, a, b, c, d):
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
        counts[_slot(keys, _edge_key(a, b, base))] = 0
        keys[new], counts[new] = _edge_key(c, d, base), 2
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


@njit(nogil=True)
def square_sides(place, cells, out):
    """Squared lengths of the sides 01, 02, 12 and so on of cells with corners at `place`."""
    for t in range(cells.shape[0]):
        side = 0
        for i in range(cells.shape[1]):
            for j in range(i + 1, cells.shape[1]):
                total = 0.0
                for k in range(place.shape[1]):
                    total += (place[cells[t, i], k] - place[cells[t, j], k]) ** 2
                out[t, side] = total
                side += 1
