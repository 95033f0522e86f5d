"""Curves on which parameters, and descriptors, are prescribed as smooth functions of t."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from numpy.polynomial import chebyshev

from equimorph.arrays import Float, Int, Lanes, Numbers, Parameters, Some, Values
from equimorph.equilibria.critical import Critical
from equimorph.equilibria.curves import PlainCurve
from equimorph.equilibria.point_conditions import Linear, Move, Values as DescriptorValues
from equimorph.errors import InputError
from equimorph.linalg import BorderedSolution
from equimorph.linalg.determinants import no_determinants
from equimorph.model import Descriptor
from equimorph.structures import Advance, Structure
from equimorph.structures.equations import LinearSystem
from equimorph.tolerances import METRIC_DIFFERENCE

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
    """

    breaks: Float[np.ndarray, " ends"]
    """Ends of the pieces, from 0 to 1."""
    tables: tuple[Table, Table, Table]
    """Coefficients of the values and of their first and second derivatives."""
    which: Numbers
    """Number of the curve of each lane."""

    def take(self, lanes: Some) -> "Pieces":
        """Return a selection of the lanes."""
        return Pieces(self.breaks, self.tables, self.which[lanes])

    def value(self, t: Values) -> Columns:
        """Values at t."""
        inside = np.minimum(np.maximum(t, 0.0), 1.0)
        beyond = t - inside
        if not beyond.any():
            return self._series(inside, 0)[0]
        out, rate = self._series(inside, 0, 1)
        return np.asarray(out + beyond[:, None] * rate)

    def value_and_rate(self, t: Values) -> tuple[Columns, Columns]:
        """Values at t, and their first derivative."""
        inside = np.minimum(np.maximum(t, 0.0), 1.0)
        out, rate = self._series(inside, 0, 1)
        return out + (t - inside)[:, None] * rate, rate

    def rate(self, t: Values) -> Columns:
        """First derivative."""
        return self._series(np.clip(t, 0.0, 1.0), 1)[0]

    def bend(self, t: Values) -> Columns:
        """Second derivative."""
        within = ((t >= 0.0) & (t <= 1.0))[:, None]
        return np.where(within, self._series(np.clip(t, 0.0, 1.0), 2)[0], 0.0)

    def _series(self, t: Values, *derivatives: int) -> list[Columns]:
        """Σ c_k cos(k arccos x) for the piece of each lane: values (0) or derivatives."""
        last = len(self.breaks) - 2
        piece = np.minimum(np.searchsorted(self.breaks, t, side="right") - 1, last)
        low, high = self.breaks[piece], self.breaks[piece + 1]
        x = (2.0 * t - low - high) / (high - low)
        angle = np.arccos(np.minimum(np.maximum(x, -1.0), 1.0))
        terms = np.cos(angle[:, None] * np.arange(self.tables[0].shape[2]))
        series = [self.tables[each][self.which, piece] for each in derivatives]
        return [np.einsum("lk,lkc->lc", terms[:, : each.shape[1]], each) for each in series]

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


