"""Compiled kernels of the nodes of a rod in space: clamps, lengths of quaternions, borders.

Unknowns of a node are the change ρ of the length r of its quaternion and a rotation φ on the axes
of its cross-section: δq = ρ q/r + ½ q φ. Lengths are eliminated at the nodes.
"""

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import INNER, balance
from equimorph.linalg.simd import (
    LANES,
    absolute,
    load,
    load2,
    load4,
    repeat2,
    repeat4,
    row_of,
    sincos,
    spread,
    square_root,
    stack2,
    store,
    where_less,
)
from equimorph.structures.spatial.force_kernels import BORDER, COLUMN, FORCE, ROW

RADIUS, INVERSE, EXCESS, SOFT, RADIAL = range(5)
"""Rows of a node: r, 1/r, c (r² − 1), 1/(c (3 r² − 1)), and the closing row along q."""
RADII = 5
"""Their number."""
COUNT, SMALL, LARGE, TOTAL, PRODUCT, EXPONENT = range(6)
"""Rows of the extremes, as of `pivot_ratio`: of the reciprocal pivots, whose product is m·2^e."""
DEFECT, WORST, SUM, PUSH = range(4)
"""Rows of the sums over nodes; PUSH: what a force that grows adds to the corner."""
SUMS = 4
"""Their number."""


@njit(**INNER)
def read_scalars(p, dp, start, scalars, rates):
    """Parameters and 1; their velocities and 0."""
    count = p.shape[1]
    for k in range(LANES):
        for j in range(count):
            scalars[j, k], rates[j, k] = p[start + k, j], dp[start + k, j]
        scalars[count, k], rates[count, k] = 1.0, 0.0


@njit(**INNER)
def mix(row, table, scalars):
    """Σ scalar · table over all scalars, for one row of a table."""
    value = spread(0.0)
    for j in range(table.shape[1]):
        if table[row, j] != 0.0:
            value = value + spread(table[row, j]) * load(scalars, j)
    return value


@njit(**INNER)
def hold_end(turned, side, scalars, rates, q, node, velocity):
    """Quaternion of a clamp from its angles, and its angular velocity on its own axes."""
    half, two = spread(0.5), spread(2.0)
    first = 3 * side
    sa, ca = sincos(half * mix(first, turned, scalars))
    sb, cb = sincos(half * mix(first + 1, turned, scalars))
    st, ct = sincos(half * mix(first + 2, turned, scalars))
    w, x, y, v = ca * cb, spread(0.0) - sa * sb, ca * sb, sa * cb
    store(q, 4 * node, w * ct - x * st)
    store(q, 4 * node + 1, w * st + x * ct)
    store(q, 4 * node + 2, y * ct + v * st)
    store(q, 4 * node + 3, v * ct - y * st)
    a, b = mix(first, turned, rates), mix(first + 1, turned, rates)
    sine, cosine = two * st * ct, ct * ct - st * st
    level, dip = cb * cb - sb * sb, two * sb * cb
    store(velocity, first, mix(first + 2, turned, rates) - a * dip)
    store(velocity, first + 1, b * cosine + a * level * sine)
    store(velocity, first + 2, a * level * cosine - b * sine)


@njit(**INNER)
def turn_row(q, at, row, to, scale):
    """Replace four entries of a row by three along φ of a node; return the one along q."""
    q0, q1, q2, q3 = load(q, at), load(q, at + 1), load(q, at + 2), load(q, at + 3)
    r0, r1, r2, r3 = load(row, to), load(row, to + 1), load(row, to + 2), load(row, to + 3)
    store(row, to, scale * (r1 * q0 - r0 * q1 + r2 * q3 - r3 * q2))
    store(row, to + 1, scale * (r2 * q0 - r0 * q2 + r3 * q1 - r1 * q3))
    store(row, to + 2, scale * (r3 * q0 - r0 * q3 + r1 * q2 - r2 * q1))
    return r0 * q0 + r1 * q1 + r2 * q2 + r3 * q3


