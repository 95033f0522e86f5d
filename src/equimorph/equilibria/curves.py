"""Curves that the tracer follows: a path in parameter space, or a homotopy."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np

from equimorph.arrays import Directions, Float, Lanes, Numbers, Parameters, Some, Values
from equimorph.linalg import Border, BorderedSolution
from equimorph.marching.kernels import squared_lengths
from equimorph.structures import Advance, Direction, Equations, LinearSystem, Structure


@runtime_checkable
class Metric(Protocol):
    """Length of steps: a diagonal mass matrix for the first `unknowns` of `size` entries."""

    @property
    def size(self) -> int:
        """Entries of z."""

    @property
    def unknowns(self) -> int:
        """Entries that the metric measures."""

    @property
    def mass(self) -> Float[np.ndarray, " unknowns"]:
        """Diagonal of the mass matrix."""


@runtime_checkable
class Curve(Protocol):
    """One curve F(z, t) = 0 per lane, t the share of the way from start (0) to goal (1)."""

    @property
    def structure(self) -> Structure:
        """The structure whose equilibria are followed."""

    @property
    def metric(self) -> Metric:
        """Length of steps in z: the structure's own, unless the curve has more unknowns."""

    @property
    def folds_change_index(self) -> bool:
        """Whether the index changes where dt/ds vanishes, and only there."""

    @property
    def weight(self) -> Values:
        """Length of the curve's own part of the metric: dt counts as weight·dt."""

    def take(self, lanes: Some) -> "Curve":
        """Return some of the lanes."""

    def parameters(self, t: Values) -> Parameters:
        """p(t)."""

    def states(self, z: Lanes, t: Values) -> tuple[Lanes, Parameters]:
        """Unknowns and multipliers of the structure, and all parameters."""

    def rate(self, t: Values) -> Parameters:
        """dp/dt."""

    def bend(self, t: Values) -> Parameters:
        """d²p/dt²."""

    def force(self, t: Values) -> tuple[Lanes, Lanes] | None:
        """What F is on the curve at t, and its rate; None if it is zero."""

    def advance(self, z: Lanes, t: Values, row: Lanes, corner: Values, defect: Values) -> Advance:
        """Newton step and tangent; see `Advance`."""


@dataclass(frozen=True)
class PlainCurve(ABC):
    """Curves whose unknowns are those of the structure.

    Subclasses give `weight` and `take`, and `parameters`, `rate` and `bend` where parameters vary.
    """

    structure: Structure

    @property
    def metric(self) -> Metric:
        """The structure's own."""
        return self.structure

    @property
    def folds_change_index(self) -> bool:
        """Whether the index changes where dt/ds vanishes, and only there."""
        return True

    @abstractmethod
    def parameters(self, t: Values) -> Parameters:
        """p(t)."""

    @abstractmethod
    def rate(self, t: Values) -> Parameters:
        """dp/dt."""

    def states(self, z: Lanes, t: Values) -> tuple[Lanes, Parameters]:
        """Return z and p(t)."""
        return z, self.parameters(t)

    def force(self, t: Values) -> tuple[Lanes, Lanes] | None:
        """None: F = 0."""
        return None

    def advance(self, z: Lanes, t: Values, row: Lanes, corner: Values, defect: Values) -> Advance:
        """Newton step and tangent; see `Advance`."""
        return self.structure.advance(z, self.parameters(t), self.rate(t), row, corner, defect)


@dataclass(frozen=True)
class ParameterLine(PlainCurve):
    """Straight line p(t) = start + t·velocity in parameter space."""

    start: Parameters
    velocity: Parameters

    @cached_property
    def weight(self) -> Values:
        """Scaled length of the line."""
        return np.asarray(np.linalg.norm(self.velocity / self.structure.scales, axis=1))

    def take(self, lanes: Some) -> "ParameterLine":
        """Return some of the lanes."""
        start, velocity = self.start.take(lanes, axis=0), self.velocity.take(lanes, axis=0)
        some = ParameterLine(self.structure, start, velocity)
        if "weight" in vars(self):  # what was computed is kept
            vars(some)["weight"] = self.weight.take(lanes)
        return some

    def parameters(self, t: Values) -> Parameters:
        """p(t)."""
        # products of whole arrays: with rows of few numbers these cost a third
        along = t.repeat(self.velocity.shape[1]).reshape(self.velocity.shape)
        along *= self.velocity
        along += self.start
        return along

    def rate(self, t: Values) -> Parameters:
        """Velocity, the same for all t."""
        return self.velocity

    def bend(self, t: Values) -> Parameters:
        """Zero."""
        return np.zeros_like(self.velocity)


@dataclass(frozen=True)
class ForceLine(PlainCurve):
    """F(z, p) = (1 − t) first + t last at fixed parameters: equilibria under a changing force."""

    p: Parameters
    first: Lanes
    """Force on the unknowns at t = 0."""
    last: Lanes
    """Force at t = 1."""
    weight: Values
    """Length of the curve's own part of the metric."""

    def take(self, lanes: Some) -> "ForceLine":
        """Return some of the lanes."""
        return ForceLine(self.structure, *(column[lanes] for column in self._columns))

    @property
    def _columns(self) -> tuple[np.ndarray, ...]:
        return self.p, self.first, self.last, self.weight

    def parameters(self, t: Values) -> Parameters:
        """Parameters, the same for all t."""
        return self.p.copy()

    def rate(self, t: Values) -> Parameters:
        """Zero."""
        return np.zeros_like(self.p)

    def bend(self, t: Values) -> Parameters:
        """Zero."""
        return np.zeros_like(self.p)

    def force(self, t: Values) -> tuple[Lanes, Lanes]:
        """Force at t, and its rate."""
        # exact where either force is none, also close to that end
        now = (1.0 - t)[:, None] * self.first + t[:, None] * self.last
        return now, self.last - self.first

    def advance(self, z: Lanes, t: Values, row: Lanes, corner: Values, defect: Values) -> Advance:
        """Newton step and tangent; see `Advance`."""
        return self.structure.advance_under(self.force(t), z, self.p, row, corner, defect)


