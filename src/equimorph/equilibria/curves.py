"""Curves that the tracer follows: a path in parameter space, or a homotopy."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.equilibria.kernels import MULTIPLIER_WEIGHT, squared_lengths
from equimorph.linalg import Border, BorderedSolution
from equimorph.structures import Advance, LinearSystem, Structure, bordered_advance
from equimorph.structures.contract import Direction


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

    def take(self, lanes: Int[np.ndarray, " some"]) -> "Curve":
        """Return some of the lanes."""

    def parameters(self, t: Values) -> Parameters:
        """p(t)."""

    def states(self, z: Lanes, t: Values) -> tuple[Lanes, Parameters]:
        """Unknowns and multipliers of the structure, and all parameters."""

    def rate(self, t: Values) -> Parameters:
        """dp/dt."""

    def bend(self, t: Values) -> Parameters:
        """d²p/dt²."""

    def advance(self, z: Lanes, t: Values, row: Lanes, corner: Values, defect: Values) -> Advance:
        """Newton step and tangent; see `Advance`."""


@dataclass(frozen=True)
class ParameterLine:
    """Straight line p(t) = start + t·velocity in parameter space."""

    structure: Structure
    start: Parameters
    velocity: Parameters

    @property
    def weight(self) -> Values:
        """Scaled length of the line."""
        return np.asarray(np.linalg.norm(self.velocity / self.structure.scales, axis=1))

    def take(self, lanes: Int[np.ndarray, " some"]) -> "ParameterLine":
        """Return some of the lanes."""
        start, velocity = (np.take(each, lanes, axis=0) for each in (self.start, self.velocity))
        return ParameterLine(self.structure, start, velocity)

    def parameters(self, t: Values) -> Parameters:
        """p(t)."""
        # products of whole arrays: with rows of few numbers these cost a third
        along = np.repeat(t, self.velocity.shape[1]).reshape(self.velocity.shape)
        along *= self.velocity
        along += self.start
        return along

    @property
    def metric(self) -> Metric:
        """The structure's own."""
        return self.structure

    @property
    def folds_change_index(self) -> bool:
        """Whether the index changes where dt/ds vanishes, and only there."""
        return True

    def states(self, z: Lanes, t: Values) -> tuple[Lanes, Parameters]:
        """Return z and p(t)."""
        return z, self.parameters(t)

    def rate(self, t: Values) -> Parameters:
        """Velocity, the same for all t."""
        return self.velocity

    def bend(self, t: Values) -> Parameters:
        """Zero."""
        return np.zeros_like(self.velocity)

    def advance(self, z: Lanes, t: Values, row: Lanes, corner: Values, defect: Values) -> Advance:
        """Newton step and tangent; see `Advance`."""
        return self.structure.advance(z, self.parameters(t), self.velocity, row, corner, defect)


@dataclass(frozen=True)
class NewtonHomotopy:
    """F(z, p) = (1 − t) F(z₀, p): from any guess z₀ at t = 0 to equilibria at t = 1."""

    structure: Structure
    p: Parameters
    defect: Lanes
    """F(z₀, p)."""

    @property
    def weight(self) -> Values:
        """One unit of length from guess to goal."""
        return np.ones(len(self.p))

    def take(self, lanes: Int[np.ndarray, " some"]) -> "NewtonHomotopy":
        """Return some of the lanes."""
        return NewtonHomotopy(self.structure, self.p[lanes], self.defect[lanes])

    def parameters(self, t: Values) -> Parameters:
        """Parameters, the same for all t."""
        return self.p + 0.0 * t[:, None]

    @property
    def metric(self) -> Metric:
        """The structure's own."""
        return self.structure

    @property
    def folds_change_index(self) -> bool:
        """Whether the index changes where dt/ds vanishes, and only there."""
        return True

    def states(self, z: Lanes, t: Values) -> tuple[Lanes, Parameters]:
        """Return z and p."""
        return z, self.parameters(t)

    def rate(self, t: Values) -> Parameters:
        """Zero."""
        return np.zeros_like(self.p)

    def bend(self, t: Values) -> Parameters:
        """Zero."""
        return np.zeros_like(self.p)

    def advance(self, z: Lanes, t: Values, row: Lanes, corner: Values, defect: Values) -> Advance:
        """Newton step and tangent by the general bordered solve."""
        residual = self.structure.residual(z, self.p) - (1.0 - t)[:, None] * self.defect
        given = (self.structure, z, self.p, residual, self.defect)
        return bordered_advance(*given, row, corner, defect)


