"""Interval arithmetic on arrays, with every result rounded outward.

An `Interval` holds two arrays between which the exact values lie, entry by entry. Elementary
operations are widened by units in the last place [MooreKearfottCloud2009]_; sums and products with
matrices by the a-priori bound of their rounding errors, γₙ = n u/(1 − n u) ([Higham2002]_, §3.1),
which holds for any order of summation.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from equimorph.arrays import Float

Array = Float[np.ndarray, "*shape"]

TURN = 2.0 * np.pi
ULPS = 4
"""Units in the last place by which library functions may be wrong, and more than they are."""
UNIT = 2.0**-53
"""Unit round-off u of double precision."""
ROOM = 2.0 * UNIT * ULPS
"""As much relative to a number, at least."""
LARGEST_ANGLE = 1e7
"""Angle beyond which sine and cosine are only known to lie between −1 and 1."""
MORE = 1.0 + 1e-12
"""Covers the rounding of sums of up to 4000 products of numbers that are not negative."""
TINY = 1e-300
"""Covers underflow."""


def gamma(terms: int) -> float:
    """γₙ = n u/(1 − n u), with four roundings more than the number of terms."""
    n = (terms + 4) * UNIT
    return n / (1.0 - n)


@dataclass(frozen=True, eq=False)
class Interval:
    """Arrays of intervals [low, high]; infinite bounds where nothing is known.

    Numbers and arrays count as exact where they are combined with intervals.
    """

    low: Array
    high: Array
    __array_ufunc__: ClassVar[None] = None
    """Lets arrays on the left of an operator give way to the methods here."""

    @staticmethod
    def at(values: Any) -> "Interval":
        """Exact values."""
        exact = np.asarray(values, dtype=float)
        return Interval(exact, exact)

    @staticmethod
    def around(middle: Array, reach: Array) -> "Interval":
        """Values within distances ≥ 0 of a middle."""
        return widen(Interval(middle - reach, middle + reach))

    @staticmethod
    def union(one: "Interval", other: "Interval") -> "Interval":
        """Least intervals that hold two."""
        return Interval(np.minimum(one.low, other.low), np.maximum(one.high, other.high))

    @staticmethod
    def zeros(*shape: int) -> "Interval":
        """Zeros, to be filled in."""
        return Interval(np.zeros(shape), np.zeros(shape))

    @property
    def middle(self) -> Array:
        """A point inside."""
        return np.asarray(0.5 * self.low + 0.5 * self.high)

    @property
    def radius(self) -> Array:
        """Distances from the `middle` that reach all values."""
        middle = self.middle
        return np.asarray(np.maximum(self.high - middle, middle - self.low) * MORE)

    @property
    def size(self) -> Array:
        """Largest absolute values."""
        return np.asarray(np.maximum(np.abs(self.low), np.abs(self.high)))

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of both arrays."""
        return self.low.shape

    def __getitem__(self, key: Any) -> "Interval":
        """The same entries of both arrays."""
        return Interval(self.low[key], self.high[key])

    def __setitem__(self, key: Any, values: Any) -> None:
        """Fill entries."""
        given = interval(values)
        self.low[key], self.high[key] = given.low, given.high

    def reshape(self, *shape: int) -> "Interval":
        """The same entries in another shape."""
        return Interval(self.low.reshape(shape), self.high.reshape(shape))

    def transpose(self, *axes: int) -> "Interval":
        """The same entries with axes in another order."""
        return Interval(self.low.transpose(axes), self.high.transpose(axes))

    def __neg__(self) -> "Interval":
        """−x."""
        return Interval(-self.high, -self.low)

    def __add__(self, other: Any) -> "Interval":
        """x + y."""
        b = interval(other)
        return widen(Interval(self.low + b.low, self.high + b.high))

    def __sub__(self, other: Any) -> "Interval":
        """x − y."""
        b = interval(other)
        return widen(Interval(self.low - b.high, self.high - b.low))

    def __rsub__(self, other: Any) -> "Interval":
        """y − x."""
        return interval(other) - self

    def __mul__(self, other: Any) -> "Interval":
        """x y; 0 · ∞ counts as 0: the factor that is not bounded takes finite values only."""
        b = interval(other)
        with np.errstate(invalid="ignore", over="ignore"):
            corners = [x * y for x in (self.low, self.high) for y in (b.low, b.high)]
        finite = [np.where(np.isnan(each), 0.0, each) for each in corners]
        return widen(Interval(np.minimum.reduce(finite), np.maximum.reduce(finite)))

    def __truediv__(self, other: Any) -> "Interval":
        """x/y."""
        return self * inverse(interval(other))

    def __rtruediv__(self, other: Any) -> "Interval":
        """y/x."""
        return interval(other) * inverse(self)

    __radd__, __rmul__ = __add__, __mul__

    def sum(self, axis: int) -> "Interval":
        """Sum along an axis."""
        room = gamma(self.shape[axis]) * self.size.sum(axis=axis) * MORE + TINY
        return Interval(self.low.sum(axis=axis) - room, self.high.sum(axis=axis) + room)


