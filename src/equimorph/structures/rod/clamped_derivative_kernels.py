"""Compiled kernels of the rod's residual, matrix and derivatives, a vector of lanes at a time.

L = Σ ½ θᵀKθ + Σᵢ (aᵢ sin θᵢ + bᵢ cos θᵢ) − λν with a = μm − qR and b = λm; see
`structures.rod.kernels`. At least eight lanes; the last block overlaps the one before.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER, write_lanes
from equimorph.linalg.simd import LANES, load, sincos, spread, store, work_rows
from equimorph.structures.rod.clamped_kernels import LAMBDA, MU, NU, Q, read_state

FIRST, LAST, LIFT = range(3)
"""Columns of the ends: ∂L/∂θ at both prescribed ends, ∂L/∂q."""


@njit(**INNER)
def _write_closing(n, along, across, rows, target, start):
    """Put the two constraints behind the n inner nodes, and write both; rows begins at node 0."""
    store(rows, n + 1, along)
    store(rows, n + 2, across)
    write_lanes(rows, 1, 1, target, start * (n + 2), n + 2, n + 2)


@njit(**FLAGS)
def energy_lanes(stiffness, loads, z, p, energy):
    """½ θᵀKθ − q Σᵢ Rᵢ sin θᵢ of every lane, one by one."""
    elements, degree, n = stiffness.shape[0], stiffness.shape[1] - 1, z.shape[1] - 2
    theta = np.empty(n + 2)
    for lane in range(z.shape[0]):
        theta[0], theta[n + 1] = p[lane, 1] + p[lane, 0], p[lane, 1] - p[lane, 0]
        for i in range(n):
            theta[i + 1] = z[lane, i]
        bending, lift = 0.0, 0.0
        for i in range(n + 2):
            lift += loads[i] * np.sin(theta[i])
        for e in range(elements):
            for i in range(degree + 1):
                moment = 0.0
                for j in range(degree + 1):
                    moment += stiffness[e, i, j] * theta[e * degree + j]
                bending += theta[e * degree + i] * moment
        energy[lane] = 0.5 * bending - p[lane, 2] * lift


@njit(**FLAGS)
def residual_lanes(stiffness, weights, loads, z, p, residual, ends):
    """F of every lane, and the derivatives by the ends and the load: ends (lanes, 3)."""
    elements, degree, n = stiffness.shape[0], stiffness.shape[1] - 1, z.shape[1] - 2
    theta, scalars, rows = work_rows(n + 3), work_rows(4), work_rows(n + 3)
    others = work_rows(3)
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        read_state(z, p, start, n, theta, scalars)
        lam, mu, q = load(scalars, LAMBDA), load(scalars, MU), load(scalars, Q)
        along, across = spread(0.0) - load(scalars, NU), spread(0.0)
        lift = spread(0.0)
        for i in range(n + 2):
            sine, cosine = sincos(load(theta, i))
            m, r = spread(weights[i]), spread(loads[i])
            store(rows, i, (mu * m - q * r) * cosine - lam * m * sine)
            along, across, lift = along + m * cosine, across + m * sine, lift - r * sine
        for e in range(elements):
            base = e * degree
            for i in range(0, degree + 1, 2):
                other = min(i + 1, degree)
                first, second = spread(0.0), spread(0.0)
                for j in range(degree + 1):
                    angle = load(theta, base + j)
                    first = first + spread(stiffness[e, i, j]) * angle
                    second = second + spread(stiffness[e, other, j]) * angle
                store(rows, base + i, load(rows, base + i) + first)
                if other > i:
                    store(rows, base + other, load(rows, base + other) + second)
        store(others, FIRST, load(rows, 0))
        store(others, LAST, load(rows, n + 1))
        store(others, LIFT, lift)
        _write_closing(n, along, across, rows, residual, start)
        write_lanes(others, 0, 1, ends, start * 3, 3, 3)


@njit(**FLAGS)
def matrix_lanes(weights, loads, z, p, shift, diagonal, border):
    """Diagonal of ∂²L/∂θ² − shift·mass without the stiffness, and the constraints' gradients.

    diagonal (lanes, nodes); border (lanes, 2, nodes).
    """
    n = z.shape[1] - 2
    nodes = n + 2
    theta, scalars, rows = work_rows(n + 3), work_rows(4), work_rows(3 * nodes)
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        read_state(z, p, start, n, theta, scalars)

        for k in range(LANES):
            scalars[NU, k] = shift[start + k]
        lam, mu = load(scalars, LAMBDA), load(scalars, MU)
        q, sigma = load(scalars, Q), load(scalars, NU)
        for i in range(nodes):
            sine, cosine = sincos(load(theta, i))
            m, r = spread(weights[i]), spread(loads[i])
            curved = (mu * m - q * r) * sine + lam * m * cosine + sigma * m
            store(rows, i, spread(0.0) - curved)
            store(rows, nodes + i, spread(0.0) - m * sine)
            store(rows, 2 * nodes + i, m * cosine)
        write_lanes(rows, 0, 1, diagonal, start * nodes, nodes, nodes)
        write_lanes(rows, nodes, 1, border, start * 2 * nodes, 2 * nodes, 2 * nodes)


@njit(**FLAGS)
def parameter_lanes(stiffness, weights, loads, z, p, dp, out):
    """F_p·dp of every lane: the ends turn, the load and the span change."""
    elements, degree, n = stiffness.shape[0], stiffness.shape[1] - 1, z.shape[1] - 2
    last = n + 1
    theta, scalars, rows = work_rows(n + 3), work_rows(4), work_rows(n + 3)
    moved = work_rows(4)
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        read_state(z, p, start, n, theta, scalars)
        for k in range(LANES):
            at = start + k
            moved[0, k], moved[1, k] = dp[at, 1] + dp[at, 0], dp[at, 1] - dp[at, 0]
            moved[2, k], moved[3, k] = dp[at, 2], dp[at, 3]
        left, right, rise = load(moved, 0), load(moved, 1), load(moved, 2)
        for i in range(1, last):
            cosine = sincos(load(theta, i))[1]
            store(rows, i, spread(0.0) - rise * spread(loads[i]) * cosine)
        for i in range(degree + 1):
            store(rows, i, load(rows, i) + spread(stiffness[0, i, 0]) * left)
            at = last - degree + i
            factor = spread(stiffness[elements - 1, i, degree])
            store(rows, at, load(rows, at) + factor * right)
        left, right = left * spread(weights[0]), right * spread(weights[last])
        (s_left, c_left), (s_right, c_right) = sincos(load(theta, 0)), sincos(load(theta, last))
        along = spread(0.0) - s_left * left - s_right * right - load(moved, 3)
        _write_closing(n, along, c_left * left + c_right * right, rows, out, start)


@njit(**FLAGS)
def linearise_lanes(
    stiffness, weights, loads, z, p, directions, residual, columns, diagonal, border
):
    """F, F_p·d for each of the directions (lanes, k, 4), and the matrix of every lane, in turn."""
    residual_lanes(stiffness, weights, loads, z, p, residual, np.empty((len(z), 3)))
    matrix_lanes(weights, loads, z, p, np.zeros(len(z)), diagonal, border)
    column, dp = np.empty(z.shape), np.empty(p.shape)
    for i in range(directions.shape[1]):
        for lane in range(len(z)):
            for j in range(p.shape[1]):
                dp[lane, j] = directions[lane, i, j]
        parameter_lanes(stiffness, weights, loads, z, p, dp, column)
        for lane in range(len(z)):
            for j in range(z.shape[1]):
                columns[lane, i, j] = column[lane, j]


@njit(**FLAGS)
def second_lanes(weights, loads, z, p, v_z, v_p, w_z, w_p, out):
    """D²F[v, w] of every lane."""
    n = z.shape[1] - 2
    theta, scalars, rows = work_rows(n + 3), work_rows(4), work_rows(n + 3)
    v, v_scalars, w, w_scalars = work_rows(n + 3), work_rows(4), work_rows(n + 3), work_rows(4)
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        read_state(z, p, start, n, theta, scalars)
        read_state(v_z, v_p, start, n, v, v_scalars)
        read_state(w_z, w_p, start, n, w, w_scalars)
        lam, mu, q = load(scalars, LAMBDA), load(scalars, MU), load(scalars, Q)
        v_lam, v_mu, v_q = load(v_scalars, LAMBDA), load(v_scalars, MU), load(v_scalars, Q)
        w_lam, w_mu, w_q = load(w_scalars, LAMBDA), load(w_scalars, MU), load(w_scalars, Q)
        along, across = spread(0.0), spread(0.0)
        for i in range(n + 2):
            sine, cosine = sincos(load(theta, i))
            m, r, dv, dw = spread(weights[i]), spread(loads[i]), load(v, i), load(w, i)
            both = dv * dw
            a, b = mu * m - q * r, lam * m
            mixed = (v_mu * m - v_q * r) * dw + (w_mu * m - w_q * r) * dv
            force = (b * sine - a * cosine) * both - sine * mixed
            store(rows, i, force - cosine * m * (v_lam * dw + w_lam * dv))
            along, across = along - m * cosine * both, across - m * sine * both
        _write_closing(n, along, across, rows, out, start)
