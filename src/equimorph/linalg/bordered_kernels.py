"""Compiled kernel of general bordered solves with the condensed factorisation."""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.condensed_kernels import (
    GROUP,
    TIES,
    TILE,
    lower_row,
    negative_of_two,
    pivot_ratio,
    reduce_group,
    restore_element,
    start_block,
    work_arrays,
    write_determinant,
)
from equimorph.linalg.coupled_kernels import coupled_arrays, reduce_coupled, restore_coupled
from equimorph.linalg.kernels import (
    FLAGS,
    INNER,
    factor_symmetric,
    read_lanes,
    solve_lanes,
    write_lanes,
)
from equimorph.linalg.simd import (
    LANES,
    load,
    load4,
    repeat4,
    sincos,
    spread,
    stack2,
    store,
    work_rows,
)

START, SIDES = np.int64(0), np.int64(2)
"""Two right-hand sides are substituted back side by side."""


@njit(**FLAGS)
def solve_condensed(
    stiffness, ends, coupling, diagonal, border, columns, rows, corner, rhs, trailing, turns, pull,
    x, negative, ratio, determinant,
):  # fmt: skip
    """Bordered solves ``[H B C; Bᵀ T …; R … D] x = rhs`` for lanes-first arrays; see `condensed`.

    diagonal (lanes, nodes); border (lanes, m, nodes); columns (lanes, k, n + m) and rows alike;
    corner (lanes, k, k); rhs (lanes, r, n + m + k); trailing T (lanes, m, m); x like rhs; turns
    (lanes, nodes) and pull (lanes) of a coupling, see `reduce_coupled`, else empty. At least
    `LANES` lanes; the last block overlaps the one before. Products aᵀH⁻¹b need forward-reduced
    columns only, in the order B, C, right-hand sides, R; just the combined right-hand sides are
    substituted back.
    """
    elements, inner = stiffness.shape[0], stiffness.shape[1] - 2
    lanes, nodes = diagonal.shape
    m, k, r = border.shape[1], columns.shape[1], rhs.shape[1]
    first, last = min(ends[0], 1), nodes - 1 - min(elements - ends[1], 1)
    n, size, width = last - first + 1, m + k, m + k + r
    tiles = tiles_of(m, k, r)
    lower, vertices, work, extremes = work_arrays(elements, inner, tiles)
    coupled = coupling[0].shape[0]
    arrays = coupled_arrays(coupled, inner, tiles)
    block, left = work_rows(nodes), work_rows(size * nodes)
    products, small = work_rows(size * tiles * TILE), work_rows(size * width)
    solution, square = work_rows(2 * nodes), np.empty((m, m))
    for begin in range(0, lanes, LANES):
        start = min(begin, lanes - LANES)
        read_lanes(diagonal, start * nodes, nodes, nodes, block, 0, 1)
        if coupled > 0:
            _read_turns(turns, pull, start, nodes, arrays)
        for c in range(m):
            position = (start * m + c) * nodes
            read_lanes(border, position, m * nodes, nodes, work, row_of_column(c, 0, nodes), TILE)
        for c in range(k):
            position = (start * k + c) * (n + m)
            at = row_of_column(m + c, first, nodes)
            read_lanes(columns, position, k * (n + m), n, work, at, TILE)
            at = row_of_column(width + c, first, nodes)
            read_lanes(rows, position, k * (n + m), n, work, at, TILE)
        for c in range(r):
            position, at = (start * r + c) * (n + m + k), row_of_column(m + k + c, first, nodes)
            read_lanes(rhs, position, r * (n + m + k), n, work, at, TILE)
        reduce_block(
            stiffness, ends, coupling, arrays, block, m, k, r, lower, vertices, work, extremes,
            left, products,
        )  # fmt: skip
        for lane in range(LANES):
            at = start + lane
            _set_small(columns[at], rows[at], corner[at], rhs[at], trailing[at], lane, small)
        subtract_products(products, tiles, size, width, small)
        close_border(small, m, width, square, extremes)
        for lane in range(LANES):
            negative[start + lane] = np.int64(extremes[0, lane])
            ratio[start + lane] = pivot_ratio(extremes, lane)
            write_determinant(extremes, lane, determinant, start + lane)
        if r > 0:
            solve_lanes(small, size, width)
        for c in range(0, r, 2):
            other = min(c + 1, r - 1)
            restore_pair(
                stiffness, ends, coupling, arrays, size, width, c, other, lower, vertices, work,
                small, solution,
            )  # fmt: skip
            for side, column in enumerate((c, other)):
                position = (start * r + column) * (n + m + k)
                lane_step = r * (n + m + k)
                write_lanes(solution, 2 * first + side, 2, x, position, lane_step, n)
                for b in range(size):
                    for lane in range(LANES):
                        x[start + lane, column, n + b] = small[b * width + size + column, lane]


