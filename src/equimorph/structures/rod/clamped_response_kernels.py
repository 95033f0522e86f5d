"""Compiled kernel of the rod: a Newton step at fixed parameters, with tangents along directions.

All columns of up to `MOST` directions fit one tile beside those of the step, so that the tangents
cost little more than the step alone.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.condensed_kernels import (
    GROUP,
    TILE,
    lower_row,
    negative_of_two,
    pivot_ratio,
    reduce_group,
    restore_element,
    start_block,
    write_determinant,
)
from equimorph.linalg.kernels import FLAGS, INNER, solve_lanes, write_lanes
from equimorph.linalg.simd import (
    LANES,
    load,
    load2,
    load4,
    repeat2,
    repeat4,
    spread,
    store,
    work_rows,
)
from equimorph.structures.rod.clamped_kernels import (
    ALONG,
    CLOSE_ALONG,
    COLUMN,
    FIRST,
    FORCE,
    LOAD,
    ONE_TILE,
    ROW,
    SECOND,
    SPAN,
    START,
    STOP,
    TOTAL,
    add_end,
    advance_work,
    assemble_group,
    read_state,
    start_sums,
)

MOST = 3
"""Most directions."""
SIDES = np.int64(4)
"""Columns that are substituted back side by side: the step, and the tangents."""
WIDTH = np.int64(2) + SIDES
"""Width of the Schur system of (λ, μ) with its right-hand sides."""
DATA = np.int64(8)
"""Rows of the closing data of a direction, of which those of a row stay zero."""
MORE = np.int64(TOTAL + 1)
"""Row of the sums from which on the constraints of further directions change."""
FIRST_PAIR, SECOND_PAIR = np.int64(0), np.int64(2)


@njit(**INNER)
def _slot(c):
    """Slot of a node for the column of direction `c`."""
    return COLUMN if c == 0 else ROW + c - 1


@njit(**INNER)
def _close(c):
    """Row of the sums of the constraints' changes by direction `c`."""
    return CLOSE_ALONG if c == 0 else MORE + 2 * (c - 1)


@njit(**INNER)
def _read_directions(directions, start, closing, sums):
    """Fill a block with the velocities of the ends, the load and the span along directions."""
    for c in range(MOST):
        at = c * DATA
        for k in range(LANES):
            lane = start + k
            if c < directions.shape[1]:
                turn, lean = directions[lane, c, 0], directions[lane, c, 1]
                closing[at + START, k], closing[at + STOP, k] = lean + turn, lean - turn
                closing[at + LOAD, k] = directions[lane, c, 2]
                closing[at + SPAN, k] = directions[lane, c, 3]
        if c > 0:
            row = _close(c)
            store(sums, row, spread(0.0) - load(closing, at + SPAN))
            store(sums, row + 1, spread(0.0))


@njit(**INNER)
def _add_directions(stiffness, group, rho, closing, columns, sums):
    """Columns of the directions after the first in the elements of a group."""
    elements, degree = stiffness.shape[0], stiffness.shape[1] - 1
    begin, end = group * GROUP, min(group * GROUP + GROUP, elements)
    for c in range(1, MOST):
        slot, close, at = _slot(c), _close(c), c * DATA
        velocity = load(closing, at + LOAD)
        for i in range(begin * degree + (begin > 0), end * degree + 1):
            value = spread(0.0) - velocity * spread(rho[i]) * load(columns, i * TILE + SECOND)
            store(columns, i * TILE + slot, value)
        if begin == 0:
            add_end(stiffness, 0, 0, load(closing, at + START), slot, close, columns, sums)
        if end == elements:
            velocity = load(closing, at + STOP)
            add_end(stiffness, elements - 1, 1, velocity, slot, close, columns, sums)


@njit(**INNER)
def _add_products(e, inner, ends, lower, vertices, columns, products):
    """Add vertex `e` and its element to bᵀH⁻¹c of forward-reduced columns, b those of (λ, μ).

    products (12, 8): with slots 4 to 7, then 2 and 3, of the first b; then of the second.
    """
    first, second = load4(products, 0), load4(products, 6)
    first_more, second_more = load2(products, 4), load2(products, 10)
    base, start = lower_row(e, inner), e * (inner + 1) * TILE
    for i in range(0 if ends[0] <= e <= ends[1] else 1, inner + 1):
        at = start + i * TILE
        pivot = load(vertices, 2 * e)
        if i > 0:
            pivot = load(lower, base + (i - 1) * (inner + 1) * GROUP)
        many, more = load4(columns, at + FIRST), load2(columns, at + ROW)
        a, b = load(columns, at + FIRST) * pivot, load(columns, at + SECOND) * pivot
        first, second = first + repeat4(a) * many, second + repeat4(b) * many
        first_more, second_more = first_more + repeat2(a) * more, second_more + repeat2(b) * more
    store(products, 0, first)
    store(products, 6, second)
    store(products, 4, first_more)
    store(products, 10, second_more)


