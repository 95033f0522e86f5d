"""Compiled loops of charts."""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS


@njit(nogil=True)
def overlap_flags(pairs, vertices, corners, inward, depth):
    """Whether the cells of each pair have no common vertex and no side that parts them.

    pairs (n, 2); vertices (C, k); corners (C, k, d); inward: normals of the sides of triangles,
    (C, 3, 2), or none: (0, 0, d); depth: up to which they only touch.
    """
    k = vertices.shape[1]
    found = np.ones(len(pairs), np.bool_)
    for n in range(len(pairs)):
        for turn in range(2):
            one, other = pairs[n, turn], pairs[n, 1 - turn]
            for side in range(inward.shape[1]):
                deepest = -np.inf
                for corner in range(k):
                    along = 0.0
                    for i in range(corners.shape[2]):
                        gap = corners[other, corner, i] - corners[one, side, i]
                        along += inward[one, side, i] * gap
                    deepest = max(deepest, along)
                if not deepest > depth:
                    found[n] = False
                    break
            if not found[n]:
                break
        if found[n]:
            for i in range(k):
                for j in range(k):
                    if vertices[pairs[n, 0], i] == vertices[pairs[n, 1], j]:
                        found[n] = False
    return found


@njit(**FLAGS)
def predicted_pairs(points, near, values, slope, normal, least, null, curvature, most, longest):
    """Steps from nearly singular states to both states of pairs, as in `singular_pairs`.

    points (n, d); near (n, starts): rows of singular states that may be tried for each, −1: none;
    their values (N, d), J⁺ without v (N, d, d), u (N, d), σ (N), v (N, d) and H (N, d, d); most:
    how many of those nearest to a point are tried; longest: step. Returns points, rows of states,
    and steps (m, d): first all with the larger root, then all with the other one.
    """
    count, (starts, d) = 0, (near.shape[1], points.shape[1])
    room = points.shape[0] * min(most, starts)
    point, row = np.empty(room, np.int64), np.empty(room, np.int64)
    steps, along, gap = np.empty((2, room, d)), np.empty(d), np.empty(starts)
    for n in range(points.shape[0]):
        for k in range(starts):
            square = 0.0 if near[n, k] >= 0 else np.inf
            for i in range(d if near[n, k] >= 0 else 0):
                square += (points[n, i] - values[near[n, k], i]) ** 2
            gap[k] = square
        for _ in range(min(most, starts)):
            k = np.argmin(gap)
            at = near[n, k]
            if not gap[k] < np.inf:
                break
            gap[k] = np.inf
            rest = points[n] - values[at]
            a, b, c = 0.0, least[at], 0.0
            for i in range(d):
                along[i] = 0.0
                for j in range(d):
                    along[i] += slope[at, i, j] * rest[j]
            for i in range(d):
                for j in range(d):
                    a += null[at, i] * curvature[at, i, j] * null[at, j]
                    b += null[at, i] * curvature[at, i, j] * along[j]
                    c += 0.5 * along[i] * curvature[at, i, j] * along[j]
                c -= normal[at, i] * rest[i]
            # the sign of the discriminant is not certain where it is small: Newton decides
            half, middle = np.sqrt(abs(b * b - 2.0 * a * c)) / abs(a), -b / a
            length = 0.0
            for side in range(2):
                square = 0.0
                for i in range(d):
                    share = middle + half if side == 0 else middle - half
                    steps[side, count, i] = along[i] + share * null[at, i]
                    square += steps[side, count, i] ** 2
                length = max(length, np.sqrt(square)) if square == square else np.inf  # noqa: PLR0124
            if length <= longest:
                point[count], row[count] = n, at
                count += 1
    both = np.concatenate((steps[0, :count], steps[1, :count]))
    twice = np.arange(2 * count) % max(count, 1)
    return point[twice], row[twice], both
