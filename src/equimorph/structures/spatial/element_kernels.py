"""Compiled kernels of one element of a rod in space, eight lanes at a time.

Nodes stand in the order of elimination: inner ones, then left, right. Variations are rotations φ on
the axes of the cross-section, δq = ½ q φ. Rows of an element: first the 3 (degree + 1) rotations,
then the `BORDER` columns. See `step_kernels` for the whole step.
"""

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import INNER
from equimorph.linalg.simd import load, load4, repeat4, spread, store

FORCE, COLUMN, ROW, BORDER = 3, 4, 5, 6
"""Border columns: three closures, −∂L/∂φ, its change by dp, the closing row; and their number."""


@njit(**INNER)
def relate(e, order, first, places, slopes, q, relative, strains):
    """Quaternions q_i* q_j of pairs i < j, and per node half the strains and q·q'.

    relative: four rows for i·order + j; strains: four rows a node.
    """
    zero = spread(0.0)
    for i in range(order):
        store(strains, 4 * i, zero)
        store(strains, 4 * i + 1, zero)
        store(strains, 4 * i + 2, zero)
        store(strains, 4 * i + 3, spread(slopes[e, i, i]))
    for i in range(order):
        at = 4 * (first + places[i])
        a0, a1, a2, a3 = load(q, at), load(q, at + 1), load(q, at + 2), load(q, at + 3)
        u0, u1 = load(strains, 4 * i), load(strains, 4 * i + 1)
        u2, u3 = load(strains, 4 * i + 2), load(strains, 4 * i + 3)
        for j in range(i + 1, order):
            to = 4 * (first + places[j])
            b0, b1, b2, b3 = load(q, to), load(q, to + 1), load(q, to + 2), load(q, to + 3)
            r0 = a0 * b0 + a1 * b1 + a2 * b2 + a3 * b3
            r1 = a0 * b1 - a1 * b0 - a2 * b3 + a3 * b2
            r2 = a0 * b2 - a2 * b0 - a3 * b1 + a1 * b3
            r3 = a0 * b3 - a3 * b0 - a1 * b2 + a2 * b1
            pair = 4 * (i * order + j)
            store(relative, pair, r0)
            store(relative, pair + 1, r1)
            store(relative, pair + 2, r2)
            store(relative, pair + 3, r3)
            ahead, back = spread(slopes[e, i, j]), spread(slopes[e, j, i])
            u0, u1 = u0 + ahead * r1, u1 + ahead * r2
            u2, u3 = u2 + ahead * r3, u3 + ahead * r0
            store(strains, 4 * j, load(strains, 4 * j) - back * r1)
            store(strains, 4 * j + 1, load(strains, 4 * j + 1) - back * r2)
            store(strains, 4 * j + 2, load(strains, 4 * j + 2) - back * r3)
            store(strains, 4 * j + 3, load(strains, 4 * j + 3) + back * r0)
        store(strains, 4 * i, u0)
        store(strains, 4 * i + 1, u1)
        store(strains, 4 * i + 2, u2)
        store(strains, 4 * i + 3, u3)


@njit(**INNER)
def combine(e, i, table, picks, scalars, out):
    """Three components at node i of an element: Σ scalar · table, into three rows of `out`."""
    a, b, c = spread(0.0), spread(0.0), spread(0.0)
    for k in range(len(picks)):
        y = load(scalars, picks[k])
        a = a + y * spread(table[k, e, i, 0])
        b = b + y * spread(table[k, e, i, 1])
        c = c + y * spread(table[k, e, i, 2])
    store(out, 0, a)
    store(out, 1, b)
    store(out, 2, c)


@njit(**INNER)
def combine_one(e, i, table, picks, scalars):
    """Σ scalar · table at node i of an element."""
    a = spread(0.0)
    for k in range(len(picks)):
        a = a + load(scalars, picks[k]) * spread(table[k, e, i])
    return a


