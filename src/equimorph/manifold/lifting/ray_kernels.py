"""Compiled kernels of the table of rays: what a pairing knows of edges from each of their ends."""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.row_kernels import with_room


@njit(nogil=True)
def rays_marked(mark, count, vertex, rays, incident, edges):
    """Points, edges and sides of rays with a mark, of the first `count` points.

    Rays on edges from whose first ends there are some are left out if they are from the second.
    rays (points, slots), incident (vertices, slots): see `Pairing`.
    """
    points, slots, found = np.empty(64, np.int64), np.empty(64, np.int64), 0
    from_first = np.zeros(edges.shape[0], np.bool_)
    for point in range(count):
        if vertex[point] < 0:
            continue
        for slot in range(rays.shape[1]):
            edge = incident[vertex[point], slot]
            if rays[point, slot] != mark or edge < 0:
                continue
            points, slots = with_room(points, found + 1), with_room(slots, found + 1)
            points[found], slots[found] = point, slot
            from_first[edge] |= edges[edge, 1] != vertex[point]
            found += 1
    out, kept = np.empty((3, found), np.int64), 0
    for k in range(found):
        edge = incident[vertex[points[k]], slots[k]]
        side = 1 if edges[edge, 1] == vertex[points[k]] else 0
        if side == 0 or not from_first[edge]:
            out[0, kept], out[1, kept], out[2, kept] = points[k], edge, side
            kept += 1
    return out[0, :kept], out[1, :kept], out[2, :kept]


CLAIMED = np.int64(-1000)
"""Below all marks of rays: that of the first one that starts or ends at a ray, less its number."""


@njit(nogil=True)
def enter_rays(points, along, sides, ends, vertex, edges, slots, rays, number):
    """Enter curves, from a number on, at rays that have none and that no other one claims.

    They start at `points`, along edges seen from `sides`, and end at `ends`, or through a
    constraint where these are negative. rays, slots: see `Pairing`. Returns the number of each
    curve, −1 of those left out.
    """
    lanes = points.shape[0]
    there, slot = np.empty((2, lanes), np.int64), np.empty((2, lanes), np.int64)
    before, alone = np.zeros((2, lanes), np.int64), np.zeros((2, lanes), np.bool_)
    for far in range(2):
        for i in range(lanes):
            point = there[far, i] = ends[i] if far == 1 else points[i]
            if point < 0:
                alone[far, i] = True
                continue
            side = sides[i]
            if far == 1:
                side = 1 if edges[along[i], 1] == vertex[point] else 0
            slot[far, i] = slots[along[i], side]
            known = rays[point, slot[far, i]]
            if known <= CLAIMED:
                first = CLAIMED - known
                alone[first // lanes, first % lanes] = False
            elif known < 0:
                before[far, i], alone[far, i] = known, True
                rays[point, slot[far, i]] = CLAIMED - (far * lanes + i)
    numbers = np.full(lanes, -1)
    for i in range(lanes):
        if alone[0, i] and alone[1, i]:
            numbers[i] = number
            number += 1
        for far in range(2):
            if there[far, i] >= 0 and before[far, i] < 0:
                rays[there[far, i], slot[far, i]] = before[far, i] if numbers[i] < 0 else numbers[i]
    return numbers
