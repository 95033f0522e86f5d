"""Compiled kernels of the rod, a vector of lanes at a time.

L = Σ ½ θᵀKθ + Σᵢ (μ mᵢ − q Rᵢ) sin θᵢ + λ mᵢ cos θᵢ − λν with quadrature weights m, load weights
R = m ρ and K the stiffness over 4π². Kernels need at least eight lanes; where these are not a
multiple of eight the last block overlaps the one before.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.condensed_kernels import (
    GROUP,
    TILE,
    add_products,
    negative_of_two,
    pivot_ratio,
    reduce_group,
    restore_element,
    start_block,
    work_arrays,
    write_determinant,
)
from equimorph.linalg.kernels import FLAGS, INNER, read_lanes, solve_lanes, write_lanes
from equimorph.linalg.simd import (
    LANES,
    absolute,
    load,
    prefetch,
    sincos,
    spread,
    stack2,
    store,
    where_less,
    work_rows,
)

ROW, FIRST, SECOND, COLUMN, FORCE = 2, 4, 5, 6, 7
"""Slots of a node: closing row; border −m sin θ and m cos θ; F_p·dp; −∂L/∂θ."""
LAMBDA, MU, Q, NU = range(4)
"""Rows of the scalars of a state."""
START, STOP, LOAD, SPAN, ROW_LAMBDA, ROW_MU, CORNER, DEFECT = range(8)
"""Rows of the closing data: velocity of θ(0), θ(1), q, ν, then the row's other entries."""
ALONG, ACROSS, CLOSE_ALONG, CLOSE_ACROSS, BALANCE, WORST, TOTAL = range(7)
"""Rows of the sums: constraints, their change by dp, residual at the last vertex, largest, sum."""
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
def _prefetch_nodes(first, second, lane, node, count):
    """Ask for as much of a block of lanes, if there is one, as some nodes take, of two batches.

    Without it, or asked for all at once, waiting for memory takes a fifth of the time of a large
    batch.
    """
    start = lane * first.shape[1] + node * LANES
    for at in range(start, min(start + count * LANES, first.size), LANES):
        prefetch(first, at)
        prefetch(second, at)


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
def _read_force(force, growth, start, n, forces, sums):
    """Fill two rows for each node with a force on it and its growth, and subtract them from sums.

    Without a force its arrays have no rows.
    """
    if force.shape[0] == 0:
        return
    read_lanes(force, start * (n + 2), n + 2, n, forces, 2, 2)
    read_lanes(growth, start * (n + 2), n + 2, n, forces, 3, 2)
    for k in range(LANES):
        at = start + k
        for a in range(2):
            sums[ALONG + a, k] -= force[at, n + a]
            sums[CLOSE_ALONG + a, k] -= growth[at, n + a]


@njit(**INNER)
def _add_force(nodes, last, forces, columns):
    """Add the force on inner nodes, and its growth, to their columns."""
    for i in range(max(nodes[0], 1), min(nodes[1], last)):
        at = i * TILE
        store(columns, at + FORCE, load(columns, at + FORCE) + load(forces, 2 * i))
        store(columns, at + COLUMN, load(columns, at + COLUMN) - load(forces, 2 * i + 1))


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


