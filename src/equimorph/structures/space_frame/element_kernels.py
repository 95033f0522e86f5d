"""Compiled forces and stiffness of one element of a frame in space, a vector of lanes at a time.

Rotations change by vectors ω on axes that turn along as drawn, w → w exp(ω/2). With the relative
turns r_ij = w_i* w_j, D the derivative, s_i = Σ_j D_ij r_ij and strains v_i = 2 vec s_i,

    δv_i = Σ_j D_ij (r₀ + [r]×)_ij ω_j + ([s]× − s₀)_i ω_i ,

and moments M_i contribute to the second variation, with W = D_ij M_i − D_ji M_j and i ≠ j,

    H_ij = ½ (W rᵀ + r Wᵀ − (W·r) 1 − r₀ [W]) ,   H_ii = −(¼ M_i·v_i + ½ Σ_k D_ki M_k·r_ki) 1 ,

where [W]_kl = ε_klm W_m. The tension N = f̃·t₀ with f̃ = R(w)ᵀ f has the gradient g = t₀ × f̃ and
the second variation ½ (f̃ t₀ᵀ + t₀ f̃ᵀ) − N 1. A hinged node turns by ω = Eᵀω_parent + a φ.
"""

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import INNER
from equimorph.linalg.simd import load, spread, store
from equimorph.structures.spatial.element_kernels import add_turned, store_turn


@njit(**INNER)
def add_to(target, row, value):
    """Add to a row."""
    store(target, row, load(target, row) + value)


@njit(**INNER)
def relate(e, nodes, derivative, inverse, w, relative, sums, strain):
    """Relative turns of the nodes of an element, s, and v."""
    order = nodes.shape[1]
    for i in range(order):
        at = 4 * nodes[e, i]
        a0, a1, a2, a3 = load(w, at), load(w, at + 1), load(w, at + 2), load(w, at + 3)
        s0, s1, s2, s3 = spread(0.0), spread(0.0), spread(0.0), spread(0.0)
        for j in range(order):
            to, there = 4 * (i * order + j), 4 * nodes[e, j]
            b0, b1 = load(w, there), load(w, there + 1)
            b2, b3 = load(w, there + 2), load(w, there + 3)
            r0 = a0 * b0 + a1 * b1 + a2 * b2 + a3 * b3
            r1 = a0 * b1 - a1 * b0 - a2 * b3 + a3 * b2
            r2 = a0 * b2 + a1 * b3 - a2 * b0 - a3 * b1
            r3 = a0 * b3 - a1 * b2 + a2 * b1 - a3 * b0
            store(relative, to, r0)
            store(relative, to + 1, r1)
            store(relative, to + 2, r2)
            store(relative, to + 3, r3)
            d = spread(derivative[i, j] * inverse)
            s0, s1, s2, s3 = s0 + d * r0, s1 + d * r1, s2 + d * r2, s3 + d * r3
        store(sums, 4 * i, s0)
        store(sums, 4 * i + 1, s1)
        store(sums, 4 * i + 2, s2)
        store(sums, 4 * i + 3, s3)
        two = spread(2.0)
        store(strain, 3 * i, two * s1)
        store(strain, 3 * i + 1, two * s2)
        store(strain, 3 * i + 2, two * s3)


@njit(**INNER)
def fill_turns(order, derivative, inverse, relative, sums, turns):
    """δv at one node by ω of another, as in `stiffen`."""
    for i in range(order):
        for j in range(order):
            at, d = 4 * (i * order + j), spread(derivative[i, j] * inverse)
            r0, r1 = d * load(relative, at), d * load(relative, at + 1)
            r2, r3 = d * load(relative, at + 2), d * load(relative, at + 3)
            if i == j:
                r0 = r0 - load(sums, 4 * i)
                r1 = r1 + load(sums, 4 * i + 1)
                r2 = r2 + load(sums, 4 * i + 2)
                r3 = r3 + load(sums, 4 * i + 3)
            store_turn(turns, i * order + j, r0, r1, r2, r3)


