"""Compiled kernels of one element of a rod in space, eight lanes at a time.

Nodes stand in the order of elimination: inner ones, then left, right. Variations are rotations φ on
the axes of the cross-section, δq = ½ q φ. Rows of an element: first the 3 (degree + 1) rotations,
then the `BORDER` columns. See `step_kernels` for the whole step.
"""

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import INNER
from equimorph.linalg.simd import load, load4, repeat4, spread, store
from equimorph.structures.spatial.force_kernels import (
    COLUMN,
    combine,
    combine_one,
    pull_nodes,
    stretch_nodes,
)


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
def own_moments(
    e, order, stiff, moments, moment_picks, torsion, torsion_picks, scalars, slopes,
    strains, twists, jacobian, width, gradient, three,
):  # fmt: skip
    """Weighted moments in place of half strains; a node's own part of Jacobian and gradient.

    gradient: four rows a node, ∂L/∂φ and q·∂L/∂q of the strains; twists: half of them.
    """
    two = spread(2.0)
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
        store_turn(jacobian, at, width, own, u0, u1, u2)
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
            store_turn(jacobian, 3 * i * width + 3 * j, width, s0, s1, s2, s3)
            s0, s1, s2, s3 = back * r0, back * r1, back * r2, back * r3
            lower = 3 * j * width + 3 * i
            store_turn(jacobian, lower, width, s0, zero - s1, zero - s2, zero - s3)
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
def store_turn(jacobian, at, width, s0, s1, s2, s3):
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