def growing_force(structure: Structure, p: Parameters, force: Lanes, lengths: Values) -> ForceLine:
    """Curves from equilibria at t = 0 under a force on the unknowns that grows to `force`."""
    return ForceLine(structure, p, np.zeros_like(force), force, lengths)


def newton_homotopy(structure: Structure, guess: Lanes, p: Parameters) -> ForceLine:
    """Curves ``F(z, p) = (1 − t) F(guess, p)`` from any guesses at t = 0 to equilibria at t = 1."""
    defect = structure.residual(guess, p)
    return ForceLine(structure, p, defect, np.zeros_like(defect), np.ones(len(p)))


class AlongCurve(Equations):
    """The equations of curves in z and t, in which `settle` finds points of these curves.

    Parameters are t and the number of the curve, see `along_parameters`.
    """

    def __init__(self, curve: Curve) -> None:
        metric = curve.metric
        self.curve, self.mass, self.unknowns = curve, metric.mass, metric.unknowns
        self.constraints = metric.size - metric.unknowns

    @property
    def scales(self) -> Float[np.ndarray, " parameters"]:
        """One unit of t, and one curve."""
        return np.ones(2)

    def _at(self, p: Parameters) -> tuple[Curve, Values]:
        """Curves and places on them."""
        return self.curve.take(p[:, 1].astype(int)), np.ascontiguousarray(p[:, 0])

    def residual(self, z: Lanes, p: Parameters) -> Lanes:
        """F(z, p(t)), less the force of the curve."""
        here, t = self._at(p)
        residual, force = here.structure.residual(*here.states(z, t)), here.force(t)
        return residual if force is None else residual - force[0]

    def parameter_derivative(self, z: Lanes, p: Parameters, dp: Parameters) -> Lanes:
        """F_p p' dt, less the change of the force."""
        (here, t), dt = self._at(p), dp[:, :1]
        column = here.structure.parameter_derivative(*here.states(z, t), dt * here.rate(t))
        force = here.force(t)
        return column if force is None else column - dt * force[1]

    def second_derivative(self, z: Lanes, p: Parameters, v: Direction, w: Direction) -> Lanes:
        """D²F along (dz, p' dt) for both directions, and F_p p'' times both dt."""
        (here, t), (by_v, by_w) = self._at(p), (v[1][:, :1], w[1][:, :1])
        state, rate = here.states(z, t), here.rate(t)
        twice = here.structure.second_derivative(*state, (v[0], by_v * rate), (w[0], by_w * rate))
        bend = by_v * by_w * here.bend(t)
        if bend.any():
            twice = twice + here.structure.parameter_derivative(*state, bend)
        return np.asarray(twice)

    def solve(
        self,
        z: Lanes,
        p: Parameters,
        rhs: Float[np.ndarray, "lanes sides bordered"],
        border: Border | None = None,
        shift: Values | None = None,
    ) -> BorderedSolution:
        """Solve with F_z − shift·mass, bordered."""
        here, t = self._at(p)
        return here.structure.solve(*here.states(z, t), rhs, border, shift)

    def linear_system(self, z: Lanes, p: Parameters, directions: Directions) -> LinearSystem:
        """F, F_t along changes of t, and solves with F_z."""
        (here, t), dt = self._at(p), directions[:, :, :1]
        system = here.structure.linear_system(*here.states(z, t), dt * here.rate(t)[:, None])
        force = here.force(t)
        if force is None:
            return system
        columns = system.columns - dt * force[1][:, None]
        return replace(system, residual=system.residual - force[0], columns=columns)

    def index(self, z: Lanes, p: Parameters) -> Numbers:
        """Negative eigenvalues of the constrained Hessian."""
        here, t = self._at(p)
        return here.structure.index(*here.states(z, t))

    def advance(
        self, z: Lanes, p: Parameters, dp: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """Newton step of the curves, in units of the change of t."""
        (here, t), unit = self._at(p), np.where(dp[:, 0] == 0.0, 1.0, dp[:, 0])
        step = here.advance(z, t, row, corner / unit, defect)
        return replace(step, dt=step.dt / unit, tangent_t=step.tangent_t / unit)


def along_parameters(t: Values) -> Parameters:
    """Parameters of `AlongCurve` at t, one lane a curve."""
    return np.column_stack([t, np.arange(len(t))])


def squared_length(metric: Metric, weight: Values, dz: Lanes, dt: Values) -> Values:
    """Squared length of a step (dz, dt) in the metric and the curve's own."""
    out = np.empty(len(dz))
    squared_lengths(np.ascontiguousarray(dz), dt, weight, metric.mass, 0.0, out)
    return out


def dual(metric: Metric, weight: Values, dz: Lanes, dt: Values) -> tuple[Lanes, Values]:
    """Row whose product with a step is the metric's inner product with (dz, dt)."""
    row = np.zeros_like(dz)
    row[:, : metric.unknowns] = dz[:, : metric.unknowns] * metric.mass
    return row, weight**2 * dt