@njit(**INNER)
def fill_moments(e, order, weights, stiff, moment_of_strain, strain, free, rate, moment, change):
    """Weighted moments M at the points of an element, and minus those of actuated strains' rates.

    free, rate: actuated strains of the cross-sections of its piece, and their rates.
    """
    for i in range(order):
        m = weights[e, i]
        for a in range(3):
            total, turned = spread(0.0), spread(0.0)
            for b in range(3):
                total = total + spread(m * stiff[e, i, a, b]) * load(strain, 3 * i + b)
                own = spread(m * moment_of_strain[e, i, a, b])
                total = total - own * load(free, b)
                turned = turned - own * load(rate, b)
            store(moment, 3 * i + a, total)
            store(change, 3 * i + a, turned)


@njit(**INNER)
def bend(order, moment, change, turns, gradient, rates):
    """Gradient by the moments, and its rate by actuated strains."""
    for i in range(order):
        for a in range(order):
            at = 3 * a
            add_turned(turns, i * order + a, moment, 3 * i, gradient, at, 1)
            add_turned(turns, i * order + a, change, 3 * i, rates, at, 1)


@njit(**INNER)
def scale_general(e, order, weights, stiff, turns, scaled):
    """S A of all pairs of nodes, in the order of `scale_turns`."""
    zero = spread(0.0)
    for i in range(order):
        for a in range(order):
            at, to = 4 * (i * order + a), 9 * (a * order + i)
            s0, s1 = load(turns, at), load(turns, at + 1)
            s2, s3 = load(turns, at + 2), load(turns, at + 3)
            for k in range(3):
                k0 = spread(weights[e, i] * stiff[e, i, k, 0])
                k1 = spread(weights[e, i] * stiff[e, i, k, 1])
                k2 = spread(weights[e, i] * stiff[e, i, k, 2])
                store(scaled, to + k, k0 * s0 + k1 * s3 - k2 * s2)
                store(scaled, to + 3 + k, zero - k0 * s3 + k1 * s0 + k2 * s1)
                store(scaled, to + 6 + k, k0 * s2 - k1 * s1 + k2 * s0)


@njit(**INNER)
def mirror(size, width, matrix):
    """Copy the upper triangle of an element's matrix to the lower one."""
    for a in range(size):
        for b in range(a):
            store(matrix, a * width + b, load(matrix, b * width + a))


@njit(**INNER)
def turn_moments(order, width, derivative, inverse, relative, strain, moment, matrix):
    """Add what moments contribute to the second variation."""
    half, quarter, zero = spread(0.5), spread(0.25), spread(0.0)
    for i in range(order):
        m1, m2, m3 = load(moment, 3 * i), load(moment, 3 * i + 1), load(moment, 3 * i + 2)
        own = m1 * load(strain, 3 * i) + m2 * load(strain, 3 * i + 1) + m3 * load(strain, 3 * i + 2)
        own = zero - quarter * own
        for k in range(order):
            at, d = 4 * (k * order + i), spread(derivative[k, i] * inverse)
            work = load(moment, 3 * k) * load(relative, at + 1)
            work = work + load(moment, 3 * k + 1) * load(relative, at + 2)
            work = work + load(moment, 3 * k + 2) * load(relative, at + 3)
            own = own - half * d * work
        for c in range(3):
            add_to(matrix, (3 * i + c) * width + 3 * i + c, own)
        for j in range(i):
            at = 4 * (i * order + j)
            d, back = (
                spread(0.5 * derivative[i, j] * inverse),
                spread(0.5 * derivative[j, i] * inverse),
            )
            w1 = d * m1 - back * load(moment, 3 * j)
            w2 = d * m2 - back * load(moment, 3 * j + 1)
            w3 = d * m3 - back * load(moment, 3 * j + 2)
            r0, r1 = load(relative, at), load(relative, at + 1)
            r2, r3 = load(relative, at + 2), load(relative, at + 3)
            d1, d2, d3 = w1 * r1, w2 * r2, w3 * r3
            s12, s13, s23 = w1 * r2 + w2 * r1, w1 * r3 + w3 * r1, w2 * r3 + w3 * r2
            t1, t2, t3 = r0 * w1, r0 * w2, r0 * w3
            row = 3 * i * width + 3 * j
            _add_pair(matrix, row, 3 * j * width + 3 * i, width, 0, 0, d1 - d2 - d3)
            _add_pair(matrix, row, 3 * j * width + 3 * i, width, 1, 1, d2 - d1 - d3)
            _add_pair(matrix, row, 3 * j * width + 3 * i, width, 2, 2, d3 - d1 - d2)
            _add_pair(matrix, row, 3 * j * width + 3 * i, width, 0, 1, s12 - t3)
            _add_pair(matrix, row, 3 * j * width + 3 * i, width, 1, 0, s12 + t3)
            _add_pair(matrix, row, 3 * j * width + 3 * i, width, 0, 2, s13 + t2)
            _add_pair(matrix, row, 3 * j * width + 3 * i, width, 2, 0, s13 - t2)
            _add_pair(matrix, row, 3 * j * width + 3 * i, width, 1, 2, s23 - t1)
            _add_pair(matrix, row, 3 * j * width + 3 * i, width, 2, 1, s23 + t1)


