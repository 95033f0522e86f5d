"""Compiled Newton step of a rod in space, eight lanes at a time.

Unknowns of a node are the change ρ of the length r of its quaternion and a rotation φ on the axes
of its cross-section: δq = ρ q/r + ½ q φ. Lengths are eliminated at the nodes, inner nodes in their
elements, vertices along the chain; what remains are three closures and the load. Coordinates along
which there is no closure have one of their own with a multiplier −1.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.condensed_kernels import pivot_ratio
from equimorph.linalg.kernels import FLAGS, INNER, read_lanes, solve_lanes, write_lanes
from equimorph.linalg.simd import (
    LANES,
    absolute,
    load,
    sincos,
    spread,
    square_root,
    store,
    where_less,
    work_rows,
)
from equimorph.structures.spatial.element_kernels import (
    BORDER,
    COLUMN,
    FORCE,
    ROW,
    add_moment_rates,
    own_moments,
    pair_moments,
    pull_nodes,
    reduce_rows,
    relate,
    stiffen,
)

RADIUS, INVERSE, EXCESS, SOFT, RADIAL = range(5)
"""Rows of a node: r, 1/r, c (r² − 1), 1/(c (3 r² − 1)), and the closing row along q."""
RADII = 5
"""Their number."""
SHARES = 9
"""Rows of one row of a vertex: three of its own block, then the border."""
COUNT, SMALL, LARGE, TOTAL, PRODUCT = range(5)
"""Rows of the extremes, as of `pivot_ratio`: of the reciprocal pivots."""
DEFECT, WORST, SUM = range(3)
"""Rows of the sums over nodes."""
SYSTEM = np.int64(6)
"""Width of the system of three closures and the load with its two right-hand sides."""


@njit(**INNER)
def _read_scalars(p, dp, start, scalars, rates):
    """Parameters and 1; their velocities and 0."""
    count = p.shape[1]
    for k in range(LANES):
        for j in range(count):
            scalars[j, k], rates[j, k] = p[start + k, j], dp[start + k, j]
        scalars[count, k], rates[count, k] = 1.0, 0.0


@njit(**INNER)
def _mix(row, table, scalars):
    """Σ scalar · table over all scalars, for one row of a table."""
    value = spread(0.0)
    for j in range(table.shape[1]):
        if table[row, j] != 0.0:
            value = value + spread(table[row, j]) * load(scalars, j)
    return value


@njit(**INNER)
def _hold_end(turned, side, scalars, rates, q, node, velocity):
    """Quaternion of a clamp from its angles, and its angular velocity on its own axes."""
    half, two = spread(0.5), spread(2.0)
    first = 3 * side
    sa, ca = sincos(half * _mix(first, turned, scalars))
    sb, cb = sincos(half * _mix(first + 1, turned, scalars))
    st, ct = sincos(half * _mix(first + 2, turned, scalars))
    w, x, y, v = ca * cb, spread(0.0) - sa * sb, ca * sb, sa * cb
    store(q, 4 * node, w * ct - x * st)
    store(q, 4 * node + 1, w * st + x * ct)
    store(q, 4 * node + 2, y * ct + v * st)
    store(q, 4 * node + 3, v * ct - y * st)
    a, b = _mix(first, turned, rates), _mix(first + 1, turned, rates)
    sine, cosine = two * st * ct, ct * ct - st * st
    level, dip = cb * cb - sb * sb, two * sb * cb
    store(velocity, first, _mix(first + 2, turned, rates) - a * dip)
    store(velocity, first + 1, b * cosine + a * level * sine)
    store(velocity, first + 2, a * level * cosine - b * sine)


@njit(**INNER)
def _turn_row(q, at, row, to, scale):
    """Replace a node's entries of the closing row by those along φ; return the one along q."""
    q0, q1, q2, q3 = load(q, at), load(q, at + 1), load(q, at + 2), load(q, at + 3)
    r0, r1, r2, r3 = load(row, at), load(row, at + 1), load(row, at + 2), load(row, at + 3)
    store(row, to, scale * (r1 * q0 - r0 * q1 + r2 * q3 - r3 * q2))
    store(row, to + 1, scale * (r2 * q0 - r0 * q2 + r3 * q1 - r1 * q3))
    store(row, to + 2, scale * (r3 * q0 - r0 * q3 + r1 * q2 - r2 * q1))
    return r0 * q0 + r1 * q1 + r2 * q2 + r3 * q3


