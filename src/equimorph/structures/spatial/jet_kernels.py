"""Compiled kernels of jets of quaternions, a vector of lanes at a time; see `quaternions`.

A jet of `parts` vectors has the rows of part 0, then of part 1, and so on. `pairs` lists (part of a
product, part of the first factor, part of the second); all products add to what is there.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import INNER
from equimorph.linalg.simd import load, sincos, spread, square_root, store

ONE = np.int64(1)
"""Parts of jets that are values only."""


@njit(**INNER)
def clear(rows, start, count):
    """Set rows to zero."""
    zero = spread(0.0)
    for i in range(count):
        store(rows, start + i, zero)


@njit(**INNER)
def add(rows, at, value):
    """Add to a row."""
    store(rows, at, load(rows, at) + value)


@njit(**INNER)
def scale(pairs, size, factor, at, vector, out):
    """Number times vector of `size` entries; factor: a row a part, from `at` on."""
    for n in range(len(pairs)):
        by, to, here = load(factor, at + pairs[n, 1]), size * pairs[n, 0], size * pairs[n, 2]
        for c in range(size):
            add(out, to + c, by * load(vector, here + c))


@njit(**INNER)
def dot(pairs, a, b, out, to):
    """a · b of quaternions; out: a row a part, from `to` on."""
    for n in range(len(pairs)):
        i, j = 4 * pairs[n, 1], 4 * pairs[n, 2]
        value = load(a, i) * load(b, j) + load(a, i + 1) * load(b, j + 1)
        value = value + load(a, i + 2) * load(b, j + 2) + load(a, i + 3) * load(b, j + 3)
        add(out, to + pairs[n, 0], value)


@njit(**INNER)
def multiply(pairs, a, b, out):
    """Product a b of quaternions."""
    for n in range(len(pairs)):
        to, i, j = 4 * pairs[n, 0], 4 * pairs[n, 1], 4 * pairs[n, 2]
        a0, a1, a2, a3 = load(a, i), load(a, i + 1), load(a, i + 2), load(a, i + 3)
        b0, b1, b2, b3 = load(b, j), load(b, j + 1), load(b, j + 2), load(b, j + 3)
        add(out, to, a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3)
        add(out, to + 1, a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2)
        add(out, to + 2, a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1)
        add(out, to + 3, a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0)


@njit(**INNER)
def multiply_vector(pairs, q, m, factor, out):
    """factor · q (0, m): the sum of m_k q e_k."""
    for n in range(len(pairs)):
        to, i, j = 4 * pairs[n, 0], 4 * pairs[n, 1], 3 * pairs[n, 2]
        q0, q1, q2, q3 = load(q, i), load(q, i + 1), load(q, i + 2), load(q, i + 3)
        m0, m1, m2 = factor * load(m, j), factor * load(m, j + 1), factor * load(m, j + 2)
        add(out, to, spread(0.0) - q1 * m0 - q2 * m1 - q3 * m2)
        add(out, to + 1, q0 * m0 - q3 * m1 + q2 * m2)
        add(out, to + 2, q3 * m0 + q0 * m1 - q1 * m2)
        add(out, to + 3, q1 * m1 - q2 * m0 + q0 * m2)


@njit(**INNER)
def vector_multiply(pairs, f, q, out):
    """(0, f) q."""
    for n in range(len(pairs)):
        to, i, j = 4 * pairs[n, 0], 3 * pairs[n, 1], 4 * pairs[n, 2]
        f0, f1, f2 = load(f, i), load(f, i + 1), load(f, i + 2)
        q0, q1, q2, q3 = load(q, j), load(q, j + 1), load(q, j + 2), load(q, j + 3)
        add(out, to, spread(0.0) - f0 * q1 - f1 * q2 - f2 * q3)
        add(out, to + 1, f0 * q0 + f1 * q3 - f2 * q2)
        add(out, to + 2, f1 * q0 + f2 * q1 - f0 * q3)
        add(out, to + 3, f2 * q0 + f0 * q2 - f1 * q1)


@njit(**INNER)
def on_axes(pairs, q, b, out):
    """(q e_k) · b: three rows a part."""
    for n in range(len(pairs)):
        to, i, j = 3 * pairs[n, 0], 4 * pairs[n, 1], 4 * pairs[n, 2]
        q0, q1, q2, q3 = load(q, i), load(q, i + 1), load(q, i + 2), load(q, i + 3)
        b0, b1, b2, b3 = load(b, j), load(b, j + 1), load(b, j + 2), load(b, j + 3)
        add(out, to, q0 * b1 - q1 * b0 - q2 * b3 + q3 * b2)
        add(out, to + 1, q0 * b2 - q2 * b0 - q3 * b1 + q1 * b3)
        add(out, to + 2, q0 * b3 - q3 * b0 - q1 * b2 + q2 * b1)


@njit(**INNER)
def in_space(pairs, q, b, out):
    """(e_k q) · b: three rows a part."""
    for n in range(len(pairs)):
        to, i, j = 3 * pairs[n, 0], 4 * pairs[n, 1], 4 * pairs[n, 2]
        q0, q1, q2, q3 = load(q, i), load(q, i + 1), load(q, i + 2), load(q, i + 3)
        b0, b1, b2, b3 = load(b, j), load(b, j + 1), load(b, j + 2), load(b, j + 3)
        add(out, to, q0 * b1 - q1 * b0 - q3 * b2 + q2 * b3)
        add(out, to + 1, q3 * b1 - q2 * b0 + q0 * b2 - q1 * b3)
        add(out, to + 2, q1 * b2 - q3 * b0 - q2 * b1 + q0 * b3)


@njit(**INNER)
def half_turn(parts, axis, angle, out):
    """Rotation exp(e_k angle/2), k = `axis`, from a row a part of the angle."""
    half, quarter, zero = spread(0.5), spread(0.25), spread(0.0)
    s, c = sincos(half * load(angle, 0))
    clear(out, 0, 4 * parts)
    store(out, 0, c)
    store(out, 1 + axis, s)
    for part in range(1, parts):
        rate = half * load(angle, part)
        store(out, 4 * part, zero - rate * s)
        store(out, 4 * part + 1 + axis, rate * c)
    if parts == 4:
        both = quarter * load(angle, 1) * load(angle, 2)
        add(out, 12, zero - both * c)
        add(out, 13 + axis, zero - both * s)


@njit(**INNER)
def reciprocal_root(parts, square, at, out):
    """1/√x from a row a part of x; both from `at` on."""
    inverse = spread(1.0) / square_root(load(square, at))
    cube = inverse * inverse * inverse
    store(out, at, inverse)
    for part in range(1, parts):
        store(out, at + part, spread(-0.5) * cube * load(square, at + part))
    if parts == 4:
        both = load(square, at + 1) * load(square, at + 2)
        add(out, at + 3, spread(0.75) * cube * inverse * inverse * both)