@njit(**INNER)
def _add_pair(matrix, lower, upper, width, k, c, value):
    """Add to entry (k, c) of a block, and to its mirror image."""
    add_to(matrix, lower + k * width + c, value)
    add_to(matrix, upper + c * width + k, value)


@njit(**INNER)
def pull(
    e, order, width, nodes, weights, tangents, arclengths, soft, count, ties, numbers, start, drop,
    scalars, velocity, w, stretch, turn, gradient, rates, matrix, border, sums,
):  # fmt: skip
    """Add what the forces in an element contribute; stretch, turn: 1 + e and its rate.

    border: three columns a node, ∂²L by ω and by a force along x, y, z; sums: Σ m σ t, its rate,
    and Σ m c t tᵀ.
    """
    compliance, zero, half, two = spread(soft), spread(0.0), spread(0.5), spread(2.0)
    for i in range(order):
        f1, f2, f3, d1, d2, d3 = zero, zero, zero, zero, zero, zero
        for r in range(count):
            y, dy, s = load(scalars, numbers[r]), load(velocity, numbers[r]), arclengths[e, i]
            x1 = spread(start[r, 0] - s * drop[r, 0])
            x2 = spread(start[r, 1] - s * drop[r, 1])
            x3 = spread(start[r, 2] - s * drop[r, 2])
            f1, f2, f3 = f1 + x1 * y, f2 + x2 * y, f3 + x3 * y
            if r >= ties:
                d1, d2, d3 = d1 + x1 * dy, d2 + x2 * dy, d3 + x3 * dy
        at, m = 4 * nodes[e, i], spread(weights[e, i])
        q0, q1, q2, q3 = load(w, at), load(w, at + 1), load(w, at + 2), load(w, at + 3)
        r11 = q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3
        r22 = q0 * q0 - q1 * q1 + q2 * q2 - q3 * q3
        r33 = q0 * q0 - q1 * q1 - q2 * q2 + q3 * q3
        r12, r21 = two * (q1 * q2 - q0 * q3), two * (q1 * q2 + q0 * q3)
        r13, r31 = two * (q1 * q3 + q0 * q2), two * (q1 * q3 - q0 * q2)
        r23, r32 = two * (q2 * q3 - q0 * q1), two * (q2 * q3 + q0 * q1)
        a1, a2 = spread(tangents[e, i, 0]), spread(tangents[e, i, 1])
        a3 = spread(tangents[e, i, 2])
        t1 = r11 * a1 + r12 * a2 + r13 * a3
        t2 = r21 * a1 + r22 * a2 + r23 * a3
        t3 = r31 * a1 + r32 * a2 + r33 * a3
        b1 = r11 * f1 + r21 * f2 + r31 * f3
        b2 = r12 * f1 + r22 * f2 + r32 * f3
        b3 = r13 * f1 + r23 * f2 + r33 * f3
        c1 = r11 * d1 + r21 * d2 + r31 * d3
        c2 = r12 * d1 + r22 * d2 + r32 * d3
        c3 = r13 * d1 + r23 * d2 + r33 * d3
        tension = f1 * t1 + f2 * t2 + f3 * t3
        sigma = stretch + compliance * tension
        change = turn + compliance * (d1 * t1 + d2 * t2 + d3 * t3)
        g1, g2, g3 = a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1
        ms, mt = m * sigma, m * change
        add_to(gradient, 3 * i, zero - ms * g1)
        add_to(gradient, 3 * i + 1, zero - ms * g2)
        add_to(gradient, 3 * i + 2, zero - ms * g3)
        add_to(rates, 3 * i, zero - mt * g1 - ms * (a2 * c3 - a3 * c2))
        add_to(rates, 3 * i + 1, zero - mt * g2 - ms * (a3 * c1 - a1 * c3))
        add_to(rates, 3 * i + 2, zero - mt * g3 - ms * (a1 * c2 - a2 * c1))
        mc, row = m * compliance, 3 * i * width + 3 * i
        add_to(matrix, row, ms * (tension - a1 * b1) - mc * g1 * g1)
        add_to(matrix, row + width + 1, ms * (tension - a2 * b2) - mc * g2 * g2)
        add_to(matrix, row + 2 * width + 2, ms * (tension - a3 * b3) - mc * g3 * g3)
        h12 = zero - half * ms * (a1 * b2 + a2 * b1) - mc * g1 * g2
        h13 = zero - half * ms * (a1 * b3 + a3 * b1) - mc * g1 * g3
        h23 = zero - half * ms * (a2 * b3 + a3 * b2) - mc * g2 * g3
        _add_pair(matrix, row, row, width, 0, 1, h12)
        _add_pair(matrix, row, row, width, 0, 2, h13)
        _add_pair(matrix, row, row, width, 1, 2, h23)
        # t₀ × (Rᵀ e) for the axes e, and the change of σ
        k1, k2, k3 = mc * t1, mc * t2, mc * t3
        store(border, 9 * i, zero - ms * (a2 * r13 - a3 * r12) - k1 * g1)
        store(border, 9 * i + 1, zero - ms * (a2 * r23 - a3 * r22) - k2 * g1)
        store(border, 9 * i + 2, zero - ms * (a2 * r33 - a3 * r32) - k3 * g1)
        store(border, 9 * i + 3, zero - ms * (a3 * r11 - a1 * r13) - k1 * g2)
        store(border, 9 * i + 4, zero - ms * (a3 * r21 - a1 * r23) - k2 * g2)
        store(border, 9 * i + 5, zero - ms * (a3 * r31 - a1 * r33) - k3 * g2)
        store(border, 9 * i + 6, zero - ms * (a1 * r12 - a2 * r11) - k1 * g3)
        store(border, 9 * i + 7, zero - ms * (a1 * r22 - a2 * r21) - k2 * g3)
        store(border, 9 * i + 8, zero - ms * (a1 * r32 - a2 * r31) - k3 * g3)
        add_to(sums, 0, ms * t1)
        add_to(sums, 1, ms * t2)
        add_to(sums, 2, ms * t3)
        add_to(sums, 3, mt * t1)
        add_to(sums, 4, mt * t2)
        add_to(sums, 5, mt * t3)
        add_to(sums, 6, k1 * t1)
        add_to(sums, 7, k2 * t1)
        add_to(sums, 8, k2 * t2)
        add_to(sums, 9, k3 * t1)
        add_to(sums, 10, k3 * t2)
        add_to(sums, 11, k3 * t3)
