"""Compiled kernels of the fields of general rods; at least a vector of lanes.

In an element, from its left end, where θ and the moment M are superconvergent,
``M' = (1 − N/EA) N'`` with N as in `model.RodModel`, ``κ = (M + bending)/rigidity``, ``θ' = κ``.
The iteration of Picard solves these integral equations on a finer rule; it converges for any
length.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER, read_lanes, write_lanes
from equimorph.linalg.simd import (
    LANES,
    absolute,
    entry,
    lanes_less,
    load,
    sincos,
    spread,
    store,
    where_less,
    work_rows,
)

MOST = np.int64(60)
"""Iterations after which a field is taken as it is: a state that the elements do not resolve."""
SETTLED = 1e-14
"""Change of θ, relative to 1 + |θ|, that is round-off."""
THETA, KAPPA, X, Y, MOMENT = range(5)
"""Fields."""


@njit(**INNER)
def _combined(table, rows, e, i, scalars):
    """Row entries of an element's node times the scalars; other rows than `rows` are zero."""
    total = spread(0.0)
    for r in range(len(rows)):
        total = total + spread(table[rows[r], e, i]) * load(scalars, rows[r])
    return total


@njit(**INNER)
def _integrate(matrix, start, length, values, at, out, row):
    """Integral of rows from `at` on, from the left end, plus a start value, into others.

    Four places at once: sums of one alone would wait for each other.
    """
    count, whole = len(matrix), spread(length)
    for i in range(0, count, 4):
        a, b, c = min(i + 1, count - 1), min(i + 2, count - 1), min(i + 3, count - 1)
        first, second, third, fourth = spread(0.0), spread(0.0), spread(0.0), spread(0.0)
        for j in range(count):
            value = load(values, at + j)
            first = first + spread(entry(matrix, i * count + j)) * value
            second = second + spread(entry(matrix, a * count + j)) * value
            third = third + spread(entry(matrix, b * count + j)) * value
            fourth = fourth + spread(entry(matrix, c * count + j)) * value
        store(out, row + i, start + whole * first)
        store(out, row + a, start + whole * second)
        store(out, row + b, start + whole * third)
        store(out, row + c, start + whole * fourth)


@njit(**INNER)
def _start_pressure(pressure, pressed, pole, weights, angles, scalars, press, moments, tangents):
    """Pressure and the way from A to its pole; what pressure adds to the left moments of elements.

    pressed (elements, order): rows of W in `pressure.EnclosedArea` at the elements' left ends, of
    their own nodes; pole (2, 2): P there; weights (elements, order) of nodes in elements; tangents
    (2 · nodes) is work.
    """
    total = spread(0.0)
    for j in range(len(pressure)):
        total = total + spread(pressure[j]) * load(scalars, j)
    (elements, order), nodes = weights.shape, angles.shape[0]
    degree = order - 1
    for i in range(nodes):
        s, c = sincos(load(angles, i))
        store(tangents, i, c)
        store(tangents, nodes + i, s)
    x, y = spread(0.0), spread(0.0)
    for e in range(elements):
        for i in range(order):
            at, weight = e * degree + i, spread(weights[e, i])
            x = x + weight * load(tangents, at)
            y = y + weight * load(tangents, nodes + at)
    # Q d, which P holds beside a half
    x_closed = spread(0.0) - spread(pole[1, 0]) * x - spread(pole[1, 1] - 0.5) * y
    y_closed = spread(pole[0, 0] - 0.5) * x + spread(pole[0, 1]) * y
    past_x, past_y, half = spread(0.0), spread(0.0), spread(0.5)
    for e in range(elements):
        own_x, own_y, across, along = spread(0.0), spread(0.0), spread(0.0), spread(0.0)
        for i in range(order):
            c, s = load(tangents, e * degree + i), load(tangents, nodes + e * degree + i)
            own_x, own_y = own_x + spread(weights[e, i]) * c, own_y + spread(weights[e, i]) * s
            across = across + spread(pressed[e, i]) * c
            along = along + spread(pressed[e, i]) * s
        first = spread(weights[e, 0])
        across = across + first * (past_x + half * (own_x - x))
        along = along + first * (past_y + half * (own_y - y))
        past_x, past_y = past_x + own_x, past_y + own_y
        c, s = load(tangents, e * degree), load(tangents, nodes + e * degree)
        closed = first * (x_closed * s - y_closed * c)
        store(moments, e, total * (across * c + along * s + closed))
    store(press, 0, total)
    store(press, 1, spread(pole[0, 0]) * x + spread(pole[0, 1]) * y)
    store(press, 2, spread(pole[1, 0]) * x + spread(pole[1, 1]) * y)


