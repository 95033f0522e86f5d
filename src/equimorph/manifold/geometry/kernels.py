"""Compiled kernels of the manifold layer."""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import SUMS
from equimorph.linalg.row_kernels import rows_with_room, with_room

PART = np.int64(16)
"""Terms of a sum that are added before it is compared."""


@njit(nogil=True, fastmath=SUMS)
def nearest_in_list(node, following, points, target, weights, reach):
    """Find the nearest point of a linked list, and its squared distance; −1 if none is in reach.

    Squared distances below `reach` count; `weights` are of the first squared differences.
    """
    best, nearest, count = -1, reach, weights.shape[0]
    while node >= 0:
        distance = 0.0
        for begin in range(0, count, PART):
            for j in range(begin, min(begin + PART, count)):
                distance += weights[j] * (target[j] - points[node, j]) ** 2
            if distance > nearest:
                break
        if distance < nearest:
            best, nearest = node, distance
        node = following[node]
    return best, nearest


@njit(nogil=True)
def match_or_add(vertices, z, mass, same, head, following, stored, count, ids, new):
    """Find each point among the known ones over its vertex, or add it.

    head (vertices,) and following (capacity,) are linked lists of known points; stored
    (capacity, size). Fills ids and new; returns the new count. Points are the same if closer than
    `same` in the metric.
    """
    for i in range(vertices.shape[0]):
        best, _ = nearest_in_list(head[vertices[i]], following, stored, z[i], mass, same * same)
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
def orient_facets(cells, signs):
    """Orientation that each cell gives the facet opposite to each of its corners.

    Relative to the corners of the facet in the order of their numbers.
    """
    corners = cells.shape[1]
    for cell in range(cells.shape[0]):
        for k in range(corners):
            sign = 1 - 2 * (k % 2)
            for i in range(corners):
                for j in range(i + 1, corners):
                    if k not in (i, j) and cells[cell, i] > cells[cell, j]:
                        sign = -sign
            signs[cell, k] = sign


@njit(nogil=True)
def orient(mates, induced, signs):
    """Give every cell a sign so that neighbours agree; return twice the number of contradictions.

    mates (cells, corners): flat place of each facet in the other of its two cells, −1 where there
    is none; induced: see `orient_facets`. They agree where both orient their facet oppositely.
    """
    cells, corners = mates.shape
    contradictions, facets = 0, induced.ravel()
    stack = np.empty(cells, np.int64)
    for seed in range(cells):
        if signs[seed] != 0:
            continue
        signs[seed], top = 1, 1
        stack[0] = seed
        while top > 0:
            top -= 1
            cell = stack[top]
            for k in range(corners):
                mate = mates[cell, k]
                if mate < 0:
                    continue
                other, sign = mate // corners, -signs[cell] * induced[cell, k] * facets[mate]
                if signs[other] == 0:
                    signs[other] = sign
                    stack[top] = other
                    top += 1
                elif signs[other] != sign:
                    contradictions += 1
    return contradictions


@njit(nogil=True, fastmath=SUMS)
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


@njit(nogil=True)
def sort_sides(cells, pairs, fixed, base):
    """Sides of cells, in order of their ends, sorted; and where those of each lower end begin.

    Each as ``upper end << 32 | number``: numbers go through the `pairs` of corners of cell after
    cell, and then through pairs of vertices `fixed`.
    """
    sides, more = pairs.shape[0], fixed.shape[0]
    count = cells.shape[0] * sides
    starts = np.zeros(base + 1, np.int64)
    for t in range(cells.shape[0]):
        for k in range(sides):
            starts[min(cells[t, pairs[k, 0]], cells[t, pairs[k, 1]]) + 1] += 1
    for i in range(more):
        starts[min(fixed[i, 0], fixed[i, 1]) + 1] += 1
    for v in range(base):
        starts[v + 1] += starts[v]
    entries, free = np.empty(count + more, np.int64), starts[:-1].copy()
    for t in range(cells.shape[0]):
        for k in range(sides):
            a, b = cells[t, pairs[k, 0]], cells[t, pairs[k, 1]]
            low, high = min(a, b), max(a, b)
            entries[free[low]] = high << 32 | (t * sides + k)
            free[low] += 1
    for i in range(more):
        low, high = min(fixed[i, 0], fixed[i, 1]), max(fixed[i, 0], fixed[i, 1])
        entries[free[low]] = high << 32 | (count + i)
        free[low] += 1
    for v in range(base):
        for i in range(starts[v] + 1, starts[v + 1]):
            own, at = entries[i], i
            while at > starts[v] and entries[at - 1] > own:
                entries[at] = entries[at - 1]
                at -= 1
            entries[at] = own
    return entries, starts