@njit(**INNER)
def _normalise(lengths, first, stop, q, row, radii, extremes, sums):
    """Unit quaternions; what belongs to the lengths of all nodes, and the closing row along φ."""
    zero, one, three, half = spread(0.0), spread(1.0), spread(3.0), spread(0.5)
    count, product, defect = zero, one, zero
    for i in range(first, stop):
        at, c = 4 * i, spread(lengths[i])
        q0, q1, q2, q3 = load(q, at), load(q, at + 1), load(q, at + 2), load(q, at + 3)
        square = q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3
        radius = square_root(square)
        inverse = one / radius
        store(q, at, q0 * inverse)
        store(q, at + 1, q1 * inverse)
        store(q, at + 2, q2 * inverse)
        store(q, at + 3, q3 * inverse)
        stiff, excess = c * (three * square - one), c * (square - one)
        soft, node = one / stiff, RADII * i
        count = count + where_less(stiff, zero, one, zero)
        product = product * (square * square * square * soft * spread(1.0 / 64.0))
        radial = _turn_row(q, at, row, at, half * radius)
        store(radii, node + RADIUS, radius)
        store(radii, node + INVERSE, inverse)
        store(radii, node + EXCESS, excess)
        store(radii, node + SOFT, soft)
        store(radii, node + RADIAL, radial)
        defect = defect + radial * excess * radius * soft
    store(sums, DEFECT, defect)
    store(extremes, COUNT, count)
    store(extremes, PRODUCT, product)


@njit(**INNER)
def _stretch(radii, node):
    """Stiffness of rotations where a quaternion is longer than 1."""
    radius = load(radii, RADII * node + RADIUS)
    return spread(0.25) * radius * radius * load(radii, RADII * node + EXCESS)


@njit(**INNER)
def _complete_inner(order, first, places, radii, row, gradient, width, matrix, base):
    """Take the lengths of inner nodes out of an element; write its part of the closing row."""
    size, one, zero = 3 * order, spread(1.0), spread(0.0)
    for i in range(order):
        at, node = base + 3 * i * width, first + places[i]
        if i >= order - 2:  # a vertex: see `_complete_vertex`
            for k in range(3):
                store(matrix, at + k * width + size + ROW, zero)
            continue
        inverse, soft = load(radii, RADII * node + INVERSE), load(radii, RADII * node + SOFT)
        growth = one + load(radii, RADII * node + EXCESS) * soft
        share = load(radii, RADII * node + RADIAL) * inverse * soft
        square = inverse * inverse * soft
        stretch = _stretch(radii, node)
        for k in range(3):
            slope, to = load(gradient, 4 * i + k), at + k * width
            for j in range(k, 3):
                own = load(matrix, to + 3 * i + j) - square * slope * load(gradient, 4 * i + j)
                store(matrix, to + 3 * i + j, own + stretch if j == k else own)
            store(matrix, to + size + FORCE, load(matrix, to + size + FORCE) * growth)
            store(matrix, to + size + ROW, load(row, 4 * node + k) + share * slope)


@njit(**INNER)
def _turn_held(order, local, side, velocity, width, matrix, base, rates):
    """Column of F_p·dp, and the rates of the closures, by the velocity of a held end."""
    size, held = 3 * order, 3 * local
    for k in range(3):
        turn = load(velocity, 3 * side + k)
        for i in range(size):
            upper = i <= held + k
            at = i * width + held + k if upper else (held + k) * width + i
            to = base + i * width + size + COLUMN
            store(matrix, to, load(matrix, to) + load(matrix, base + at) * turn)
        for c in range(3):
            at = base + (held + k) * width + size + c
            store(rates, c, load(rates, c) + load(matrix, at) * turn)


