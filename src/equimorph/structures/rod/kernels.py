"""Compiled kernels of the rod, eight lanes at a time.

L = Σ ½ θᵀKθ + Σᵢ (μ mᵢ − q Rᵢ) sin θᵢ + λ mᵢ cos θᵢ − λν with quadrature weights m, load weights
R = m ρ and K the stiffness over 4π². Kernels need at least eight lanes; where these are not a
multiple of eight the last block overlaps the one before.
"""

import numpy as np
from numba import njit

from equimorph.linalg.condensed.kernels import (
    GROUP,
    TILE,
    add_products,
    negative_of_two,
    pivot_ratio,
    reduce_group,
    restore_element,
    start_block,
    work_arrays,
)
from equimorph.linalg.kernels import (
    FLAGS,
    INNER,
    read_lanes,
    solve_lanes,
    write_lanes,
)
from equimorph.linalg.simd import (
    LANES,
    absolute,
    larger,
    load,
    sincos,
    spread,
    stack2,
    store,
    work_rows,
)

ROW, FIRST, SECOND, COLUMN, FORCE = 2, 4, 5, 6, 7
"""Slots of a node: closing row; border −m sin θ and m cos θ; F_p·dp; −∂L/∂θ."""
LAMBDA, MU, Q, NU = range(4)
"""Rows of the scalars of a state."""
START, STOP, LOAD, SPAN, ROW_LAMBDA, ROW_MU, CORNER, DEFECT = range(8)
"""Rows of the closing data: velocity of θ(0), θ(1), q, ν, then the row's other entries."""
ALONG, ACROSS, CLOSE_ALONG, CLOSE_ACROSS, BALANCE, WORST = range(6)
"""Rows of the sums: constraints, their change by dp, residual at the last vertex, largest."""
ONE_TILE, FIRST_ROW, SIDES = np.int64(1), np.int64(0), np.int64(2)
"""Columns of a step fill one tile; step and tangent are solved side by side."""
SMALL_WIDTH = np.int64(5)
"""Width of the Schur system of (λ, μ, t) with its two right-hand sides."""


@njit(**INNER)
def read_state(z, p, start, n, theta, scalars):
    """Fill a block with the nodal angles and (λ, μ, q, ν) of lanes; theta has n + 3 rows."""
    read_lanes(z, start * (n + 2), n + 2, n + 2, theta, 1, 1)
    store(scalars, LAMBDA, load(theta, n + 1))
    store(scalars, MU, load(theta, n + 2))
    for k in range(LANES):
        theta[0, k] = p[start + k, 1] + p[start + k, 0]
        theta[n + 1, k] = p[start + k, 1] - p[start + k, 0]
        scalars[Q, k], scalars[NU, k] = p[start + k, 2], p[start + k, 3]


@njit(**INNER)
def _read_closing(dp, row, corner, defect, start, n, closing_row, closing):
    """Fill a block with the closing row and the data named by START … DEFECT."""
    read_lanes(row, start * (n + 2), n + 2, n, closing_row, 1, 1)
    for k in range(LANES):
        at = start + k
        closing[START, k], closing[STOP, k] = dp[at, 1] + dp[at, 0], dp[at, 1] - dp[at, 0]
        closing[LOAD, k], closing[SPAN, k] = dp[at, 2], dp[at, 3]
        closing[ROW_LAMBDA, k], closing[ROW_MU, k] = row[at, n], row[at, n + 1]
        closing[CORNER, k], closing[DEFECT, k] = corner[at], defect[at]


@njit(**INNER)
def _assemble(
    weights, loads, nodes, theta, scalars, closing_row, velocity, diagonal, columns, sums
):
    """Diagonal of the Hessian and columns of the nodes, without the stiffness."""
    lam, mu, q = load(scalars, LAMBDA), load(scalars, MU), load(scalars, Q)
    along, across, zero = load(sums, ALONG), load(sums, ACROSS), spread(0.0)
    for i in range(nodes[0], nodes[1]):
        sine, cosine = sincos(load(theta, i))
        m, r, at = spread(weights[i]), spread(loads[i]), i * TILE
        a, b = mu * m - q * r, lam * m
        first, second = zero - m * sine, m * cosine
        store(diagonal, i, zero - a * sine - b * cosine)
        store(columns, at + ROW, load(closing_row, i))
        store(columns, at + FIRST, first)
        store(columns, at + SECOND, second)
        store(columns, at + COLUMN, zero - velocity * r * cosine)
        store(columns, at + FORCE, b * sine - a * cosine)
        along, across = along + second, across - first
    store(sums, ALONG, along)
    store(sums, ACROSS, across)


