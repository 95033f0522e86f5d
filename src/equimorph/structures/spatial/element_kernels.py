"""Compiled kernels of one element of a rod in space, a vector of lanes at a time.

Nodes stand in the order of elimination: inner ones, then left, right. Variations are rotations φ on
the axes of the cross-section, δq = ½ q φ. Rows of an element: first the 3 (degree + 1) rotations,
then the `BORDER` columns. See `step_kernels` for the whole step.
"""

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import INNER
from equimorph.linalg.simd import load, spread, store
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
    strains, twists, turns, gradient, three,
):  # fmt: skip
    """Weighted moments in place of half strains; a node's own part of turns and gradient.

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
        store_turn(turns, i * order + i, own, u0, u1, u2)
        store(gradient, 4 * i, own * m0 + u2 * m1 - u1 * m2)
        store(gradient, 4 * i + 1, own * m1 - u2 * m0 + u0 * m2)
        store(gradient, 4 * i + 2, own * m2 + u1 * m0 - u0 * m1)
        store(gradient, 4 * i + 3, two * (u0 * m0 + u1 * m1 + u2 * m2))
        store(strains, 4 * i, m0)
        store(strains, 4 * i + 1, m1)
        store(strains, 4 * i + 2, m2)


@njit(**INNER)
def pair_moments(e, order, slopes, turns, moments, width, gradient, matrix, base):
    """Parts of pairs of nodes: gradient, geometric stiffness, and turns in place of quaternions."""
    zero, half, two = spread(0.0), spread(0.5), spread(2.0)
    for i in range(order):
        m0, m1, m2 = load(moments, 4 * i), load(moments, 4 * i + 1), load(moments, 4 * i + 2)
        g0, g1 = load(gradient, 4 * i), load(gradient, 4 * i + 1)
        g2, g3 = load(gradient, 4 * i + 2), load(gradient, 4 * i + 3)
        for j in range(i + 1, order):
            pair = 4 * (i * order + j)
            r0, r1 = load(turns, pair), load(turns, pair + 1)
            r2, r3 = load(turns, pair + 2), load(turns, pair + 3)
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
            store_turn(turns, i * order + j, ahead * r0, ahead * r1, ahead * r2, ahead * r3)
            other = zero - back
            store_turn(turns, j * order + i, back * r0, other * r1, other * r2, other * r3)
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
def store_turn(turns, pair, s0, s1, s2, s3):
    """Write s, four rows a pair: strains at a node change by A = s₀ I + [s]× times φ of another."""
    store(turns, 4 * pair, s0)
    store(turns, 4 * pair + 1, s1)
    store(turns, 4 * pair + 2, s2)
    store(turns, 4 * pair + 3, s3)


@njit(**INNER)
def scale_turns(e, order, stiff, torsion, torsion_picks, scalars, turns, scaled):
    """Write K A of all pairs of nodes, column by column: nine rows each, of one φ together."""
    zero = spread(0.0)
    for i in range(order):
        k0, k1, k2 = spread(stiff[e, i, 0]), spread(stiff[e, i, 1]), spread(stiff[e, i, 2])
        if len(torsion_picks) > 0:
            k0 = k0 + combine_one(e, i, torsion, torsion_picks, scalars)
        for a in range(order):
            at, to = 4 * (i * order + a), 9 * (a * order + i)
            s0, s1 = load(turns, at), load(turns, at + 1)
            s2, s3 = load(turns, at + 2), load(turns, at + 3)
            store(scaled, to, k0 * s0)
            store(scaled, to + 1, k1 * s3)
            store(scaled, to + 2, zero - k2 * s2)
            store(scaled, to + 3, zero - k0 * s3)
            store(scaled, to + 4, k1 * s0)
            store(scaled, to + 5, k2 * s1)
            store(scaled, to + 6, k0 * s2)
            store(scaled, to + 7, zero - k1 * s1)
            store(scaled, to + 8, k2 * s0)


@njit(**INNER)
def stiffen(order, width, turns, scaled, matrix, base):
    """Add Σ Aᵀ K A to the upper triangle of the element's matrix, in blocks of two nodes.

    scaled: K A of `scale_turns`. Nine sums stay in registers.
    """
    for a in range(order):
        for b in range(a, order):
            at, apart = base + 3 * a * width + 3 * b, b > a
            h00, h01, h02 = load(matrix, at), load(matrix, at + 1), load(matrix, at + 2)
            h10 = load(matrix, at + width) if apart else h01
            h11, h12 = load(matrix, at + width + 1), load(matrix, at + width + 2)
            h20 = load(matrix, at + 2 * width) if apart else h02
            h21 = load(matrix, at + 2 * width + 1) if apart else h12
            h22 = load(matrix, at + 2 * width + 2)
            for i in range(order):
                pair, row = 4 * (i * order + b), 9 * (a * order + i)
                s0, s1 = load(turns, pair), load(turns, pair + 1)
                s2, s3 = load(turns, pair + 2), load(turns, pair + 3)
                g0, g1, g2 = load(scaled, row), load(scaled, row + 1), load(scaled, row + 2)
                h00 = h00 + g0 * s0 + g1 * s3 - g2 * s2
                h01 = h01 - g0 * s3 + g1 * s0 + g2 * s1
                h02 = h02 + g0 * s2 - g1 * s1 + g2 * s0
                g0, g1, g2 = load(scaled, row + 3), load(scaled, row + 4), load(scaled, row + 5)
                h10 = h10 + g0 * s0 + g1 * s3 - g2 * s2
                h11 = h11 - g0 * s3 + g1 * s0 + g2 * s1
                h12 = h12 + g0 * s2 - g1 * s1 + g2 * s0
                g0, g1, g2 = load(scaled, row + 6), load(scaled, row + 7), load(scaled, row + 8)
                h20 = h20 + g0 * s0 + g1 * s3 - g2 * s2
                h21 = h21 - g0 * s3 + g1 * s0 + g2 * s1
                h22 = h22 + g0 * s2 - g1 * s1 + g2 * s0
            store_row(matrix, at, h00, h01, h02)
            store_row(matrix, at + width, h10, h11, h12)
            store_row(matrix, at + 2 * width, h20, h21, h22)


@njit(**INNER)
def store_row(rows, at, first, second, third):
    """Write three rows of lanes."""
    store(rows, at, first)
    store(rows, at + 1, second)
    store(rows, at + 2, third)


@njit(**INNER)
def add_moment_rates(
    e, order, width, moments, moment_picks, torsion, torsion_picks, rates, twists, turns,
    matrix, base, three,
):  # fmt: skip
    """Add Σ Aᵀ ṁ to the column of F_p·dp: intrinsic strains and tendons that change with dp.

    twists: half the twist at the nodes.
    """
    for i in range(order):
        combine(e, i, moments, moment_picks, rates, three)
        m0 = spread(0.0) - load(three, 0)
        m1, m2 = spread(0.0) - load(three, 1), spread(0.0) - load(three, 2)
        if len(torsion_picks) > 0:
            rate = combine_one(e, i, torsion, torsion_picks, rates)
            m0 = m0 + spread(2.0) * load(twists, i) * rate
        store_row(three, 0, m0, m1, m2)
        for a in range(order):
            at = base + 3 * a * width + 3 * order + COLUMN
            add_turned(turns, i * order + a, three, 0, matrix, at, width)


@njit(**INNER)
def add_turned(turns, pair, vector, at, rows, to, step):
    """Add Aᵀ times three rows of a vector to rows `step` apart."""
    s0, s1 = load(turns, 4 * pair), load(turns, 4 * pair + 1)
    s2, s3 = load(turns, 4 * pair + 2), load(turns, 4 * pair + 3)
    m0, m1, m2 = load(vector, at), load(vector, at + 1), load(vector, at + 2)
    store(rows, to, load(rows, to) + s0 * m0 + s3 * m1 - s2 * m2)
    to += step
    store(rows, to, load(rows, to) - s3 * m0 + s0 * m1 + s1 * m2)
    to += step
    store(rows, to, load(rows, to) + s2 * m0 - s1 * m1 + s0 * m2)


@njit(**INNER)
def reduce_rows(inner, size, width, matrix, base, lower, pivots, at):
    """Eliminate the inner rotations of an element, node by node; its last rows are what remains.

    lower: L by column; pivots: reciprocals. Blocks of three rows and columns stay in registers.
    """
    one, zero = spread(1.0), spread(0.0)
    for i in range(0, size, 3):
        first, second, third = zero, zero, zero  # pivots of the node, and L among its rows
        l10, l20, l21 = zero, zero, zero
        for c in range(i, width - 2, 3):
            row = base + i * width + c
            a0, a1, a2 = load(matrix, row), load(matrix, row + 1), load(matrix, row + 2)
            row += width
            b0, b1, b2 = load(matrix, row), load(matrix, row + 1), load(matrix, row + 2)
            row += width
            c0, c1, c2 = load(matrix, row), load(matrix, row + 1), load(matrix, row + 2)
            for j in range(min(i, inner)):
                left, above = j * width + i, base + j * width + c
                x0, x1, x2 = load(matrix, above), load(matrix, above + 1), load(matrix, above + 2)
                factor = load(lower, left)
                a0, a1, a2 = a0 - factor * x0, a1 - factor * x1, a2 - factor * x2
                factor = load(lower, left + 1)
                b0, b1, b2 = b0 - factor * x0, b1 - factor * x1, b2 - factor * x2
                factor = load(lower, left + 2)
                c0, c1, c2 = c0 - factor * x0, c1 - factor * x1, c2 - factor * x2
            if i < inner:
                if c == i:
                    first = one / a0
                    l10, l20 = first * a1, first * a2
                    second = one / (b1 - l10 * a1)
                    l21 = second * (b2 - l10 * a2)
                    third = one / (c2 - l20 * a2 - l21 * (b2 - l10 * a2))
                    store_row(pivots, at + i, first, second, third)
                b0, b1, b2 = b0 - l10 * a0, b1 - l10 * a1, b2 - l10 * a2
                c0, c1 = c0 - l20 * a0 - l21 * b0, c1 - l20 * a1 - l21 * b1
                c2 = c2 - l20 * a2 - l21 * b2
                row = i * width + c
                store_row(lower, row, first * a0, first * a1, first * a2)
                store_row(lower, row + width, second * b0, second * b1, second * b2)
                store_row(lower, row + 2 * width, third * c0, third * c1, third * c2)
            row = base + i * width + c
            store_row(matrix, row, a0, a1, a2)
            store_row(matrix, row + width, b0, b1, b2)
            store_row(matrix, row + 2 * width, c0, c1, c2)


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
    turns, strains, twists, scaled, gradient, three, more = work
    order = slopes.shape[1]
    node = e * (order - 1)
    relate(e, order, node, places, slopes, q, turns, strains)
    own_moments(
        e, order, stiff, moments, moment_picks, torsion, torsion_picks, scalars, slopes,
        strains, twists, turns, gradient, three,
    )  # fmt: skip
    pair_moments(e, order, slopes, turns, strains, width, gradient, matrix, base)
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
    scale_turns(e, order, stiff, torsion, torsion_picks, scalars, turns, scaled)
    stiffen(order, width, turns, scaled, matrix, base)
    if len(moment_picks) > 0 or len(torsion_picks) > 0:
        add_moment_rates(
            e, order, width, moments, moment_picks, torsion, torsion_picks, rates, twists,
            turns, matrix, base, three,
        )  # fmt: skip