@njit(**INNER)
def _add_products(inner, size, width, matrix, base, lower, products):
    """Products of the border columns over the inner rotations of an element."""
    for a in range(BORDER):
        for c in range(a, BORDER):
            value = load(products, BORDER * a + c)
            for k in range(inner):
                at = k * width + size
                value = value + load(lower, at + a) * load(matrix, base + at + c)
            store(products, BORDER * a + c, value)


@njit(**INNER)
def _to_vertices(e, inner, size, width, matrix, base, vertices, ties):
    """Add what remains of an element to the rows of its vertices."""
    for side in range(2):
        for r in range(3):
            row, to = base + (inner + 3 * side + r) * width, (3 * (e + side) + r) * SHARES
            for c in range(r, 3):
                own = load(matrix, row + inner + 3 * side + c)
                store(vertices, to + c, load(vertices, to + c) + own)
            for c in range(BORDER):
                value = load(matrix, row + size + c)
                store(vertices, to + 3 + c, load(vertices, to + 3 + c) + value)
    for r in range(3):
        for c in range(3):
            tie = load(matrix, base + (inner + r) * width + inner + 3 + c)
            store(ties, 9 * e + 3 * r + c, tie)


@njit(**INNER)
def _complete_vertex(v, node, radii, row, slopes, vertices):
    """Take the length of a vertex out of its rows; write its part of the closing row."""
    inverse, soft = load(radii, RADII * node + INVERSE), load(radii, RADII * node + SOFT)
    growth = load(radii, RADII * node + EXCESS) * soft
    share = load(radii, RADII * node + RADIAL) * inverse * soft
    square, stretch = inverse * inverse * soft, _stretch(radii, node)
    for k in range(3):
        slope, to = load(slopes, 3 * node + k), (3 * v + k) * SHARES
        for j in range(k, 3):
            own = load(vertices, to + j) - square * slope * load(slopes, 3 * node + j)
            store(vertices, to + j, own + stretch if j == k else own)
        store(vertices, to + 3 + FORCE, load(vertices, to + 3 + FORCE) - growth * slope)
        own = load(vertices, to + 3 + ROW) + share * slope
        store(vertices, to + 3 + ROW, own + load(row, 4 * node + k))


@njit(**INNER)
def _eliminate_vertex(v, last, vertices, ties, products, extremes):
    """Eliminate the rotation of a vertex from the next one and from the border."""
    one = spread(1.0)
    for k in range(3):
        row = (3 * v + k) * SHARES
        inverse = one / load(vertices, row + k)
        store(vertices, row + k, inverse)
        _note_pivot(inverse, extremes)
        for i in range(k + 1, 3):
            factor, to = load(vertices, row + i) * inverse, (3 * v + i) * SHARES
            for j in range(i, SHARES):
                store(vertices, to + j, load(vertices, to + j) - factor * load(vertices, row + j))
            if v < last:
                tie, here = 9 * v + 3 * i, 9 * v + 3 * k
                for j in range(3):
                    store(ties, tie + j, load(ties, tie + j) - factor * load(ties, here + j))
        if v < last:
            for i in range(3):
                factor = load(ties, 9 * v + 3 * k + i) * inverse
                to = (3 * v + 3 + i) * SHARES
                for j in range(i, 3):
                    own = load(vertices, to + j) - factor * load(ties, 9 * v + 3 * k + j)
                    store(vertices, to + j, own)
                for j in range(3, SHARES):
                    own = load(vertices, to + j) - factor * load(vertices, row + j)
                    store(vertices, to + j, own)
        for a in range(BORDER):
            factor = load(vertices, row + 3 + a) * inverse
            for c in range(a, BORDER):
                at = BORDER * a + c
                store(products, at, load(products, at) + factor * load(vertices, row + 3 + c))