@njit(**INNER)
def _subtract_stiffness(stiffness, e, theta, columns, sums):
    """Subtract K θ of an element from the force, two rows at a time; note the largest residual."""
    order, base = stiffness.shape[1], e * (stiffness.shape[1] - 1)
    worst = load(sums, WORST)
    for i in range(0, order, 2):
        other = min(i + 1, order - 1)
        first, second = spread(0.0), spread(0.0)
        for j in range(order):
            angle = load(theta, base + j)
            first = first + spread(stiffness[e, i, j]) * angle
            second = second + spread(stiffness[e, other, j]) * angle
        at, to = (base + i) * TILE + FORCE, (base + other) * TILE + FORCE
        if i == 0:  # the other element at this vertex may be condensed already
            balance = load(sums, BALANCE) - first
            worst = larger(worst, absolute(balance)) if e > 0 else worst
            store(columns, at, load(columns, at) - first)
        elif i < order - 1:
            first = load(columns, at) - first
            worst = larger(worst, absolute(first))
            store(columns, at, first)
        second = load(columns, to) - second
        store(columns, to, second)
        if other < order - 1:
            worst = larger(worst, absolute(second))
        else:
            store(sums, BALANCE, second)
    store(sums, WORST, worst)


@njit(**INNER)
def _add_end(stiffness, e, end, velocity, columns, sums):
    """Part of F_p·dp by the velocity of a prescribed end of element `e`: 0 left, 1 right."""
    order = stiffness.shape[1]
    base = e * (order - 1) * TILE
    for i in range(order):
        at = base + i * TILE + COLUMN
        factor = spread(stiffness[e, i, end * (order - 1)])
        store(columns, at, load(columns, at) + factor * velocity)
    at = base + end * (order - 1) * TILE
    store(sums, CLOSE_ALONG, load(sums, CLOSE_ALONG) + load(columns, at + FIRST) * velocity)
    store(sums, CLOSE_ACROSS, load(sums, CLOSE_ACROSS) + load(columns, at + SECOND) * velocity)


@njit(**INNER)
def _assemble_group(
    stiffness, group, weights, loads, theta, scalars, closing_row, closing, diagonal, columns, sums
):
    """Everything that the elements of a group need before they are reduced."""
    elements, degree = stiffness.shape[0], stiffness.shape[1] - 1
    begin, end = group * GROUP, min(group * GROUP + GROUP, elements)
    nodes = (begin * degree + (begin > 0), end * degree + 1)
    velocity = load(closing, LOAD)
    _assemble(weights, loads, nodes, theta, scalars, closing_row, velocity, diagonal, columns, sums)
    for e in range(begin, end):
        _subtract_stiffness(stiffness, e, theta, columns, sums)
    if begin == 0:
        _add_end(stiffness, 0, 0, load(closing, START), columns, sums)
    if end == elements:
        _add_end(stiffness, elements - 1, 1, load(closing, STOP), columns, sums)


@njit(**INNER)
def _start_sums(scalars, closing, sums, products):
    """Reset the sums over nodes of a block."""
    zero = spread(0.0)
    store(sums, ALONG, zero - load(scalars, NU))
    store(sums, ACROSS, zero)
    store(sums, CLOSE_ALONG, zero - load(closing, SPAN))
    store(sums, CLOSE_ACROSS, zero)
    store(sums, BALANCE, zero)
    store(sums, WORST, zero)
    for i in range(12):
        store(products, i, zero)


@njit(**INNER)
def _small_system(products, sums, closing, small):
    """Schur system of (λ, μ, t) with the two right-hand sides, in rows of five."""
    zero, one = spread(0.0), spread(1.0)
    for a in range(2):
        store(small, 5 * a, zero - load(products, 4 * a))
        store(small, 5 * a + 1, zero - load(products, 4 * a + 1))
        store(small, 5 * a + 2, load(sums, CLOSE_ALONG + a) - load(products, 4 * a + 2))
        store(small, 5 * a + 3, zero - load(sums, ALONG + a) - load(products, 4 * a + 3))
        store(small, 5 * a + 4, zero)
        store(small, 10 + a, load(closing, ROW_LAMBDA + a) - load(products, 8 + a))
    store(small, 12, load(closing, CORNER) - load(products, 10))
    store(small, 13, zero - load(closing, DEFECT) - load(products, 11))
    store(small, 14, one)