@njit(nogil=True)
def number_edges(cells, pairs, base, ends, of_cells):
    """Number the edges of cells in the order of their ends, sorted; return how many there are.

    Fills ends (edges, 2), which must have room for all sides of all cells, and of_cells
    (cells, sides) in the order of the pairs of corners.
    """
    sides = pairs.shape[0]
    entries, starts = sort_sides(cells, pairs, np.empty((0, 2), np.int64), base)
    edge = -1
    for v in range(base):
        last = -1
        for i in range(starts[v], starts[v + 1]):
            high, own = entries[i] >> 32, entries[i] & 0xFFFFFFFF
            if high != last:
                edge, last = edge + 1, high
                ends[edge, 0], ends[edge, 1] = v, high
            of_cells[own // sides, own % sides] = edge
    return edge + 1


@njit(nogil=True, forceinline=True, fastmath=SUMS)
def lean(place, rows, a, b, chord, flat):
    """Fill the way from a to b, and the tangent vectors (2, d) at both ends that it is nearest to.

    They are as long as the way; where that is far from a tangent space they stay short.
    """
    width, d, squared = place.shape[1], rows.shape[1], 0.0
    for c in range(width):
        chord[c] = place[b, c] - place[a, c]
        squared += chord[c] * chord[c]
    for side in range(2):
        at, total = b if side else a, 0.0
        for i in range(d):
            share = 0.0
            for c in range(width):
                share += rows[at, i, c] * chord[c]
            flat[side, i] = share
            total += share * share
        factor = min(np.sqrt(squared) / max(np.sqrt(total), 1e-300), 2.0)
        for i in range(d):
            flat[side, i] *= factor


@njit(nogil=True, fastmath=SUMS)
def measure_edges(place, rows, ends, s_shape, out):
    """How far the cubics over edges that touch the planes at both ends are from the edges.

    place (V, coordinates), rows (V, d, coordinates), orthonormal, and s_shape as in
    `tangents.Cubics`, which says the same of edges on which something stays zero.
    """
    width, d = place.shape[1], rows.shape[1]
    chord, flat, one, other = np.empty(width), np.empty((2, d)), np.empty(width), np.empty(width)
    for e in range(ends.shape[0]):
        a, b = ends[e, 0], ends[e, 1]
        lean(place, rows, a, b, chord, flat)
        for c in range(width):
            one[c] = other[c] = -chord[c]
        for i in range(d):
            for c in range(width):
                one[c] += flat[0, i] * rows[a, i, c]
                other[c] += flat[1, i] * rows[b, i, c]
        first, second, apart = 0.0, 0.0, 0.0
        for c in range(width):
            first += one[c] * one[c]
            second += other[c] * other[c]
            apart += (one[c] - other[c]) ** 2
        out[e] = max(np.sqrt(apart) / 8.0, s_shape * np.sqrt(max(first, second)))


@njit(nogil=True, fastmath=SUMS)
def look_back(place, rows, cells, out):
    """Sum of the areas of triangles, twice, seen in the planes at their three corners."""
    width = place.shape[1]
    for t in range(cells.shape[0]):
        a, b, c = cells[t, 0], cells[t, 1], cells[t, 2]
        total = 0.0
        for k in range(3):
            plane = cells[t, k]
            bx, by, cx, cy = 0.0, 0.0, 0.0, 0.0
            for i in range(width):
                to_b, to_c = place[b, i] - place[a, i], place[c, i] - place[a, i]
                bx += rows[plane, 0, i] * to_b
                by += rows[plane, 1, i] * to_b
                cx += rows[plane, 0, i] * to_c
                cy += rows[plane, 1, i] * to_c
            total += bx * cy - by * cx
        out[t] = total


@njit(nogil=True)
def walk_chains(ends, first, around, order):
    """Polylines along edges, split where other than two meet; closed ones repeat the start.

    ends (E, 2): vertices of the edges; the edges around vertex v are those from ``first[v]`` to
    ``first[v + 1]`` of `around`; order: of the vertices from which lines start. Returns the
    vertices of all lines, one line after the other, and where they start.
    """
    used = np.zeros(ends.shape[0], np.bool_)
    points, starts = np.empty(2 * ends.shape[0], np.int64), np.empty(ends.shape[0], np.int64)
    count, stop = 0, 0
    for closed in range(2):
        for start in order:
            if closed == 0 and first[start + 1] - first[start] == 2:
                continue
            for side in range(first[start], first[start + 1]):
                edge, at = around[side], start
                if used[edge] or (closed == 1 and used[around[first[start]]]):
                    continue
                starts[count], points[stop] = stop, start
                count, stop = count + 1, stop + 1
                while edge >= 0:
                    used[edge] = True
                    at = ends[edge, 1] if ends[edge, 0] == at else ends[edge, 0]
                    points[stop], stop, edge = at, stop + 1, -1
                    if first[at + 1] - first[at] == 2:
                        for onward in around[first[at] : first[at + 1]]:
                            if not used[onward]:
                                edge = onward
                                break
    return points[:stop], starts[:count]


@njit(nogil=True)
def cut_rows(rows, edges, base):
    """Cut rows of vertices below `base` at vertices base + e on edges e, the first ones first.

    Return the rows and those that they come from. Second halves follow behind, cut by cut.
    """
    head, following = np.full(base, -1), np.empty(edges.shape[0], np.int64)
    for e in range(edges.shape[0]):
        low = min(edges[e, 0], edges[e, 1])
        following[e], head[low] = head[low], e
    count, corners = rows.shape
    room = count + 4 * edges.shape[0] + 16
    active = np.arange(count)
    # both are lengthened by the same rule: neither has room where the other has none
    out, owner = rows_with_room(rows, room), with_room(active, room)
    while active.shape[0] > 0:
        cut, start = 0, count
        for i in range(active.shape[0]):
            row = active[i]
            which = _first_edge(out[row], edges, head, following)
            if which < 0:
                continue
            if count == out.shape[0]:
                out, owner = rows_with_room(out, count + 1), with_room(owner, count + 1)
            for k in range(corners):
                vertex = out[row, k]
                out[count, k] = base + which if vertex == edges[which, 0] else vertex
                out[row, k] = base + which if vertex == edges[which, 1] else vertex
            owner[count] = owner[row]
            active[cut] = row
            count += 1
            cut += 1
        again = np.empty(2 * cut, np.int64)
        for i in range(cut):
            again[i], again[cut + i] = active[i], start + i
        active = again
    return out[:count], owner[:count]


@njit(nogil=True)
def _first_edge(row, edges, head, following):
    """First of some edges, listed by their lower ends, that a row of vertices holds; else −1."""
    best = -1
    for i in range(row.shape[0]):
        for j in range(i + 1, row.shape[0]):
            low, high = min(row[i], row[j]), max(row[i], row[j])
            edge = head[low] if low < head.shape[0] else -1
            while edge >= 0:
                if max(edges[edge, 0], edges[edge, 1]) == high and (best < 0 or edge < best):
                    best = edge
                edge = following[edge]
    return best