@njit(**INNER)
def _read_turns(turns, pull, start, nodes, arrays):
    """Fill in cosines, sines and pull of a block of lanes."""
    cosine, sine = arrays[0], arrays[1]
    read_lanes(turns, start * nodes, nodes, nodes, cosine, 0, 1)
    for i in range(nodes):
        s, c = sincos(load(cosine, i))
        store(sine, i, s)
        store(cosine, i, c)
    for lane in range(LANES):
        arrays[2][0, lane] = pull[start + lane]


@njit(**INNER)
def reduce_block(
    stiffness, ends, coupling, arrays, block, m, k, r, lower, vertices, work, extremes, left,
    products,
):  # fmt: skip
    """Factor H of all lanes, reduce its columns, and multiply those of the border with all."""
    elements, inner, nodes = stiffness.shape[0], stiffness.shape[1] - 2, block.shape[0]
    first, last = min(ends[0], 1), nodes - 1 - min(elements - ends[1], 1)
    tiles, coupled = tiles_of(m, k, r), coupling[0].shape[0] > 0
    if coupled:
        reduce_coupled(stiffness, ends, coupling, arrays, block, tiles, work, extremes)
    else:
        start_block(block, vertices, extremes)
        for group in range((elements + GROUP - 1) // GROUP):
            reduce_group(stiffness, group, block, ends, tiles, lower, vertices, work, extremes)
    for a in range(m + k):
        column = row_of_column(a if a < m else r + k + a, 0, nodes)
        if coupled:
            for i in range(first, last + 1):
                weighed = load(work, column + i * TILE) * load(arrays[3], i)
                store(left, a * nodes + i, weighed)
        else:
            _weigh(lower, vertices, inner, work, column, left, a * nodes, last)
        _products(left, a * nodes, work, nodes, tiles, first, last, products, a)


@njit(**INNER)
def tiles_of(m, k, r):
    """Tiles that hold ties, m constraints, k columns and rows, and r right-hand sides."""
    return (TIES + m + 2 * k + r + TILE - 1) // TILE


@njit(**INNER)
def restore_pair(
    stiffness, ends, coupling, arrays, size, width, c, other, lower, vertices, work, small, solution
):
    """Substitute two right-hand sides back, side by side, with the border's part solved."""
    elements, inner = stiffness.shape[0], stiffness.shape[1] - 2
    nodes = elements * (inner + 1) + 1
    if coupling[0].shape[0] > 0:
        _combine(work, nodes, 0, nodes, size, width, c, other, small, solution)
        restore_coupled(ends, coupling, arrays, solution)
        return
    for e in range(elements, -1, -1):
        node = e * (inner + 1)
        stop = min(node + inner, nodes - 1) + 1
        _combine(work, nodes, node, stop, size, width, c, other, small, solution)
        restore_element(e, elements, inner, ends, lower, vertices, work, solution, START, SIDES)


@njit(**INNER)
def row_of_column(c, node, nodes):
    """Row of column c (ties not counted) at a node."""
    slot = TIES + c
    return ((slot // TILE) * nodes + node) * TILE + slot % TILE


@njit(**INNER)
def _weigh(lower, vertices, inner, work, column, left, to, last):
    """Multiply a forward-reduced column by the reciprocal pivots; rows from `to` of left.

    What stands in a prescribed first node is left out of the products.
    """
    for e in range((last - 1) // (inner + 1) + 1):
        node = e * (inner + 1)
        store(left, to + node, load(work, column + node * TILE) * load(vertices, 2 * e))
        base = lower_row(e, inner)
        for i in range(inner):
            pivot = load(lower, base + i * (inner + 1) * GROUP)
            at = node + 1 + i
            store(left, to + at, load(work, column + at * TILE) * pivot)
    if last % (inner + 1) == 0:
        pivot = load(vertices, 2 * (last // (inner + 1)))
        store(left, to + last, load(work, column + last * TILE) * pivot)


@njit(**INNER)
def _products(left, start, work, nodes, tiles, first, last, products, a):
    """Products of one weighted column with all columns: row a of products, slot by slot."""
    for half in range(2 * tiles):
        value = repeat4(spread(0.0))
        at = (half // 2) * nodes * TILE + (half % 2) * (TILE // 2)
        for i in range(first, last + 1):
            value = value + repeat4(load(left, start + i)) * load4(work, at + i * TILE)
        store(products, a * tiles * TILE + half * (TILE // 2), value)


@njit(**INNER)
def _set_small(columns, rows, corner, rhs, trailing, lane, small):
    """What the border itself puts into the small system of one lane, right-hand sides last."""
    m, k, r = trailing.shape[0], columns.shape[0], rhs.shape[0]
    n, size, width = rhs.shape[1] - m - k, m + k, m + k + r
    for a in range(size):
        for b in range(size):
            if a < m and b < m:
                fixed = trailing[a, b]
            elif a < m:
                fixed = columns[b - m, n + a]
            elif b < m:
                fixed = rows[a - m, n + b]
            else:
                fixed = corner[a - m, b - m]
            small[a * width + b, lane] = fixed
        for c in range(r):
            small[a * width + size + c, lane] = rhs[c, n + a]


@njit(**INNER)
def subtract_products(products, tiles, size, width, small):
    """Complete the Schur complement of H and its right-hand sides."""
    for a in range(size):
        for b in range(width):
            product = load(products, a * tiles * TILE + TIES + b)
            store(small, a * width + b, load(small, a * width + b) - product)


@njit(**INNER)
def close_border(small, m, width, square, extremes):
    """Add the negative eigenvalues of the first m rows and columns to the count of pivots.

    The product of the reciprocal pivots becomes the determinant.
    """
    if m == 2:
        store(extremes, 0, load(extremes, 0) + negative_of_two(small, 0, width))
        across = load(small, 1) * load(small, width)
        store(extremes, 4, (load(small, 0) * load(small, width + 1) - across) / load(extremes, 4))
        return
    for lane in range(LANES):
        for a in range(m):
            for b in range(m):
                square[a, b] = small[a * width + b, lane]
        negative, product = factor_symmetric(square)
        extremes[0, lane] += negative
        extremes[4, lane] = product / extremes[4, lane]


@njit(**INNER)
def _combine(work, nodes, start, stop, size, width, c, other, small, solution):
    """Two right-hand sides less the border's share, side by side: f − [B C] y, reduced."""
    for i in range(start, stop):
        first = load(work, row_of_column(size + c, i, nodes))
        second = load(work, row_of_column(size + other, i, nodes))
        for b in range(size):
            column = load(work, row_of_column(b, i, nodes))
            first = first - column * load(small, b * width + size + c)
            second = second - column * load(small, b * width + size + other)
        store(solution, 2 * i, stack2(first, second))
