"""Compiled loops of charts."""

import numpy as np

from equimorph.linalg.compiled import njit


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
