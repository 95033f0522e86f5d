"""Facets of cells, numbered in order, and the links across them, in linear time.

Those of the few triangles over one grid tetrahedron are compared with each other.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.graph_kernels import root_of


@njit(nogil=True)
def sort_facets(cells, base):
    """Facets of cells in the order of their corners, sorted, equal ones as they come.

    Returns keys, the upper corners of each; places in the flat array of cells, of the corner that
    is opposite; and where the facets of each lowest corner begin.
    """
    count, corners = cells.shape
    lows, uppers = np.empty(cells.size, np.int64), np.empty(cells.size, np.int64)
    starts, row = np.zeros(base + 1, np.int64), np.empty(corners, np.int64)
    for t in range(count):
        for k in range(corners):
            at = 0
            for j in range(corners):
                if j != k:
                    own, to = cells[t, j], at
                    while to > 0 and row[to - 1] > own:
                        row[to] = row[to - 1]
                        to -= 1
                    row[to] = own
                    at += 1
            key = np.int64(0)
            for j in range(1, at):
                key = key << 32 | row[j]
            lows[t * corners + k], uppers[t * corners + k] = row[0], key
            starts[row[0] + 1] += 1
    for v in range(base):
        starts[v + 1] += starts[v]
    keys, places, free = np.empty_like(lows), np.empty_like(lows), starts[:-1].copy()
    for place in range(cells.size):
        low, key = lows[place], uppers[place]
        at = free[low]
        free[low] += 1
        while at > starts[low] and keys[at - 1] > key:
            keys[at], places[at] = keys[at - 1], places[at - 1]
            at -= 1
        keys[at], places[at] = key, place
    return keys, places, starts


@njit(nogil=True)
def join_cells(cells, base):
    """Fields of an `Adjacency`: facets, counts, cell_facets, across and places."""
    keys, order, starts = sort_facets(cells, base)
    size, corners = cells.size, cells.shape[1]
    facets, counts = np.empty((size, corners - 1), np.int64), np.zeros(size, np.int64)
    of_cells = np.empty((cells.shape[0], corners), np.int64)
    across, places = np.empty(size, np.int64), np.empty((size, 2), np.int64)
    facet, link = -1, 0
    for v in range(base):
        for i in range(starts[v], starts[v + 1]):
            if i > starts[v] and keys[i] == keys[i - 1]:
                across[link], places[link, 0], places[link, 1] = facet, order[i - 1], order[i]
                link += 1
            else:
                facet += 1
                key, facets[facet, 0] = keys[i], v
                for k in range(corners - 2, 0, -1):
                    facets[facet, k] = key & 0xFFFFFFFF
                    key >>= 32
            counts[facet] += 1
            of_cells[order[i] // corners, order[i] % corners] = facet
    many = facet + 1
    return (
        facets[:many].copy(), counts[:many].copy(), of_cells,
        across[:link].copy(), places[:link].copy(),
    )  # fmt: skip


@njit(nogil=True)
def join_triangles(corners, sheets, owner, shares, piece):
    """How many triangles of an owner share each side, and the pieces that they form.

    corners (n, 3) of triangles whose owners (n,) are in order; sheets (n, 3) of their sides ab, bc,
    ca: those of different sheets differ. shares (n, 3) and piece (n,) are written; pieces are
    numbered in the order of their first triangles.
    """
    keys, before = np.empty(corners.size, np.int64), np.arange(owner.size)
    for i in range(corners.size):
        a, b = corners[i // 3, i % 3], corners[i // 3, (i % 3 + 1) % 3]
        keys[i] = min(a, b) << 32 | max(a, b)
    sheet, count = sheets.reshape(-1), shares.reshape(-1)
    count[:] = 1
    first, many = 0, 0
    for end in range(1, owner.size + 1):
        if end < owner.size and owner[end] == owner[first]:
            continue
        for i in range(3 * first, 3 * end):
            for j in range(i + 1, 3 * end):
                if keys[i] == keys[j] and sheet[i] == sheet[j]:
                    count[i] += 1
                    count[j] += 1
                    one, other = root_of(before, i // 3), root_of(before, j // 3)
                    before[max(one, other)] = min(one, other)
        for t in range(first, end):
            root = root_of(before, t)
            piece[t] = many if root == t else piece[root]
            many += root == t
        first = end
