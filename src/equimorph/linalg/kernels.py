"""Compiled kernels of the condensed layout: eight lanes at a time.

One matrix H per lane is the sum of element matrices (the same for every lane) and a diagonal (its
own for every lane). Elements are chained: the last node of one is the first node of the next. Inner
nodes are eliminated inside each element; what remains is tridiagonal in the vertices. Everything is
kept as ``LDLᵀ`` so that the signs of the pivots are the inertia (Sylvester).

Work arrays have rows of eight lanes. Columns lie in tiles, ``columns[tile, node, slot]``: the
`TILE` slots of a node are one bundle, so that one entry of L serves eight columns while it is in a
register. The first two slots of the first tile are the *ties*, the columns of an element's inner
nodes at its left and right vertex: eliminated like any other column, they leave the Schur
complement of the vertices in their slots there.
"""

import numpy as np
from numba import njit

from equimorph.linalg.simd import (
    LANES,
    absolute,
    load,
    load2,
    load4,
    load8,
    repeat2,
    repeat4,
    repeat8,
    spread,
    stack2,
    store,
    where_less,
    work_rows,
)

TILE = 8
TIES = 2
GROUP = 2
FLAGS = {"cache": True, "nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
INNER = {**FLAGS, "_nrt": False}
"""Flags of kernels that are called by kernels and allocate nothing.

They need not count references to their arrays: atomic operations that, element by element, cost as
much as the arithmetic.
"""


@njit(**INNER)
def lower_row(e, inner):
    """Row of L₀₀ of element `e`; entry (i, j) lies ``(i·inner + j)·GROUP`` rows further."""
    return (e // GROUP) * inner * inner * GROUP + e % GROUP


@njit(**FLAGS)
def work_arrays(elements, inner, tiles):
    """Work arrays ``lower, vertices, columns, extremes`` of `reduce_group`; columns are zero."""
    groups = (elements + GROUP - 1) // GROUP
    columns = work_rows(tiles * (elements * (inner + 1) + 1) * TILE)
    columns[:] = 0.0
    lower, vertices = work_rows(groups * inner * inner * GROUP), work_rows(2 * (elements + 1))
    return lower, vertices, columns, work_rows(4)


@njit(**INNER)
def _factor_group(stiffness, group, diagonal, lower):
    """LDLᵀ of the inner blocks of two elements at once: one alone would wait for its divisions.

    Below the diagonal L, above it D·Lᵀ, on it the reciprocal pivots.
    """
    elements, inner = stiffness.shape[0], stiffness.shape[1] - 2
    base, e = group * inner * inner * GROUP, group * GROUP
    other = min(e + 1, elements - 1)  # a spare member repeats the last element
    inverse = stack2(spread(1.0), spread(1.0))
    for j in range(inner):
        row_j = base + j * inner * GROUP
        for i in range(j, inner):
            row_i = base + i * inner * GROUP
            first = spread(stiffness[e, i + 1, j + 1])
            second = spread(stiffness[other, i + 1, j + 1])
            if i == j:
                first = first + load(diagonal, e * (inner + 1) + 1 + i)
                second = second + load(diagonal, other * (inner + 1) + 1 + i)
            value = stack2(first, second)
            for k in range(j):
                above = load2(lower, base + (k * inner + i) * GROUP)
                value = value - above * load2(lower, row_j + k * GROUP)
            if i == j:
                inverse = repeat2(spread(1.0)) / value
                store(lower, row_j + j * GROUP, inverse)
            else:
                store(lower, row_j + i * GROUP, value)
                store(lower, row_i + j * GROUP, value * inverse)


@njit(**INNER)
def _set_ties(stiffness, e, columns):
    """Write the ties of element `e` into the first two slots of its nodes."""
    order = stiffness.shape[1]
    at = e * (order - 1) * TILE
    for i in range(order):
        inside = 0 < i < order - 1
        store(columns, at + i * TILE, spread(stiffness[e, i, 0] if inside else 0.0))
        store(columns, at + i * TILE + 1, spread(stiffness[e, i, order - 1] if inside else 0.0))


@njit(**INNER)
def _reduce_tile(lower, base, inner, columns, ties, first):
    """Forward-substitute a tile in an element's inner nodes, and take them out of its vertices."""
    left, right = load8(columns, first - TILE), load8(columns, first + inner * TILE)
    for i in range(inner):
        row, at = base + i * inner * GROUP, first + i * TILE
        value = load8(columns, at)
        for j in range(i):
            factor = repeat8(load(lower, row + j * GROUP))
            value = value - factor * load8(columns, first + j * TILE)
        store(columns, at, value)
        pivot = load(lower, row + i * GROUP)
        left = left - repeat8(load(columns, ties + i * TILE) * pivot) * value
        right = right - repeat8(load(columns, ties + i * TILE + 1) * pivot) * value
    store(columns, first - TILE, left)
    store(columns, first + inner * TILE, right)


@njit(**INNER)
def _note_pivots(lower, base, inner, extremes):
    """Count negative pivots of an element; note smallest, largest and sum of the reciprocals."""
    count, small, large = load(extremes, 0), load(extremes, 1), load(extremes, 2)
    total, zero, one = load(extremes, 3), spread(0.0), spread(1.0)
    for i in range(inner):
        value = load(lower, base + (i * inner + i) * GROUP)
        size = absolute(value)
        count = count + where_less(value, zero, one, zero)
        small, large = where_less(size, small, size, small), where_less(large, size, size, large)
        total = total + value
    store(extremes, 0, count)
    store(extremes, 1, small)
    store(extremes, 2, large)
    store(extremes, 3, total)


@njit(**INNER)
def _eliminate_vertex(e, last, degree, vertices, columns, tiles, extremes):
    """Invert the pivot of vertex `e` and take the vertex out of the next one, if unknown."""
    inverse = spread(1.0) / load(vertices, 2 * e)
    store(vertices, 2 * e, inverse)
    _note_pivots(vertices, 2 * e, 1, extremes)
    if e < last:
        tie = load(vertices, 2 * e + 1)
        factor = tie * inverse
        store(vertices, 2 * e + 1, factor)
        store(vertices, 2 * e + 2, load(vertices, 2 * e + 2) - factor * tie)
        rows = columns.shape[0] // tiles
        for t in range(tiles):
            at = t * rows + e * degree * TILE
            following = at + degree * TILE
            value = load8(columns, following) - repeat8(factor) * load8(columns, at)
            store(columns, following, value)


@njit(**INNER)
def start_block(diagonal, vertices, extremes):
    """Prepare the reduction of one block of lanes."""
    store(extremes, 0, spread(0.0))
    store(extremes, 1, spread(np.inf))
    store(extremes, 2, spread(0.0))
    store(extremes, 3, spread(0.0))
    store(vertices, 0, load(diagonal, 0))


@njit(**INNER)
def reduce_group(stiffness, group, diagonal, ends, tiles, lower, vertices, columns, extremes):
    """Factor the elements of a group and forward-reduce their columns in place.

    stiffness (elements, degree + 1, degree + 1); diagonal (nodes, 8); ends: first and last vertex
    that is unknown; columns (tiles, nodes, TILE, 8), ties left to this function. Filled: lower
    (see `lower_row`); vertices (elements + 1, 2, 8), reciprocal pivot and factor to the next;
    extremes (4, 8): see `_note_pivots`.
    """
    elements, degree = stiffness.shape[0], stiffness.shape[1] - 1
    inner, rows = degree - 1, columns.shape[0] // tiles
    _factor_group(stiffness, group, diagonal, lower)
    for e in range(group * GROUP, min(group * GROUP + GROUP, elements)):
        _set_ties(stiffness, e, columns)
        base, start = lower_row(e, inner), e * degree * TILE
        stop = start + degree * TILE
        for t in range(tiles):
            _reduce_tile(lower, base, inner, columns, start + TILE, t * rows + start + TILE)
        _note_pivots(lower, base, inner, extremes)
        own = load(vertices, 2 * e) + spread(stiffness[e, 0, 0])
        store(vertices, 2 * e, own + load(columns, start))
        store(vertices, 2 * e + 1, spread(stiffness[e, 0, degree]) + load(columns, start + 1))
        own = load(diagonal, (e + 1) * degree) + spread(stiffness[e, degree, degree])
        store(vertices, 2 * e + 2, own + load(columns, stop + 1))
        if ends[0] <= e <= ends[1]:
            _eliminate_vertex(e, ends[1], degree, vertices, columns, tiles, extremes)
        if e + 1 == elements == ends[1]:
            _eliminate_vertex(e + 1, ends[1], degree, vertices, columns, tiles, extremes)


@njit(**INNER)
def restore_element(e, elements, inner, ends, lower, vertices, columns, values, at, step):
    """Back-substitute two forward-reduced columns in vertex `e` and the element right of it.

    Called from the last vertex down. The columns are rows at, at + 1 of `values` for the first node
    and `step` rows further for each following one; `columns` holds the reduced ties.
    """
    start = at + e * (inner + 1) * step
    stop = start + (inner + 1) * step
    value = repeat2(spread(0.0))
    if ends[0] <= e <= ends[1]:
        value = load2(values, start) * repeat2(load(vertices, 2 * e))
        if e < ends[1]:
            value = value - repeat2(load(vertices, 2 * e + 1)) * load2(values, stop)
    store(values, start, value)
    if e < elements:
        ties = (e * (inner + 1) + 1) * TILE
        _restore_inner(lower, lower_row(e, inner), inner, columns, ties, values, start, step)


@njit(**INNER)
def _restore_inner(lower, base, inner, columns, ties, values, start, step):
    """Back-substitute two columns in the inner nodes of an element whose vertices are known."""
    v_start, v_stop = load2(values, start), load2(values, start + (inner + 1) * step)
    for i in range(inner - 1, -1, -1):
        tie, at = ties + i * TILE, start + (i + 1) * step
        value = load2(values, at) - repeat2(load(columns, tie)) * v_start
        value = value - repeat2(load(columns, tie + 1)) * v_stop
        value = value * repeat2(load(lower, base + (i * inner + i) * GROUP))
        for j in range(inner - 1, i, -1):
            factor = repeat2(load(lower, base + (j * inner + i) * GROUP))
            value = value - factor * load2(values, start + (j + 1) * step)
        store(values, at, value)


@njit(**INNER)
def add_products(e, inner, ends, lower, vertices, columns, products):
    """Add vertex `e` and its element to aᵀH⁻¹b = Σ aᵢ bᵢ / dᵢ of forward-reduced columns.

    a: slots 4, 5 and 2; b: slots 4 to 7 of the first tile. products (12, 8), a by a.
    """
    first, second, third = load4(products, 0), load4(products, 4), load4(products, 8)
    base, start = lower_row(e, inner), e * (inner + 1) * TILE
    for i in range(0 if ends[0] <= e <= ends[1] else 1, inner + 1):
        at = start + i * TILE
        pivot = load(vertices, 2 * e)
        if i > 0:
            pivot = load(lower, base + (i - 1) * (inner + 1) * GROUP)
        many = load4(columns, at + 4)
        first = first + repeat4(load(columns, at + 4) * pivot) * many
        second = second + repeat4(load(columns, at + 5) * pivot) * many
        third = third + repeat4(load(columns, at + 2) * pivot) * many
    store(products, 0, first)
    store(products, 4, second)
    store(products, 8, third)


@njit(**INNER)
def pivot_ratio(extremes, lane):
    """Smallest over largest |pivot| of a lane; not a number if a pivot is not."""
    total = extremes[3, lane]
    return extremes[1, lane] / extremes[2, lane] if total == total else np.nan  # noqa: PLR0124


@njit(**INNER)
def solve_lanes(a, size, width):
    """Gauss with partial pivoting on eight systems: a (size, width, 8), right sides last."""
    for k in range(size):
        for i in range(k + 1, size):
            here, there = absolute(load(a, k * width + k)), absolute(load(a, i * width + k))
            for j in range(k, width):
                upper, lower = load(a, k * width + j), load(a, i * width + j)
                store(a, k * width + j, where_less(here, there, lower, upper))
                store(a, i * width + j, where_less(here, there, upper, lower))
        inverse = spread(1.0) / load(a, k * width + k)
        for j in range(k + 1, width):
            store(a, k * width + j, load(a, k * width + j) * inverse)
        for i in range(k + 1, size):
            factor = load(a, i * width + k)
            for j in range(k + 1, width):
                at = i * width + j
                store(a, at, load(a, at) - factor * load(a, k * width + j))
    for k in range(size - 2, -1, -1):
        for i in range(k + 1, size):
            factor = load(a, k * width + i)
            for j in range(size, width):
                at = k * width + j
                store(a, at, load(a, at) - factor * load(a, i * width + j))


@njit(**FLAGS)
def factor_symmetric(a):
    """Number of negative eigenvalues of a symmetric matrix, by LDLᵀ with complete pivoting.

    Bunch and Parlett (1971): 1 × 1 and 2 × 2 pivots; `a` is overwritten. Sylvester's law of inertia
    gives the signs: a 2 × 2 pivot chosen by this rule always has one negative eigenvalue.
    """
    size = a.shape[0]
    alpha = 0.6403882032022076  # (1 + √17) / 8 bounds the growth of the entries
    negative, k = 0, 0
    while k < size:
        diagonal, d = -1.0, k
        off, r, s = -1.0, k, k
        for i in range(k, size):
            if abs(a[i, i]) > diagonal:
                diagonal, d = abs(a[i, i]), i
            for j in range(k, i):
                if abs(a[i, j]) > off:
                    off, r, s = abs(a[i, j]), i, j
        if max(diagonal, off) == 0.0:
            break
        if diagonal >= alpha * off:
            _swap(a, k, d)
            pivot = a[k, k]
            negative += pivot < 0.0
            for i in range(k + 1, size):
                factor = a[i, k] / pivot
                for j in range(k + 1, i + 1):
                    a[i, j] -= factor * a[j, k]
            for i in range(k + 1, size):
                for j in range(k + 1, i):
                    a[j, i] = a[i, j]
            k += 1
        else:
            _swap(a, k, s)
            _swap(a, k + 1, r)
            negative += 1
            p, q, b = a[k, k], a[k + 1, k + 1], a[k + 1, k]
            determinant = p * q - b * b
            for i in range(k + 2, size):
                first = (q * a[i, k] - b * a[i, k + 1]) / determinant
                second = (p * a[i, k + 1] - b * a[i, k]) / determinant
                for j in range(k + 2, i + 1):
                    a[i, j] -= first * a[j, k] + second * a[j, k + 1]
            for i in range(k + 2, size):
                for j in range(k + 2, i):
                    a[j, i] = a[i, j]
            k += 2
    return negative


@njit(**INNER)
def _swap(a, i, j):
    """Exchange rows and columns i and j of a symmetric matrix."""
    if i != j:
        for c in range(a.shape[0]):
            a[i, c], a[j, c] = a[j, c], a[i, c]
        for c in range(a.shape[0]):
            a[c, i], a[c, j] = a[c, j], a[c, i]


@njit(**FLAGS)
def count_negative(matrices, out):
    """Negative eigenvalues of each symmetric matrix (lanes, n, n)."""
    for lane in range(matrices.shape[0]):
        out[lane] = factor_symmetric(matrices[lane].copy())


@njit(**FLAGS)
def solve_small(a, b):
    """Gauss with partial pivoting: overwrite b (size, count) with a⁻¹ b; `a` is overwritten."""
    size, count = b.shape
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        if best != k:
            for j in range(k, size):
                a[k, j], a[best, j] = a[best, j], a[k, j]
            for j in range(count):
                b[k, j], b[best, j] = b[best, j], b[k, j]
        for i in range(k + 1, size):
            factor = a[i, k] / a[k, k]
            for j in range(k + 1, size):
                a[i, j] -= factor * a[k, j]
            for j in range(count):
                b[i, j] -= factor * b[k, j]
    for j in range(count):
        for i in range(size - 1, -1, -1):
            for k in range(i + 1, size):
                b[i, j] -= a[i, k] * b[k, j]
            b[i, j] /= a[i, i]


@njit(**FLAGS)
def solve_condensed(
    stiffness, ends, diagonal, border, columns, rows, corner, rhs, x, negative, ratio
):
    """Bordered solves ``[H B C; Bᵀ 0 …; R … D] x = rhs`` for lanes-first arrays; see `condensed`.

    diagonal (lanes, nodes); border (lanes, m, nodes); columns (lanes, k, n + m) and rows alike;
    corner (lanes, k, k); rhs (lanes, r, n + m + k); x like rhs.
    """
    elements, degree = stiffness.shape[0], stiffness.shape[1] - 1
    lanes, nodes = diagonal.shape
    m, k, r = border.shape[1], columns.shape[1], rhs.shape[1]
    first, last = min(ends[0], 1), nodes - 1 - min(elements - ends[1], 1)
    n, total = last - first + 1, m + k + r
    tiles = (TIES + total + TILE - 1) // TILE
    lower, vertices, work, extremes = work_arrays(elements, degree - 1, tiles)
    block, plain = work_rows(nodes), np.empty((total, nodes, LANES))
    block[:] = 1.0
    for start in range(0, lanes, LANES):
        active = min(LANES, lanes - start)
        work[:] = 0.0
        for lane in range(active):
            at = start + lane
            block[:, lane] = diagonal[at]
            for c in range(total):
                for i in range(nodes if c < m else n):
                    if c < m:
                        work[_row(c, i, nodes), lane] = border[at, c, i]
                    elif c < m + k:
                        work[_row(c, first + i, nodes), lane] = columns[at, c - m, i]
                    else:
                        work[_row(c, first + i, nodes), lane] = rhs[at, c - m - k, i]
        start_block(block, vertices, extremes)
        for group in range((elements + GROUP - 1) // GROUP):
            reduce_group(stiffness, group, block, ends, tiles, lower, vertices, work, extremes)
        for c in range(0, total, 2):
            at = _row(c, 0, nodes)
            for e in range(elements, -1, -1):
                restore_element(
                    e, elements, degree - 1, ends, lower, vertices, work, work, at, TILE
                )
        for c in range(total):
            for i in range(nodes):
                plain[c, i] = work[_row(c, i, nodes)]
        for lane in range(active):
            at = start + lane
            negative[at] = np.int64(extremes[0, lane]) + _close_border(
                border[at], columns[at], rows[at], corner[at], rhs[at], plain, lane, first, x[at]
            )
            ratio[at] = pivot_ratio(extremes, lane)


@njit(**INNER)
def _row(c, node, nodes):
    """Row of column c (ties not counted) at a node."""
    slot = TIES + c
    return ((slot // TILE) * nodes + node) * TILE + slot % TILE


@njit(**FLAGS)
def _close_border(border, columns, rows, corner, rhs, work, lane, first, x):
    """Solve the small Schur system of one lane; return the negative eigenvalues of −BᵀH⁻¹B."""
    m, k, r = border.shape[0], columns.shape[0], rhs.shape[0]
    n = rhs.shape[1] - m - k
    schur, small = np.empty((m + k, m + k)), np.empty((m + k, r))
    for a in range(m + k):
        for b in range(m + k + r):
            value = 0.0
            for i in range(n):
                left = border[a, first + i] if a < m else rows[a - m, i]
                value += left * work[b, first + i, lane]
            if b < m + k:
                fixed = 0.0
                if a < m and b >= m:
                    fixed = columns[b - m, n + a]
                elif a >= m and b < m:
                    fixed = rows[a - m, n + b]
                elif a >= m:
                    fixed = corner[a - m, b - m]
                schur[a, b] = fixed - value
            else:
                small[a, b - m - k] = rhs[b - m - k, n + a] - value
    negative = factor_symmetric(schur[:m, :m].copy())
    solve_small(schur, small)
    for c in range(r):
        for i in range(n):
            value = work[m + k + c, first + i, lane]
            for b in range(m + k):
                value -= work[b, first + i, lane] * small[b, c]
            x[c, i] = value
        for b in range(m + k):
            x[c, n + b] = small[b, c]
    return negative