@njit(**INNER)
def _note_pivot(inverse, extremes):
    """Count a negative pivot; note extremes, sum and product of the reciprocals."""
    zero, one, size = spread(0.0), spread(1.0), absolute(inverse)
    count, small, large = load(extremes, COUNT), load(extremes, SMALL), load(extremes, LARGE)
    store(extremes, COUNT, count + where_less(inverse, zero, one, zero))
    store(extremes, SMALL, where_less(size, small, size, small))
    store(extremes, LARGE, where_less(large, size, size, large))
    store(extremes, TOTAL, load(extremes, TOTAL) + inverse)
    store(extremes, PRODUCT, load(extremes, PRODUCT) * inverse)


@njit(**INNER)
def _small_system(axes, compliance, products, closing, rates, row, given, small):
    """Schur system of the closures and the load, in rows of `SYSTEM`; given: corner and defect."""
    zero = spread(0.0)
    for a in range(3):
        at = a * SYSTEM
        if axes[a] < 0:
            for c in range(SYSTEM):
                store(small, at + c, spread(compliance[a, c] if c < 3 else 0.0))
            store(small, 3 * SYSTEM + a, zero)
            continue
        for c in range(3):
            low, high = min(a, c), max(a, c)
            value = spread(compliance[a, c]) - load(products, BORDER * low + high)
            store(small, at + c, value if axes[c] >= 0 else zero)
        store(small, at + 3, load(rates, a) - load(products, BORDER * a + COLUMN))
        store(small, at + 4, zero - load(closing, a) - load(products, BORDER * a + FORCE))
        store(small, at + 5, zero)
        store(small, 3 * SYSTEM + a, load(row, a) - load(products, BORDER * a + ROW))
    at = 3 * SYSTEM
    store(small, at + 3, load(given, 0) - load(products, BORDER * COLUMN + ROW))
    store(small, at + 4, zero - load(given, 1) - load(products, BORDER * FORCE + ROW))
    store(small, at + 5, spread(1.0))


@njit(**INNER)
def _note_closures(small, extremes):
    """Count negative eigenvalues of the closures' block, by the signs of its invariants; det."""
    a, b, c = load(small, 0), load(small, 1), load(small, 2)
    d, e, f = load(small, SYSTEM + 1), load(small, SYSTEM + 2), load(small, 2 * SYSTEM + 2)
    zero, one = spread(0.0), spread(1.0)
    first, second = a + d + f, a * d - b * b + a * f - c * c + d * f - e * e
    third = a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d)
    # changes of sign in x³ − first x² + second x − third, at −x
    count, sign = zero, one
    for value in (first, second, third):
        count = count + where_less(sign * value, zero, one, zero)
        sign = where_less(value, zero, zero - one, one)
    store(extremes, COUNT, load(extremes, COUNT) + count)
    store(extremes, PRODUCT, third / load(extremes, PRODUCT))


@njit(**INNER)
def _restore_vertex(v, last, node, after, vertices, ties, small, turns):
    """Back-substitute step and tangent at a vertex; turns: six rows a node."""
    for k in range(2, -1, -1):
        row = (3 * v + k) * SHARES
        step, turn = _reduced(vertices, row + 3, small)
        for j in range(k + 1, 3):
            factor, at = load(vertices, row + j), 6 * node + 2 * j
            step, turn = step - factor * load(turns, at), turn - factor * load(turns, at + 1)
        if v < last:
            for j in range(3):
                factor, at = load(ties, 9 * v + 3 * k + j), 6 * after + 2 * j
                step, turn = step - factor * load(turns, at), turn - factor * load(turns, at + 1)
        inverse = load(vertices, row + k)
        store(turns, 6 * node + 2 * k, step * inverse)
        store(turns, 6 * node + 2 * k + 1, turn * inverse)


