"""Compiled kernel of the fields of general rods, one lane at a time; at least eight lanes.

In an element, from its left end, where θ and the moment M are superconvergent,
``M' = (1 − N/EA) N'`` with N as in `model.RodModel`, ``κ = (M + bending)/rigidity``, ``θ' = κ``.
The iteration of Picard solves these integral equations on a finer rule; it converges for any
length.
"""

import numpy as np
from numba import njit

from equimorph.linalg.kernels import FLAGS, INNER

MOST = 60
"""Iterations after which a field is taken as it is: a state that the elements do not resolve."""
SETTLED = 1e-14
"""Change of θ, relative to 1 + |θ|, that is round-off."""
THETA, KAPPA, X, Y, MOMENT = range(5)
"""Fields."""


@njit(**INNER)
def _combine(rows, scalars, e, out):
    """Combine the rows of an element with the scalars."""
    out[:] = 0.0
    for j in range(len(scalars)):
        if scalars[j] != 0.0:
            for i in range(len(out)):
                out[i] += scalars[j] * rows[j, e, i]


@njit(**INNER)
def _integrate(matrix, start, length, values, out):
    """Integral from the left end, plus a start value."""
    for i in range(len(out)):
        total = 0.0
        for j in range(len(values)):
            total += matrix[i, j] * values[j]
        out[i] = start + length * total


@njit(**INNER)
def _left_moment(stiffness, slope, weight, softness, along, across, e, angles, scalars):
    """Moment at the left end of an element, by its balance."""
    order = stiffness.shape[1]
    moment, a, b = 0.0, 0.0, 0.0
    for j in range(len(scalars)):
        moment += scalars[j] * slope[j, e, 0]
        a += scalars[j] * across[j, e, 0]
        b += scalars[j] * along[j, e, 0]
    for i in range(order):
        moment -= stiffness[e, 0, i] * angles[e * (order - 1) + i]
    s, c = np.sin(angles[e * (order - 1)]), np.cos(angles[e * (order - 1)])
    normal = a * s + b * c
    return moment - weight[e, 0] * (1.0 - softness[e, 0] * normal) * (a * c - b * s)


@njit(**FLAGS)
def fields_lanes(
    stiffness, slope, weight, softness, along, across, fine_along, fine_across, fine_bending,
    rigidity, fine_softness, spread, integral, lengths, angles, scalars, out,
):  # fmt: skip
    """θ, κ, x, y and M of every lane at the finer nodes: out (lanes, elements, 5, fine).

    angles (lanes, nodes); scalars (lanes, scalars); spread (fine, order) interpolates from the
    element's nodes; x and y begin at 0.
    """
    elements, order, fine = stiffness.shape[0], stiffness.shape[1], len(integral)
    a, b, g = np.empty(fine), np.empty(fine), np.empty(fine)
    theta, rate, kappa, new = np.empty(fine), np.empty(fine), np.empty(fine), np.empty(fine)
    moment, along_x, along_y = np.empty(fine), np.empty(fine), np.empty(fine)
    for lane in range(len(angles)):
        x, y = 0.0, 0.0
        mine, values = angles[lane], scalars[lane]
        for e in range(elements):
            base, h = e * (order - 1), lengths[e]
            start = _left_moment(stiffness, slope, weight, softness, along, across, e, mine, values)
            _combine(fine_across, values, e, a)
            _combine(fine_along, values, e, b)
            _combine(fine_bending, values, e, g)
            for i in range(fine):
                theta[i] = 0.0
                for j in range(order):
                    theta[i] += spread[i, j] * mine[base + j]
            for _ in range(MOST):
                for i in range(fine):
                    s, c = np.sin(theta[i]), np.cos(theta[i])
                    stretch = 1.0 - fine_softness[e, i] * (a[i] * s + b[i] * c)
                    rate[i] = stretch * (a[i] * c - b[i] * s)
                    along_x[i], along_y[i] = stretch * c, stretch * s
                _integrate(integral, start, h, rate, moment)
                for i in range(fine):
                    kappa[i] = (moment[i] + g[i]) / rigidity[e, i]
                _integrate(integral, mine[base], h, kappa, new)
                change = 0.0
                for i in range(fine):
                    change = max(change, abs(new[i] - theta[i]) / (1.0 + abs(new[i])))
                    theta[i] = new[i]
                if not change > SETTLED:
                    break
            out[lane, e, THETA], out[lane, e, KAPPA] = theta, kappa
            out[lane, e, MOMENT] = moment
            _integrate(integral, x, h, along_x, out[lane, e, X])
            _integrate(integral, y, h, along_y, out[lane, e, Y])
            x, y = out[lane, e, X, fine - 1], out[lane, e, Y, fine - 1]