@njit(**INNER)
def own_moments(
    e, order, stiff, moments, moment_picks, torsion, torsion_picks, scalars, slopes,
    strains, twists, jacobian, width, gradient, three,
):  # fmt: skip
    """Weighted moments in place of half strains; a node's own part of Jacobian and gradient.

    gradient: four rows a node, ∂L/∂φ and q·∂L/∂q of the strains; twists: half of them.
    """
    zero, two = spread(0.0), spread(2.0)
    for i in range(order):
        u0, u1, u2 = load(strains, 4 * i), load(strains, 4 * i + 1), load(strains, 4 * i + 2)
        store(twists, i, u0)
        m0 = u0 * two * spread(stiff[e, i, 0])
        m1, m2 = u1 * two * spread(stiff[e, i, 1]), u2 * two * spread(stiff[e, i, 2])
        if len(moment_picks) > 0:
            combine(e, i, moments, moment_picks, scalars, three)
            m0, m1, m2 = m0 - load(three, 0), m1 - load(three, 1), m2 - load(three, 2)
        if len(torsion_picks) > 0:
            m0 = m0 + two * u0 * combine_one(e, i, torsion, torsion_picks, scalars)
        own = spread(slopes[e, i, i]) - load(strains, 4 * i + 3)
        at = 3 * i * width + 3 * i
        store(jacobian, at, own)
        store(jacobian, at + 1, zero - u2)
        store(jacobian, at + 2, u1)
        store(jacobian, at + width, u2)
        store(jacobian, at + width + 1, own)
        store(jacobian, at + width + 2, zero - u0)
        store(jacobian, at + 2 * width, zero - u1)
        store(jacobian, at + 2 * width + 1, u0)
        store(jacobian, at + 2 * width + 2, own)
        store(gradient, 4 * i, own * m0 + u2 * m1 - u1 * m2)
        store(gradient, 4 * i + 1, own * m1 - u2 * m0 + u0 * m2)
        store(gradient, 4 * i + 2, own * m2 + u1 * m0 - u0 * m1)
        store(gradient, 4 * i + 3, two * (u0 * m0 + u1 * m1 + u2 * m2))
        store(strains, 4 * i, m0)
        store(strains, 4 * i + 1, m1)
        store(strains, 4 * i + 2, m2)


@njit(**INNER)
def pair_moments(e, order, slopes, relative, moments, jacobian, width, gradient, matrix, base):
    """Parts of pairs of nodes: Jacobian of the strains, gradient, geometric stiffness."""
    zero, half, two = spread(0.0), spread(0.5), spread(2.0)
    for i in range(order):
        m0, m1, m2 = load(moments, 4 * i), load(moments, 4 * i + 1), load(moments, 4 * i + 2)
        g0, g1 = load(gradient, 4 * i), load(gradient, 4 * i + 1)
        g2, g3 = load(gradient, 4 * i + 2), load(gradient, 4 * i + 3)
        for j in range(i + 1, order):
            pair = 4 * (i * order + j)
            r0, r1 = load(relative, pair), load(relative, pair + 1)
            r2, r3 = load(relative, pair + 2), load(relative, pair + 3)
            ahead, back = spread(slopes[e, i, j]), spread(slopes[e, j, i])
            c0, c1, c2 = ahead * m0, ahead * m1, ahead * m2
            e0, e1 = back * load(moments, 4 * j), back * load(moments, 4 * j + 1)
            e2 = back * load(moments, 4 * j + 2)
            to = 4 * j
            store(gradient, to, load(gradient, to) + r0 * c0 + r3 * c1 - r2 * c2)
            store(gradient, to + 1, load(gradient, to + 1) + r0 * c1 - r3 * c0 + r1 * c2)
            store(gradient, to + 2, load(gradient, to + 2) + r0 * c2 + r2 * c0 - r1 * c1)
            along = two * (r1 * c0 + r2 * c1 + r3 * c2)
            store(gradient, to + 3, load(gradient, to + 3) + along)
            g0 = g0 + r0 * e0 - r3 * e1 + r2 * e2
            g1 = g1 + r0 * e1 + r3 * e0 - r1 * e2
            g2 = g2 + r0 * e2 - r2 * e0 + r1 * e1
            g3 = g3 - two * (r1 * e0 + r2 * e1 + r3 * e2)
            s0, s1, s2, s3 = ahead * r0, ahead * r1, ahead * r2, ahead * r3
            _store_turn(jacobian, 3 * i * width + 3 * j, width, s0, s1, s2, s3)
            s0, s1, s2, s3 = back * r0, back * r1, back * r2, back * r3
            lower = 3 * j * width + 3 * i
            _store_turn(jacobian, lower, width, s0, zero - s1, zero - s2, zero - s3)
            n0, n1, n2 = half * (c0 - e0), half * (c1 - e1), half * (c2 - e2)
            x, y, v = n0 * r1, n1 * r2, n2 * r3
            s01, s02, s12 = n1 * r1 + n0 * r2, n2 * r1 + n0 * r3, n2 * r2 + n1 * r3
            h0, h1, h2 = r0 * n0, r0 * n1, r0 * n2
            at = base + 3 * i * width + 3 * j
            store(matrix, at, x - y - v)
            store(matrix, at + 1, s01 - h2)
            store(matrix, at + 2, s02 + h1)
            store(matrix, at + width, s01 + h2)
            store(matrix, at + width + 1, y - x - v)
            store(matrix, at + width + 2, s12 - h0)
            store(matrix, at + 2 * width, s02 - h1)
            store(matrix, at + 2 * width + 1, s12 + h0)
            store(matrix, at + 2 * width + 2, v - x - y)
        store(gradient, 4 * i, g0)
        store(gradient, 4 * i + 1, g1)
        store(gradient, 4 * i + 2, g2)
        store(gradient, 4 * i + 3, g3)