@njit(**INNER)
def normalise(lengths, lowered, first, stop, q, row, radii, extremes, sums):
    """Unit quaternions; what belongs to the lengths of all nodes, and the closing row along φ.

    lowered: one row, by how much a shift of the metric lowers r² in units of the stiffness.
    """
    zero, one, three, half = spread(0.0), spread(1.0), spread(3.0), spread(0.5)
    count, product, exponent, defect = zero, one, zero, zero
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
        less = one + load(lowered, 0)
        stiff, excess = c * (three * square - less), c * (square - less)
        soft, node = one / stiff, RADII * i
        count = count + where_less(stiff, zero, one, zero)
        product = product * (square * square * square * soft * spread(1.0 / 64.0))
        product, exponent = balance(product, exponent)
        radial = turn_row(q, at, row, at, half * radius)
        store(radii, node + RADIUS, radius)
        store(radii, node + INVERSE, inverse)
        store(radii, node + EXCESS, excess)
        store(radii, node + SOFT, soft)
        store(radii, node + RADIAL, radial)
        defect = defect + radial * excess * radius * soft
    store(sums, DEFECT, defect)
    store(extremes, COUNT, count)
    store(extremes, PRODUCT, product)
    store(extremes, EXPONENT, exponent)


@njit(**INNER)
def turn_forces(first, stop, q, radii, force, growth, sums):
    """Forces on quaternions, and their rates: three along φ, one along q; their sums over lengths.

    As `normalise` turns the closing row; both forces are to be taken off F and its rate.
    """
    defect, push, half = load(sums, DEFECT), load(sums, PUSH), spread(0.5)
    for i in range(first, stop):
        node = RADII * i
        scale = half * load(radii, node + RADIUS)
        share = load(radii, node + RADIAL) * load(radii, node + SOFT)
        along, more = (
            turn_row(q, 4 * i, force, 4 * i, scale),
            turn_row(q, 4 * i, growth, 4 * i, scale),
        )
        store(force, 4 * i + 3, along)
        store(growth, 4 * i + 3, more)
        defect, push = defect - share * along, push + share * more
    store(sums, DEFECT, defect)
    store(sums, PUSH, push)


@njit(**INNER)
def force_node(node, radii, force, growth, slopes, at, rows, to, step):
    """Add the forces on a node to both columns of its three rows, `step` apart.

    slopes: ∂L/∂φ of the node, from the row `at` on.
    """
    soft = load(radii, RADII * node + INVERSE) * load(radii, RADII * node + SOFT)
    share, more = soft * load(force, 4 * node + 3), soft * load(growth, 4 * node + 3)
    for k in range(3):
        slope, here = load(slopes, at + k), to + k * step
        pull, rate = load(force, 4 * node + k), load(growth, 4 * node + k)
        store(rows, here + FORCE, load(rows, here + FORCE) + pull + slope * share)
        store(rows, here + COLUMN, load(rows, here + COLUMN) - rate - slope * more)


@njit(**INNER)
def stretch_of(radii, node):
    """Stiffness of rotations where a quaternion is longer than 1."""
    radius = load(radii, RADII * node + RADIUS)
    return spread(0.25) * radius * radius * load(radii, RADII * node + EXCESS)


@njit(**INNER)
def complete_inner(order, first, places, radii, row, gradient, width, matrix, base):
    """Take the lengths of inner nodes out of an element; write its part of the closing row."""
    size, one, zero = 3 * order, spread(1.0), spread(0.0)
    for i in range(order):
        at, node = base + 3 * i * width, first + places[i]
        if i >= order - 2:  # a vertex: see `complete_vertex`
            for k in range(3):
                store(matrix, at + k * width + size + ROW, zero)
            continue
        inverse, soft = load(radii, RADII * node + INVERSE), load(radii, RADII * node + SOFT)
        growth = one + load(radii, RADII * node + EXCESS) * soft
        share = load(radii, RADII * node + RADIAL) * inverse * soft
        square = inverse * inverse * soft
        stretch = stretch_of(radii, node)
        for k in range(3):
            slope, to = load(gradient, 4 * i + k), at + k * width
            for j in range(k, 3):
                own = load(matrix, to + 3 * i + j) - square * slope * load(gradient, 4 * i + j)
                store(matrix, to + 3 * i + j, own + stretch if j == k else own)
            store(matrix, to + size + FORCE, load(matrix, to + size + FORCE) * growth)
            store(matrix, to + size + ROW, load(row, 4 * node + k) + share * slope)


