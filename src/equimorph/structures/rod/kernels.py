"""Compiled kernels of the rod, eight lanes at a time.

L = Σ ½ θᵀKθ + Σᵢ (μ mᵢ − q Rᵢ) sin θᵢ + λ mᵢ cos θᵢ − λν with quadrature weights m, load weights
R = m ρ and K the stiffness over 4π².
"""

import numpy as np
from numba import njit

from equimorph.linalg.kernels import (
    FLAGS,
    factor_symmetric,
    pivot_signs_block,
    reduce_block,
    restore_block,
    solve_small,
)
from equimorph.linalg.simd import LANES, load, sincos, spread, store


@njit(**FLAGS)
def _gather(z, p, start, n, theta, scalars):
    """Fill a block with the nodal angles and (λ, μ, q, ν) of lanes; spare lanes repeat the last."""
    for k in range(LANES):
        at = min(start + k, z.shape[0] - 1)
        for i in range(n):
            theta[i + 1, k] = z[at, i]
        theta[0, k] = p[at, 1] + p[at, 0]
        theta[n + 1, k] = p[at, 1] - p[at, 0]
        scalars[0, k] = z[at, n]
        scalars[1, k] = z[at, n + 1]
        scalars[2, k] = p[at, 2]
        scalars[3, k] = p[at, 3]


@njit(**FLAGS)
def _assemble(weights, loads, theta, scalars, diagonal, columns, sums):
    """Diagonal of the Hessian, border columns 0 and 1, gradient without stiffness in column 3."""
    nodes = theta.shape[0]
    lam, mu, q = load(scalars, 0), load(scalars, 1), load(scalars, 2)
    along, across = spread(0.0), spread(0.0)
    for i in range(nodes):
        sine, cosine = sincos(load(theta, i))
        m = spread(weights[i])
        a = mu * m - q * spread(loads[i])
        b = lam * m
        store(diagonal, i, spread(0.0) - a * sine - b * cosine)
        store(columns, i, spread(0.0) - m * sine)
        store(columns, nodes + i, m * cosine)
        store(columns, 2 * nodes + i, spread(loads[i]) * cosine)
        store(columns, 3 * nodes + i, b * sine - a * cosine)
        along = along + m * cosine
        across = across + m * sine
    store(sums, 0, along - load(scalars, 3))
    store(sums, 1, across)


@njit(**FLAGS)
def _subtract_stiffness(stiffness, theta, columns, c):
    """columns[c] −= K θ."""
    elements, order = stiffness.shape[0], stiffness.shape[1]
    nodes = theta.shape[0]
    for e in range(elements):
        base = e * (order - 1)
        for i in range(order):
            even, odd = spread(0.0), spread(0.0)
            for j in range(0, order - 1, 2):
                even = even + spread(stiffness[e, i, j]) * load(theta, base + j)
                odd = odd + spread(stiffness[e, i, j + 1]) * load(theta, base + j + 1)
            if order % 2 == 1:
                even = even + spread(stiffness[e, i, order - 1]) * load(theta, base + order - 1)
            at = c * nodes + base + i
            store(columns, at, load(columns, at) - even - odd)


@njit(**FLAGS)
def _parameter_column(stiffness, weights, columns, velocity, k, closing):
    """Finish column 2, F_p·dp, of lane k: scaled load, ends through the stiffness, constraints."""
    elements, order = stiffness.shape[0], stiffness.shape[1]
    last = columns.shape[1] - 1
    start, stop = velocity[1] + velocity[0], velocity[1] - velocity[0]
    for i in range(last + 1):
        columns[2, i, k] *= -velocity[2]
    for i in range(order):
        columns[2, i, k] += stiffness[0, i, 0] * start
        columns[2, last - order + 1 + i, k] += stiffness[elements - 1, i, order - 1] * stop
    closing[0, k] = columns[0, 0, k] * start + columns[0, last, k] * stop - velocity[3]
    closing[1, k] = columns[1, 0, k] * start + columns[1, last, k] * stop