@njit(**INNER)
def _store_turn(jacobian, at, width, s0, s1, s2, s3):
    """Write the block s₀ I + [s]×."""
    zero = spread(0.0)
    store(jacobian, at, s0)
    store(jacobian, at + 1, zero - s3)
    store(jacobian, at + 2, s2)
    store(jacobian, at + width, s3)
    store(jacobian, at + width + 1, s0)
    store(jacobian, at + width + 2, zero - s1)
    store(jacobian, at + 2 * width, zero - s2)
    store(jacobian, at + 2 * width + 1, s1)
    store(jacobian, at + 2 * width + 2, s0)


@njit(**INNER)
def pull_nodes(
    e, order, first, places, weights, forces, picks, scalars, rates, pulls, q, gradient, width,
    matrix, base, three, closing,
):  # fmt: skip
    """Forces on the cross-sections: own blocks, border columns, and the sums of the closures.

    scalars, rates: parameters with 1, and their velocities; pulls: multipliers along x, y, z;
    closing: rows of ∫ t.
    """
    zero, half, quarter = spread(0.0), spread(0.5), spread(0.25)
    two, size = spread(2.0), 3 * order
    for i in range(order):
        at, weight = 4 * (first + places[i]), spread(weights[e, i])
        double = two * weight
        q0, q1, q2, q3 = load(q, at), load(q, at + 1), load(q, at + 2), load(q, at + 3)
        s0, s1, s2, s3 = q0 * q0, q1 * q1, q2 * q2, q3 * q3
        t0, t1, t2 = weight * (s0 + s1 - s2 - s3), double * (q1 * q2 + q0 * q3), double * (
            q1 * q3 - q0 * q2
        )  # fmt: skip
        n0, n1, n2 = double * (q1 * q2 - q0 * q3), weight * (s0 - s1 + s2 - s3), double * (
            q2 * q3 + q0 * q1
        )  # fmt: skip
        b0, b1, b2 = double * (q1 * q3 + q0 * q2), double * (q2 * q3 - q0 * q1), weight * (
            s0 - s1 - s2 + s3
        )  # fmt: skip
        store(closing, 0, load(closing, 0) + t0)
        store(closing, 1, load(closing, 1) + t1)
        store(closing, 2, load(closing, 2) + t2)
        combine(e, i, forces, picks, scalars, three)
        f0, f1 = load(pulls, 0) + load(three, 0), load(pulls, 1) + load(three, 1)
        f2 = load(pulls, 2) + load(three, 2)
        combine(e, i, forces, picks, rates, three)
        d0, d1, d2 = load(three, 0), load(three, 1), load(three, 2)
        along = f0 * t0 + f1 * t1 + f2 * t2
        left, up = f0 * n0 + f1 * n1 + f2 * n2, f0 * b0 + f1 * b1 + f2 * b2
        radial = quarter * load(gradient, 4 * i + 3)
        at = base + 3 * i * width + 3 * i
        store(matrix, at, zero - radial)
        store(matrix, at + 1, half * left)
        store(matrix, at + 2, half * up)
        store(matrix, at + width + 1, zero - radial - along)
        store(matrix, at + width + 2, zero)
        store(matrix, at + 2 * width + 2, zero - radial - along)
        g1, g2 = load(gradient, 4 * i + 1) - up, load(gradient, 4 * i + 2) + left
        store(gradient, 4 * i + 1, g1)
        store(gradient, 4 * i + 2, g2)
        at = base + 3 * i * width + size
        store(matrix, at, zero)
        store(matrix, at + 1, zero)
        store(matrix, at + 2, zero)
        store(matrix, at + FORCE, zero - load(gradient, 4 * i))
        store(matrix, at + COLUMN, zero)
        at += width
        store(matrix, at, zero - b0)
        store(matrix, at + 1, zero - b1)
        store(matrix, at + 2, zero - b2)
        store(matrix, at + FORCE, zero - g1)
        store(matrix, at + COLUMN, zero - d0 * b0 - d1 * b1 - d2 * b2)
        at += width
        store(matrix, at, n0)
        store(matrix, at + 1, n1)
        store(matrix, at + 2, n2)
        store(matrix, at + FORCE, zero - g2)
        store(matrix, at + COLUMN, d0 * n0 + d1 * n1 + d2 * n2)


