"""Curves on which parameters, and descriptors, are prescribed as smooth functions of t."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int
from numpy.polynomial import chebyshev

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.equilibria.curves import Metric
from equimorph.errors import InputError
from equimorph.model import Descriptor
from equimorph.structures import Advance, Structure

Columns = Float[np.ndarray, "lanes columns"]
Table = Float[np.ndarray, "curves pieces _ columns"]
Function = Callable[[float], Float[np.ndarray, "curves columns"]]

DEGREE = 16
"""Degree of the polynomials that approximate a prescribed curve piece by piece."""
MOST_PIECES = 64
"""Largest number of polynomial pieces; a function that needs more is refused as not smooth."""
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
        """Return a selection of the lanes."""
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


@dataclass(frozen=True)
class SmoothCurve:
    """Curves p(t) given by polynomials in pieces; `weight` is the scaled length of each."""

    structure: Structure
    pieces: Pieces
    weight: Values

    @property
    def metric(self) -> Metric:
        """The structure's own."""
        return self.structure

    @property
    def folds_change_index(self) -> bool:
        """Whether the index changes where dt/ds vanishes, and only there."""
        return True

    def take(self, lanes: Int[np.ndarray, " some"]) -> "SmoothCurve":
        """Return a selection of the lanes."""
        return SmoothCurve(self.structure, self.pieces.take(lanes), self.weight[lanes])

    def parameters(self, t: Values) -> Parameters:
        """p(t)."""
        return self.pieces.value(t)

    def states(self, z: Lanes, t: Values) -> tuple[Lanes, Parameters]:
        """Return z and p(t)."""
        return z, self.parameters(t)

    def rate(self, t: Values) -> Parameters:
        """dp/dt."""
        return self.pieces.rate(t)

    def bend(self, t: Values) -> Parameters:
        """d²p/dt²."""
        return self.pieces.bend(t)

    def advance(self, z: Lanes, t: Values, row: Lanes, corner: Values, defect: Values) -> Advance:
        """Newton step and tangent; see `Advance`."""
        return self.structure.advance(z, self.parameters(t), self.rate(t), row, corner, defect)


Extended = Float[np.ndarray, "lanes extended"]
Rows = Float[np.ndarray, "lanes k size"]

DIFFERENCE = 1e-5
"""Step of central differences: their error and that of round-off are about 1e-11."""


@dataclass(frozen=True)
class TrackedMetric:
    """Metric of (u, a, λ): that of the structure, and the scales of the unknown parameters a."""

    size: int
    unknowns: int
    mass: Float[np.ndarray, " unknowns"]


