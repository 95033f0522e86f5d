"""Compiled kernels of the chain of vertices of a rod in space, and of its closures.

Coordinates along which there is no closure have one of their own with a multiplier −1.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import INNER, balance
from equimorph.linalg.simd import (
    LANES,
    absolute,
    load,
    load2,
    repeat2,
    spread,
    stack2,
    store,
    where_less,
)
from equimorph.structures.spatial.force_kernels import BORDER, COLUMN, FORCE, ROW
from equimorph.structures.spatial.node_kernels import (
    COUNT,
    EXCESS,
    EXPONENT,
    INVERSE,
    LARGE,
    PRODUCT,
    RADIAL,
    RADII,
    SMALL,
    SOFT,
    TOTAL,
    stretch_of,
)

INLINE = {**INNER, "forceinline": True}
"""Flags of kernels whose loops are unrolled where they are called, by constants there."""
SHARES = 9
"""Rows of one row of a vertex: three of its own block, then the border."""
SYSTEM = np.int64(6)
"""Width of the system of three closures and the load with its two right-hand sides."""


@njit(**INLINE)
def to_vertices(e, inner, size, width, matrix, base, border, vertices, ties):
    """Add what remains of an element to the rows of its vertices, which have `border` columns."""
    shares = 3 + border
    for side in range(2):
        for r in range(3):
            row, to = base + (inner + 3 * side + r) * width, (3 * (e + side) + r) * shares
            for c in range(r, 3):
                own = load(matrix, row + inner + 3 * side + c)
                store(vertices, to + c, load(vertices, to + c) + own)
            for c in range(border):
                value = load(matrix, row + size + c)
                store(vertices, to + 3 + c, load(vertices, to + 3 + c) + value)
    for r in range(3):
        for c in range(3):
            tie = load(matrix, base + (inner + r) * width + inner + 3 + c)
            store(ties, 9 * e + 3 * r + c, tie)


@njit(**INNER)
def complete_vertex(v, node, radii, row, slopes, vertices):
    """Take the length of a vertex out of its rows; write its part of the closing row."""
    inverse, soft = load(radii, RADII * node + INVERSE), load(radii, RADII * node + SOFT)
    growth = load(radii, RADII * node + EXCESS) * soft
    share = load(radii, RADII * node + RADIAL) * inverse * soft
    square, stretch = inverse * inverse * soft, stretch_of(radii, node)
    for k in range(3):
        slope, to = load(slopes, 3 * node + k), (3 * v + k) * SHARES
        for j in range(k, 3):
            own = load(vertices, to + j) - square * slope * load(slopes, 3 * node + j)
            store(vertices, to + j, own + stretch if j == k else own)
        store(vertices, to + 3 + FORCE, load(vertices, to + 3 + FORCE) - growth * slope)
        own = load(vertices, to + 3 + ROW) + share * slope
        store(vertices, to + 3 + ROW, own + load(row, 4 * node + k))


@njit(**INLINE)
def eliminate_vertex(v, last, border, left, vertices, ties, products, extremes):
    """Eliminate the rotation of a vertex from the next one and from the border.

    products: of the first `left` columns of the border with those from there on, `border` a row.
    """
    shares = 3 + border
    one = spread(1.0)
    for k in range(3):
        row = (3 * v + k) * shares
        inverse = one / load(vertices, row + k)
        store(vertices, row + k, inverse)
        note_pivot(inverse, extremes)
        for i in range(k + 1, 3):
            factor, to = load(vertices, row + i) * inverse, (3 * v + i) * shares
            for j in range(i, shares):
                store(vertices, to + j, load(vertices, to + j) - factor * load(vertices, row + j))
            if v < last:
                tie, here = 9 * v + 3 * i, 9 * v + 3 * k
                for j in range(3):
                    store(ties, tie + j, load(ties, tie + j) - factor * load(ties, here + j))
        if v < last:
            for i in range(3):
                factor = load(ties, 9 * v + 3 * k + i) * inverse
                to = (3 * v + 3 + i) * shares
                for j in range(i, 3):
                    own = load(vertices, to + j) - factor * load(ties, 9 * v + 3 * k + j)
                    store(vertices, to + j, own)
                for j in range(3, shares):
                    own = load(vertices, to + j) - factor * load(vertices, row + j)
                    store(vertices, to + j, own)
        for a in range(left):
            factor = load(vertices, row + 3 + a) * inverse
            for c in range(a, border):
                at = border * a + c
                store(products, at, load(products, at) + factor * load(vertices, row + 3 + c))


@njit(**INNER)
def spring_vertices(springs, start, shares, vertices):
    """Add the spring of each lane to its vertex."""
    for lane in range(LANES):
        v = int(springs[start + lane, 0])
        for k in range(3):
            for j in range(k, 3):
                stiffness = springs[start + lane, 1 + k] * springs[start + lane, 1 + j]
                vertices[(3 * v + k) * shares + j, lane] += stiffness


@njit(**INNER)
def note_pivot(inverse, extremes):
    """Count a negative pivot; note extremes, sum and product of the reciprocals.

    The product is balanced by `balance_pivots`, once an element.
    """
    zero, one, size = spread(0.0), spread(1.0), absolute(inverse)
    count, small, large = load(extremes, COUNT), load(extremes, SMALL), load(extremes, LARGE)
    store(extremes, COUNT, count + where_less(inverse, zero, one, zero))
    store(extremes, SMALL, where_less(size, small, size, small))
    store(extremes, LARGE, where_less(large, size, size, large))
    store(extremes, TOTAL, load(extremes, TOTAL) + inverse)
    store(extremes, PRODUCT, load(extremes, PRODUCT) * inverse)


@njit(**INNER)
def balance_pivots(extremes):
    """Keep the product of the reciprocal pivots within the range of numbers."""
    product, exponent = balance(load(extremes, PRODUCT), load(extremes, EXPONENT))
    store(extremes, PRODUCT, product)
    store(extremes, EXPONENT, exponent)


@njit(**INNER)
def close_system(axes, compliant, products, width, system, small):
    """Schur complement of the closures, in rows of `system`; rows of products have `width`."""
    for a in range(3):
        for c in range(3):
            low, high = min(a, c), max(a, c)
            value = load(compliant, 3 * a + c)
            if axes[a] >= 0 and axes[c] >= 0:
                value = value - load(products, width * low + high)
            store(small, a * system + c, value)


@njit(**INNER)
def small_system(axes, compliant, products, closing, rates, row, given, small):
    """Schur system of the closures and the load, in rows of `SYSTEM`; given: corner and defect."""
    close_system(axes, compliant, products, BORDER, SYSTEM, small)
    zero = spread(0.0)
    for a in range(3):
        at = a * SYSTEM
        if axes[a] < 0:
            for c in range(3, SYSTEM):
                store(small, at + c, zero)
            store(small, 3 * SYSTEM + a, zero)
            continue
        store(small, at + 3, load(rates, a) - load(products, BORDER * a + COLUMN))
        store(small, at + 4, zero - load(closing, a) - load(products, BORDER * a + FORCE))
        store(small, at + 5, zero)
        store(small, 3 * SYSTEM + a, load(row, a) - load(products, BORDER * a + ROW))
    at = 3 * SYSTEM
    store(small, at + 3, load(given, 0) - load(products, BORDER * COLUMN + ROW))
    store(small, at + 4, zero - load(given, 1) - load(products, BORDER * FORCE + ROW))
    store(small, at + 5, spread(1.0))


@njit(**INNER)
def note_closures(small, system, extremes):
    """Count negative eigenvalues of the closures' block, by the signs of its invariants; det."""
    a, b, c = load(small, 0), load(small, 1), load(small, 2)
    d, e, f = load(small, system + 1), load(small, system + 2), load(small, 2 * system + 2)
    zero, one = spread(0.0), spread(1.0)
    first, second = a + d + f, a * d - b * b + a * f - c * c + d * f - e * e
    third = a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d)
    # changes of sign in x³ − first x² + second x − third, at −x
    count, sign = zero, one
    for value in (first, second, third):
        count = count + where_less(sign * value, zero, one, zero)
        sign = where_less(value, zero, zero - one, one)
    store(extremes, COUNT, load(extremes, COUNT) + count)
    store(extremes, PRODUCT, third / load(extremes, PRODUCT))