@njit(**INNER)
def turn_axes(q, at, axes):
    """Components of t, n, b in space: nine rows, one axis after the other."""
    two = spread(2.0)
    q0, q1, q2, q3 = load(q, at), load(q, at + 1), load(q, at + 2), load(q, at + 3)
    s0, s1, s2, s3 = q0 * q0, q1 * q1, q2 * q2, q3 * q3
    store(axes, 0, s0 + s1 - s2 - s3)
    store(axes, 1, two * (q1 * q2 + q0 * q3))
    store(axes, 2, two * (q1 * q3 - q0 * q2))
    store(axes, 3, two * (q1 * q2 - q0 * q3))
    store(axes, 4, s0 - s1 + s2 - s3)
    store(axes, 5, two * (q2 * q3 + q0 * q1))
    store(axes, 6, two * (q1 * q3 + q0 * q2))
    store(axes, 7, two * (q2 * q3 - q0 * q1))
    store(axes, 8, s0 - s1 - s2 + s3)


@njit(**INNER)
def on_axes(axes, force, out):
    """Components of a force on t, n, b."""
    for k in range(3):
        value = load(axes, 3 * k) * load(force, 0) + load(axes, 3 * k + 1) * load(force, 1)
        store(out, k, value + load(axes, 3 * k + 2) * load(force, 2))


@njit(**INNER)
def turn_components(components, k, turns):
    """Change of the k-th component by rotations on the axes: component of f × e_k."""
    zero = spread(0.0)
    a, n, b = load(components, 0), load(components, 1), load(components, 2)
    store(turns, 0, zero if k == 0 else (b if k == 1 else zero - n))
    store(turns, 1, zero - b if k == 0 else (zero if k == 1 else a))
    store(turns, 2, n if k == 0 else (zero - a if k == 1 else zero))


