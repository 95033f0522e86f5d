"""Compiled kernels of the forces on cross-sections of a rod in space, vector by vector of lanes."""

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import INNER
from equimorph.linalg.simd import load, spread, store

FORCE, COLUMN, ROW, BORDER = 3, 4, 5, 6
"""Border columns: three closures, −∂L/∂φ, its change by dp, the closing row; and their number."""


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