@njit(**INNER)
def _left_moment(
    stiffness, slope, weight, softness, along, across, tension, rows, e, angles, scalars
):
    """Moment at the left end of an element by its balance.

    rows: those of across, along, slope and tension.
    """
    order = stiffness.shape[1]
    base = e * (order - 1)
    moment = _combined(slope, rows[2], e, 0, scalars)
    for i in range(order):
        moment = moment - spread(stiffness[e, 0, i]) * load(angles, base + i)
    s, c = sincos(load(angles, base))
    a, b = _combined(across, rows[0], e, 0, scalars), _combined(along, rows[1], e, 0, scalars)
    normal = a * s + b * c + _combined(tension, rows[3], e, 0, scalars)
    stretch = spread(1.0) - spread(softness[e, 0]) * normal
    return moment - spread(weight[e, 0]) * stretch * (a * c - b * s)


@njit(**INNER)
def _place(integral, length, corner, press, theta, new, out):
    """Places under pressure from the last angles, less the way from A to the pole."""
    fine = len(integral)
    for i in range(fine):
        s, c = sincos(load(theta, i))
        store(new, fine + i, c)
        store(new, 2 * fine + i, s)
    _integrate(integral, corner[0] - load(press, 1), length, new, fine, out, X * fine)
    _integrate(integral, corner[1] - load(press, 2), length, new, 2 * fine, out, Y * fine)


@njit(**INNER)
def _iterate(
    integral, length, left, start, corner, press, pull, give, softness, e, theta, new, out
):
    """One iteration; whether some lane moved.

    left, start, corner: angle, moment and place at the left end; press: see `_start_pressure`, or
    empty; pull: rows of a, b, bending and tension; give: one over rigidity; new: rate, then
    stretched cosine and sine; out: κ and the moment. Lanes that have settled keep their θ, so that
    what happens to a lane never depends on those beside it.
    """
    fine = len(integral)
    if len(press) > 0:
        _place(integral, length, corner, press, theta, new, out)
    for i in range(fine):
        a, b = load(pull, i), load(pull, fine + i)
        if len(press) == 0:
            s, c = sincos(load(theta, i))
        else:
            s, c = load(new, 2 * fine + i), load(new, fine + i)
            a = a + load(press, 0) * load(out, X * fine + i)
            b = b - load(press, 0) * load(out, Y * fine + i)
        normal = a * s + b * c + load(pull, 3 * fine + i)
        stretch = spread(1.0) - spread(softness[e, i]) * normal
        store(new, i, stretch * (a * c - b * s))
        store(new, fine + i, stretch * c)
        store(new, 2 * fine + i, stretch * s)
    _integrate(integral, start, length, new, 0, out, MOMENT * fine)
    for i in range(fine):
        moment = load(out, MOMENT * fine + i) + load(pull, 2 * fine + i)
        store(out, KAPPA * fine + i, moment * spread(give[e, i]))
        store(new, i, load(out, KAPPA * fine + i))
    _integrate(integral, left, length, new, 0, out, THETA * fine)
    worst = spread(0.0)
    for i in range(fine):
        turned = load(out, THETA * fine + i)
        change = absolute(turned - load(theta, i)) / (spread(1.0) + absolute(turned))
        worst = where_less(worst, change, change, worst)
    settled = spread(SETTLED)
    for i in range(fine):
        turned = load(out, THETA * fine + i)
        store(theta, i, where_less(settled, worst, turned, load(theta, i)))
    return lanes_less(settled, worst) != 0