@njit(**INNER)
def stretch_nodes(
    e, order, first, places, weights, forces, picks, tension, tension_picks, softness, scalars,
    rates, pulls, q, gradient, width, matrix, base, three, closing, compliant, closing_rates,
    work,
):  # fmt: skip
    """As `pull_nodes` for a rod that stretches and shears by the force on its cross-sections.

    compliant: the closures by the multipliers, nine rows; work: arrays of nine, then three rows.
    """
    zero, half, quarter = spread(0.0), spread(0.5), spread(0.25)
    size = 3 * order
    axes, force, speed, on, rate, stretch, soft, turns, column, gains = work
    for i in range(order):
        weight = spread(weights[e, i])
        turn_axes(q, 4 * (first + places[i]), axes)
        combine(e, i, forces, picks, scalars, three)
        combine(e, i, forces, picks, rates, speed)
        for c in range(3):
            store(force, c, load(pulls, c) + load(three, c))
        on_axes(axes, force, on)
        on_axes(axes, speed, rate)
        pull = combine_one(e, i, tension, tension_picks, scalars)
        tightening = combine_one(e, i, tension, tension_picks, rates)
        for k in range(3):
            store(soft, k, weight * spread(softness[e, i, k]))
            strain = load(on, k) + pull if k == 0 else load(on, k)
            value = zero - load(soft, k) * strain
            store(stretch, k, value + weight if k == 0 else value)
        e0, e1, e2 = load(stretch, 0), load(stretch, 1), load(stretch, 2)
        a, n, b = load(on, 0), load(on, 1), load(on, 2)
        radial = quarter * load(gradient, 4 * i + 3)
        at = base + 3 * i * width + 3 * i
        store(matrix, at, zero - radial - e1 * n - e2 * b)
        store(matrix, at + 1, half * (e0 * n + e1 * a))
        store(matrix, at + 2, half * (e0 * b + e2 * a))
        store(matrix, at + width + 1, zero - radial - e0 * a - e2 * b)
        store(matrix, at + width + 2, half * (e1 * b + e2 * n))
        store(matrix, at + 2 * width + 2, zero - radial - e0 * a - e1 * n)
        to = base + 3 * i * width + size
        for r in range(3):
            for c in range(5):
                store(matrix, to + r * width + c, zero)
        for k in range(3):
            by, yields = load(stretch, k), load(soft, k)
            change = load(rate, k) + tightening if k == 0 else load(rate, k)
            turn_components(on, k, turns)
            turn_components(rate, k, gains)
            for r in range(3):
                turn = load(turns, r)
                store(gradient, 4 * i + r, load(gradient, 4 * i + r) + by * turn)
                here = at + r * width
                for c in range(r, 3):
                    own = load(matrix, here + c) - yields * turn * load(turns, c)
                    store(matrix, here + c, own)
                there = to + r * width + COLUMN
                gain = by * load(gains, r) - yields * turn * change
                store(matrix, there, load(matrix, there) + gain)
            for c in range(3):
                along = load(axes, 3 * k + c)
                store(closing, c, load(closing, c) + by * along)
                slowing = load(closing_rates, c) - yields * along * change
                store(closing_rates, c, slowing)
                for d in range(3):
                    own = load(compliant, 3 * c + d) - yields * along * load(axes, 3 * k + d)
                    store(compliant, 3 * c + d, own)
                for d in range(3):
                    store(column, d, load(axes, 3 * d + c))
                turn_components(column, k, gains)
                for r in range(3):
                    there = to + r * width + c
                    gain = by * load(gains, r) - yields * load(turns, r) * along
                    store(matrix, there, load(matrix, there) + gain)
        for r in range(3):
            store(matrix, to + r * width + FORCE, zero - load(gradient, 4 * i + r))


