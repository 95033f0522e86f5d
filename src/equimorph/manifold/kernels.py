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
