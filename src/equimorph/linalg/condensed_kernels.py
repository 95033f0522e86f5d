"""Compiled kernels of the condensed layout: a vector of lanes at a time.

One matrix H per lane is the sum of element matrices (the same for every lane) and a diagonal (its
own for every lane). Elements are chained: the last node of one is the first node of the next. Inner
nodes are eliminated inside each element; what remains is tridiagonal in the vertices. Everything is
kept as ``LDLᵀ`` so that the signs of the pivots are the inertia (Sylvester).

Work arrays have rows of lanes. Columns lie in tiles, ``columns[tile, node, slot]``: the
`TILE` slots of a node are one bundle, so that one entry of L serves eight columns while it is in a
register. The first two slots of the first tile are the *ties*, the columns of an element's inner
nodes at its left and right vertex: eliminated like any other column, they leave the Schur
complement of the vertices in their slots there.
"""

import numpy as np

from equimorph.linalg.compiled import njit
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
    stack2,
    store,
    where_less,
    work_rows,
)

# Plain integers: for a literal argument the compiler would make another copy of a kernel.
TILE, TIES, GROUP = np.int64(8), np.int64(2), np.int64(2)
USUAL = np.int64(8)
"""Inner nodes of an element of the usual degree: loops of known lengths are unrolled."""


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
    return lower, vertices, columns, work_rows(6)


@njit(**INNER)
def _factor_group(stiffness, group, diagonal, lower):
    """LDLᵀ of the inner blocks of two elements at once: one alone would wait for its divisions.

    Below the diagonal L, above it D·Lᵀ, on it the reciprocal pivots.
    """
    inner = stiffness.shape[1] - 2
    if inner == USUAL:
        _factor_inner(stiffness, group, diagonal, lower, USUAL)
    else:
        _factor_inner(stiffness, group, diagonal, lower, inner)


@njit(**{**INNER, "forceinline": True})
def _factor_inner(stiffness, group, diagonal, lower, inner):
    elements = stiffness.shape[0]
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
    for i in range(inner):
        row, at = base + i * inner * GROUP, first + i * TILE
        value = load8(columns, at)
        for j in range(i):
            factor = repeat8(load(lower, row + j * GROUP))
            value = value - factor * load8(columns, first + j * TILE)
        store(columns, at, value)
    # one after the other: sums for both vertices do not fit in the registers
    _take_out(lower, base, inner, columns, ties, first, first - TILE)
    _take_out(lower, base, inner, columns, ties + 1, first, first + inner * TILE)


@njit(**{**INNER, "forceinline": True})
def _take_out(lower, base, inner, columns, tie, first, vertex):
    """Take the inner nodes of an element out of the columns of a vertex; `tie`: its column."""
    value = load8(columns, vertex)
    for i in range(inner):
        factor = load(columns, tie + i * TILE) * load(lower, base + (i * inner + i) * GROUP)
        value = value - repeat8(factor) * load8(columns, first + i * TILE)
    store(columns, vertex, value)


@njit(**INNER)
def _note_pivots(lower, base, inner, extremes):
    """Count negative pivots of an element; note extremes, sum and product of the reciprocals.

    The product is m·2^e, with m in row 4 and e in row 5.
    """
    count, small, large = load(extremes, 0), load(extremes, 1), load(extremes, 2)
    total, product = load(extremes, 3), load(extremes, 4)
    zero, one = spread(0.0), spread(1.0)
    for i in range(inner):
        value = load(lower, base + (i * inner + i) * GROUP)
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
    store(extremes, 4, spread(1.0))
    store(extremes, 5, spread(0.0))
    store(vertices, 0, load(diagonal, 0))


@njit(**{**INNER, "forceinline": True})
def reduce_group(stiffness, group, diagonal, ends, tiles, lower, vertices, columns, extremes):
    """Factor the elements of a group and forward-reduce their columns in place.

    stiffness (elements, degree + 1, degree + 1); diagonal (nodes, 8); ends: first and last vertex
    that is unknown; columns (tiles, nodes, TILE, 8), ties left to this function. Filled: lower
    (see `lower_row`); vertices (elements + 1, 2, 8), reciprocal pivot and factor to the next;
    extremes (6, 8): see `_note_pivots`.
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
def negative_of_two(rows, start, step):
    """Negative eigenvalues of [a b; b c], by determinant and trace; rows `step` apart."""
    zero, one = spread(0.0), spread(1.0)
    a, b, c = load(rows, start), load(rows, start + 1), load(rows, start + step + 1)
    definite = where_less(a + c, zero, one + one, zero)
    return where_less(a * c - b * b, zero, one, definite)


@njit(**INNER)
def pivot_ratio(extremes, lane):
    """Smallest over largest |pivot| of a lane; not a number if a pivot is not."""
    total = extremes[3, lane]
    return extremes[1, lane] / extremes[2, lane] if total == total else np.nan  # noqa: PLR0124


@njit(**INNER)
def write_determinant(extremes, lane, determinant, at):
    """Write m and e of det = m·2^e, which the product of the reciprocal pivots has become."""
    determinant[at, 0], determinant[at, 1] = extremes[4, lane], -extremes[5, lane]
