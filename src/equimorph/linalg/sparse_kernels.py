"""Compiled elimination of sparse symmetric matrices, a vector of lanes at a time."""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import (
    FLAGS,
    INNER,
    balance,
    read_lanes,
    solve_lanes,
    write_lanes,
)
from equimorph.linalg.simd import (
    LANES,
    absolute,
    larger,
    load,
    spread,
    store,
    where_less,
    work_rows,
)


@njit(**INNER)
def eliminate(start, rows, alike, target, factors, columns):
    """LDLᵀ in place without pivoting, the last pivot left alone.

    `factors` holds the pivots, then the columns of L one after the other, whose rows ascend.
    Columns with the same rows below follow each other: alike[0] counts those of a group after each;
    `target` has, from alike[1] on, the places that each pair of entries below the group updates.
    `columns` has room for the longest column. Returns
    (number of negative pivots, largest change of a diagonal entry, m, e of their product m·2^e).
    """
    size = len(start) - 1
    negative, growth = spread(0.0), spread(0.0)
    zero, one = spread(0.0), spread(1.0)
    product, exponent = one, zero
    for k in range(size - 1):
        pivot = load(factors, k)
        product, exponent = balance(product * pivot, exponent)
        negative = negative + where_less(pivot, zero, one, zero)
        inverse = one / pivot
        first, count = start[k], start[k + 1] - start[k]
        group, pair = alike[0, k], alike[1, k]
        for i in range(count):
            column, own = load(factors, size + first + i), rows[first + i]
            store(columns, i, column)
            factor = column * inverse
            store(factors, size + first + i, factor)
            growth = larger(growth, absolute(factor * column))
            store(factors, own, load(factors, own) - factor * column)
            for j in range(min(i, group)):
                at = size + start[k + 1 + j] + i - j - 1
                store(factors, at, load(factors, at) - factor * load(columns, j))
            for j in range(group, i):
                at = target[pair]
                store(factors, at, load(factors, at) - factor * load(columns, j))
                pair += 1
    return negative, growth, product, exponent


@njit(**INNER)
def forward(start, rows, factors, x, width):
    """L⁻¹ x for `width` columns side by side: x (size · width, 8)."""
    size = len(start) - 1
    for k in range(size - 1):
        for at in range(start[k], start[k + 1]):
            factor, row = load(factors, size + at), rows[at] * width
            for c in range(width):
                store(x, row + c, load(x, row + c) - factor * load(x, k * width + c))


@njit(**INNER)
def close(factors, x, tail, size, k, sides):
    """Solve the last pivot together with the border by Gauss with partial pivoting.

    x holds, per row, k columns of the border, its k rows and the right sides, all forward-reduced.
    On return the right sides hold Lᵀ times the solution; the border's unknowns are left in `tail`.
    """
    width, across = 2 * k + sides, k + 1 + sides
    last = (size - 1) * width
    store(tail, 0, load(factors, size - 1))
    for c in range(k):
        store(tail, 1 + c, load(x, last + c))
        store(tail, (1 + c) * across, load(x, last + k + c))
    for c in range(sides):
        store(tail, 1 + k + c, load(x, last + 2 * k + c))
    for i in range(size - 1):
        inverse = spread(1.0) / load(factors, i)
        for a in range(k):
            row = load(x, i * width + k + a) * inverse
            for c in range(k):
                at = (1 + a) * across + 1 + c
                store(tail, at, load(tail, at) - row * load(x, i * width + c))
            for c in range(sides):
                at = (1 + a) * across + 1 + k + c
                store(tail, at, load(tail, at) - row * load(x, i * width + 2 * k + c))
    solve_lanes(tail, k + 1, across)
    for c in range(sides):
        store(x, last + 2 * k + c, load(tail, 1 + k + c))
    for i in range(size - 1):
        inverse = spread(1.0) / load(factors, i)
        for c in range(sides):
            at = i * width + 2 * k + c
            total = load(x, at)
            for a in range(k):
                unknown = load(tail, (1 + a) * across + 1 + k + c)
                total = total - load(x, i * width + a) * unknown
            store(x, at, total * inverse)


@njit(**INNER)
def backward(start, rows, factors, x, width, first):
    """L⁻ᵀ x for the columns from `first` on."""
    size = len(start) - 1
    for k in range(size - 2, -1, -1):
        for at in range(start[k], start[k + 1]):
            factor, row = load(factors, size + at), rows[at] * width
            for c in range(first, width):
                store(x, k * width + c, load(x, k * width + c) - factor * load(x, row + c))


@njit(**FLAGS)
def solve_sparse(
    start, rows, alike, target, scatter, order, values, columns, border_rows, corner, rhs,
    x, negative, growth, determinant,
):  # fmt: skip
    """Bordered solutions, inertia, growth and determinant of all lanes: `SparseLayout.solve`."""
    lanes, entries = values.shape
    size, k, sides = len(order), columns.shape[1], rhs.shape[1]
    width, across, full = 2 * k + sides, k + 1 + sides, size + k
    longest = 0
    for i in range(size):
        longest = max(longest, start[i + 1] - start[i])
    raw, factors = work_rows(max(entries, full)), work_rows(size + len(rows))
    column, part = work_rows(longest + 2), work_rows(size * width)
    tail = work_rows((k + 1) * across)
    for block in range(0, lanes, LANES):
        lane = min(block, lanes - LANES)
        read_lanes(values, lane * entries, entries, entries, raw, 0, 1)
        factors[:] = 0.0
        largest = spread(1e-300)
        for e in range(entries):
            value = load(raw, e)
            store(factors, scatter[e], value)
            largest = larger(largest, absolute(value))
        found = eliminate(start, rows, alike, target, factors, column)
        below, grown, product, exponent = found
        one, zero = spread(1.0), spread(0.0)
        below = below + where_less(load(factors, size - 1), zero, one, zero)
        store(column, 0, below)
        for i in range(LANES):
            negative[lane + i] = np.int64(column[0, i])
        store(column, 0, grown / largest)
        for i in range(LANES):
            growth[lane + i] = column[0, i]
        store(column, 0, product * load(factors, size - 1))
        store(column, 1, exponent)
        for i in range(LANES):
            determinant[lane + i, 0], determinant[lane + i, 1] = column[0, i], column[1, i]
        if sides == 0:
            continue
        for c in range(k):
            for a in range(k):
                for i in range(LANES):
                    tail[(1 + c) * across + 1 + a, i] = corner[lane + i, c, a]
        for c in range(width):
            if c < k:
                read_lanes(columns, (lane * k + c) * size, k * size, size, raw, 0, 1)
            elif c < 2 * k:
                at = (lane * k + c - k) * size
                read_lanes(border_rows, at, k * size, size, raw, 0, 1)
            else:
                at = (lane * sides + c - 2 * k) * full
                read_lanes(rhs, at, sides * full, full, raw, 0, 1)
                for a in range(k):
                    store(tail, (1 + a) * across + 1 + k + c - 2 * k, load(raw, size + a))
            for i in range(size):
                store(part, i * width + c, load(raw, order[i]))
        forward(start, rows, factors, part, width)
        close(factors, part, tail, size, k, sides)
        backward(start, rows, factors, part, width, 2 * k)
        for c in range(sides):
            for i in range(size):
                store(raw, order[i], load(part, i * width + 2 * k + c))
            for a in range(k):
                store(raw, size + a, load(tail, (1 + a) * across + 1 + k + c))
            write_lanes(raw, 0, 1, x, (lane * sides + c) * full, sides * full, full)
