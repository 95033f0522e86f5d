"""Compiled kernels of single nodes of frames in space: turns, hinges, lengths of quaternions."""

import math

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import INNER
from equimorph.linalg.simd import load, sincos, spread, square_root, store


@njit(**INNER)
def vector_sums(table, first, y, dy, out, rate):
    """Rows of a table times the scalars from `first` on, and times their rates."""
    for c in range(table.shape[1]):
        total, change = spread(0.0), spread(0.0)
        for r in range(table.shape[0]):
            if table[r, c] != 0.0:
                total = total + spread(table[r, c]) * load(y, first + r)
                change = change + spread(table[r, c]) * load(dy, first + r)
        store(out, c, total)
        store(rate, c, change)


@njit(**INNER)
def turn_held(vectors, first, y, dy, turns, rates):
    """Turns of what supports hold: about the axes of the parameters, one after the other.

    rates: their angular velocities on the axes of the cross-sections that turn.
    """
    one, two = spread(1.0), spread(2.0)
    for h in range(vectors.shape[1]):
        w0, w1, w2, w3 = one, spread(0.0), spread(0.0), spread(0.0)
        v1, v2, v3 = spread(0.0), spread(0.0), spread(0.0)
        for k in range(len(vectors)):
            a1, a2, a3 = vectors[k, h, 0], vectors[k, h, 1], vectors[k, h, 2]
            size = math.sqrt(a1 * a1 + a2 * a2 + a3 * a3)
            if size == 0.0:
                continue
            sine, e0 = sincos(spread(0.5 * size) * load(y, first + k))
            e1, e2, e3 = (
                spread(a1 / size) * sine,
                spread(a2 / size) * sine,
                spread(a3 / size) * sine,
            )
            b0, b1, b2, b3 = w0, w1, w2, w3
            w0 = b0 * e0 - b1 * e1 - b2 * e2 - b3 * e3
            w1 = b0 * e1 + b1 * e0 + b2 * e3 - b3 * e2
            w2 = b0 * e2 - b1 * e3 + b2 * e0 + b3 * e1
            w3 = b0 * e3 + b1 * e2 - b2 * e1 + b3 * e0
            # turned back: v + 2 e₀ (v × e) + 2 e × (e × v)
            c1, c2, c3 = (
                two * (v2 * e3 - v3 * e2),
                two * (v3 * e1 - v1 * e3),
                two * (v1 * e2 - v2 * e1),
            )
            rate = load(dy, first + k)
            v1 = v1 + e0 * c1 + c2 * e3 - c3 * e2 + spread(a1) * rate
            v2 = v2 + e0 * c2 + c3 * e1 - c1 * e3 + spread(a2) * rate
            v3 = v3 + e0 * c3 + c1 * e2 - c2 * e1 + spread(a3) * rate
        store(turns, 4 * h, w0)
        store(turns, 4 * h + 1, w1)
        store(turns, 4 * h + 2, w2)
        store(turns, 4 * h + 3, w3)
        store(rates, 3 * h, v1)
        store(rates, 3 * h + 1, v2)
        store(rates, 3 * h + 2, v3)


@njit(**INNER)
def set_turns(free, held, rows, held_turns, w, radii):
    """Unit quaternions of free and held nodes; lengths of the free ones and their reciprocals."""
    for i in range(len(free)):
        square = spread(0.0)
        for c in range(4):
            value = load(rows, 4 * i + c)
            square = square + value * value
        radius = square_root(square)
        inverse = spread(1.0) / radius
        store(radii, 2 * i, radius)
        store(radii, 2 * i + 1, inverse)
        for c in range(4):
            store(w, 4 * free[i] + c, load(rows, 4 * i + c) * inverse)
    for i in range(len(held)):
        for c in range(4):
            store(w, 4 * held[i] + c, load(held_turns, 4 * i + c))


@njit(**INNER)
def hinge_turns(hinged, parents, axes, first, rows, w, turned):
    """Quaternions of hinged nodes, and the turns exp(a φ/2) on their parents."""
    for h in range(len(hinged)):
        sine, cosine = sincos(spread(0.5) * load(rows, first + h))
        e1, e2, e3 = spread(axes[h, 0]) * sine, spread(axes[h, 1]) * sine, spread(axes[h, 2]) * sine
        store(turned, 4 * h, cosine)
        store(turned, 4 * h + 1, e1)
        store(turned, 4 * h + 2, e2)
        store(turned, 4 * h + 3, e3)
        at, to = 4 * parents[h], 4 * hinged[h]
        a0, a1, a2, a3 = load(w, at), load(w, at + 1), load(w, at + 2), load(w, at + 3)
        store(w, to, a0 * cosine - a1 * e1 - a2 * e2 - a3 * e3)
        store(w, to + 1, a0 * e1 + a1 * cosine + a2 * e3 - a3 * e2)
        store(w, to + 2, a0 * e2 - a1 * e3 + a2 * cosine + a3 * e1)
        store(w, to + 3, a0 * e3 + a1 * e2 - a2 * e1 + a3 * cosine)