def interval(values: Any) -> Interval:
    """Intervals as they are, other values as exact ones."""
    return values if isinstance(values, Interval) else Interval.at(values)


def widen(a: Interval) -> Interval:
    """Intervals widened by a few units in the last place; unknown bounds become infinite."""
    with np.errstate(invalid="ignore"):
        low = a.low - (ROOM * np.abs(a.low) + TINY)
        high = a.high + (ROOM * np.abs(a.high) + TINY)
    return Interval(np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high))


def join(parts: Sequence[Interval], axis: int) -> Interval:
    """Intervals side by side."""
    bounds = ([each.low for each in parts], [each.high for each in parts])
    return Interval(*(np.concatenate(each, axis=axis) for each in bounds))


def product(matrix: Array, x: Interval) -> Interval:
    """Product of exact matrices and matrices of intervals, by middle and radius [Rump1999]_."""
    middle, radius = x.middle, x.radius
    room = np.abs(matrix) @ (radius + gamma(matrix.shape[-1]) * np.abs(middle)) * MORE + TINY
    return Interval.around(np.asarray(matrix @ middle), room)


def symmetric(matrix: Interval) -> Interval:
    """What the bounds of both triangles of symmetric matrices leave."""
    other = Interval(np.swapaxes(matrix.low, -1, -2), np.swapaxes(matrix.high, -1, -2))
    return Interval(np.maximum(matrix.low, other.low), np.minimum(matrix.high, other.high))


def rising(function: Callable[[Array], Array], a: Interval) -> Interval:
    """A function of numpy that does not fall."""
    return widen(Interval(function(a.low), function(a.high)))


def falling(function: Callable[[Array], Array], a: Interval) -> Interval:
    """A function of numpy that does not rise."""
    return widen(Interval(function(a.high), function(a.low)))


def square(a: Interval) -> Interval:
    """x²."""
    return widen(Interval(_least_size(a) ** 2, a.size**2))


def _least_size(a: Interval) -> Array:
    inside = (a.low <= 0.0) & (a.high >= 0.0)
    return np.where(inside, 0.0, np.minimum(np.abs(a.low), np.abs(a.high)))


def inverse(a: Interval) -> Interval:
    """1/x."""
    through = (a.low <= 0.0) & (a.high >= 0.0)
    with np.errstate(divide="ignore"):
        bounds = Interval(
            np.where(through, -np.inf, 1.0 / a.high), np.where(through, np.inf, 1.0 / a.low)
        )
    return widen(bounds)


def sine(a: Interval) -> Interval:
    """sin x."""
    return _wave(np.sin, a, 0.5 * np.pi)


def cosine(a: Interval) -> Interval:
    """cos x."""
    return _wave(np.cos, a, 0.0)


def _wave(function: Callable[[Array], Array], a: Interval, top: float) -> Interval:
    """Extremes inside, else at the ends: 1 at `top`, −1 half a turn beyond, both periodic.

    An extreme that rounding hides lies so near to an end that the value there is the same.
    """
    ends = function(a.low), function(a.high)

    def meets(place: float) -> Any:
        return np.floor((a.high - place) / TURN) >= np.ceil((a.low - place) / TURN)

    wild = ~(a.size <= LARGEST_ANGLE)
    low = np.where(meets(top - np.pi) | wild, -1.0, np.minimum(*ends))
    return widen(Interval(low, np.where(meets(top) | wild, 1.0, np.maximum(*ends))))


def tangent(a: Interval) -> Interval:
    """Tangent, rising between poles."""
    pole = np.floor(a.high / np.pi + 0.5) > np.floor(a.low / np.pi + 0.5)
    pole = pole | ~(a.size <= LARGEST_ANGLE)
    low, high = np.tan(a.low), np.tan(a.high)
    return widen(Interval(np.where(pole, -np.inf, low), np.where(pole, np.inf, high)))


def even_growth(a: Interval) -> Interval:
    """Hyperbolic cosine."""
    return widen(Interval(np.cosh(_least_size(a)), np.cosh(a.size)))


def power(a: Interval, b: Interval) -> Interval:
    """Power with a constant exponent; unbounded for a variable one."""
    n = b.low
    whole, odd = n == np.round(n), np.mod(n, 2.0) == 1.0
    low, high = a.low**n, a.high**n
    through = (a.low <= 0.0) & (a.high >= 0.0)
    even = through & whole & ~odd & (n > 0.0)
    least = np.where(even, 0.0, np.minimum(low, high))
    known = (n == b.high) & np.where(whole, (n > 0.0) | ~through, a.low > 0.0)
    most = np.where(known, np.maximum(low, high), np.inf)
    return widen(Interval(np.where(known, least, -np.inf), most))
