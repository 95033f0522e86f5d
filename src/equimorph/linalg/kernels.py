"""Compiled kernels of the condensed layout: eight lanes at a time.

One matrix H per lane is the sum of element matrices (the same for every lane) and a diagonal (its
own for every lane). Elements are chained: the last node of one is the first node of the next. Inner
nodes are eliminated inside each element; what remains is tridiagonal in the vertices. Everything is
kept as ``LDLᵀ`` so that the signs of the pivots are the inertia (Sylvester).

Arrays of a block carry the lanes last, ``columns[c, node, lane]``, and are read by row. Columns go
four at a time (their number is a multiple of `TILE`): four independent sums hide the latency of
the fused multiply-add, and an entry of L is loaded once for all four.
"""

import numpy as np
from numba import njit

from equimorph.linalg.simd import LANES, load, spread, store

TILE = 4
FLAGS = {"cache": True, "nogil": True, "error_model": "numpy", "fastmath": {"contract"}}


@njit(**FLAGS)
def _factor_inner(stiffness, e, diagonal, lower, pivots):
    """LDLᵀ of the inner block of element `e`, column by column (its updates are independent)."""
    inner = stiffness.shape[1] - 2
    base, one = e * (inner + 1) + 1, spread(1.0)
    for i in range(inner):
        at = (e * inner + i) * inner
        for j in range(i):
            store(lower, at + j, spread(stiffness[e, i + 1, j + 1]))
        store(lower, at + i, spread(stiffness[e, i + 1, i + 1]) + load(diagonal, base + i))
    for j in range(inner):
        inverse = one / load(lower, (e * inner + j) * inner + j)
        store(pivots, base + j, inverse)
        for i in range(j + 1, inner):
            at = (e * inner + i) * inner
            factor = load(lower, at + j) * inverse
            store(lower, at + i, load(lower, at + i) - factor * load(lower, at + j))
            for c in range(i + 1, inner):
                below = (e * inner + c) * inner
                store(lower, below + i, load(lower, below + i) - factor * load(lower, below + j))
            store(lower, at + j, factor)


@njit(**FLAGS)
def _forward_tile(lower, e, columns, c, nodes, base):
    """Forward-substitute four columns in the inner nodes of element `e`."""
    inner = lower.shape[1]
    at0, at1 = c * nodes + base, (c + 1) * nodes + base
    at2, at3 = (c + 2) * nodes + base, (c + 3) * nodes + base
    for i in range(1, inner):
        row = (e * inner + i) * inner
        v0, v1 = load(columns, at0 + i), load(columns, at1 + i)
        v2, v3 = load(columns, at2 + i), load(columns, at3 + i)
        for j in range(i):
            factor = load(lower, row + j)
            v0 = v0 - factor * load(columns, at0 + j)
            v1 = v1 - factor * load(columns, at1 + j)
            v2 = v2 - factor * load(columns, at2 + j)
            v3 = v3 - factor * load(columns, at3 + j)
        store(columns, at0 + i, v0)
        store(columns, at1 + i, v1)
        store(columns, at2 + i, v2)
        store(columns, at3 + i, v3)


@njit(**FLAGS)
def _condense_tile(ties, pivots, e, inner, columns, c):
    """Take the eliminated inner nodes of element `e` out of four columns at its vertices."""
    nodes = pivots.shape[0]
    start = e * (inner + 1)
    stop = start + inner + 1
    at0, at1, at2, at3 = c * nodes, (c + 1) * nodes, (c + 2) * nodes, (c + 3) * nodes
    l0, l1 = load(columns, at0 + start), load(columns, at1 + start)
    l2, l3 = load(columns, at2 + start), load(columns, at3 + start)
    r0, r1 = load(columns, at0 + stop), load(columns, at1 + stop)
    r2, r3 = load(columns, at2 + stop), load(columns, at3 + stop)
    for i in range(start + 1, stop):
        pivot = load(pivots, i)
        left, right = load(ties, i) * pivot, load(ties, nodes + i) * pivot
        v0, v1 = load(columns, at0 + i), load(columns, at1 + i)
        v2, v3 = load(columns, at2 + i), load(columns, at3 + i)
        l0, l1, l2, l3 = l0 - left * v0, l1 - left * v1, l2 - left * v2, l3 - left * v3
        r0, r1, r2, r3 = r0 - right * v0, r1 - right * v1, r2 - right * v2, r3 - right * v3
    store(columns, at0 + start, l0)
    store(columns, at1 + start, l1)
    store(columns, at2 + start, l2)
    store(columns, at3 + start, l3)
    store(columns, at0 + stop, r0)
    store(columns, at1 + stop, r1)
    store(columns, at2 + stop, r2)
    store(columns, at3 + stop, r3)