@njit(**INNER)
def restore_vertex(v, last, node, after, vertices, ties, small, turns):
    """Back-substitute step and tangent at a vertex; turns: six rows a node, in pairs."""
    for k in range(2, -1, -1):
        row = (3 * v + k) * SHARES
        pair = reduced(vertices, row + 3, small)
        for j in range(k + 1, 3):
            pair = pair - repeat2(load(vertices, row + j)) * load2(turns, 6 * node + 2 * j)
        if v < last:
            for j in range(3):
                tie = repeat2(load(ties, 9 * v + 3 * k + j))
                pair = pair - tie * load2(turns, 6 * after + 2 * j)
        store(turns, 6 * node + 2 * k, pair * repeat2(load(vertices, row + k)))


@njit(**INNER)
def reduced(rows, at, small):
    """Right-hand sides of step and tangent, a pair of rows, from reduced border columns."""
    pair = stack2(load(rows, at + FORCE), spread(0.0))
    for c in range(4):
        column = load(rows, at + (c if c < 3 else COLUMN))
        pair = pair - repeat2(column) * load2(small, c * SYSTEM + 4)
    return pair


@njit(**INNER)
def restore_inner(inner, size, first, places, width, matrix, base, pivots, at, small, turns):
    """Back-substitute step and tangent at the inner nodes of an element."""
    for i in range(inner - 3, -1, -3):
        row = base + i * width
        below, last = row + width, row + 2 * width
        a, b = reduced(matrix, row + size, small), reduced(matrix, below + size, small)
        c = reduced(matrix, last + size, small)
        for j in range(i + 3, size):
            turn = load2(turns, 6 * (first + places[j // 3]) + 2 * (j % 3))
            a = a - repeat2(load(matrix, row + j)) * turn
            b = b - repeat2(load(matrix, below + j)) * turn
            c = c - repeat2(load(matrix, last + j)) * turn
        c = c * repeat2(load(pivots, at + i + 2))
        b = (b - repeat2(load(matrix, below + i + 2)) * c) * repeat2(load(pivots, at + i + 1))
        a = a - repeat2(load(matrix, row + i + 1)) * b - repeat2(load(matrix, row + i + 2)) * c
        to = 6 * (first + places[i // 3])
        store(turns, to, a * repeat2(load(pivots, at + i)))
        store(turns, to + 2, b)
        store(turns, to + 4, c)
