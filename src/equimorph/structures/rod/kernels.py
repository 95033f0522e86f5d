"""Compiled kernels of the rod, eight lanes at a time.

L = Σ ½ θᵀKθ + Σᵢ (μ mᵢ − q Rᵢ) sin θᵢ + λ mᵢ cos θᵢ − λν with quadrature weights m, load weights
R = m ρ and K the stiffness over 4π². Kernels need at least eight lanes; where these are not a
multiple of eight the last block overlaps the one before.
"""

import numpy as np
from numba import njit

from equimorph.linalg.kernels import (
    FLAGS,
    TILE,
    pivot_products,
    reduce_block,
    restore_block,
    solve_lanes,
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
START, STOP, LOAD, SPAN, ROW_LAMBDA, ROW_MU, CORNER, DEFECT = range(8)
"""Rows of the closing data: the parameters' velocity, then the row's other entries."""
LAMBDA, MU = 0, 1
ACROSS = 4.0 * np.pi**2


@njit(**FLAGS)
def _read(source, start, count, target, row, step):
    """Read the first entries of lanes of a lanes-first array into rows `step` apart."""
    flat, out, width = source.reshape(-1), target.reshape(-1), source.shape[1]
    if count < LANES:
        for i in range(count):
            for k in range(LANES):
                target[row + i * step, k] = source[start + k, i]
    else:
        for block in range(0, count, LANES):
            i = min(block, count - LANES)
            at = (row + i * step) * LANES
            transpose(flat, start * width + i, width, out, at, step * LANES)


@njit(**FLAGS)
def _write(source, row, step, target, start):
    """Write rows `step` apart into lanes of a lanes-first array."""
    flat, out, width = source.reshape(-1), target.reshape(-1), target.shape[1]
    if width < LANES:
        for i in range(width):
            for k in range(LANES):
                target[start + k, i] = source[row + i * step, k]
    else:
        for block in range(0, width, LANES):
            i = min(block, width - LANES)
            at = (row + i * step) * LANES
            transpose(flat, at, step * LANES, out, start * width + i, width)


@njit(**FLAGS)
def _read_state(z, p, start, n, theta, scalars):
    """Fill a block with the nodal angles and (λ, μ, q, ν) of lanes; theta has n + 3 rows."""
    _read(z, start, n + 2, theta, 1, 1)
    store(scalars, 0, load(theta, n + 1))
    store(scalars, 1, load(theta, n + 2))
    for k in range(LANES):
        theta[0, k] = p[start + k, 1] + p[start + k, 0]
        theta[n + 1, k] = p[start + k, 1] - p[start + k, 0]
        scalars[2, k], scalars[3, k] = p[start + k, 2], p[start + k, 3]


@njit(**FLAGS)
def _read_closing(dp, row, corner, defect, start, n, columns, closing):
    """Fill a block with the closing row and the data named by START … DEFECT."""
    _read(row, start, n, columns, TILE + ROW, TILE)
    for k in range(LANES):
        at = start + k
        closing[START, k], closing[STOP, k] = dp[at, 1] + dp[at, 0], dp[at, 1] - dp[at, 0]
        closing[LOAD, k], closing[SPAN, k] = dp[at, 2], dp[at, 3]
        closing[ROW_LAMBDA, k], closing[ROW_MU, k] = row[at, n], row[at, n + 1]
        closing[CORNER, k], closing[DEFECT, k] = corner[at], defect[at]


@njit(**FLAGS)
def _assemble(weights, loads, theta, scalars, velocity, diagonal, columns, sums):
    """Diagonal of the Hessian, border, load part of F_p·dp, gradient without stiffness."""
    lam, mu, q = load(scalars, 0), load(scalars, 1), load(scalars, 2)
    along, across = spread(0.0), spread(0.0)
    for i in range(weights.shape[0]):
        sine, cosine = sincos(load(theta, i))
        m, r = spread(weights[i]), spread(loads[i])
        a, b = mu * m - q * r, lam * m
        first, second = spread(0.0) - m * sine, m * cosine
        store(diagonal, i, spread(0.0) - a * sine - b * cosine)
        store(columns, i * TILE + FIRST, first)
        store(columns, i * TILE + SECOND, second)
        store(columns, i * TILE + COLUMN, spread(0.0) - velocity * r * cosine)
        store(columns, i * TILE + FORCE, b * sine - a * cosine)
        along, across = along + second, across - first
    store(sums, 0, along - load(scalars, 3))
    store(sums, 1, across)


@njit(**FLAGS)
def _subtract_stiffness(stiffness, theta, columns):
    """Subtract K θ from the force, two rows of an element at a time."""
    order = stiffness.shape[1]
    for e in range(stiffness.shape[0]):
        base = e * (order - 1)
        for i in range(0, order, 2):
            other = min(i + 1, order - 1)
            first, second = spread(0.0), spread(0.0)
            for j in range(order):
                angle = load(theta, base + j)
                first = first + spread(stiffness[e, i, j]) * angle
                second = second + spread(stiffness[e, other, j]) * angle
            at = (base + i) * TILE + FORCE
            store(columns, at, load(columns, at) - first)
            if other > i:
                store(columns, at + TILE, load(columns, at + TILE) - second)


@njit(**FLAGS)
def _close_column(stiffness, columns, closing, sums):
    """Ends' part of F_p·dp: through the stiffness in its slot, through the constraints in `sums`."""
    elements, order = stiffness.shape[0], stiffness.shape[1]
    start, stop = load(closing, START), load(closing, STOP)
    last = elements * (order - 1) * TILE
    for i in range(order):
        at, to = i * TILE + COLUMN, last + (i + 1 - order) * TILE + COLUMN
        store(columns, at, load(columns, at) + spread(stiffness[0, i, 0]) * start)
        by_stop = spread(stiffness[elements - 1, i, order - 1]) * stop
        store(columns, to, load(columns, to) + by_stop)
    first = load(columns, FIRST) * start + load(columns, last + FIRST) * stop
    second = load(columns, SECOND) * start + load(columns, last + SECOND) * stop
    store(sums, 2, first - load(closing, SPAN))
    store(sums, 3, second)


@njit(**FLAGS)
def _largest_residual(columns, sums, n):
    """Largest absolute entry of F; not a number if one of them is not."""
    worst = larger(absolute(load(sums, 0)), absolute(load(sums, 1)))
    for i in range(1, n + 1):
        worst = larger(worst, absolute(load(columns, i * TILE + FORCE)))
    return worst


@njit(**FLAGS)
def _small_system(products, sums, closing, small):
    """Schur system of (λ, μ, t) with the two right-hand sides, in rows of five."""
    zero, one = spread(0.0), spread(1.0)
    for a in range(2):
        store(small, 5 * a, zero - load(products, 4 * a))
        store(small, 5 * a + 1, zero - load(products, 4 * a + 1))
        store(small, 5 * a + 2, load(sums, 2 + a) - load(products, 4 * a + 2))
        store(small, 5 * a + 3, zero - load(sums, a) - load(products, 4 * a + 3))
        store(small, 5 * a + 4, zero)
        store(small, 10 + a, load(closing, ROW_LAMBDA + a) - load(products, 8 + a))
    store(small, 12, load(closing, CORNER) - load(products, 10))
    store(small, 13, zero - load(closing, DEFECT) - load(products, 11))
    store(small, 14, one)


@njit(**FLAGS)
def _negative_of_two(small):
    """Negative eigenvalues of the leading 2 × 2 block, by its determinant and trace."""
    zero, one = spread(0.0), spread(1.0)
    a, b, c = load(small, 0), load(small, 1), load(small, 6)
    determinant = a * c - b * b
    definite = where_less(a + c, zero, one + one, zero)
    return where_less(determinant, zero, one, definite)


@njit(**FLAGS)
def _combine(columns, small, n, solution):
    """Reduced columns of the step and of the tangent, side by side."""
    step0, step1, step2 = load(small, 3), load(small, 8), load(small, 13)
    turn0, turn1, turn2 = load(small, 4), load(small, 9), load(small, 14)
    for i in range(1, n + 1):
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
    theta, diagonal = work_rows(n + 3), work_rows(n + 2)
    scalars, closing, sums = work_rows(4), work_rows(8), work_rows(4)
    products, small, solution = work_rows(12), work_rows(15), work_rows(2 * (n + 3))
    lower, vertices, columns, extremes = work_arrays(elements, inner, 1)
    for block in range(0, lanes, LANES):
        start = min(block, lanes - LANES)
        _read_state(z, p, start, n, theta, scalars)
        _read_closing(dp, row, corner, defect, start, n, columns, closing)
        _assemble(weights, loads, theta, scalars, load(closing, LOAD), diagonal, columns, sums)
        _subtract_stiffness(stiffness, theta, columns)
        _close_column(stiffness, columns, closing, sums)
        store(scalars, 0, _largest_residual(columns, sums, n))
        reduce_block(stiffness, diagonal, ends, 1, lower, vertices, columns, extremes)
        pivot_products(elements, inner, ends, lower, vertices, columns, products)
        _small_system(products, sums, closing, small)
        store(extremes, 0, load(extremes, 0) + _negative_of_two(small))
        solve_lanes(small, 3, 5)
        _combine(columns, small, n, solution)
        restore_block(elements, inner, ends, lower, vertices, columns, solution, 0, 2)
        store(solution, 2 * (n + 1), stack2(load(small, 3), load(small, 4)))
        store(solution, 2 * (n + 2), stack2(load(small, 8), load(small, 9)))
        _write(solution, 2, 2, dz, start)
        _write(solution, 3, 2, tangent_z, start)
        for k in range(LANES):
            at = start + k
            dt[at], tangent_t[at] = small[13, k], small[14, k]
            residual[at], index[at] = scalars[0, k], np.int64(extremes[0, k]) - 2
            ratio[at] = extremes[1, k] / extremes[2, k]


@njit(**FLAGS)
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
            store(out, kappa + i, spread(ACROSS) * (spread(lengths[e]) * first - moment))
            store(out, kappa + other, spread(ACROSS) * (spread(lengths[e]) * second - moment))


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


@njit(**FLAGS)
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


@njit(**FLAGS)
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
    rise = spread(ACROSS * width) * larger(absolute(left), absolute(right))
    return turning & lanes_less(load(best, 0), mean + rise)


@njit(**FLAGS)
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
    value = abs(out[e * order, k] + ACROSS * length * _integral(series, t))
    if value > best[0, k]:
        best[0, k], best[1, k] = value, e + t


@njit(**FLAGS)
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


@njit(**FLAGS)
def _integral(coefficients, t):
    """Integral of a Legendre series on [0, 1] from 0 to t."""
    x = 2.0 * t - 1.0
    before, now, total = 1.0, x, coefficients[0] * (x + 1.0)
    for k in range(1, coefficients.shape[0]):
        after = ((2 * k + 1) * x * now - k * before) / (k + 1)
        total += coefficients[k] * (after - before) / (2 * k + 1)
        before, now = now, after
    return 0.5 * total


@njit(**FLAGS)
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
