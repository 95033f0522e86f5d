"""Smooth functions of t, for one or many lanes, as polynomials in pieces."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int
from numpy.polynomial import chebyshev

from equimorph.arrays import Values
from equimorph.errors import InputError

Columns = Float[np.ndarray, "lanes columns"]
Table = Float[np.ndarray, "curves pieces _ columns"]
Function = Callable[[float], Float[np.ndarray, "curves columns"]]

DEGREE = 16
MOST_PIECES = 64
CLOSE = 1e-12
"""Largest miss of the polynomials, relative to the sizes of the columns."""


@dataclass(frozen=True)
class Pieces:
    """Chebyshev series on each piece of [0, 1], for one curve or one for each lane.

    Beyond t = 0 and 1 curves go on straight.

    Parameters
    ----------
    breaks
        Ends of the pieces, from 0 to 1.
    tables
        Coefficients of the values and of their first and second derivatives.
    which
        Number of the curve of each lane.
    """

    breaks: Float[np.ndarray, " ends"]
    tables: tuple[Table, Table, Table]
    which: Int[np.ndarray, " lanes"]

    def take(self, lanes: Int[np.ndarray, " some"]) -> "Pieces":
        """Return some of the lanes."""
        return Pieces(self.breaks, self.tables, self.which[lanes])

    def value(self, t: Values) -> Columns:
        """Values at t."""
        inside = np.clip(t, 0.0, 1.0)
        beyond = (t - inside)[:, None] * self._series(1, inside)
        return np.asarray(self._series(0, inside) + beyond)

    def rate(self, t: Values) -> Columns:
        """First derivative."""
        return self._series(1, np.clip(t, 0.0, 1.0))

    def bend(self, t: Values) -> Columns:
        """Second derivative."""
        within = ((t >= 0.0) & (t <= 1.0))[:, None]
        return np.where(within, self._series(2, np.clip(t, 0.0, 1.0)), 0.0)

    def _series(self, derivative: int, t: Values) -> Columns:
        """Clenshaw's recurrence for the piece of each lane."""
        last = len(self.breaks) - 2
        piece = np.clip(np.searchsorted(self.breaks, t, side="right") - 1, 0, last)
        low, high = self.breaks[piece], self.breaks[piece + 1]
        x = ((2.0 * t - low - high) / (high - low))[:, None]
        series = self.tables[derivative][self.which, piece]
        first, second = np.zeros_like(series[:, 0]), np.zeros_like(series[:, 0])
        for k in range(series.shape[1] - 1, 0, -1):
            first, second = series[:, k] + 2.0 * x * first - second, first
        return np.asarray(series[:, 0] + x * first - second)

    def lengths(self, scales: Float[np.ndarray, " columns"]) -> Values:
        """Length of each lane's curve, columns measured by their scales."""
        x, weights = np.polynomial.legendre.leggauss(DEGREE)
        total = np.zeros(len(self.which))
        for low, high in pairwise(self.breaks):
            half = 0.5 * (high - low)
            for t, weight in zip(low + half * (1.0 + x), half * weights, strict=True):
                speed = self.rate(np.full(len(total), t)) / scales
                total += weight * np.linalg.norm(speed, axis=1)
        return total


def interpolated(
    breaks: Float[np.ndarray, " ends"], function: Function, lanes: int, degree: int
) -> Pieces:
    """Polynomials through the values of a function at the Chebyshev points of each piece.

    `function` gives one row for all lanes, or one for each.
    """
    nodes = chebyshev.chebpts1(degree + 1)
    middle, half = 0.5 * (breaks[1:] + breaks[:-1]), 0.5 * np.diff(breaks)
    places = middle[:, None] + half[:, None] * nodes
    values = np.array([[function(float(t)) for t in piece] for piece in places])
    fit = np.linalg.inv(chebyshev.chebvander(nodes, degree))
    series = np.einsum("kn,pncd->cpkd", fit, values)
    slopes = chebyshev.chebder(series, axis=2) / half[:, None, None]
    bends = chebyshev.chebder(slopes, axis=2) / half[:, None, None]
    which = np.arange(lanes) if len(series) == lanes else np.zeros(lanes, int)
    return Pieces(breaks, (series, slopes, bends), which)


def approximated(function: Function, lanes: int, scales: Float[np.ndarray, " columns"]) -> Pieces:
    """Polynomials that agree with a smooth function to round-off, in as few pieces as it takes.

    Raises
    ------
    InputError
        If 64 pieces do not suffice.
    """
    between = np.cos(np.pi * np.arange(1, DEGREE + 1) / (DEGREE + 1))
    count = 1
    while True:
        breaks = np.linspace(0.0, 1.0, count + 1)
        found = interpolated(breaks, function, lanes, DEGREE)
        missed, place = 0.0, 0.0
        for low, high in pairwise(breaks):
            for t in 0.5 * (low + high) + 0.5 * (high - low) * between:
                exact = function(float(t))
                here = found.take(np.arange(len(exact))).value(np.full(len(exact), t))
                miss = float(np.max(np.abs(here - exact) / (scales + np.abs(exact))))
                missed, place = max((missed, place), (miss, float(t)))
        if missed <= CLOSE:
            return found
        count *= 2
        if count > MOST_PIECES:
            raise InputError(
                f"`to` must be smooth for t between 0 and 1; got a curve that {MOST_PIECES} "
                f"polynomials of degree {DEGREE} miss by {missed:.1g} near t={place:.3g}. Give "
                "several curves that meet where it is not smooth."
            )
