"""Compiled kernel of the largest norms of vectors in elements; see `extrema.largest_norms`."""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER

LOWEST = 0.84
"""Least share of the largest norm of all places that one next to the extremum has: √cos(π/4)."""
POLISHING = 5
"""Newton iterations from the highest places towards the extremum."""


@njit(**INNER)
def _larger(one, other):
    """Larger of two values; what is no number is larger than any."""
    return one if one != one or other <= one else other  # noqa: PLR0124


@njit(**INNER)
def _squared(basis, series):
    """Squared norm of the sum of vectors times what a basis is at a place."""
    total = 0.0
    for k in range(series.shape[1]):
        value = 0.0
        for i in range(series.shape[0]):
            value += basis[i] * series[i, k]
        total += value * value
    return total


@njit(**INNER)
def _fill_basis(x, basis):
    """Legendre polynomials at a place."""
    basis[0], basis[1] = 1.0, x
    for n in range(2, len(basis)):
        basis[n] = ((2 * n - 1) * x * basis[n - 1] - (n - 1) * basis[n - 2]) / n


@njit(**INNER)
def _differentiate(slope, series, out):
    """Coefficients of the derivative."""
    order, components = series.shape
    for i in range(order):
        for k in range(components):
            value = 0.0
            for j in range(i + 1, order):
                value += slope[i, j] * series[j, k]
            out[i, k] = value


@njit(**INNER)
def _polished(place, low, top, series, basis):
    """Squared norm at the peak next to a place, by Newton's method between bounds.

    series: coefficients of the vector and of its first and second derivatives.
    """
    order, components = series.shape[1:]
    for _ in range(POLISHING):
        _fill_basis(place, basis)
        down, curved = 0.0, 0.0
        for k in range(components):
            value, rate, bend = 0.0, 0.0, 0.0
            for i in range(order):
                value += basis[i] * series[0, i, k]
                rate += basis[i] * series[1, i, k]
                bend += basis[i] * series[2, i, k]
            down += value * rate
            curved += value * bend + rate * rate
        if curved < 0.0:
            place = min(max(place - down / curved, low), top)
    _fill_basis(place, basis)
    return _squared(basis, series[0])


@njit(**FLAGS)
def largest_norms_lanes(to_legendre, grid, basis, slope, values, largest):
    """Largest norm in each element; see `extrema.largest_norms`.

    grid: places in an element, basis: Legendre polynomials there, slope: the matrix of their
    derivatives.
    """
    lanes, elements, order, components = values.shape
    series, sizes = np.empty((3, order, components)), np.empty(len(grid))
    here = np.empty(order)
    for lane in range(lanes):
        for e in range(elements):
            for i in range(order):
                for k in range(components):
                    value = 0.0
                    for j in range(order):
                        value += to_legendre[i, j] * values[lane, e, j, k]
                    series[0, i, k] = value
            highest, last = 0.0, len(grid) - 1
            for g in range(last + 1):
                sizes[g] = _squared(basis[g], series[0])
                highest = _larger(highest, sizes[g])
            low, best, differentiated = LOWEST * LOWEST * highest, highest, False
            for g in range(last + 1):
                if not sizes[g] >= low or (g > 0 and not sizes[g] >= sizes[g - 1]):
                    continue
                if g < last and not sizes[g] > sizes[g + 1]:
                    continue
                if not differentiated:
                    _differentiate(slope, series[0], series[1])
                    _differentiate(slope, series[1], series[2])
                    differentiated = True
                bounds = grid[max(g - 1, 0)], grid[min(g + 1, last)]
                best = _larger(best, _polished(grid[g], *bounds, series, here))
            largest[lane, e] = np.sqrt(best)