@njit(**FLAGS)
def fields_lanes(
    stiffness, slope, weight, softness, along, across, tension, fine_along, fine_across,
    fine_bending, fine_tension, give, fine_softness, across_rows, along_rows, bending_rows,
    tension_rows, refine, integral, lengths,
    pressure, pressed, pole, angles, scalars, out,
):  # fmt: skip
    """θ, κ, x, y and M of every lane at the finer nodes: out (lanes, elements · 5 · fine).

    angles (lanes, nodes); scalars (lanes, scalars); refine (fine, order) interpolates from the
    element's nodes; give: one over rigidity; pressed: see `_start_pressure`, empty without
    pressure; x and y begin at 0.
    """
    elements, order, fine = stiffness.shape[0], stiffness.shape[1], len(integral)
    nodes, count = angles.shape[1], scalars.shape[1]
    size = elements * 5 * fine
    nodal, y = work_rows(nodes), work_rows(count)
    pull, theta, new = work_rows(4 * fine), work_rows(fine), work_rows(3 * fine)
    local, whole = work_rows(5 * fine), work_rows(size)
    press, moments = work_rows(3 if len(pressed) > 0 else 0), work_rows(len(pressed))
    tangents = work_rows(2 * nodes)
    rows = (across_rows, along_rows, bending_rows, tension_rows)
    for block in range(0, angles.shape[0], LANES):
        start = min(block, angles.shape[0] - LANES)
        read_lanes(angles, start * nodes, nodes, nodes, nodal, 0, 1)
        read_lanes(scalars, start * count, count, count, y, 0, 1)
        if len(pressed) > 0:
            _start_pressure(pressure, pressed, pole, weight, nodal, y, press, moments, tangents)
        x_left, y_left = spread(0.0), spread(0.0)
        for e in range(elements):
            base, length = e * (order - 1), lengths[e]
            moment = _left_moment(
                stiffness, slope, weight, softness, along, across, tension, rows, e, nodal, y
            )
            if len(pressed) > 0:
                moment = moment - load(moments, e)
            for i in range(fine):
                store(pull, i, _combined(fine_across, across_rows, e, i, y))
                store(pull, fine + i, _combined(fine_along, along_rows, e, i, y))
                store(pull, 2 * fine + i, _combined(fine_bending, bending_rows, e, i, y))
                store(pull, 3 * fine + i, _combined(fine_tension, tension_rows, e, i, y))
                angle = spread(0.0)
                for j in range(order):
                    angle = angle + spread(refine[i, j]) * load(nodal, base + j)
                store(theta, i, angle)
            left, steps = load(nodal, base), 0
            corner = (x_left, y_left)
            while steps < MOST and _iterate(
                integral, length, left, moment, corner, press, pull, give, fine_softness, e, theta,
                new, local,
            ):  # fmt: skip
                steps += 1
            # the sums of the last iteration, as they belong to its κ
            _integrate(integral, x_left, length, new, fine, local, X * fine)
            _integrate(integral, y_left, length, new, 2 * fine, local, Y * fine)
            x_left, y_left = load(local, X * fine + fine - 1), load(local, Y * fine + fine - 1)
            for i in range(5 * fine):
                store(whole, e * 5 * fine + i, load(local, i))
        write_lanes(whole, 0, 1, out, start * size, size, size)


@njit(**INNER)
def _derivatives(series, x):
    """Sum of a series of Legendre polynomials at x, with its first and second derivative."""
    before, here, slope_before, slope, bend_before, bend = 0.0, 1.0, 0.0, 0.0, 0.0, 0.0
    value, turn, rate = 0.0, 0.0, 0.0
    for k in range(len(series)):
        value, turn, rate = (
            value + series[k] * here,
            turn + series[k] * slope,
            rate + series[k] * bend,
        )
        twice = 2.0 * k + 1.0
        bend_before, bend = bend, bend_before + twice * slope
        slope_before, slope = slope, slope_before + twice * here
        before, here = here, (twice * x * here - k * before) / (k + 1.0)
    return value, turn, rate


@njit(**INNER)
def _refine_peak(fields, e, top, nodes, to_legendre, steps, series):
    """Place in [−1, 1] and size of the extremum of κ next to a node of an element."""
    count = len(nodes)
    for i in range(count):
        total = 0.0
        for j in range(count):
            total += to_legendre[i, j] * fields[e, KAPPA, j]
        series[i] = total
    x, low, high = nodes[top], nodes[max(top - 1, 0)], nodes[min(top + 1, count - 1)]
    for _ in range(steps):
        _, turn, rate = _derivatives(series, x)
        moved = x - turn / rate
        if low <= moved <= high:
            x = moved
    found, at_node = abs(_derivatives(series, x)[0]), abs(fields[e, KAPPA, top])
    if found >= at_node:
        return x, found
    return nodes[top], at_node


@njit(**FLAGS)
def peaks_lanes(nodes, to_legendre, breaks, lengths, near, steps, fields, value, place):
    """Largest |κ| of every lane, and its arclength, from fields (lanes, elements, 5, fine).

    Every node of the finer rule, in [−1, 1], that is a peak in its element, and not below the share
    `near` of the largest one, is improved by Newton's method on the element's polynomial.
    """
    lanes, elements, _, fine = fields.shape
    series = np.empty(fine)
    for lane in range(lanes):
        largest, total = 0.0, 0.0
        for e in range(elements):
            for i in range(fine):
                size = abs(fields[lane, e, KAPPA, i])
                largest, total = max(largest, size), total + size
        value[lane], place[lane] = -1.0, 0.0
        for e in range(elements):
            for i in range(fine):
                size = abs(fields[lane, e, KAPPA, i])
                left = abs(fields[lane, e, KAPPA, i - 1]) if i > 0 else -1.0
                right = abs(fields[lane, e, KAPPA, i + 1]) if i + 1 < fine else -1.0
                if size < left or size <= right or size < near * largest:
                    continue
                x, found = _refine_peak(fields[lane], e, i, nodes, to_legendre, steps, series)
                if found >= value[lane]:
                    value[lane] = found
                    place[lane] = breaks[e] + lengths[e] * 0.5 * (x + 1.0)
        if np.isnan(total):
            value[lane], place[lane] = np.nan, np.nan