@njit(**FLAGS)
def _dot(a, b, c, nodes):
    """Sum over the inner nodes of row block a (flattened at a) times column c, per lane."""
    even, odd = spread(0.0), spread(0.0)
    for i in range(1, nodes - 2, 2):
        even = even + load(a, i) * load(b, c * nodes + i)
        odd = odd + load(a, i + 1) * load(b, c * nodes + i + 1)
    if nodes % 2 == 1:
        even = even + load(a, nodes - 2) * load(b, c * nodes + nodes - 2)
    return even + odd


@njit(**FLAGS)
def advance_lanes(
    stiffness, ends, weights, loads, z, p, dp, row, corner, defect,
    dz, dt, tangent_z, tangent_t, residual, index, ratio,
):
    """Fused Newton step, tangent and inertia of the rod; see `structures.contract.Advance`."""
    elements, degree = stiffness.shape[0], stiffness.shape[1] - 1
    lanes, nodes = z.shape[0], weights.shape[0]
    n = nodes - 2
    theta, scalars = np.empty((nodes, LANES)), np.empty((4, LANES))
    diagonal, columns = np.empty((nodes, LANES)), np.empty((4, nodes, LANES))
    border = np.empty((3, nodes, LANES))
    sums, closing = np.empty((2, LANES)), np.empty((2, LANES))
    lower = np.empty((elements, degree - 1, degree - 1, LANES))
    pivots, ties = np.empty((nodes, LANES)), np.empty((2, nodes, LANES))
    chain, dots = np.empty((elements + 1, LANES)), np.empty((12, LANES))
    signs, ratios = np.empty(LANES, np.int64), np.empty(LANES)
    worst = np.empty(LANES)
    schur, small, corner2 = np.empty((3, 3)), np.empty((3, 2)), np.empty((2, 2))
    for start in range(0, lanes, LANES):
        active = min(LANES, lanes - start)
        _gather(z, p, start, n, theta, scalars)
        _assemble(weights, loads, theta, scalars, diagonal, columns, sums)
        _subtract_stiffness(stiffness, theta, columns, 3)
        for k in range(LANES):
            at = min(start + k, lanes - 1)
            _parameter_column(stiffness, weights, columns, dp[at], k, closing)
            worst[k] = max(abs(sums[0, k]), abs(sums[1, k]))
            for i in range(n):
                border[2, i + 1, k] = row[at, i]
                worst[k] = max(worst[k], abs(columns[3, i + 1, k]))
        border[:2] = columns[:2]
        reduce_block(stiffness, diagonal, ends, columns, lower, pivots, ties, chain)
        restore_block(lower, pivots, ties, chain, ends, columns, 0)
        restore_block(lower, pivots, ties, chain, ends, columns, 2)
        pivot_signs_block(pivots, 1, n, signs, ratios)
        for a in range(3):
            for c in range(4):
                store(dots, 4 * a + c, _dot(border[a], columns, c, nodes))
        for k in range(active):
            at = start + k
            for a in range(2):
                for c in range(2):
                    schur[a, c] = -dots[4 * a + c, k]
                    corner2[a, c] = schur[a, c]
                schur[a, 2] = closing[a, k] - dots[4 * a + 2, k]
                schur[2, a] = row[at, n + a] - dots[8 + a, k]
                small[a, 0] = -sums[a, k] - dots[4 * a + 3, k]
                small[a, 1] = 0.0
            schur[2, 2] = corner[at] - dots[10, k]
            small[2, 0] = -defect[at] - dots[11, k]
            small[2, 1] = 1.0
            index[at] = signs[k] + factor_symmetric(corner2) - 2
            ratio[at] = ratios[k]
            residual[at] = worst[k]
            solve_small(schur, small)
            for i in range(n):
                w0, w1, w2 = columns[0, i + 1, k], columns[1, i + 1, k], columns[2, i + 1, k]
                dz[at, i] = columns[3, i + 1, k] - (
                    w0 * small[0, 0] + w1 * small[1, 0] + w2 * small[2, 0]
                )
                tangent_z[at, i] = -(w0 * small[0, 1] + w1 * small[1, 1] + w2 * small[2, 1])
            for a in range(2):
                dz[at, n + a] = small[a, 0]
                tangent_z[at, n + a] = small[a, 1]
            dt[at] = small[2, 0]
            tangent_t[at] = small[2, 1]