@njit(**INNER)
def _reduced(rows, at, small):
    """Right-hand sides of step and tangent from reduced border columns."""
    step, turn = load(rows, at + FORCE), spread(0.0)
    for c in range(4):
        column = load(rows, at + (c if c < 3 else COLUMN))
        step = step - column * load(small, c * SYSTEM + 4)
        turn = turn - column * load(small, c * SYSTEM + 5)
    return step, turn


@njit(**INNER)
def _restore_inner(inner, size, first, places, width, matrix, base, pivots, at, small, turns):
    """Back-substitute step and tangent at the inner nodes of an element."""
    for k in range(inner - 1, -1, -1):
        row = base + k * width
        step, turn = _reduced(matrix, row + size, small)
        for j in range(k + 1, size):
            to = 6 * (first + places[j // 3]) + 2 * (j % 3)
            factor = load(matrix, row + j)
            step, turn = step - factor * load(turns, to), turn - factor * load(turns, to + 1)
        to, inverse = 6 * (first + places[k // 3]) + 2 * (k % 3), load(pivots, at + k)
        store(turns, to, step * inverse)
        store(turns, to + 1, turn * inverse)


@njit(**INNER)
def _finish_nodes(first, stop, q, radii, slopes, turns, sums, out):
    """Changes of the quaternions by step and tangent, in pairs of rows; the largest residual."""
    half, two = spread(0.5), spread(2.0)
    worst, total = load(sums, WORST), load(sums, SUM)
    for i in range(first, stop):
        at, node = 4 * i, RADII * i
        q0, q1, q2, q3 = load(q, at), load(q, at + 1), load(q, at + 2), load(q, at + 3)
        radius, inverse = load(radii, node + RADIUS), load(radii, node + INVERSE)
        soft, push = load(radii, node + SOFT), load(radii, node + EXCESS) * radius
        g0, g1, g2 = load(slopes, 3 * i), load(slopes, 3 * i + 1), load(slopes, 3 * i + 2)
        for side in range(2):
            w0, w1 = load(turns, 6 * i + side), load(turns, 6 * i + 2 + side)
            w2 = load(turns, 6 * i + 4 + side)
            grow = inverse * (g0 * w0 + g1 * w1 + g2 * w2)
            grow = soft * (grow - push) if side == 0 else soft * grow
            w0, w1, w2 = half * radius * w0, half * radius * w1, half * radius * w2
            to = 8 * i + side
            store(out, to, grow * q0 - w0 * q1 - w1 * q2 - w2 * q3)
            store(out, to + 2, grow * q1 + w0 * q0 - w1 * q3 + w2 * q2)
            store(out, to + 4, grow * q2 + w0 * q3 + w1 * q0 - w2 * q1)
            store(out, to + 6, grow * q3 - w0 * q2 + w1 * q1 + w2 * q0)
        g0, g1, g2 = two * inverse * g0, two * inverse * g1, two * inverse * g2
        f0, f1 = push * q0 - g0 * q1 - g1 * q2 - g2 * q3, push * q1 + g0 * q0 - g1 * q3 + g2 * q2
        f2, f3 = push * q2 + g0 * q3 + g1 * q0 - g2 * q1, push * q3 - g0 * q2 + g1 * q1 + g2 * q0
        for value in (f0, f1, f2, f3):
            size = absolute(value)
            worst, total = where_less(worst, size, size, worst), total + size
    store(sums, WORST, worst)
    store(sums, SUM, total)


@njit(**INNER)
def _start_block(closing_table, scalars, rates, compliance, pulls, closing, closing_rates, sums):
    """Closures before the sum over nodes, and their rates by the parameters themselves."""
    zero = spread(0.0)
    for a in range(3):
        value = _mix(a, closing_table, scalars)
        for c in range(3):
            value = value + spread(compliance[a, c]) * load(pulls, c)
        store(closing, a, value)
        store(closing_rates, a, _mix(a, closing_table, rates))
    store(sums, WORST, zero)
    store(sums, SUM, zero)


@njit(**INNER)
def _clear_block(vertices, products, extremes):
    """Reset what elements and pivots are added to."""
    zero = spread(0.0)
    for i in range(vertices.shape[0]):
        store(vertices, i, zero)
    for i in range(products.shape[0]):
        store(products, i, zero)
    store(extremes, SMALL, spread(np.inf))
    store(extremes, LARGE, zero)
    store(extremes, TOTAL, zero)


@njit(**INNER)
def _keep_slopes(order, first, places, gradient, slopes):
    """Add an element's ∂L/∂φ to its nodes."""
    for i in range(order):
        to = 3 * (first + places[i])
        for k in range(3):
            store(slopes, to + k, load(slopes, to + k) + load(gradient, 4 * i + k))


@njit(**FLAGS)
def advance_lanes(
    places, slopes, weights, stiff, moments, moment_picks, torsion, torsion_picks, forces,
    force_picks, turned, held, axes, closing_table, compliance, lengths,
    z, p, dp, row, corner, defect,
    dz, dt, tangent_z, tangent_t, residual, index, determinant, ratio,
):  # fmt: skip
    """Fused Newton step, tangent and inertia of a rod; see `structures.contract.Advance`.

    axes: number of the multiplier along x, y, z, or −1; moment rates are left out where nothing
    but forces changes with parameters.
    """
    elements, order = slopes.shape[0], slopes.shape[1]
    degree, size, inner = order - 1, 3 * order, 3 * (order - 2)
    width = (size + BORDER + 3) // 4 * 4
    nodes, lanes, entries = elements * degree + 1, z.shape[0], z.shape[1]
    first, stop = held[0], nodes - held[1]
    begin, last = held[0], elements - held[1]
    free = 4 * (stop - first)
    q, row_q, radii = work_rows(4 * nodes + 8), work_rows(4 * nodes + 8), work_rows(RADII * nodes)
    scalars, rates = work_rows(p.shape[1] + 1), work_rows(p.shape[1] + 1)
    velocity, pulls, closing, closing_rates = (
        work_rows(6), work_rows(3), work_rows(3), work_rows(3)
    )  # fmt: skip
    row_pulls, given, sums, extremes = work_rows(3), work_rows(2), work_rows(3), work_rows(5)
    relative, strains, gradient = (
        work_rows(4 * order * order), work_rows(4 * order), work_rows(4 * order)
    )  # fmt: skip
    jacobian, scaled = work_rows((size + 1) * width), work_rows((size + 1) * width)
    twists, three, total = work_rows(order), work_rows(3), work_rows(3 * nodes)
    matrix, lower = work_rows((elements * size + 1) * width + 8), work_rows((size + 1) * width)
    pivots, vertices = work_rows(elements * inner), work_rows((elements + 1) * 3 * SHARES)
    ties, products, small = work_rows(elements * 9), work_rows(36), work_rows(24)
    turns, out = work_rows(6 * nodes), work_rows(8 * nodes + 16)
    jacobian[:], scaled[:], matrix[:], lower[:] = 0.0, 0.0, 0.0, 0.0
    turns[:] = 0.0
    for block in range(0, lanes, LANES):
        start = min(block, lanes - LANES)
        _read_scalars(p, dp, start, scalars, rates)
        read_lanes(z, start * entries, entries, free, q, 4 * first, 1)
        read_lanes(row, start * entries, entries, free, row_q, 4 * first, 1)
        for k in range(LANES):
            at = start + k
            for c in range(3):
                there = axes[c] >= 0
                pulls[c, k] = z[at, free + axes[c]] if there else 0.0
                row_pulls[c, k] = row[at, free + axes[c]] if there else 0.0
            given[0, k], given[1, k] = corner[at], defect[at]
        _clear_block(vertices, products, extremes)
        _start_block(closing_table, scalars, rates, compliance, pulls, closing, closing_rates, sums)
        _normalise(lengths, first, stop, q, row_q, radii, extremes, sums)
        store(given, 1, load(given, 1) - load(sums, DEFECT))
        if held[0]:
            _hold_end(turned, 0, scalars, rates, q, 0, velocity)
        if held[1]:
            _hold_end(turned, 1, scalars, rates, q, nodes - 1, velocity)
        total[:] = 0.0
        for e in range(elements):
            node, base = e * degree, e * size * width
            relate(e, order, node, places, slopes, q, relative, strains)
            own_moments(
                e, order, stiff, moments, moment_picks, torsion, torsion_picks, scalars, slopes,
                strains, twists, jacobian, width, gradient, three,
            )  # fmt: skip
            pair_moments(
                e, order, slopes, relative, strains, jacobian, width, gradient, matrix, base
            )
            pull_nodes(
                e, order, node, places, weights, forces, force_picks, scalars, rates, pulls, q,
                gradient, width, matrix, base, three, closing,
            )  # fmt: skip
            _keep_slopes(order, node, places, gradient, total)
            stiffen(
                e, order, width, stiff, torsion, torsion_picks, scalars, jacobian, scaled, matrix,
                base,
            )  # fmt: skip
            if len(moment_picks) > 0 or len(torsion_picks) > 0:
                add_moment_rates(
                    e, order, width, moments, moment_picks, torsion, torsion_picks, rates, twists,
                    jacobian, matrix, base, three,
                )  # fmt: skip
            if e == 0 and held[0]:
                _turn_held(order, order - 2, 0, velocity, width, matrix, base, closing_rates)
            if e == elements - 1 and held[1]:
                _turn_held(order, order - 1, 1, velocity, width, matrix, base, closing_rates)
            _complete_inner(order, node, places, radii, row_q, gradient, width, matrix, base)
            reduce_rows(inner, size, width, matrix, base, lower, pivots, e * inner)
            for k in range(inner):
                _note_pivot(load(pivots, e * inner + k), extremes)
            _add_products(inner, size, width, matrix, base, lower, products)
            _to_vertices(e, inner, size, width, matrix, base, vertices, ties)
        for v in range(begin, last + 1):
            _complete_vertex(v, v * degree, radii, row_q, total, vertices)
        for v in range(begin, last + 1):
            _eliminate_vertex(v, last, vertices, ties, products, extremes)
        _small_system(axes, compliance, products, closing, closing_rates, row_pulls, given, small)
        _note_closures(small, extremes)
        solve_lanes(small, 4, 6)
        for v in range(last, begin - 1, -1):
            _restore_vertex(v, last, v * degree, (v + 1) * degree, vertices, ties, small, turns)
        for e in range(elements):
            _restore_inner(
                inner, size, e * degree, places, width, matrix, e * size * width, pivots,
                e * inner, small, turns,
            )  # fmt: skip
        _finish_nodes(first, stop, q, radii, total, turns, sums, out)
        for c in range(3):
            if axes[c] >= 0:
                at = 2 * (4 * stop + axes[c])
                store(out, at, load(small, c * SYSTEM + 4))
                store(out, at + 1, load(small, c * SYSTEM + 5))
                gap = absolute(load(closing, c))
                worst = load(sums, WORST)
                store(sums, WORST, where_less(worst, gap, gap, worst))
                store(sums, SUM, load(sums, SUM) + gap)
        write_lanes(out, 8 * first, 2, dz, start * entries, entries, entries)
        write_lanes(out, 8 * first + 1, 2, tangent_z, start * entries, entries, entries)
        for k in range(LANES):
            at, whole = start + k, sums[SUM, k]
            dt[at], tangent_t[at] = small[3 * SYSTEM + 4, k], small[3 * SYSTEM + 5, k]
            residual[at] = sums[WORST, k] if whole == whole else np.nan  # noqa: PLR0124
            index[at] = np.int64(extremes[COUNT, k]) - 3
            determinant[at], ratio[at] = extremes[PRODUCT, k], pivot_ratio(extremes, k)