@njit(**FLAGS)
def _reduce_ties(stiffness, e, lower, pivots, ties, chain):
    """Forward-reduce the ties of element `e` to its vertices; Schur complement of the vertices."""
    inner, nodes = lower.shape[1], pivots.shape[0]
    start = e * (inner + 1)
    stop = start + inner + 1
    from_start = load(pivots, start) + spread(stiffness[e, 0, 0])
    from_stop = load(pivots, stop) + spread(stiffness[e, inner + 1, inner + 1])
    tie = spread(stiffness[e, 0, inner + 1])
    for i in range(inner):
        left = spread(stiffness[e, i + 1, 0])
        right = spread(stiffness[e, i + 1, inner + 1])
        for j in range(i):
            factor = load(lower, (e * inner + i) * inner + j)
            left = left - factor * load(ties, start + 1 + j)
            right = right - factor * load(ties, nodes + start + 1 + j)
        store(ties, start + 1 + i, left)
        store(ties, nodes + start + 1 + i, right)
        pivot = load(pivots, start + 1 + i)
        from_start = from_start - left * left * pivot
        tie = tie - left * right * pivot
        from_stop = from_stop - right * right * pivot
    store(pivots, start, from_start)
    store(pivots, stop, from_stop)
    store(chain, e, tie)


@njit(**FLAGS)
def reduce_block(stiffness, diagonal, ends, columns, lower, pivots, ties, chain):
    """Factor one block of lanes and forward-reduce its columns in place.

    stiffness (elements, degree + 1, degree + 1); diagonal (nodes, 8); ends: first and last vertex
    that is unknown; columns (c, nodes, 8). Filled for `restore_block`: lower (elements,
    degree - 1, degree - 1, 8), pivots (nodes, 8) as reciprocals, ties (2, nodes, 8), chain
    (elements + 1, 8).
    """
    elements, degree = stiffness.shape[0], stiffness.shape[1] - 1
    nodes, count = pivots.shape[0], columns.shape[0]
    one = spread(1.0)
    for e in range(elements + 1):
        store(pivots, e * degree, load(diagonal, e * degree))
    for e in range(elements):
        _factor_inner(stiffness, e, diagonal, lower, pivots)
        _reduce_ties(stiffness, e, lower, pivots, ties, chain)
        for c in range(0, count, TILE):
            _forward_tile(lower, e, columns, c, nodes, e * degree + 1)
            _condense_tile(ties, pivots, e, degree - 1, columns, c)
    for e in range(ends[0], ends[1] + 1):
        node, following = e * degree, (e + 1) * degree
        inverse = one / load(pivots, node)
        store(pivots, node, inverse)
        if e < ends[1]:
            tie = load(chain, e)
            factor = tie * inverse
            store(chain, e, factor)
            store(pivots, following, load(pivots, following) - factor * tie)
            for c in range(count):
                at = c * nodes
                value = load(columns, at + following) - factor * load(columns, at + node)
                store(columns, at + following, value)