@njit(**FLAGS)
def curvature_lanes(stiffness, lengths, nodal_weights, integral, rho, z, p, kappa, force):
    """Curvature by moment balance, and its derivative over 4π², at the nodes of every element.

    κ = −4π² r₀ at the left end of an element, r₀ its residual there, and κ' = 4π² g inside with
    g = λ·(−sin θ) + (μ − qρ) cos θ. kappa and force (lanes, elements, degree + 1).
    """
    elements, order = stiffness.shape[0], stiffness.shape[1]
    lanes, n = z.shape[0], z.shape[1] - 2
    theta, scalars = np.empty((n + 2, LANES)), np.empty((4, LANES))
    sines, cosines = np.empty((n + 2, LANES)), np.empty((n + 2, LANES))
    local, bend = np.empty((order, LANES)), np.empty((order, LANES))
    factor = spread(4.0 * np.pi**2)
    for start in range(0, lanes, LANES):
        active = min(LANES, lanes - start)
        _gather(z, p, start, n, theta, scalars)
        for i in range(n + 2):
            sine, cosine = sincos(load(theta, i))
            store(sines, i, sine)
            store(cosines, i, cosine)
        lam, mu, q = load(scalars, 0), load(scalars, 1), load(scalars, 2)
        for e in range(elements):
            base = e * (order - 1)
            for i in range(order):
                value = (mu - q * spread(rho[e, i])) * load(cosines, base + i)
                store(local, i, value - lam * load(sines, base + i))
            moment = spread(lengths[e] * nodal_weights[0]) * load(local, 0)
            for j in range(order):
                moment = moment + spread(stiffness[e, 0, j]) * load(theta, base + j)
            for i in range(order):
                total = spread(0.0)
                for j in range(order):
                    total = total + spread(integral[i, j]) * load(local, j)
                store(bend, i, factor * (spread(lengths[e]) * total - moment))
            for k in range(active):
                for i in range(order):
                    kappa[start + k, e, i] = bend[i, k]
                    force[start + k, e, i] = local[i, k]


@njit(**FLAGS)
def largest_curvature(kappa, force, lengths, nodes, to_legendre, out, place):
    """Largest |κ| over s of each lane and where: nodal maximum, then every interior extremum.

    Extrema are roots of the interpolated κ' between nodes where it changes sign; `place` holds
    element + local coordinate.
    """
    lanes, elements, order = kappa.shape
    coefficients = np.empty(order)
    for lane in range(lanes):
        best, where = 0.0, 0.0
        for e in range(elements):
            for i in range(order):
                if abs(kappa[lane, e, i]) > best:
                    best, where = abs(kappa[lane, e, i]), e + nodes[i]
        rough = best
        for e in range(elements):
            for i in range(order - 1):
                f0, f1 = force[lane, e, i], force[lane, e, i + 1]
                width = (nodes[i + 1] - nodes[i]) * lengths[e]
                size = max(abs(kappa[lane, e, i]), abs(kappa[lane, e, i + 1]))
                reach = size + 4.0 * np.pi**2 * width * max(abs(f0), abs(f1))
                if f0 * f1 >= 0.0 or reach <= rough:
                    continue
                for a in range(order):
                    coefficients[a] = 0.0
                    for b in range(order):
                        coefficients[a] += to_legendre[a, b] * force[lane, e, b]
                t = _root(coefficients, nodes[i], nodes[i + 1], f0)
                value = abs(
                    kappa[lane, e, 0]
                    + 4.0 * np.pi**2 * lengths[e] * _integral(coefficients, t)
                )
                if value > best:
                    best, where = value, e + t
        out[lane], place[lane] = best, where


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
def _root(coefficients, low, high, f_low):
    """Root of a Legendre series between two points of opposite sign: Newton kept in its bracket."""
    t = 0.5 * (low + high)
    for _ in range(60):
        value, slope = _value(coefficients, t)
        if value * f_low > 0.0:
            low = t
        else:
            high = t
        step = -value / slope if slope != 0.0 else 0.0
        following = t + step
        if not (low < following < high) or step == 0.0:
            following = 0.5 * (low + high)
        if abs(following - t) < 1e-15:
            break
        t = following
    return t