@njit(**FLAGS)
def halved(stiffness):
    """Even and odd half of every element matrix: (elements, 2, half, half).

    Nodes and weights are their own mirror image, so that K maps even vectors to even ones and odd
    to odd: ``(Kθ)ᵢ ± (Kθ)ₙ₋ᵢ`` needs ``θⱼ ± θₙ₋ⱼ`` alone, and half the products.
    """
    elements, order = stiffness.shape[0], stiffness.shape[1]
    half = (order + 1) // 2
    out = np.zeros((elements, 2, half, half))
    for e in range(elements):
        for i in range(half):
            for j in range(order // 2):
                near, far = 0.5 * stiffness[e, i, j], 0.5 * stiffness[e, i, order - 1 - j]
                out[e, 0, i, j], out[e, 1, i, j] = near + far, near - far
            if half > order // 2:  # the middle node is its own mirror image: even
                out[e, 0, i, half - 1] = 0.5 * stiffness[e, i, half - 1]
    return out


@njit(**INNER)
def _subtract_stiffness(halves, e, order, theta, columns, pairs, sums):
    """Subtract K θ of an element from the force; note the largest residual.

    pairs (order + 1): even and odd part of θ, pair by pair.
    """
    half, base = halves.shape[2], e * (order - 1)
    for j in range(half):
        near, far = load(theta, base + j), load(theta, base + order - 1 - j)
        store(pairs, 2 * j, stack2(near + far, near - far))
    worst, total = load(sums, WORST), load(sums, TOTAL)
    for i in range(half):
        even, odd = spread(0.0), spread(0.0)
        for j in range(half):
            even = even + spread(halves[e, 0, i, j]) * load(pairs, 2 * j)
            odd = odd + spread(halves[e, 1, i, j]) * load(pairs, 2 * j + 1)
        at, to = (base + i) * TILE + FORCE, (base + order - 1 - i) * TILE + FORCE
        first, second = load(columns, at) - (even + odd), load(columns, to) - (even - odd)
        if i == 0:  # the other element at the left vertex may be condensed already
            balance = absolute(load(sums, BALANCE) - (even + odd)) if e > 0 else spread(0.0)
            store(sums, BALANCE, second)
        else:
            near, far = absolute(first), absolute(second)
            balance = where_less(near, far, far, near)
        worst, total = where_less(worst, balance, balance, worst), total + first + second
        store(columns, at, first)
        store(columns, to, second)
    store(sums, WORST, worst)
    store(sums, TOTAL, total)


@njit(**INNER)
def add_end(stiffness, e, end, velocity, slot, close, columns, sums):
    """Part of F_p·dp by the velocity of a prescribed end of element `e`: 0 left, 1 right.

    To the slot of a column, and to the sums of its constraints from row `close` on.
    """
    order = stiffness.shape[1]
    base = e * (order - 1) * TILE
    for i in range(order):
        at = base + i * TILE + slot
        factor = spread(stiffness[e, i, end * (order - 1)])
        store(columns, at, load(columns, at) + factor * velocity)
    at = base + end * (order - 1) * TILE
    store(sums, close, load(sums, close) + load(columns, at + FIRST) * velocity)
    store(sums, close + 1, load(sums, close + 1) + load(columns, at + SECOND) * velocity)


@njit(**INNER)
def assemble_group(
    stiffness, halves, group, weights, loads, theta, scalars, closing_row, closing,
    diagonal, columns, pairs, sums, forces, forced,
):  # fmt: skip
    """Everything that the elements of a group need before they are reduced."""
    elements, degree = stiffness.shape[0], stiffness.shape[1] - 1
    begin, end = group * GROUP, min(group * GROUP + GROUP, elements)
    nodes = (begin * degree + (begin > 0), end * degree + 1)
    velocity = load(closing, LOAD)
    _assemble(weights, loads, nodes, theta, scalars, closing_row, velocity, diagonal, columns, sums)
    if forced:
        _add_force(nodes, elements * degree, forces, columns)
    for e in range(begin, end):
        _subtract_stiffness(halves, e, degree + 1, theta, columns, pairs, sums)
    if begin == 0:
        add_end(stiffness, 0, 0, load(closing, START), COLUMN, CLOSE_ALONG, columns, sums)
    if end == elements:
        velocity = load(closing, STOP)
        add_end(stiffness, elements - 1, 1, velocity, COLUMN, CLOSE_ALONG, columns, sums)


@njit(**INNER)
def start_sums(scalars, closing, sums, products):
    """Reset the sums over nodes of a block."""
    zero = spread(0.0)
    store(sums, ALONG, zero - load(scalars, NU))
    store(sums, ACROSS, zero)
    store(sums, CLOSE_ALONG, zero - load(closing, SPAN))
    store(sums, CLOSE_ACROSS, zero)
    store(sums, BALANCE, zero)
    store(sums, WORST, zero)
    store(sums, TOTAL, zero)
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
def _note_constraints(sums):
    """Largest residual, constraints included; not a number if one of them is not.

    Comparisons pass over what is not a number, and are much faster than a maximum that does not;
    the sum of all residuals keeps it.
    """
    along, across = absolute(load(sums, ALONG)), absolute(load(sums, ACROSS))
    total, worst = load(sums, TOTAL) + along + across, load(sums, WORST)
    worst = where_less(worst, along, along, worst)
    worst = where_less(worst, across, across, worst)
    store(sums, WORST, worst + (total - total))


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
    dz, dt, tangent_z, tangent_t, residual, index, determinant, ratio,
):  # fmt: skip
    """Fused Newton step, tangent and inertia of the rod; see `structures.contract.Advance`."""
    none = np.empty((0, z.shape[1]))
    advance_in(
        advance_work(stiffness), stiffness, ends, weights, loads, z, p, dp, row, corner, defect,
        none, none, dz, dt, tangent_z, tangent_t, residual, index, determinant, ratio,
    )  # fmt: skip


