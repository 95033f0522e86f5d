"""Vertices on edges: where they are looked for, and which are believed, edge by edge."""

import numpy as np

from equimorph.linalg.compiled import njit


@njit(nogil=True, forceinline=True)
def _change(z, p, free, scales, root, a, b, c):
    """Entry c of the way from vertex a to vertex b in the embedding."""
    n = root.shape[0]
    if c < n:
        return root[c] * (z[b, c] - z[a, c])
    k = c - n
    return (p[b, free[k]] - p[a, free[k]]) / scales[k]


@njit(nogil=True)
def lean_edges(z, p, rows, metric, ends, flat):
    """Tangent vectors (edges, 2, d) at both ends that edges are nearest to, as `Ends.along`.

    metric: free parameters, their scales, roots of the mass.
    """
    free, scales, root = metric
    width, d = rows.shape[2], rows.shape[1]
    chord = np.empty(width)
    for e in range(ends.shape[0]):
        length = 0.0
        for c in range(width):
            chord[c] = _change(z, p, free, scales, root, ends[e, 0], ends[e, 1], c)
            length += chord[c] * chord[c]
        for side in range(2):
            total = 0.0
            for i in range(d):
                share = 0.0
                for c in range(width):
                    share += rows[ends[e, side], i, c] * chord[c]
                flat[e, side, i] = share
                total += share * share
            factor = min(np.sqrt(length) / max(np.sqrt(total), 1e-300), 2.0)
            for i in range(d):
                flat[e, side, i] *= factor


@njit(nogil=True, forceinline=True)
def _off(chord, flat, frame, e, side, at, column):
    """Entry of how far the tangent vector at an end is off the chord."""
    out = -chord
    for i in range(flat.shape[2]):
        out += flat[e, side, i] * frame[at, i, column]
    return out


@njit(nogil=True)
def bend_edges(z, p, frame, rows, metric, ends, t, held, flat, out):
    """Points at t on the cubics over edges with such tangent vectors, and the planes there.

    held (d,): free parameters that stay what they are. Fills z, p, places in the embedding, planes
    (edges, d, coordinates), the mean of those at both ends, and lengths of the edges.
    """
    free, scales, root = metric
    there, values, place, plane, lengths = out
    size, n, d = z.shape[1], root.shape[0], free.shape[0]
    for e in range(ends.shape[0]):
        a, b, share = ends[e, 0], ends[e, 1], t[e]
        first, second = share * (1.0 - share) ** 2, share**2 * (1.0 - share)
        for i in range(size):
            chord = z[b, i] - z[a, i]
            bend = first * _off(chord, flat, frame, e, 0, a, i)
            bend -= second * _off(chord, flat, frame, e, 1, b, i)
            there[e, i] = z[a, i] + share * chord + bend
        for i in range(p.shape[1]):
            values[e, i] = p[a, i]
        for k in range(d):
            if not held[k]:
                chord = (p[b, free[k]] - p[a, free[k]]) / scales[k]
                bend = first * _off(chord, flat, frame, e, 0, a, size + k)
                bend -= second * _off(chord, flat, frame, e, 1, b, size + k)
                values[e, free[k]] += scales[k] * (share * chord + bend)
        total = 0.0
        for c in range(n + d):
            total += _change(z, p, free, scales, root, a, b, c) ** 2
            if c < n:
                place[e, c] = root[c] * there[e, c]
            else:
                place[e, c] = values[e, free[c - n]] / scales[c - n]
        lengths[e] = np.sqrt(total)
        for i in range(d):
            for c in range(n + d):
                plane[e, i, c] = rows[a, i, c]
            for j in range(d):
                turned = 0.0
                for c in range(n + d):
                    turned += rows[a, i, c] * rows[b, j, c]
                for c in range(n + d):
                    plane[e, i, c] += turned * rows[b, j, c]


@njit(nogil=True)
def check_edges(z, p, metric, ends, t, near, limits, at, found):
    """Drop from `found` points that are far from their places, or beyond an end of their edges.

    near: places and lengths; limits: of the distances from places, of the excess beyond ends, and
    least cosine of edges and tangent spaces; at: points, z, p, and their frames, if they are known.
    """
    free, scales, root = metric
    place, lengths = near
    reach, excess, least = limits
    there, values, frames = at
    n, d, size = root.shape[0], free.shape[0], z.shape[1]
    for e in range(ends.shape[0]):
        off, way, rest, whole = 0.0, 0.0, 0.0, 0.0
        a, b = ends[e, 0], ends[e, 1]
        for c in range(n + d):
            if c < n:
                here, begin, end = root[c] * there[e, c], root[c] * z[a, c], root[c] * z[b, c]
            else:
                k = free[c - n]
                here, begin, end = values[e, k], p[a, k], p[b, k]
                here, begin, end = here / scales[c - n], begin / scales[c - n], end / scales[c - n]
            off += (here - place[e, c]) ** 2
            way += (here - begin) ** 2
            rest += (here - end) ** 2
            whole += (end - begin) ** 2
        length = lengths[e]
        good = np.sqrt(off) <= reach * length
        good &= np.sqrt(way) <= (t[e] + excess) * length
        good &= np.sqrt(rest) <= (1.0 - t[e] + excess) * length
        if frames.shape[1] > 0:
            total = 0.0
            for i in range(d):
                share = 0.0
                for c in range(n):
                    share += frames[e, i, c] * root[c] ** 2 * (z[b, c] - z[a, c])
                for k in range(d):
                    share += frames[e, i, size + k] * (p[b, free[k]] - p[a, free[k]]) / scales[k]
                total += share * share
            good &= np.sqrt(total) >= least * np.sqrt(whole)
        found[e] &= good
