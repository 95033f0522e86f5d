"""Vertices on edges: where they are looked for, and which are believed, edge by edge."""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import SUMS
from equimorph.manifold.geometry.kernels import lean


@njit(nogil=True, fastmath=SUMS)
def lean_edges(place, rows, ends, flat):
    """Tangent vectors (edges, 2, d) at both ends that edges are nearest to, as `Ends.along`."""
    chord, own = np.empty(place.shape[1]), np.empty((2, rows.shape[1]))
    for e in range(ends.shape[0]):
        lean(place, rows, ends[e, 0], ends[e, 1], chord, own)
        for i in range(own.shape[1]):
            flat[e, 0, i], flat[e, 1, i] = own[0, i], own[1, i]


@njit(nogil=True, fastmath=SUMS)
def bend_edges(vertices, metric, ends, t, held, flat, out):
    """Points at t on the cubics over edges with such tangent vectors, and the planes there.

    vertices: z, p, places, frames and rows of all; metric: free parameters, their scales, roots of
    the mass; held (d,): free parameters that stay what they are. Fills z, p, places in the
    embedding, planes (edges, d, coordinates), the mean of those at both ends, and lengths of the
    edges.
    """
    z, p, known, frame, rows = vertices
    free, scales, root = metric
    there, values, place, plane, lengths = out
    size, n, d = z.shape[1], root.shape[0], free.shape[0]
    for e in range(ends.shape[0]):
        a, b, share = ends[e, 0], ends[e, 1], t[e]
        first, second = share * (1.0 - share) ** 2, share**2 * (1.0 - share)
        straight = share - first + second
        for i in range(size):
            there[e, i] = z[a, i] + straight * (z[b, i] - z[a, i])
        for k in range(d):
            one, other = first * flat[e, 0, k], second * flat[e, 1, k]
            for i in range(size):
                there[e, i] += one * frame[a, k, i] - other * frame[b, k, i]
        for i in range(p.shape[1]):
            values[e, i] = p[a, i]
        for k in range(d):
            if not held[k]:
                way = straight * (known[b, n + k] - known[a, n + k])
                for j in range(d):
                    way += first * flat[e, 0, j] * frame[a, j, size + k]
                    way -= second * flat[e, 1, j] * frame[b, j, size + k]
                values[e, free[k]] += scales[k] * way
        total = 0.0
        for c in range(n + d):
            total += (known[b, c] - known[a, c]) ** 2
        lengths[e] = np.sqrt(total)
        for c in range(n):
            place[e, c] = root[c] * there[e, c]
        for k in range(d):
            place[e, n + k] = values[e, free[k]] / scales[k]
        for i in range(d):
            for c in range(n + d):
                plane[e, i, c] = rows[a, i, c]
            for j in range(d):
                turned = 0.0
                for c in range(n + d):
                    turned += rows[a, i, c] * rows[b, j, c]
                for c in range(n + d):
                    plane[e, i, c] += turned * rows[b, j, c]


@njit(nogil=True, fastmath=SUMS)
def check_edges(known, metric, ends, t, near, limits, at, found):
    """Drop from `found` points that are far from their places, or beyond an end of their edges.

    known: places of all vertices; near: places and lengths; limits: of the distances from places,
    of the excess beyond ends, and least cosine of edges and tangent spaces; at: points, z, p, and
    their frames, if they are known.
    """
    free, scales, root = metric
    place, lengths = near
    reach, excess, least = limits
    there, values, frames = at
    n, d, size = root.shape[0], free.shape[0], there.shape[1]
    here = np.empty(n + d)
    for e in range(ends.shape[0]):
        off, way, rest, whole = 0.0, 0.0, 0.0, 0.0
        a, b = ends[e, 0], ends[e, 1]
        for c in range(n):
            here[c] = root[c] * there[e, c]
        for k in range(d):
            here[n + k] = values[e, free[k]] / scales[k]
        for c in range(n + d):
            off += (here[c] - place[e, c]) ** 2
            way += (here[c] - known[a, c]) ** 2
            rest += (here[c] - known[b, c]) ** 2
            whole += (known[b, c] - known[a, c]) ** 2
        length = lengths[e]
        good = np.sqrt(off) <= reach * length
        good &= np.sqrt(way) <= (t[e] + excess) * length
        good &= np.sqrt(rest) <= (1.0 - t[e] + excess) * length
        if frames.shape[1] > 0:
            total = 0.0
            for i in range(d):
                share = 0.0
                for c in range(n):
                    share += frames[e, i, c] * root[c] * (known[b, c] - known[a, c])
                for k in range(d):
                    share += frames[e, i, size + k] * (known[b, n + k] - known[a, n + k])
                total += share * share
            good &= np.sqrt(total) >= least * np.sqrt(whole)
        found[e] &= good