@dataclass(frozen=True)
class TrackedCurve:
    """Equilibria with ``S(z, p) = S*(t)``, part of the parameters given and part of them unknown.

    Unknowns (u, a, λ): those of the structure with the free parameters a between u and λ. The
    gradients of descriptors are taken by central differences.

    Parameters
    ----------
    prescribed
        All parameters (those of the free ones do not count) and then S*, as functions of t.
    free
        Places of the unknown parameters, as many as descriptors.
    weight
        Scaled length of what is prescribed.
    """

    structure: Structure
    prescribed: Pieces
    free: Int[np.ndarray, " k"]
    descriptors: tuple[Descriptor, ...]
    weight: Values

    @cached_property
    def metric(self) -> TrackedMetric:
        """Mass of u and of a."""
        structure, k = self.structure, len(self.free)
        mass = np.concatenate([structure.mass, structure.scales[self.free] ** -2.0])
        return TrackedMetric(structure.size + k, structure.unknowns + k, mass)

    @property
    def folds_change_index(self) -> bool:
        """Whether the index changes where dt/ds vanishes, and only there."""
        return False

    def take(self, lanes: Int[np.ndarray, " some"]) -> "TrackedCurve":
        """Return a selection of the lanes."""
        given, weight = self.prescribed.take(lanes), self.weight[lanes]
        return TrackedCurve(self.structure, given, self.free, self.descriptors, weight)

    def begin(self, z: Lanes, p: Parameters) -> Extended:
        """(u, a, λ) of states."""
        return self._joined(z, p[:, self.free])

    def _joined(self, z: Lanes, a: Float[np.ndarray, "lanes k"]) -> Extended:
        n = self.structure.unknowns
        return np.concatenate([z[:, :n], a, z[:, n:]], axis=1)

    def parameters(self, t: Values) -> Parameters:
        """Return what is given of p; the free ones as they were."""
        return self.prescribed.value(t)[:, : len(self.structure.parameters)]

    def states(self, z: Extended, t: Values) -> tuple[Lanes, Parameters]:
        """Unknowns and multipliers of the structure, and all parameters."""
        n, k, p = self.structure.unknowns, len(self.free), self.parameters(t)
        p[:, self.free] = z[:, n : n + k]
        return np.concatenate([z[:, :n], z[:, n + k :]], axis=1), p

    def rate(self, t: Values) -> Parameters:
        """Rate of what is given of p."""
        rate = self.prescribed.rate(t)[:, : len(self.structure.parameters)]
        rate[:, self.free] = 0.0
        return rate

    def bend(self, t: Values) -> Parameters:
        """Second derivative of what is given of p."""
        bend = self.prescribed.bend(t)[:, : len(self.structure.parameters)]
        bend[:, self.free] = 0.0
        return bend

    def advance(
        self, z: Extended, t: Values, row: Extended, corner: Values, defect: Values
    ) -> Advance:
        """Newton step and tangent by the bordered solve with k + 1 more rows and columns."""
        structure, k, n = self.structure, len(self.free), self.structure.unknowns
        count = len(structure.parameters)
        x, p = self.states(z, t)
        residual = structure.residual(x, p)
        missed = self._values(x, p) - self.prescribed.value(t)[:, count:]
        changes = self._changes(self.rate(t))
        columns = np.stack([structure.parameter_derivative(x, p, dp) for dp in changes], 1)
        rows, slopes = self._gradients(x, p, changes)
        slopes[:, :, k] -= self.prescribed.rate(t)[:, count:]
        corners = np.zeros((len(z), k + 1, k + 1))
        corners[:, :k], corners[:, k, :k], corners[:, k, k] = slopes, row[:, n : n + k], corner
        last = np.concatenate([row[:, :n], row[:, n + k :]], axis=1)
        rhs = np.zeros((len(z), 2, structure.size + k + 1))
        rhs[:, 0] = -np.concatenate([residual, missed, defect[:, None]], axis=1)
        rhs[:, 1, -1] = 1.0
        border = (columns, np.concatenate([rows, last[:, None]], axis=1), corners)
        solved = structure.solve(x, p, rhs, border)
        step, tangent = (
            self._joined(each[:, : structure.size], each[:, structure.size : -1])
            for each in (solved.x[:, 0], solved.x[:, 1])
        )
        return Advance(
            step,
            solved.x[:, 0, -1].copy(),
            tangent,
            solved.x[:, 1, -1].copy(),
            np.abs(np.concatenate([residual, missed], axis=1)).max(axis=1),
            solved.negative - structure.constraints,
            np.full(len(z), np.nan),
        )

    def _values(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes k"]:
        return np.stack([descriptor.function(z, p) for descriptor in self.descriptors], 1)

    def _changes(self, rate: Parameters) -> list[Parameters]:
        """Directions in parameter space: each free parameter, and the given rate."""
        units = np.zeros((len(self.free), *rate.shape))
        for unit, place in zip(units, self.free, strict=True):
            unit[:, place] = 1.0
        return [*units, rate]

    def _gradients(
        self, z: Lanes, p: Parameters, changes: list[Parameters]
    ) -> tuple[Rows, Float[np.ndarray, "lanes k directions"]]:
        """∂S/∂z, and ∂S/∂p along directions."""
        lanes, size = z.shape
        steps = DIFFERENCE * np.eye(size)
        here = np.repeat(p, size, axis=0)
        ahead, behind = (
            self._values((z[:, None] + sign * steps).reshape(-1, size), here)
            for sign in (1.0, -1.0)
        )
        rows = ((ahead - behind) / (2.0 * DIFFERENCE)).reshape(lanes, size, -1)
        slopes = [self._along(z, p, dp) for dp in changes]
        return np.ascontiguousarray(rows.transpose(0, 2, 1)), np.stack(slopes, 2)

    def _along(self, z: Lanes, p: Parameters, dp: Parameters) -> Float[np.ndarray, "lanes k"]:
        longest = np.abs(dp / self.structure.scales).max(axis=1)
        h = (DIFFERENCE / np.maximum(longest, 1e-300))[:, None]
        h = np.where(longest[:, None] > 0.0, h, 1.0)
        change = self._values(z, p + h * dp) - self._values(z, p - h * dp)
        return np.asarray(change / (2.0 * h))