def interpolate(
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


def approximate(function: Function, lanes: int, scales: Float[np.ndarray, " columns"]) -> Pieces:
    """Polynomials that agree with a smooth function to round-off, in as few pieces as it takes.

    Refused if 64 pieces do not suffice.
    """
    between = np.cos(np.pi * np.arange(1, DEGREE + 1) / (DEGREE + 1))
    count = 1
    while True:
        breaks = np.linspace(0.0, 1.0, count + 1)
        found = interpolate(breaks, function, lanes, DEGREE)
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
class SmoothCurve(PlainCurve):
    """Curves p(t) given by polynomials in pieces; `weight` is the scaled length of each."""

    pieces: Pieces
    weight: Values

    def take(self, lanes: Some) -> "SmoothCurve":
        """Return a selection of the lanes."""
        return SmoothCurve(self.structure, self.pieces.take(lanes), self.weight[lanes])

    def parameters(self, t: Values) -> Parameters:
        """p(t)."""
        return self.pieces.value(t)

    def rate(self, t: Values) -> Parameters:
        """dp/dt."""
        return self.pieces.rate(t)

    def bend(self, t: Values) -> Parameters:
        """d²p/dt²."""
        return self.pieces.bend(t)


Extended = Float[np.ndarray, "lanes extended"]


@dataclass(frozen=True)
class TrackedMetric:
    """Metric of (u, a, λ): that of the structure, and the scales of the unknown parameters a."""

    size: int
    unknowns: int
    mass: Float[np.ndarray, " unknowns"]


@dataclass(frozen=True)
class TrackedCurve:
    """Equilibria with ``S(z, p) = S*(t)``, part of the parameters given and part of them unknown.

    Unknowns (u, a, λ): those of the structure with the free parameters a between u and λ.
    Descriptors are differentiated along the set, by central differences.
    """

    structure: Structure
    prescribed: Pieces
    """All parameters (those of the free ones do not count) and then S*, as functions of t."""
    free: Int[np.ndarray, " k"]
    """Places of the unknown parameters, as many as descriptors."""
    descriptors: tuple[Descriptor, ...]
    weight: Values
    """Scaled length of what is prescribed."""

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

    def take(self, lanes: Some) -> "TrackedCurve":
        """Return a selection of the lanes."""
        given, weight = self.prescribed.take(lanes), self.weight[lanes]
        return TrackedCurve(self.structure, given, self.free, self.descriptors, weight)

    def begin(self, z: Lanes, p: Parameters) -> Extended:
        """(u, a, λ) of states."""
        return self._join(z, p[:, self.free])

    def _join(self, z: Lanes, a: Float[np.ndarray, "lanes k"]) -> Extended:
        n = self.structure.unknowns
        return np.concatenate([z[:, :n], a, z[:, n:]], axis=1)

    def parameters(self, t: Values) -> Parameters:
        """Return what is given of p; the free ones as they were."""
        return self.prescribed.value(t)[:, : len(self.structure.parameters)]

    def states(self, z: Extended, t: Values) -> tuple[Lanes, Parameters]:
        """Unknowns and multipliers of the structure, and all parameters."""
        return self._states(z, self.parameters(t))

    def _states(self, z: Extended, given: Parameters) -> tuple[Lanes, Parameters]:
        """The same, from the parameters that are given."""
        n, k, p = self.structure.unknowns, len(self.free), given.copy()
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

    def force(self, t: Values) -> tuple[Lanes, Lanes] | None:
        """None: F = 0."""
        return None

    def advance(
        self, z: Extended, t: Values, row: Extended, corner: Values, defect: Values
    ) -> Advance:
        """Newton step and tangent: onto the set, and along it to the conditions.

        The set has k + 1 directions here; the descriptors and the closing row are k + 1 conditions.
        """
        structure, k, many = self.structure, len(self.free), len(self.structure.parameters)
        given, slope = self.prescribed.value_and_rate(t)
        x, p = self._states(z, given[:, :many])
        rate = slope[:, :many].copy()
        rate[:, self.free] = 0.0
        size, changes = structure.size, self._changes(rate)
        system = structure.linear_system(x, p, changes)
        solved = _tangent_space(system)
        onto, along = solved.x[:, 0], solved.x[:, 1:]
        linear = self._linear(x, p, given[:, many:], slope[:, many:], solved.x, changes)
        closing = self._closing(solved.x, row, corner)
        matrix = np.concatenate([linear.slopes, closing[:, None, 1:]], axis=1)
        rhs = np.zeros((len(z), 2, k + 1))
        rhs[:, 0, :k], rhs[:, 0, k], rhs[:, 1, k] = -linear.value, -defect - closing[:, 0], 1.0
        step, tangent = (_solve_small(matrix, rhs) @ along).transpose(1, 0, 2)
        step += onto
        return Advance(
            self._join(step[:, :size], step[:, size:-1]),
            step[:, -1].copy(),
            self._join(tangent[:, :size], tangent[:, size:-1]),
            tangent[:, -1].copy(),
            np.abs(np.concatenate([system.residual, linear.value], axis=1)).max(axis=1),
            solved.negative - structure.constraints,
            no_determinants(len(z)),
        )

    def _linear(
        self,
        z: Lanes,
        p: Parameters,
        targets: Float[np.ndarray, "lanes k"],
        slope: Float[np.ndarray, "lanes k"],
        moves: Float[np.ndarray, "lanes moves bordered"],
        changes: Float[np.ndarray, "lanes directions parameters"],
    ) -> Linear:
        """S − S* after the first move, onto the set, and its slopes along the others.

        targets, slope: S* and its rate.
        """
        structure, size = self.structure, self.structure.size
        dz, dp = moves[:, :, :size], moves[:, :, size:] @ changes
        functions = tuple(descriptor.function for descriptor in self.descriptors)
        takes = DescriptorValues(functions, targets, METRIC_DIFFERENCE)
        move = Move(dz[:, 0], dp[:, 0], dz[:, 1:], dp[:, 1:])
        found = takes.linear(Critical(structure, z, p, z), move)
        rate = slope[:, :, None] * moves[:, None, :, -1]
        return Linear(found.value - rate[:, :, 0], found.slopes - rate[:, :, 1:])

    def _changes(self, rate: Parameters) -> Float[np.ndarray, "lanes directions parameters"]:
        """Directions in parameter space: each free parameter, and the given rate."""
        units = np.zeros((len(rate), len(self.free), rate.shape[1]))
        units[:, np.arange(len(self.free)), self.free] = 1.0
        return np.concatenate([units, rate[:, None]], axis=1)

    def _closing(
        self, moves: Float[np.ndarray, "lanes moves bordered"], row: Extended, corner: Values
    ) -> Float[np.ndarray, "lanes moves"]:
        """Products of the closing row with changes of (z, a, t)."""
        n, k = self.structure.unknowns, len(self.free)
        whole = np.concatenate([row[:, :n], row[:, n + k :], row[:, n : n + k], corner[:, None]], 1)
        return np.asarray(np.einsum("lmi,li->lm", moves, whole))


def _tangent_space(system: LinearSystem) -> BorderedSolution:
    """A step onto the set, and directions along it, for changes of the parameters."""
    lanes, k, size = system.columns.shape
    rows = np.tile(_normals(k, size + k), (lanes, 1, 1))
    rhs = np.zeros((lanes, k + 1, size + k))
    rhs[:, 0, :size], rhs[:, 1:, size:] = -system.residual, np.eye(k)
    return system.solve(rhs, (system.columns, rows[:, :, :size], rows[:, :, size:]))


@lru_cache
def _normals(k: int, size: int) -> Float[np.ndarray, "k size"]:
    """Rows that close the system: any that see the tangent space will do."""
    return np.cos(np.outer(np.arange(1, k + 1), 1.7 * np.arange(size)) + 0.4)


def _solve_small(
    matrix: Float[np.ndarray, "lanes k k"], rhs: Float[np.ndarray, "lanes sides k"]
) -> Float[np.ndarray, "lanes sides k"]:
    """Solutions of small systems; not a number where they are singular."""
    with np.errstate(invalid="ignore", over="ignore"):
        regular = np.abs(np.linalg.det(matrix)) > 0.0
    out = np.full(rhs.shape, np.nan)
    out[regular] = np.linalg.solve(matrix[regular], rhs[regular].transpose(0, 2, 1)).transpose(
        0, 2, 1
    )
    return out