@njit(**FLAGS)
def advance_under_lanes(
    stiffness, ends, weights, loads, z, p, dp, row, corner, defect, force, growth,
    dz, dt, tangent_z, tangent_t, residual, index, determinant, ratio,
):  # fmt: skip
    """The same for F less a force on the unknowns that grows."""
    advance_in(
        advance_work(stiffness), stiffness, ends, weights, loads, z, p, dp, row, corner, defect,
        force, growth, dz, dt, tangent_z, tangent_t, residual, index, determinant, ratio,
    )  # fmt: skip


@njit(**FLAGS)
def advance_work(stiffness):
    """Work arrays of `advance_in`."""
    elements, inner = stiffness.shape[0], stiffness.shape[1] - 2
    n = elements * (inner + 1) - 1
    theta, closing_row, diagonal = work_rows(n + 3), work_rows(n + 2), work_rows(n + 2)
    scalars, closing, sums = work_rows(4), work_rows(8), work_rows(7)
    products, small, solution = work_rows(12), work_rows(15), work_rows(2 * (n + 3))
    closing_row[:] = 0.0
    return (
        theta, closing_row, diagonal, scalars, closing, sums, products, small, solution,
        *work_arrays(elements, inner, ONE_TILE), halved(stiffness), work_rows(inner + 3),
        work_rows(2 * (n + 2)),
    )  # fmt: skip


@njit(**INNER)
def advance_in(
    work, stiffness, ends, weights, loads, z, p, dp, row, corner, defect, force, growth,
    dz, dt, tangent_z, tangent_t, residual, index, determinant, ratio,
):  # fmt: skip
    """`advance_under_lanes` in work arrays; without a force its arrays have no rows.

    With H = LDLᵀ, products bᵀH⁻¹c need the forward-reduced columns only; the step and the tangent
    are combined from these before the one back-substitution.
    """
    theta, closing_row, diagonal, scalars, closing, sums, products, small, solution = work[:9]
    lower, vertices, columns, extremes, halves, pairs, forces = work[9:]
    forced, elements, inner = force.shape[0] > 0, stiffness.shape[0], stiffness.shape[1] - 2
    lanes, n = z.shape[0], z.shape[1] - 2
    for block in range(0, lanes, LANES):
        start = min(block, lanes - LANES)
        read_state(z, p, start, n, theta, scalars)
        _read_closing(dp, row, corner, defect, start, n, closing_row, closing)
        start_sums(scalars, closing, sums, products)
        _read_force(force, growth, start, n, forces, sums)
        for group in range((elements + GROUP - 1) // GROUP):
            assemble_group(
                stiffness, halves, group, weights, loads, theta, scalars, closing_row, closing,
                diagonal, columns, pairs, sums, forces, forced,
            )  # fmt: skip
            if group == 0:
                start_block(diagonal, vertices, extremes)
            reduce_group(
                stiffness, group, diagonal, ends, ONE_TILE, lower, vertices, columns, extremes
            )
            for e in range(group * GROUP, min(group * GROUP + GROUP, elements)):
                add_products(e, inner, ends, lower, vertices, columns, products)
                _prefetch_nodes(z, row, start + LANES, e * (inner + 1), inner + 1)
        _small_system(products, sums, closing, small)
        store(extremes, 0, load(extremes, 0) + negative_of_two(small, 0, SMALL_WIDTH))
        square = load(small, 0) * load(small, 6) - load(small, 1) * load(small, 5)
        store(extremes, 4, square / load(extremes, 4))
        solve_lanes(small, 3, 5)
        for e in range(elements, -1, -1):
            node = e * (inner + 1)
            _prefetch_nodes(dz, tangent_z, start, node, inner + 1)
            _combine(columns, small, (node, min(node + inner, n + 1) + 1), solution)
            restore_element(
                e, elements, inner, ends, lower, vertices, columns, solution, FIRST_ROW, SIDES
            )
        store(solution, 2 * (n + 1), stack2(load(small, 3), load(small, 4)))
        store(solution, 2 * (n + 2), stack2(load(small, 8), load(small, 9)))
        write_lanes(solution, 2, 2, dz, start * (n + 2), n + 2, n + 2)
        write_lanes(solution, 3, 2, tangent_z, start * (n + 2), n + 2, n + 2)
        _note_constraints(sums)
        for k in range(LANES):
            at = start + k
            dt[at], tangent_t[at] = small[13, k], small[14, k]
            residual[at], index[at] = sums[WORST, k], np.int64(extremes[0, k]) - 2
            write_determinant(extremes, k, determinant, at)
            ratio[at] = pivot_ratio(extremes, k)
