"""Compiled kernels of small dense matrices, and the way of lanes into and out of blocks."""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.simd import (
    LANES,
    absolute,
    entry,
    load,
    set_entry,
    spread,
    store,
    transpose,
    where_less,
)

FLAGS = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
INNER = {**FLAGS, "_nrt": False}
"""Flags of kernels that are called by kernels and allocate nothing.

They need not count references to their arrays: atomic operations that, element by element, cost as
much as the arithmetic.
"""
SUMS = {"contract", "reassoc"}
"""Freedom of kernels whose sums may be taken in any order, in vectors: the same on every call."""
POWER, HUGE, TINY = 256.0, 2.0**256, 2.0**-256
"""Products of pivots beyond 2^±256 are divided by a power of two, which is counted."""


@njit(**INNER)
def solve_lanes(a, size, width):
    """Gauss with partial pivoting on `LANES` systems: a (size, width, lanes), right sides last."""
    for k in range(size):
        for i in range(k + 1, size):
            here, there = absolute(load(a, k * width + k)), absolute(load(a, i * width + k))
            for j in range(k, width):
                upper, lower = load(a, k * width + j), load(a, i * width + j)
                store(a, k * width + j, where_less(here, there, lower, upper))
                store(a, i * width + j, where_less(here, there, upper, lower))
        inverse = spread(1.0) / load(a, k * width + k)
        for j in range(k + 1, width):
            store(a, k * width + j, load(a, k * width + j) * inverse)
        for i in range(k + 1, size):
            factor = load(a, i * width + k)
            for j in range(k + 1, width):
                at = i * width + j
                store(a, at, load(a, at) - factor * load(a, k * width + j))
    for k in range(size - 2, -1, -1):
        for i in range(k + 1, size):
            factor = load(a, k * width + i)
            for j in range(size, width):
                at = k * width + j
                store(a, at, load(a, at) - factor * load(a, i * width + j))


@njit(**INNER)
def balance(product, exponent):
    """Products and exponents of m·2^e, with m within 2^±256 unless it was beyond 2^±512."""
    one, zero, size = spread(1.0), spread(0.0), absolute(product)
    huge, tiny, power = spread(HUGE), spread(TINY), spread(POWER)
    factor = where_less(huge, size, tiny, where_less(size, tiny, huge, one))
    more = where_less(huge, size, power, where_less(size, tiny, zero - power, zero))
    return product * factor, exponent + more


@njit(**INNER)
def balance_one(product, exponent):
    """`balance` for one number."""
    if abs(product) > HUGE:
        return product * TINY, exponent + POWER
    if abs(product) < TINY:
        return product * HUGE, exponent - POWER
    return product, exponent


@njit(**FLAGS)
def factor_symmetric(a):
    """Negative eigenvalues of a symmetric matrix, and det, by LDLᵀ with complete pivoting.

    Bunch and Parlett (1971): 1 × 1 and 2 × 2 pivots; `a` is overwritten. Sylvester's law of inertia
    gives the signs: a 2 × 2 pivot chosen by this rule always has one negative eigenvalue. −1 and
    nan where entries are not finite.
    """
    size = a.shape[0]
    alpha = 0.6403882032022076  # (1 + √17) / 8 bounds the growth of the entries
    negative, k, product = 0, 0, 1.0
    while k < size:
        diagonal, d = -1.0, k
        off, r, s = -1.0, k, k
        for i in range(k, size):
            if abs(a[i, i]) > diagonal:
                diagonal, d = abs(a[i, i]), i
            for j in range(k, i):
                if abs(a[i, j]) > off:
                    off, r, s = abs(a[i, j]), i, j
        if max(diagonal, off) < 0.0:  # a pivot that overflows leaves no numbers
            return -1, np.nan
        if max(diagonal, off) == 0.0:
            return negative, 0.0
        if diagonal >= alpha * off:
            exchange(a, k, d)
            pivot = a[k, k]
            negative += pivot < 0.0
            product *= pivot
            for i in range(k + 1, size):
                factor = a[i, k] / pivot
                for j in range(k + 1, i + 1):
                    a[i, j] -= factor * a[j, k]
            for i in range(k + 1, size):
                for j in range(k + 1, i):
                    a[j, i] = a[i, j]
            k += 1
        else:
            exchange(a, k, s)
            exchange(a, k + 1, r)
            negative += 1
            p, q, b = a[k, k], a[k + 1, k + 1], a[k + 1, k]
            determinant = p * q - b * b
            product *= determinant
            for i in range(k + 2, size):
                first = (q * a[i, k] - b * a[i, k + 1]) / determinant
                second = (p * a[i, k + 1] - b * a[i, k]) / determinant
                for j in range(k + 2, i + 1):
                    a[i, j] -= first * a[j, k] + second * a[j, k + 1]
            for i in range(k + 2, size):
                for j in range(k + 2, i):
                    a[j, i] = a[i, j]
            k += 2
    return negative, product