@njit(**INNER)
def _turn_three(turned, h, target, first, step):
    """Turn three rows of a vector by exp(a φ/2): v + 2 e₀ (e × v) + 2 e × (e × v)."""
    two = spread(2.0)
    e0, e1 = load(turned, 4 * h), load(turned, 4 * h + 1)
    e2, e3 = load(turned, 4 * h + 2), load(turned, 4 * h + 3)
    v1, v2 = load(target, first), load(target, first + step)
    v3 = load(target, first + 2 * step)
    c1, c2, c3 = two * (e2 * v3 - e3 * v2), two * (e3 * v1 - e1 * v3), two * (e1 * v2 - e2 * v1)
    store(target, first, v1 + e0 * c1 + e2 * c3 - e3 * c2)
    store(target, first + step, v2 + e0 * c2 + e3 * c1 - e1 * c3)
    store(target, first + 2 * step, v3 + e0 * c3 + e1 * c2 - e2 * c1)


@njit(**INNER)
def _along(axes, h, target, first, step):
    """Component along the axis of a hinge."""
    total = spread(0.0)
    for c in range(3):
        total = total + spread(axes[h, c]) * load(target, first + c * step)
    return total


@njit(**INNER)
def lean_on_parent(side, order, width, h, axes, turned, gradient, rates, matrix, border):
    """Pass what acts on a hinged end of an element to its parent and to the angle of the hinge.

    The parent's rotation takes the rows of the node, the angle the row 3·order + side.
    """
    first, angle, half = 3 * (order - 1) * side, 3 * order + side, spread(0.5)
    g1, g2, g3 = load(gradient, first), load(gradient, first + 1), load(gradient, first + 2)
    a1, a2, a3 = spread(axes[h, 0]), spread(axes[h, 1]), spread(axes[h, 2])
    for target in (gradient, rates):
        store(target, angle, _along(axes, h, target, first, 1))
        _turn_three(turned, h, target, first, 1)
    for c in range(3):
        store(border, 3 * angle + c, _along(axes, h, border, 3 * first + c, 3))
        _turn_three(turned, h, border, 3 * first + c, 3)
    for b in range(width):
        store(matrix, angle * width + b, _along(axes, h, matrix, first * width + b, width))
        _turn_three(turned, h, matrix, first * width + b, width)
    for b in range(width):
        store(matrix, b * width + angle, _along(axes, h, matrix, b * width + first, 1))
        _turn_three(turned, h, matrix, b * width + first, 1)
    # second variation of exp(ω/2) exp(a φ/2): half of a × g, turned with the parent
    store(gradient, width, half * (a2 * g3 - a3 * g2))
    store(gradient, width + 1, half * (a3 * g1 - a1 * g3))
    store(gradient, width + 2, half * (a1 * g2 - a2 * g1))
    _turn_three(turned, h, gradient, width, 1)
    for c in range(3):
        row, back = angle * width + first + c, (first + c) * width + angle
        store(matrix, row, load(matrix, row) + load(gradient, width + c))
        store(matrix, back, load(matrix, back) + load(gradient, width + c))


@njit(**INNER)
def finish_nodes(free, lengths, masses, slots, shift, radii, force, entries):
    """Take the lengths of quaternions out of the entries of the nodes.

    Second derivatives by a length ρ: k/2 (3ρ² − 1) alone, −τ/ρ with the rotation.
    """
    one, quarter, moved = spread(1.0), spread(0.25), load(shift, 0)
    for i in range(len(free)):
        size, inverse = load(radii, 2 * i), load(radii, 2 * i + 1)
        square, stiff = size * size, spread(0.5 * lengths[i])
        pivot = stiff * (spread(3.0) * square - one) - moved * spread(masses[i])
        own = quarter * square * (stiff * (square - one) - moved * spread(masses[i]))
        share = inverse * inverse / pivot
        for a in range(3):
            for b in range(a + 1):
                at = slots[i, a * (a + 1) // 2 + b]
                value = load(entries, at)
                value = value - share * load(force, 3 * i + a) * load(force, 3 * i + b)
                store(entries, at, value + own if a == b else value)