@njit(**INNER)
def _combine(columns, small, nodes, solution):
    """Reduced columns of the step and of the tangent, side by side."""
    step0, step1, step2 = load(small, 3), load(small, 8), load(small, 13)
    turn0, turn1, turn2 = load(small, 4), load(small, 9), load(small, 14)
    for i in range(nodes[0], nodes[1]):
        at = i * TILE
        first, second = load(columns, at + FIRST), load(columns, at + SECOND)
        column = load(columns, at + COLUMN)
        step = load(columns, at + FORCE) - first * step0 - second * step1 - column * step2
        turn = spread(0.0) - first * turn0 - second * turn1 - column * turn2
        store(solution, 2 * i, stack2(step, turn))


@njit(**FLAGS)
def advance_lanes(
    stiffness, ends, weights, loads, z, p, dp, row, corner, defect,
    dz, dt, tangent_z, tangent_t, residual, index, ratio,
):  # fmt: skip
    """Fused Newton step, tangent and inertia of the rod; see `structures.contract.Advance`.

    With H = LDLᵀ, products bᵀH⁻¹c need the forward-reduced columns only; the step and the tangent
    are combined from these before the one back-substitution.
    """
    elements, inner = stiffness.shape[0], stiffness.shape[1] - 2
    lanes, n = z.shape[0], z.shape[1] - 2
    theta, closing_row, diagonal = work_rows(n + 3), work_rows(n + 2), work_rows(n + 2)
    scalars, closing, sums = work_rows(4), work_rows(8), work_rows(6)
    products, small, solution = work_rows(12), work_rows(15), work_rows(2 * (n + 3))
    lower, vertices, columns, extremes = work_arrays(elements, inner, ONE_TILE)
    closing_row[:] = 0.0
    for block in range(0, lanes, LANES):
        start = min(block, lanes - LANES)
        read_state(z, p, start, n, theta, scalars)
        _read_closing(dp, row, corner, defect, start, n, closing_row, closing)
        _start_sums(scalars, closing, sums, products)
        for group in range((elements + GROUP - 1) // GROUP):
            _assemble_group(
                stiffness, group, weights, loads, theta, scalars, closing_row, closing,
                diagonal, columns, sums,
            )  # fmt: skip
            if group == 0:
                start_block(diagonal, vertices, extremes)
            reduce_group(
                stiffness, group, diagonal, ends, ONE_TILE, lower, vertices, columns, extremes
            )
            for e in range(group * GROUP, min(group * GROUP + GROUP, elements)):
                add_products(e, inner, ends, lower, vertices, columns, products)
        _small_system(products, sums, closing, small)
        store(extremes, 0, load(extremes, 0) + negative_of_two(small, 0, SMALL_WIDTH))
        solve_lanes(small, 3, 5)
        for e in range(elements, -1, -1):
            node = e * (inner + 1)
            _combine(columns, small, (node, min(node + inner, n + 1) + 1), solution)
            restore_element(
                e, elements, inner, ends, lower, vertices, columns, solution, FIRST_ROW, SIDES
            )
        store(solution, 2 * (n + 1), stack2(load(small, 3), load(small, 4)))
        store(solution, 2 * (n + 2), stack2(load(small, 8), load(small, 9)))
        write_lanes(solution, 2, 2, dz, start * (n + 2), n + 2, n + 2)
        write_lanes(solution, 3, 2, tangent_z, start * (n + 2), n + 2, n + 2)
        worst = larger(absolute(load(sums, ALONG)), absolute(load(sums, ACROSS)))
        store(sums, WORST, larger(load(sums, WORST), worst))
        for k in range(LANES):
            at = start + k
            dt[at], tangent_t[at] = small[13, k], small[14, k]
            residual[at], index[at] = sums[WORST, k], np.int64(extremes[0, k]) - 2
            ratio[at] = pivot_ratio(extremes, k)