@njit(**INNER)
def exchange(a, i, j):
    """Exchange rows and columns i and j of a symmetric matrix."""
    if i != j:
        for c in range(a.shape[0]):
            a[i, c], a[j, c] = a[j, c], a[i, c]
        for c in range(a.shape[0]):
            a[c, i], a[c, j] = a[c, j], a[c, i]


@njit(**FLAGS)
def multiply_lanes(x, matrix, out):
    """Rows of x times a matrix, each summed in the same order."""
    out[:] = 0.0
    for lane in range(x.shape[0]):
        for i in range(matrix.shape[0]):
            factor = x[lane, i]
            for j in range(matrix.shape[1]):
                out[lane, j] += factor * matrix[i, j]


@njit(**FLAGS)
def metric_lengths(x, mass, out):
    """Lengths of the first entries of rows of x, whose squares count by masses."""
    for lane in range(x.shape[0]):
        total = 0.0
        for i in range(len(mass)):
            total += x[lane, i] ** 2 * mass[i]
        out[lane] = np.sqrt(total)


@njit(**FLAGS)
def largest_products(x, matrix, out):
    """Largest entries, by size, of rows of x times a matrix."""
    totals = np.empty(matrix.shape[1])
    for lane in range(x.shape[0]):
        totals[:] = 0.0
        for i in range(matrix.shape[0]):
            factor = x[lane, i]
            for j in range(matrix.shape[1]):
                totals[j] += factor * matrix[i, j]
        largest = 0.0
        for j in range(matrix.shape[1]):
            if not abs(totals[j]) <= largest:
                largest = abs(totals[j])
        out[lane] = largest


@njit(**FLAGS)
def orthonormal_lanes(rows, count, weights):
    """Make the first rows of each lane orthonormal, and the others orthogonal to these; in place.

    Gram and Schmidt in the metric of the weights. NaN where rows are dependent.
    """
    width = rows.shape[2]
    for lane in range(rows.shape[0]):
        for i in range(rows.shape[1]):
            for j in range(min(i, count)):
                share = 0.0
                for n in range(width):
                    share += rows[lane, i, n] * weights[n] * rows[lane, j, n]
                for n in range(width):
                    rows[lane, i, n] -= share * rows[lane, j, n]
            if i < count:
                squared = 0.0
                for n in range(width):
                    squared += weights[n] * rows[lane, i, n] * rows[lane, i, n]
                scale = 1.0 / np.sqrt(squared) if 0.0 < squared < np.inf else np.nan
                for n in range(width):
                    rows[lane, i, n] *= scale


@njit(**INNER)
def read_lanes(source, position, lane_step, count, target, row, step):
    """Read `count` consecutive entries of each lane into rows `step` apart; see `transpose`."""
    if count < LANES:
        for i in range(count):
            for k in range(LANES):
                target[row + i * step, k] = entry(source, position + k * lane_step + i)
    for block in range(0, count if count >= LANES else 0, LANES):
        i = min(block, count - LANES)
        at = (row + i * step) * LANES
        transpose(source, position + i, lane_step, target, at, step * LANES)


@njit(**INNER)
def write_lanes(source, row, step, target, position, lane_step, count):
    """Write rows `step` apart into `count` consecutive entries of each lane."""
    if count < LANES:
        for i in range(count):
            for k in range(LANES):
                set_entry(target, position + k * lane_step + i, source[row + i * step, k])
    for block in range(0, count if count >= LANES else 0, LANES):
        i = min(block, count - LANES)
        at = (row + i * step) * LANES
        transpose(source, at, step * LANES, target, position + i, lane_step)