@njit(**INNER)
def _small_system(products, sums, small):
    """Schur system of (λ, μ) with the right-hand sides of the step and of the tangents."""
    zero = spread(0.0)
    for a in range(2):
        row, known = a * WIDTH, 6 * a
        store(small, row, zero - load(products, known))
        store(small, row + 1, zero - load(products, known + 1))
        store(small, row + 2, zero - load(sums, ALONG + a) - load(products, known + 3))
        for c in range(MOST):
            product = load(products, known + (2 if c == 0 else 3 + c))
            store(small, row + 3 + c, product - load(sums, _close(c) + a))


@njit(**INNER)
def _combine(columns, small, begin, end, solution):
    """Reduced columns of the step and of the tangents, side by side."""
    for i in range(begin, end):
        at, to = i * TILE, i * SIDES
        first, second = load(columns, at + FIRST), load(columns, at + SECOND)
        for side in range(SIDES):
            slot = FORCE if side == 0 else _slot(side - 1)
            value = load(columns, at + slot)
            if side > 0:
                value = spread(0.0) - value
            value = value - first * load(small, 2 + side) - second * load(small, WIDTH + 2 + side)
            store(solution, to + side, value)


@njit(**FLAGS)
def respond_lanes(
    stiffness, ends, weights, loads, z, p, directions,
    dz, tangents, index, determinant, ratio,
):  # fmt: skip
    """Newton step, inertia, and tangents (lanes, k, size) along directions, k ≤ `MOST`.

    Without directions only the inertia is told, which needs no substitution back.
    """
    work = advance_work(stiffness)
    theta, closing_row, diagonal, scalars = work[:4]
    lower, vertices, columns, extremes, halves, pairs, forces = work[9:]
    elements, inner = stiffness.shape[0], stiffness.shape[1] - 2
    (lanes, k, _), n = directions.shape, z.shape[1] - 2
    products, small, closing = work[6], work_rows(2 * WIDTH), work_rows(MOST * DATA)
    sums = work_rows(MORE + 2 * (MOST - 1))
    solution, rho = work_rows((n + 4) * SIDES), loads / weights
    closing[:] = 0.0
    for block in range(0, lanes, LANES):
        start = min(block, lanes - LANES)
        read_state(z, p, start, n, theta, scalars)
        _read_directions(directions, start, closing, sums)
        start_sums(scalars, closing, sums, products)
        for group in range((elements + GROUP - 1) // GROUP):
            assemble_group(
                stiffness, halves, group, weights, loads, theta, scalars, closing_row, closing,
                diagonal, columns, pairs, sums, forces, False,
            )  # fmt: skip
            _add_directions(stiffness, group, rho, closing, columns, sums)
            if group == 0:
                start_block(diagonal, vertices, extremes)
            reduce_group(
                stiffness, group, diagonal, ends, ONE_TILE, lower, vertices, columns, extremes
            )
            for e in range(group * GROUP, min(group * GROUP + GROUP, elements)):
                _add_products(e, inner, ends, lower, vertices, columns, products)
        _small_system(products, sums, small)
        store(extremes, 0, load(extremes, 0) + negative_of_two(small, 0, WIDTH))
        square = load(small, 0) * load(small, WIDTH + 1) - load(small, 1) * load(small, WIDTH)
        store(extremes, 4, square / load(extremes, 4))
        for lane in range(LANES):
            at = start + lane
            index[at] = np.int64(extremes[0, lane]) - 2
            write_determinant(extremes, lane, determinant, at)
            ratio[at] = pivot_ratio(extremes, lane)
        if k == 0:
            continue
        solve_lanes(small, 2, WIDTH)
        for e in range(elements, -1, -1):
            node = e * (inner + 1)
            _combine(columns, small, node, min(node + inner, n + 1) + 1, solution)
            restore_element(
                e, elements, inner, ends, lower, vertices, columns, solution, FIRST_PAIR, SIDES
            )
            if k > 1:
                restore_element(
                    e, elements, inner, ends, lower, vertices, columns, solution, SECOND_PAIR,
                    SIDES,
                )  # fmt: skip
        for side in range(k + 1):
            for a in range(2):
                store(solution, (n + 1 + a) * SIDES + side, load(small, a * WIDTH + 2 + side))
        write_lanes(solution, SIDES, SIDES, dz, start * (n + 2), n + 2, n + 2)
        for c in range(k):
            position = (start * k + c) * (n + 2)
            write_lanes(solution, SIDES + 1 + c, SIDES, tangents, position, k * (n + 2), n + 2)