@njit(**INNER)
def finish_nodes(first, stop, q, radii, slopes, turns, force, growth, shares, sums, out):
    """Changes of the quaternions by step and tangent, in pairs of rows; the largest residual.

    force, growth: as of `turn_forces`; shares: two rows, how far both go along the curve.
    """
    half, two = spread(0.5), spread(2.0)
    worst, total = load(sums, WORST), load(sums, SUM)
    for i in range(first, stop):
        at, node = 4 * i, RADII * i
        q0, q1, q2, q3 = load(q, at), load(q, at + 1), load(q, at + 2), load(q, at + 3)
        radius, inverse = load(radii, node + RADIUS), load(radii, node + INVERSE)
        soft = load(radii, node + SOFT)
        push = load(radii, node + EXCESS) * radius - load(force, 4 * i + 3)
        g0, g1, g2 = load(slopes, 3 * i), load(slopes, 3 * i + 1), load(slopes, 3 * i + 2)
        for side in range(2):
            w0, w1 = load(turns, 6 * i + side), load(turns, 6 * i + 2 + side)
            w2 = load(turns, 6 * i + 4 + side)
            grow = inverse * (g0 * w0 + g1 * w1 + g2 * w2)
            grow = grow + load(growth, 4 * i + 3) * load(shares, side)
            grow = soft * (grow - push) if side == 0 else soft * grow
            w0, w1, w2 = half * radius * w0, half * radius * w1, half * radius * w2
            to = 8 * i + side
            store(out, to, grow * q0 - w0 * q1 - w1 * q2 - w2 * q3)
            store(out, to + 2, grow * q1 + w0 * q0 - w1 * q3 + w2 * q2)
            store(out, to + 4, grow * q2 + w0 * q3 + w1 * q0 - w2 * q1)
            store(out, to + 6, grow * q3 - w0 * q2 + w1 * q1 + w2 * q0)
        g0, g1 = g0 - load(force, 4 * i), g1 - load(force, 4 * i + 1)
        g2 = g2 - load(force, 4 * i + 2)
        g0, g1, g2 = two * inverse * g0, two * inverse * g1, two * inverse * g2
        f0, f1 = push * q0 - g0 * q1 - g1 * q2 - g2 * q3, push * q1 + g0 * q0 - g1 * q3 + g2 * q2
        f2, f3 = push * q2 + g0 * q3 + g1 * q0 - g2 * q1, push * q3 - g0 * q2 + g1 * q1 + g2 * q0
        for value in (f0, f1, f2, f3):
            size = absolute(value)
            worst, total = where_less(worst, size, size, worst), total + size
    store(sums, WORST, worst)
    store(sums, SUM, total)


@njit(**INNER)
def turn_held(order, local, side, velocity, width, matrix, base, rates):
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
def add_products(inner, size, width, matrix, base, lower, products):
    """Products of the border columns over the inner rotations of an element.

    Those with a closure, and those of the closing row with the two columns of the load.
    """
    for a in range(3):
        many, few = load4(products, BORDER * a), load2(products, BORDER * a + 4)
        for k in range(inner):
            at = k * width + size
            factor = load(lower, at + a)
            many = many + repeat4(factor) * load4(matrix, base + at)
            few = few + repeat2(factor) * load2(matrix, base + at + 4)
        store(products, BORDER * a, many)
        store(products, BORDER * a + 4, few)
    pair = stack2(load(products, BORDER * FORCE + ROW), load(products, BORDER * COLUMN + ROW))
    for k in range(inner):
        at = k * width + size
        pair = pair + load2(matrix, base + at + FORCE) * repeat2(load(lower, at + ROW))
    store(products, BORDER * FORCE + ROW, row_of(pair, 0))
    store(products, BORDER * COLUMN + ROW, row_of(pair, 1))