@njit(**INNER)
def stiffen(
    e, order, width, stiff, torsion, torsion_picks, scalars, jacobian, scaled, matrix, base
):
    """Add Jᵀ K J to the upper triangle of the element's matrix; scaled: K J.

    Columns of J beyond its size are zero.
    """
    size = 3 * order
    for i in range(order):
        k0, k1, k2 = spread(stiff[e, i, 0]), spread(stiff[e, i, 1]), spread(stiff[e, i, 2])
        if len(torsion_picks) > 0:
            k0 = k0 + combine_one(e, i, torsion, torsion_picks, scalars)
        for c in range(size):
            at = 3 * i * width + c
            store(scaled, at, k0 * load(jacobian, at))
            store(scaled, at + width, k1 * load(jacobian, at + width))
            store(scaled, at + 2 * width, k2 * load(jacobian, at + 2 * width))
    for c in range(0, size, 2):
        for k in range((c // 4) * 4, size, 4):
            first, second = (
                load4(matrix, base + c * width + k),
                load4(matrix, base + (c + 1) * width + k),
            )
            for r in range(size):
                many = load4(jacobian, r * width + k)
                first = first + repeat4(load(scaled, r * width + c)) * many
                second = second + repeat4(load(scaled, r * width + c + 1)) * many
            store(matrix, base + c * width + k, first)
            store(matrix, base + (c + 1) * width + k, second)


@njit(**INNER)
def add_moment_rates(
    e, order, width, moments, moment_picks, torsion, torsion_picks, rates, twists, jacobian,
    matrix, base, three,
):  # fmt: skip
    """Add Jᵀ ṁ to the column of F_p·dp: intrinsic strains and tendons that change with dp.

    twists: half the twist at the nodes.
    """
    size = 3 * order
    for i in range(order):
        combine(e, i, moments, moment_picks, rates, three)
        m0 = spread(0.0) - load(three, 0)
        m1, m2 = spread(0.0) - load(three, 1), spread(0.0) - load(three, 2)
        if len(torsion_picks) > 0:
            rate = combine_one(e, i, torsion, torsion_picks, rates)
            m0 = m0 + spread(2.0) * load(twists, i) * rate
        for c in range(size):
            row, at = 3 * i * width + c, base + c * width + size + COLUMN
            change = load(jacobian, row) * m0 + load(jacobian, row + width) * m1
            change = change + load(jacobian, row + 2 * width) * m2
            store(matrix, at, load(matrix, at) + change)


@njit(**INNER)
def reduce_rows(inner, size, width, matrix, base, lower, pivots, at):
    """Eliminate the inner rotations of an element, rows by rows; its last rows are what remains.

    lower: L by column; pivots: reciprocals.
    """
    one = spread(1.0)
    for i in range(size):
        top = min(i, inner)
        for k in range((i // 4) * 4, width, 4):
            value = load4(matrix, base + i * width + k)
            for j in range(top):
                factor = repeat4(load(lower, j * width + i))
                value = value - factor * load4(matrix, base + j * width + k)
            store(matrix, base + i * width + k, value)
        if i < inner:
            inverse = one / load(matrix, base + i * width + i)
            store(pivots, at + i, inverse)
            for j in range(i + 1, width):
                store(lower, i * width + j, inverse * load(matrix, base + i * width + j))


@njit(**INNER, forceinline=True)
def assemble_element(
    e, tables, width, scalars, rates, pulls, q, matrix, base, closing, closing_rates, compliant,
    total, work,
):  # fmt: skip
    """Matrix and border columns of one element, its share of the closures, and ∂L/∂φ by node."""
    (
        places, slopes, weights, stiff, moments, moment_picks, torsion, torsion_picks, forces,
        force_picks, tension, tension_picks, softness,
    ) = tables  # fmt: skip
    relative, strains, twists, jacobian, scaled, gradient, three, more = work
    order = slopes.shape[1]
    node = e * (order - 1)
    relate(e, order, node, places, slopes, q, relative, strains)
    own_moments(
        e, order, stiff, moments, moment_picks, torsion, torsion_picks, scalars, slopes,
        strains, twists, jacobian, width, gradient, three,
    )  # fmt: skip
    pair_moments(e, order, slopes, relative, strains, jacobian, width, gradient, matrix, base)
    if softness.shape[0] > 0:
        stretch_nodes(
            e, order, node, places, weights, forces, force_picks, tension, tension_picks,
            softness, scalars, rates, pulls, q, gradient, width, matrix, base, three, closing,
            compliant, closing_rates, more,
        )  # fmt: skip
    else:
        pull_nodes(
            e, order, node, places, weights, forces, force_picks, scalars, rates, pulls, q,
            gradient, width, matrix, base, three, closing,
        )  # fmt: skip
    for i in range(order):
        to = 3 * (node + places[i])
        for k in range(3):
            store(total, to + k, load(total, to + k) + load(gradient, 4 * i + k))
    stiffen(e, order, width, stiff, torsion, torsion_picks, scalars, jacobian, scaled, matrix, base)
    if len(moment_picks) > 0 or len(torsion_picks) > 0:
        add_moment_rates(
            e, order, width, moments, moment_picks, torsion, torsion_picks, rates, twists,
            jacobian, matrix, base, three,
        )  # fmt: skip
