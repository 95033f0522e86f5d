"""Compiled kernels of dense matrices of any size, one lane after the other."""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER, balance_one, exchange


@njit(**FLAGS)
def solve_dense(systems, size, symmetric, x, negative, determinant):
    """Solve each system, and count the negative eigenvalues of symmetric matrices; their det.

    systems: (lanes, size, size + sides), right-hand sides last; overwritten, like the matrices.
    """
    for lane in range(systems.shape[0]):
        negative[lane], product, exponent = _factor_by_rooks(symmetric[lane])
        determinant[lane, 0], determinant[lane, 1] = product, exponent
        solve_by_rows(systems[lane], size)
        for side in range(x.shape[1]):
            for i in range(size):
                x[lane, side, i] = systems[lane, i, size + side]


@njit(**INNER)
def solve_by_rows(a, size):
    """Gauss with partial pivoting, right-hand sides last; the determinant.

    No numbers where a pivot vanishes.
    """
    width, determinant = a.shape[1], 1.0
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        if best != k:
            determinant = -determinant
            for j in range(k, width):
                a[k, j], a[best, j] = a[best, j], a[k, j]
        if a[k, k] == 0.0:
            a[:, size:] = np.nan
            return 0.0
        determinant *= a[k, k]
        inverse = 1.0 / a[k, k]
        for i in range(k + 1, size):
            factor = a[i, k] * inverse
            if factor != 0.0:
                for j in range(k + 1, width):
                    a[i, j] -= factor * a[k, j]
    for k in range(size - 1, -1, -1):
        for i in range(k + 1, size):
            factor = a[k, i]
            for j in range(size, width):
                a[k, j] -= factor * a[i, j]
        for j in range(size, width):
            a[k, j] /= a[k, k]
    return determinant


@njit(**INNER)
def _factor_by_rooks(a):
    """Negative eigenvalues of a symmetric matrix, and m, e of det = m·2^e, by LDLᵀ.

    Rook pivoting of Ashcraft, Grimes and Lewis (1998): 1 × 1 and 2 × 2 pivots, the largest of
    their rows; `a` is overwritten. Sylvester's law of inertia gives the signs: a 2 × 2 pivot chosen
    by this rule always has one negative eigenvalue. −1 and nan where entries are not finite.
    """
    size = a.shape[0]
    alpha = 0.6403882032022076  # (1 + √17) / 8 bounds the growth of the entries
    negative, k, product, exponent = 0, 0, 1.0, 0.0
    while k < size:
        first, second = k, k
        off, r = _largest_beside(a, k, k)
        single = abs(a[k, k]) >= alpha * off
        if not (single or off > 0.0):  # entries that are no numbers
            return -1, np.nan, 0.0
        while not single and first == second:
            other, s = _largest_beside(a, r, k)
            if abs(a[r, r]) >= alpha * other:
                single, first, second = True, r, r
            elif not other > off:
                second = r
            else:
                first, second, off, r = r, r, other, s
        if single:
            exchange(a, k, first)
            pivot = a[k, k]
            if pivot == 0.0:  # its row is zero, too
                product, k = 0.0, k + 1
                continue
            negative += pivot < 0.0
            product *= pivot
            for i in range(k + 1, size):
                factor = a[i, k] / pivot
                if factor != 0.0:
                    for j in range(k + 1, size):
                        a[i, j] -= factor * a[k, j]
            k += 1
        else:
            exchange(a, k, min(first, second))
            exchange(a, k + 1, max(first, second))
            b = a[k + 1, k]
            p, q = a[k, k] / b, a[k + 1, k + 1] / b
            shape = p * q - 1.0
            if not shape < 0.0:
                return -1, np.nan, 0.0
            negative += 1
            product, exponent = balance_one(product * b, exponent)
            product *= shape * b
            for i in range(k + 2, size):
                one = (q * a[i, k] - a[i, k + 1]) / (shape * b)
                two = (p * a[i, k + 1] - a[i, k]) / (shape * b)
                for j in range(k + 2, size):
                    a[i, j] -= one * a[k, j] + two * a[k + 1, j]
            k += 2
        product, exponent = balance_one(product, exponent)
    return negative, product, exponent


@njit(**INNER)
def _largest_beside(a, row, start):
    """Largest entry of a row beside the diagonal, from a column on, and its place."""
    largest, place = 0.0, row
    for j in range(start, a.shape[0]):
        if j != row and abs(a[row, j]) > largest:
            largest, place = abs(a[row, j]), j
    return largest, place
