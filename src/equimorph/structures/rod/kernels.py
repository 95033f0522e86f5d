"""Compiled kernels of the rod, eight lanes at a time.

L = Σ ½ θᵀKθ + Σᵢ (μ mᵢ − q Rᵢ) sin θᵢ + λ mᵢ cos θᵢ − λν with quadrature weights m, load weights
R = m ρ and K the stiffness over 4π². Kernels need at least eight lanes; where these are not a
multiple of eight the last block overlaps the one before.
"""

import numpy as np
from numba import njit

from equimorph.linalg.kernels import (
    FLAGS,
    GROUP,
    INNER,
    TILE,
    add_products,
    pivot_ratio,
    reduce_group,
    restore_element,
    solve_lanes,
    start_block,
    work_arrays,
)
from equimorph.linalg.simd import (
    LANES,
    absolute,
    lanes_less,
    larger,
    load,
    sincos,
    spread,
    stack2,
    store,
    transpose,
    where_less,
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
FOUR_PI_SQUARED = 4.0 * np.pi**2


@njit(**INNER)
def _read(source, start, count, target, row, step):
    """Read the first entries of lanes of a lanes-first array into rows `step` apart."""
    width = source.shape[1]
    if count < LANES:
        for i in range(count):
            for k in range(LANES):
                target[row + i * step, k] = source[start + k, i]
    else:
        for block in range(0, count, LANES):
            i = min(block, count - LANES)
            at = (row + i * step) * LANES
            transpose(source, start * width + i, width, target, at, step * LANES)


@njit(**INNER)
def _write(source, row, step, target, start):
    """Write rows `step` apart into lanes of a lanes-first array."""
    width = target.shape[1]
    if width < LANES:
        for i in range(width):
            for k in range(LANES):
                target[start + k, i] = source[row + i * step, k]
    else:
        for block in range(0, width, LANES):
            i = min(block, width - LANES)
            at = (row + i * step) * LANES
            transpose(source, at, step * LANES, target, start * width + i, width)


@njit(**INNER)
def _read_state(z, p, start, n, theta, scalars):
    """Fill a block with the nodal angles and (λ, μ, q, ν) of lanes; theta has n + 3 rows."""
    _read(z, start, n + 2, theta, 1, 1)
    store(scalars, LAMBDA, load(theta, n + 1))
    store(scalars, MU, load(theta, n + 2))
    for k in range(LANES):
        theta[0, k] = p[start + k, 1] + p[start + k, 0]
        theta[n + 1, k] = p[start + k, 1] - p[start + k, 0]
        scalars[Q, k], scalars[NU, k] = p[start + k, 2], p[start + k, 3]


@njit(**INNER)
def _read_closing(dp, row, corner, defect, start, n, closing_row, closing):
    """Fill a block with the closing row and the data named by START … DEFECT."""
    _read(row, start, n, closing_row, 1, 1)
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
def _negative_of_two(small):
    """Negative eigenvalues of the leading 2 × 2 block, by its determinant and trace."""
    zero, one = spread(0.0), spread(1.0)
    a, b, c = load(small, 0), load(small, 1), load(small, 6)
    determinant = a * c - b * b
    definite = where_less(a + c, zero, one + one, zero)
    return where_less(determinant, zero, one, definite)


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
    lower, vertices, columns, extremes = work_arrays(elements, inner, 1)
    closing_row[:] = 0.0
    for block in range(0, lanes, LANES):
        start = min(block, lanes - LANES)
        _read_state(z, p, start, n, theta, scalars)
        _read_closing(dp, row, corner, defect, start, n, closing_row, closing)
        _start_sums(scalars, closing, sums, products)
        for group in range((elements + GROUP - 1) // GROUP):
            _assemble_group(
                stiffness, group, weights, loads, theta, scalars, closing_row, closing,
                diagonal, columns, sums,
            )  # fmt: skip
            if group == 0:
                start_block(diagonal, vertices, extremes)
            reduce_group(stiffness, group, diagonal, ends, 1, lower, vertices, columns, extremes)
            for e in range(group * GROUP, min(group * GROUP + GROUP, elements)):
                add_products(e, inner, ends, lower, vertices, columns, products)
        _small_system(products, sums, closing, small)
        store(extremes, 0, load(extremes, 0) + _negative_of_two(small))
        solve_lanes(small, 3, 5)
        for e in range(elements, -1, -1):
            node = e * (inner + 1)
            _combine(columns, small, (node, min(node + inner, n + 1) + 1), solution)
            restore_element(e, elements, inner, ends, lower, vertices, columns, solution, 0, 2)
        store(solution, 2 * (n + 1), stack2(load(small, 3), load(small, 4)))
        store(solution, 2 * (n + 2), stack2(load(small, 8), load(small, 9)))
        _write(solution, 2, 2, dz, start)
        _write(solution, 3, 2, tangent_z, start)
        worst = larger(absolute(load(sums, ALONG)), absolute(load(sums, ACROSS)))
        store(sums, WORST, larger(load(sums, WORST), worst))
        for k in range(LANES):
            at = start + k
            dt[at], tangent_t[at] = small[13, k], small[14, k]
            residual[at], index[at] = sums[WORST, k], np.int64(extremes[0, k]) - 2
            ratio[at] = pivot_ratio(extremes, k)


@njit(**INNER)
def _curvature_block(stiffness, lengths, nodal_weights, integral, rho, theta, scalars, waves, out):
    """Curvature by moment balance, and its derivative over 4π², at the nodes of every element.

    κ = −4π² r₀ at the left end of an element, r₀ its residual there, and κ' = 4π² g inside with
    g = λ·(−sin θ) + (μ − qρ) cos θ. out (2, elements, degree + 1, 8).
    """
    elements, order = stiffness.shape[0], stiffness.shape[1]
    lam, mu, q = load(scalars, 0), load(scalars, 1), load(scalars, 2)
    for i in range(elements * (order - 1) + 1):
        sine, cosine = sincos(load(theta, i))
        store(waves, 2 * i, lam * sine)
        store(waves, 2 * i + 1, cosine)
    for e in range(elements):
        base, kappa = e * (order - 1), e * order
        force = kappa + elements * order
        moment = spread(0.0)
        for i in range(order):
            lever = (mu - q * spread(rho[e, i])) * load(waves, 2 * (base + i) + 1)
            store(out, force + i, lever - load(waves, 2 * (base + i)))
            moment = moment + spread(stiffness[e, 0, i]) * load(theta, base + i)
        moment = moment + spread(lengths[e] * nodal_weights[0]) * load(out, force)
        for i in range(0, order, 2):
            other = min(i + 1, order - 1)
            first, second = spread(0.0), spread(0.0)
            for j in range(order):
                own = load(out, force + j)
                first = first + spread(integral[i, j]) * own
                second = second + spread(integral[other, j]) * own
            store(out, kappa + i, spread(FOUR_PI_SQUARED) * (spread(lengths[e]) * first - moment))
            store(
                out, kappa + other, spread(FOUR_PI_SQUARED) * (spread(lengths[e]) * second - moment)
            )


@njit(**FLAGS)
def curvature_lanes(stiffness, lengths, nodal_weights, integral, rho, z, p, both):
    """Nodal curvature and force of every lane; both (lanes, 2 · elements · (degree + 1))."""
    n = z.shape[1] - 2
    theta, scalars, waves = work_rows(n + 3), work_rows(4), work_rows(2 * (n + 2))
    out = work_rows(both.shape[1])
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        _read_state(z, p, start, n, theta, scalars)
        _curvature_block(
            stiffness, lengths, nodal_weights, integral, rho, theta, scalars, waves, out
        )
        _write(out, 0, 1, both, start)


@njit(**FLAGS)
def largest_lanes(
    stiffness, lengths, nodal_weights, integral, rho, nodes, to_legendre, z, p, largest, place
):
    """Largest |κ| over s of each lane and where: nodal maximum, then every interior extremum.

    Extrema are roots of the interpolated κ' between nodes where it changes sign; `place` holds
    element + local coordinate.
    """
    elements, order, n = stiffness.shape[0], stiffness.shape[1], z.shape[1] - 2
    theta, scalars, waves = work_rows(n + 3), work_rows(4), work_rows(2 * (n + 2))
    out, best, series = work_rows(2 * elements * order), work_rows(2), np.empty(order)
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        _read_state(z, p, start, n, theta, scalars)
        _curvature_block(
            stiffness, lengths, nodal_weights, integral, rho, theta, scalars, waves, out
        )
        _nodal_maximum(out, elements, nodes, best)
        for e in range(elements):
            for i in range(order - 1):
                at = e * order + i
                width = (nodes[i + 1] - nodes[i]) * lengths[e]
                lanes = _may_exceed(out, at, elements * order, width, best)
                for k in range(LANES):
                    if lanes >> k & 1:
                        _refine(out, e, i, k, lengths[e], nodes, to_legendre, series, best)
        for k in range(LANES):
            largest[start + k], place[start + k] = best[0, k], best[1, k]


@njit(**INNER)
def _nodal_maximum(out, elements, nodes, best):
    """Largest nodal |κ| in row 0 and its element + local coordinate in row 1 of best."""
    order = nodes.shape[0]
    most, where = spread(0.0), spread(0.0)
    for e in range(elements):
        for i in range(order):
            value = absolute(load(out, e * order + i))
            where = where_less(most, value, spread(e + nodes[i]), where)
            most = larger(most, value)
    store(best, 0, most)
    store(best, 1, where)


@njit(**INNER)
def _may_exceed(out, at, forces, width, best):
    """Lanes (bits) where κ' changes sign between two nodes and |κ| may rise above the best there.

    Between the nodes |κ| stays below the mean of both plus half the way at the steeper slope; twice
    that allows for a slope that bends.
    """
    left, right = load(out, forces + at), load(out, forces + at + 1)
    turning = lanes_less(left * right, spread(0.0))
    if turning == 0:
        return turning
    mean = spread(0.5) * (absolute(load(out, at)) + absolute(load(out, at + 1)))
    rise = spread(FOUR_PI_SQUARED * width) * larger(absolute(left), absolute(right))
    return turning & lanes_less(load(best, 0), mean + rise)


@njit(**INNER)
def _refine(out, e, i, k, length, nodes, to_legendre, series, best):
    """Take the extremum of κ between nodes i and i + 1 of an element into the best of lane k."""
    order = nodes.shape[0]
    forces = out.shape[0] // 2 + e * order
    for a in range(order):
        total = 0.0
        for b in range(order):
            total += to_legendre[a, b] * out[forces + b, k]
        series[a] = total
    t = _root(series, nodes[i], nodes[i + 1], out[forces + i, k], out[forces + i + 1, k])
    value = abs(out[e * order, k] + FOUR_PI_SQUARED * length * _integral(series, t))
    if value > best[0, k]:
        best[0, k], best[1, k] = value, e + t


@njit(**INNER)
def _value(coefficients, t):
    """Legendre series on [0, 1] and its derivative at t."""
    x = 2.0 * t - 1.0
    before, now, total = 1.0, x, coefficients[0] + coefficients[1] * x
    slope_before, slope_now, slope = 0.0, 1.0, coefficients[1]
    for k in range(1, coefficients.shape[0] - 1):
        after = ((2 * k + 1) * x * now - k * before) / (k + 1)
        slope_after = slope_before + (2 * k + 1) * now
        before, now = now, after
        slope_before, slope_now = slope_now, slope_after
        total += coefficients[k + 1] * now
        slope += coefficients[k + 1] * slope_now
    return total, 2.0 * slope


@njit(**INNER)
def _integral(coefficients, t):
    """Integral of a Legendre series on [0, 1] from 0 to t."""
    x = 2.0 * t - 1.0
    before, now, total = 1.0, x, coefficients[0] * (x + 1.0)
    for k in range(1, coefficients.shape[0]):
        after = ((2 * k + 1) * x * now - k * before) / (k + 1)
        total += coefficients[k] * (after - before) / (2 * k + 1)
        before, now = now, after
    return 0.5 * total


@njit(**INNER)
def _root(coefficients, low, high, f_low, f_high):
    """Root of a Legendre series between two points of opposite sign: Newton kept in its bracket.

    The last step is below 1e-8, so that its successor would be below round-off.
    """
    t = low + (high - low) * f_low / (f_low - f_high)
    for _ in range(60):
        value, slope = _value(coefficients, t)
        if value * f_low > 0.0:
            low = t
        else:
            high = t
        step = -value / slope if slope != 0.0 else np.inf
        following = t + step
        if abs(step) < 1e-8:
            return min(max(following, low), high)
        t = following if low < following < high else 0.5 * (low + high)
        if high - low < 1e-15:
            break
    return t