@dataclass(frozen=True)
class AlongCurve:
    """The equations of curves in z and t, in which `settle` finds points of these curves.

    Parameters are t and the number of the curve, see `along_parameters`.
    """

    curve: Curve

    @property
    def unknowns(self) -> int:
        """Entries of z that the metric measures."""
        return self.curve.metric.unknowns

    @property
    def constraints(self) -> int:
        """The other entries of z."""
        return self.size - self.unknowns

    @property
    def size(self) -> int:
        """Length of z."""
        return self.curve.metric.size

    @property
    def mass(self) -> Float[np.ndarray, " unknowns"]:
        """Diagonal of the mass matrix."""
        return self.curve.metric.mass

    @property
    def scales(self) -> Float[np.ndarray, " parameters"]:
        """One unit of t, and one curve."""
        return np.ones(2)

    def _at(self, p: Parameters) -> tuple[Curve, Values]:
        """Curves and places on them."""
        return self.curve.take(p[:, 1].astype(int)), np.ascontiguousarray(p[:, 0])

    def residual(self, z: Lanes, p: Parameters) -> Lanes:
        """F(z, p(t))."""
        here, t = self._at(p)
        return here.structure.residual(*here.states(z, t))

    def parameter_derivative(self, z: Lanes, p: Parameters, dp: Parameters) -> Lanes:
        """F_p p' dt."""
        (here, t), dt = self._at(p), dp[:, :1]
        return here.structure.parameter_derivative(*here.states(z, t), dt * here.rate(t))

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

    def linear_system(
        self, z: Lanes, p: Parameters, directions: Float[np.ndarray, "lanes k parameters"]
    ) -> LinearSystem:
        """F, F_p p' along changes of t, and solves with F_z."""
        here, t = self._at(p)
        changes = directions[:, :, :1] * here.rate(t)[:, None]
        return here.structure.linear_system(*here.states(z, t), changes)

    def index(self, z: Lanes, p: Parameters) -> Int[np.ndarray, " lanes"]:
        """Negative eigenvalues of the constrained Hessian."""
        here, t = self._at(p)
        return here.structure.index(*here.states(z, t))

    def advance(
        self, z: Lanes, p: Parameters, dp: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """Newton step of the curves; the tangent is that for one unit of t."""
        del dp
        here, t = self._at(p)
        return here.advance(z, t, row, corner, defect)


def along_parameters(t: Values) -> Parameters:
    """Parameters of `AlongCurve` at t, one lane a curve."""
    return np.column_stack([t, np.arange(len(t))])


@dataclass(frozen=True)
class ForceLine:
    """F(z, p) = t·force at fixed parameters: from an equilibrium at t = 0 under a growing force."""

    structure: Structure
    p: Parameters
    force: Lanes
    """Force on the unknowns at t = 1."""
    lengths: Values
    """Length of the curve's own part of the metric."""

    @property
    def weight(self) -> Values:
        """As given."""
        return self.lengths

    def take(self, lanes: Int[np.ndarray, " some"]) -> "ForceLine":
        """Return some of the lanes."""
        return ForceLine(self.structure, self.p[lanes], self.force[lanes], self.lengths[lanes])

    def parameters(self, t: Values) -> Parameters:
        """Parameters, the same for all t."""
        return self.p + 0.0 * t[:, None]

    @property
    def metric(self) -> Metric:
        """The structure's own."""
        return self.structure

    @property
    def folds_change_index(self) -> bool:
        """Whether the index changes where dt/ds vanishes, and only there."""
        return True

    def states(self, z: Lanes, t: Values) -> tuple[Lanes, Parameters]:
        """Return z and p."""
        return z, self.parameters(t)

    def rate(self, t: Values) -> Parameters:
        """Zero."""
        return np.zeros_like(self.p)

    def bend(self, t: Values) -> Parameters:
        """Zero."""
        return np.zeros_like(self.p)

    def advance(self, z: Lanes, t: Values, row: Lanes, corner: Values, defect: Values) -> Advance:
        """Newton step and tangent by the general bordered solve."""
        residual = self.structure.residual(z, self.p) - t[:, None] * self.force
        given = (self.structure, z, self.p, residual, -self.force)
        return bordered_advance(*given, row, corner, defect)


def squared_length(metric: Metric, weight: Values, dz: Lanes, dt: Values) -> Values:
    """Squared length of a step (dz, dt) in the metric and the curve's own."""
    return _squared(metric, weight, dz, dt, 0.0)


def correction_size(metric: Metric, weight: Values, dz: Lanes, dt: Values) -> Values:
    """Size of a Newton correction: its length, with the multipliers included lightly."""
    return np.asarray(np.sqrt(_squared(metric, weight, dz, dt, MULTIPLIER_WEIGHT)))


def _squared(metric: Metric, weight: Values, dz: Lanes, dt: Values, light: float) -> Values:
    out = np.empty(len(dz))
    squared_lengths(np.ascontiguousarray(dz), dt, weight, metric.mass, light, out)
    return out


def dual(metric: Metric, weight: Values, dz: Lanes, dt: Values) -> tuple[Lanes, Values]:
    """Row whose product with a step is the metric's inner product with (dz, dt)."""
    row = np.zeros_like(dz)
    row[:, : metric.unknowns] = dz[:, : metric.unknowns] * metric.mass
    return row, weight**2 * dt
