"""Compiled kernels of chains whose nodes also work on each other through two sums along the chain.

Beside elements and diagonal H has ``pull (W_ij sin(θ_i − θ_j) + m_i m_j Re(q exp(i(θ_i + θ_j))))``
for angles θ and weights m, with ``W_ij = ½ sign(e − f) m_i m_j`` between elements e and f; inside
an element W is given. What lies left of an element works on what follows through the vertex
between, and through ``A = Σ m v cos θ`` and ``B = Σ m v sin θ`` of what follows. Eliminated, it
leaves a symmetric matrix of these three, and three entries of each column, which the element takes
over: H costs as much as a chain whose elements have two nodes more.

Elements are eliminated from left to right; in each the inner nodes, then its left vertex. Rows of
its factor: inner nodes, left vertex, right vertex, A, B. Columns lie as in `condensed_kernels`.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.condensed_kernels import TILE
from equimorph.linalg.kernels import FLAGS, INNER, balance
from equimorph.linalg.simd import (
    absolute,
    load,
    load2,
    load4,
    load8,
    repeat2,
    repeat4,
    repeat8,
    spread,
    store,
    where_less,
    work_rows,
)


@njit(**INNER)
def coupled_width(inner):
    """Rows and columns of the factor of an element, filled up to bundles of four."""
    return (inner + 7) // 4 * 4


@njit(**FLAGS)
def coupled_arrays(elements, inner, tiles):
    """Work arrays ``cosine, sine, pull, pivots, past, carried, lower``, of no rows for 0 elements.

    cosine, sine and pivots, which are reciprocal, by node; pull has one row.
    """
    width, some = coupled_width(inner), min(elements, 1)
    nodes = elements * (inner + 1) + some
    cosine, sine, pivots = work_rows(nodes), work_rows(nodes), work_rows(nodes)
    pull, past, carried = work_rows(some), work_rows(6 * some), work_rows(2 * TILE * tiles * some)
    lower = work_rows(elements * width * width)
    lower[:] = 0.0
    return cosine, sine, pull, pivots, past, carried, lower


@njit(**INNER)
def _place(i, inner):
    """Node of an element that has row i of its factor."""
    if i < inner:
        return i + 1
    return 0 if i == inner else inner + 1


@njit(**INNER)
def start_coupled(closed, pull, past, extremes):
    """Prepare the elimination: what the closing q adds to the matrix of vertex, A and B."""
    re, im = pull * spread(closed[0]), pull * spread(closed[1])
    zero = spread(0.0)
    for row in range(3):
        store(past, row, zero)
    store(past, 3, re)
    store(past, 4, zero - im)
    store(past, 5, zero - re)
    store(extremes, 0, zero)
    store(extremes, 1, spread(np.inf))
    store(extremes, 2, zero)
    store(extremes, 3, zero)
    store(extremes, 4, spread(1.0))
    store(extremes, 5, zero)


@njit(**INNER)
def _assemble(stiffness, inside, weights, e, diagonal, cosine, sine, pull, past, lower, base):
    """Upper triangle of the matrix of an element, with what the past left; rows from `base` on."""
    inner = stiffness.shape[1] - 2
    width, start, vertex = coupled_width(inner), e * (inner + 1), inner
    half_pull = spread(0.5) * pull
    v_a, v_b = load(past, 1), load(past, 2)
    aa, ab, bb = load(past, 3), load(past, 4), load(past, 5)
    for i in range(inner + 2):
        a = _place(i, inner)
        c, s, row = load(cosine, start + a), load(sine, start + a), base + i * width
        weight = spread(weights[e, a])
        arm_c, arm_s, pressed_c, pressed_s = weight * c, weight * s, pull * c, pull * s
        by_c, by_s = aa * arm_c + ab * arm_s, ab * arm_c + bb * arm_s
        if i == vertex:
            by_c, by_s = by_c + v_a, by_s + v_b
        for j in range(i, inner + 2):
            b = _place(j, inner)
            there, beside = load(cosine, start + b), load(sine, start + b)
            value = spread(inside[e, a, b]) * (pressed_s * there - pressed_c * beside)
            value = value + spread(weights[e, b]) * (by_c * there + by_s * beside)
            value = value + spread(stiffness[e, a, b])
            if j == vertex:
                value = value + v_a * arm_c + v_b * arm_s
            store(lower, row + j, value)
        store(lower, row + inner + 2, by_c - half_pull * arm_s)
        store(lower, row + inner + 3, by_s + half_pull * arm_c)
        if i <= vertex:
            store(lower, row + i, load(lower, row + i) + load(diagonal, start + a))
    at = base + vertex * width + vertex
    store(lower, at, load(lower, at) + load(past, 0))
    at = base + (inner + 2) * (width + 1)
    store(lower, at, aa)
    store(lower, at + 1, ab)
    store(lower, at + width + 1, bb)


@njit(**INNER)
def _eliminate(lower, base, width, count, stop, pivots, node, inner):
    """Eliminate the first rows of an element; of each its row of Lᵀ remains.

    count: rows that are used. Reciprocal pivots go to `pivots` by node, from `node` on.
    """
    for k in range(stop):
        row = base + k * width
        inverse = spread(1.0) / load(lower, row + k)
        store(pivots, node + _place(k, inner), inverse)
        for j in range(k + 1, count):
            factor = load(lower, row + j) * inverse
            for at in range(j // 4 * 4, width, 4):
                change = repeat4(factor) * load4(lower, row + at)
                store(lower, base + j * width + at, load4(lower, base + j * width + at) - change)
        for j in range(k + 1, count):
            store(lower, row + j, load(lower, row + j) * inverse)


@njit(**INNER)
def note_pivots(pivots, first, stop, extremes):
    """Count negative pivots, and note the extremes, sum and product of their reciprocals."""
    count, small, large = load(extremes, 0), load(extremes, 1), load(extremes, 2)
    total, product = load(extremes, 3), load(extremes, 4)
    zero, one = spread(0.0), spread(1.0)
    for i in range(first, stop):
        value = load(pivots, i)
        size = absolute(value)
        count = count + where_less(value, zero, one, zero)
        small, large = where_less(size, small, size, small), where_less(large, size, size, large)
        total, product = total + value, product * value
    store(extremes, 0, count)
    store(extremes, 1, small)
    store(extremes, 2, large)
    store(extremes, 3, total)
    product, exponent = balance(product, load(extremes, 5))
    store(extremes, 4, product)
    store(extremes, 5, exponent)


@njit(**INNER)
def _reduce_tile(lower, base, width, stop, weights, e, cosine, sine, columns, first, carried, t):
    """Forward-substitute a tile of columns in an element; `first`: row of its left vertex."""
    inner = weights.shape[1] - 2
    start, sums = e * (inner + 1), 2 * t * TILE
    for i in range(inner + 4):
        if i < inner + 2:
            a = _place(i, inner)
            weight = spread(weights[e, a])
            value = load8(columns, first + a * TILE)
            turned = repeat8(weight * load(cosine, start + a))
            value = value + turned * load8(carried, sums)
            turned = repeat8(weight * load(sine, start + a))
            value = value + turned * load8(carried, sums + TILE)
        else:
            value = load8(carried, sums + (i - inner - 2) * TILE)
        for k in range(min(i, stop)):
            factor = repeat8(load(lower, base + k * width + i))
            value = value - factor * load8(columns, first + _place(k, inner) * TILE)
        if i < inner + 2:
            store(columns, first + _place(i, inner) * TILE, value)
        else:
            store(carried, sums + (i - inner - 2) * TILE, value)


@njit(**INNER)
def reduce_coupled(stiffness, ends, coupling, arrays, diagonal, tiles, columns, extremes):
    """Factor H of all lanes and forward-reduce the columns in place.

    coupling: W inside of elements, weights and q; arrays: those of `coupled_arrays`, with cosine,
    sine and pull filled; diagonal by node.
    """
    inside, weights, closed = coupling
    cosine, sine, pull, pivots, past, carried, lower = arrays
    elements, inner = stiffness.shape[0], stiffness.shape[1] - 2
    width, rows = coupled_width(inner), columns.shape[0] // tiles
    start_coupled(closed, load(pull, 0), past, extremes)
    carried[:] = 0.0
    for e in range(elements):
        base, node = e * width * width, e * (inner + 1)
        stop = inner + 1 if e >= ends[0] else inner
        _assemble(
            stiffness, inside, weights, e, diagonal, cosine, sine, load(pull, 0), past, lower, base
        )
        _eliminate(lower, base, width, inner + 4, stop, pivots, node, inner)
        note_pivots(pivots, node + inner + 1 - stop, node + inner + 1, extremes)
        for t in range(tiles):
            _reduce_tile(
                lower, base, width, stop, weights, e, cosine, sine, columns,
                t * rows + node * TILE, carried, t,
            )  # fmt: skip
        at, row = 0, base + (inner + 1) * (width + 1)
        for i in range(3):
            for j in range(3 - i):
                store(past, at, load(lower, row + i * (width + 1) + j))
                at += 1
    if ends[1] == elements:
        last = elements * (inner + 1)
        store(pivots, last, spread(1.0) / (load(past, 0) + load(diagonal, last)))
        note_pivots(pivots, last, last + 1, extremes)


@njit(**INNER)
def restore_coupled(ends, coupling, arrays, values):
    """Back-substitute two forward-reduced columns, side by side in `values`, two rows a node."""
    _, weights, _ = coupling
    cosine, sine, _, pivots, _, _, lower = arrays
    elements, inner = weights.shape[0], weights.shape[1] - 2
    width, last, zero = coupled_width(inner), elements * (inner + 1), repeat2(spread(0.0))
    if ends[1] == elements:
        store(values, 2 * last, load2(values, 2 * last) * repeat2(load(pivots, last)))
    else:
        store(values, 2 * last, zero)
    if ends[0] > 0:
        store(values, 0, zero)
    a, b = zero, zero
    for e in range(elements - 1, -1, -1):
        base, node = e * width * width, e * (inner + 1)
        for k in range(inner if e >= ends[0] else inner - 1, -1, -1):
            at, row = node + _place(k, inner), base + k * width
            value = load2(values, 2 * at) * repeat2(load(pivots, at))
            for j in range(k + 1, inner + 2):
                there = load2(values, 2 * (node + _place(j, inner)))
                value = value - repeat2(load(lower, row + j)) * there
            value = value - repeat2(load(lower, row + inner + 2)) * a
            value = value - repeat2(load(lower, row + inner + 3)) * b
            store(values, 2 * at, value)
        for i in range(inner + 2):
            weighted = repeat2(spread(weights[e, i])) * load2(values, 2 * (node + i))
            a = a + repeat2(load(cosine, node + i)) * weighted
            b = b + repeat2(load(sine, node + i)) * weighted
