"""Compiled kernels of the rod's curvature, eight lanes at a time; at least eight lanes."""

import numpy as np
from numba import njit

from equimorph.linalg.kernels import (
    FLAGS,
    INNER,
    write_lanes,
)
from equimorph.linalg.simd import (
    LANES,
    absolute,
    lanes_less,
    larger,
    load,
    sincos,
    spread,
    store,
    where_less,
    work_rows,
)
from equimorph.structures.rod.kernels import (
    LAMBDA,
    MU,
    Q,
    read_state,
)

FOUR_PI_SQUARED = 4.0 * np.pi**2


@njit(**INNER)
def _curvature_block(stiffness, lengths, nodal_weights, integral, rho, theta, scalars, waves, out):
    """Curvature by moment balance, and its derivative over 4π², at the nodes of every element.

    κ = −4π² r₀ at the left end of an element, r₀ its residual there, and κ' = 4π² g inside with
    g = λ·(−sin θ) + (μ − qρ) cos θ. out (2, elements, degree + 1, 8).
    """
    elements, order = stiffness.shape[0], stiffness.shape[1]
    lam, mu, q = load(scalars, LAMBDA), load(scalars, MU), load(scalars, Q)
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
        read_state(z, p, start, n, theta, scalars)
        _curvature_block(
            stiffness, lengths, nodal_weights, integral, rho, theta, scalars, waves, out
        )
        write_lanes(out, 0, 1, both, start * both.shape[1], both.shape[1], both.shape[1])


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
        read_state(z, p, start, n, theta, scalars)
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