@njit(**FLAGS)
def restore_block(lower, pivots, ties, chain, ends, columns, c):
    """Back-substitute the forward-reduced columns c and c + 1 in place: H⁻¹ times the column."""
    elements, inner, nodes = lower.shape[0], lower.shape[1], pivots.shape[0]
    degree, at, to = inner + 1, c * nodes, (c + 1) * nodes
    for node in (0, nodes - 1):
        if (node == 0 and ends[0] > 0) or (node > 0 and ends[1] < elements):
            store(columns, at + node, spread(0.0))
            store(columns, to + node, spread(0.0))
    for e in range(ends[1], ends[0] - 1, -1):
        node = e * degree
        value = load(columns, at + node) * load(pivots, node)
        other = load(columns, to + node) * load(pivots, node)
        if e < ends[1]:
            value = value - load(chain, e) * load(columns, at + node + degree)
            other = other - load(chain, e) * load(columns, to + node + degree)
        store(columns, at + node, value)
        store(columns, to + node, other)
    for e in range(elements):
        start = e * degree
        stop = start + degree
        v_start, v_stop = load(columns, at + start), load(columns, at + stop)
        w_start, w_stop = load(columns, to + start), load(columns, to + stop)
        for i in range(inner - 1, -1, -1):
            node = start + 1 + i
            left, right, pivot = load(ties, node), load(ties, nodes + node), load(pivots, node)
            value = (load(columns, at + node) - left * v_start - right * v_stop) * pivot
            other = (load(columns, to + node) - left * w_start - right * w_stop) * pivot
            for j in range(i + 1, inner):
                factor = load(lower, (e * inner + j) * inner + i)
                value = value - factor * load(columns, at + start + 1 + j)
                other = other - factor * load(columns, to + start + 1 + j)
            store(columns, at + node, value)
            store(columns, to + node, other)


@njit(**FLAGS)
def pivot_signs_block(pivots, first, last, negative, ratio):
    """Count of negative pivots, and smallest over largest |pivot|, of the nodes first … last.

    A pivot that is not a number makes the ratio not a number: the caller's guard is
    ``not ratio >= bound``.
    """
    for k in range(LANES):
        count, small, large, total = 0, 0.0, np.inf, 0.0
        for i in range(first, last + 1):
            value = pivots[i, k]
            count += value < 0.0
            small = max(small, abs(value))
            large = min(large, abs(value))
            total += value
        negative[k] = count
        ratio[k] = large / small if total == total else np.nan  # noqa: PLR0124


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


@njit(**FLAGS)
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
def solve_condensed(stiffness, ends, diagonal, border, columns, rows, corner, rhs, x, negative, ratio):
    """Bordered solves ``[H B C; Bᵀ 0 …; R … D] x = rhs`` for lanes-first arrays; see `condensed`.

    diagonal (lanes, nodes); border (lanes, m, nodes); columns (lanes, k, n + m) and rows alike;
    corner (lanes, k, k); rhs (lanes, r, n + m + k); x like rhs.
    """
    elements, degree = stiffness.shape[0], stiffness.shape[1] - 1
    lanes, nodes = diagonal.shape
    m, k, r = border.shape[1], columns.shape[1], rhs.shape[1]
    first, last = min(ends[0], 1), nodes - 1 - min(elements - ends[1], 1)
    n = last - first + 1
    total = (m + k + r + TILE - 1) // TILE * TILE
    work = np.zeros((total, nodes, LANES))
    lower = np.empty((elements, degree - 1, degree - 1, LANES))
    pivots, ties = np.empty((nodes, LANES)), np.empty((2, nodes, LANES))
    chain, block = np.empty((elements + 1, LANES)), np.ones((nodes, LANES))
    signs, ratios = np.empty(LANES, np.int64), np.empty(LANES)
    for start in range(0, lanes, LANES):
        active = min(LANES, lanes - start)
        work[:] = 0.0
        for lane in range(active):
            at = start + lane
            for i in range(nodes):
                block[i, lane] = diagonal[at, i]
            for c in range(m):
                for i in range(nodes):
                    work[c, i, lane] = border[at, c, i]
            for c in range(k):
                for i in range(n):
                    work[m + c, first + i, lane] = columns[at, c, i]
            for c in range(r):
                for i in range(n):
                    work[m + k + c, first + i, lane] = rhs[at, c, i]
        reduce_block(stiffness, block, ends, work, lower, pivots, ties, chain)
        for c in range(0, total, 2):
            restore_block(lower, pivots, ties, chain, ends, work, c)
        pivot_signs_block(pivots, first, last, signs, ratios)
        for lane in range(active):
            at = start + lane
            negative[at] = signs[lane] + _close_border(
                border[at], columns[at], rows[at], corner[at], rhs[at], work, lane, first, x[at]
            )
            ratio[at] = ratios[lane]


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
