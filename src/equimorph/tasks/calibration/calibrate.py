"""`calibrate`: fit unknown parameters to measured states by least squares over exact equilibria."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Lanes, Parameters
from equimorph.equilibria import ParameterLine, TraceOptions, check_start, settle, trace
from equimorph.equilibria.trace_options import EventCode
from equimorph.errors import InputError
from equimorph.structures import States, Structure
from equimorph.tasks.calibration.measurements import (
    Columns,
    Measurement,
    Readings,
    by_data,
    derivative,
)
from equimorph.tasks.calibration.unknowns import Family, Unknowns, Vector, Wanted, unknowns

CONVERGED = 1e-13
"""Relative change of the unknowns, and of the gradient, at which least squares end."""
EVALUATIONS = 200
"""Most trials of a fit."""
BLIND = 1e-8
"""Ratio of singular values of the scaled Jacobian below which a direction is not determined."""
LEVEL = 1e-6
"""Cosine between residuals and the fit's directions up to which a fit is at its minimum."""
NOTHING = 1e-9
"""Residuals that are round-off."""
Status = Literal["fitted", "undetermined", "branch ends", "limit", "not converged"]
Residuals = Float[np.ndarray, " numbers"]
Jacobian = Float[np.ndarray, "numbers k"]
SHORT = 1e-6
"""Moves in the parameter space, in scales, over which Newton's method needs no steps."""
TRANSFERS = (1, 8, 64)
"""Steps in which states are carried over to a structure with other data, if fewer do not do."""
STEPS = 200
"""Of one lift; a trial further away is not worth more, since the trust region shrinks."""
FAILURES = 20
"""Trials that are not reached, after which a fit is given up: it ends at the end of a branch."""


class Accepted(NamedTuple):
    """Unknowns that were accepted, with their residuals and the Jacobian of these."""

    x: Vector
    residuals: Residuals
    jacobian: Jacobian


@dataclass
class Branch:
    """States at trial values of the unknowns, lifted from those of the last accepted ones.

    A trial that a branch does not reach (at a fold, say) has infinite residuals, so that the
    trust region shrinks; `failure` says what the last such trial met.
    """

    unknowns: Unknowns
    measurements: Sequence[Measurement]
    measured: Columns
    sigma: Columns
    z: Lanes
    p: Parameters
    x: Vector
    trial: tuple[Lanes, Parameters] | None = None
    accepted: Accepted | None = None
    failure: tuple[str, str] = ("", "")
    failures: int = 0

    @property
    def states(self) -> States:
        """States at the last accepted unknowns."""
        return States(self.unknowns.made(self.x), self.z, self.p)

    def residuals(self, x: Vector) -> Residuals:
        """(predicted − measured)/σ where there is a measurement."""
        p = self.unknowns.parameters(x)
        z = self._states_at(x, p)
        if z is None:
            self.failures += 1
            if self.failures > FAILURES:
                raise BranchEnds
            return np.full(np.isfinite(self.measured).sum(), np.inf)
        self.trial = z, p
        return self._misfit(self.unknowns.made(x), z, p)

    def _misfit(self, structure: Structure, z: Lanes, p: Parameters) -> Residuals:
        predicted = [each.predict(structure, z, p) for each in self.measurements]
        return self._at_measurements(np.concatenate(predicted, axis=1) - self.measured)

    def jacobian(self, x: Vector) -> Jacobian:
        """Derivatives of the residuals at the last trial, which becomes the accepted one.

        Sensitivities of the states: dz = −F_z⁻¹ F_p dp.
        """
        assert self.trial is not None
        self.x, (self.z, self.p) = x.copy(), self.trial
        assert np.array_equal(self.p, self.unknowns.parameters(x))
        structure, z, p = self.unknowns.made(x), self.z, self.p
        columns = np.stack([self._force(k) for k in range(len(x))], axis=1)
        moves = -structure.solve(z, p, columns).x
        slopes = [self._slope(k, np.ascontiguousarray(moves[:, k])) for k in range(len(x))]
        jacobian = np.stack([self._at_measurements(slope) for slope in slopes], axis=1)
        self.accepted = Accepted(x.copy(), self._misfit(structure, z, p), jacobian)
        return jacobian

    def _structures_near(self, k: int) -> Callable[[float], Structure]:
        """Structures near that of the accepted unknowns, by the change of unknown k."""
        unit = np.zeros_like(self.x)
        unit[k] = 1.0
        return lambda amount: self.unknowns.made(self.x + amount * unit)

    def _force(self, k: int) -> Lanes:
        """Derivative of F by unknown k."""
        z, p = self.z, self.p
        if k not in self.unknowns.data.values():
            here = self.unknowns.made(self.x)
            return here.parameter_derivative(z, p, self.unknowns.columns[k])
        still = np.zeros_like(z)
        size = abs(self.x[k])
        return by_data(
            lambda made, at: made.residual(at, p), self._structures_near(k), size, z, still
        )

    def _slope(self, k: int, moves: Lanes) -> Columns:
        """Derivative of what is predicted by unknown k, with the moves of the states."""
        z, p = self.z, self.p

        def predicted(made: Structure, at: Lanes) -> Columns:
            return np.concatenate([each.predict(made, at, p) for each in self.measurements], 1)

        if k in self.unknowns.data.values():
            return by_data(predicted, self._structures_near(k), abs(self.x[k]), z, moves)
        here, dp = self.unknowns.made(self.x), self.unknowns.columns[k]
        parts = [derivative(each, here, z, p, moves, dp) for each in self.measurements]
        return np.concatenate(parts, axis=1)

    def _at_measurements(self, table: Columns) -> Residuals:
        return np.asarray((table / self.sigma)[np.isfinite(self.measured)])

    def _states_at(self, x: Vector, p: Parameters) -> Lanes | None:
        """States of unknowns on the branches of the accepted ones; None if one is not reached."""
        try:
            structure = self.unknowns.made(x)
        except InputError as error:
            self.failure = ("limit", f"no structure has such data: {error}")
            return None
        name = self.unknowns.outside(p, structure)
        if name:
            self.failure = ("limit", f"{name} leaves the limits of its meaning")
            return None
        z = self._continue_data(x)
        return None if z is None else self._lift(structure, z, p)

    def _continue_data(self, x: Vector) -> Lanes | None:
        """States at the accepted parameters of the structure with other data, step by step."""
        own = list(self.unknowns.data.values())
        if np.array_equal(x[own], self.x[own]):
            return self.z.copy()
        index = self.states.index
        for steps in TRANSFERS:
            z, good = self.z.copy(), True
            for k in range(1, steps + 1):
                made = self.unknowns.made(self.x + (x - self.x) * (k / steps))
                there = settle(made, z, self.p)
                z, good = there.z, bool(there.found.all())
                if not good:
                    break
            if good and np.array_equal(States(made, z, self.p).index, index):
                return z
        self._note("lost", 0)
        return None

    def _lift(self, structure: Structure, z: Lanes, p: Parameters) -> Lanes | None:
        """States of a structure lifted to parameters from the accepted ones."""
        length = np.linalg.norm((p - self.p) / structure.scales, axis=1)
        near, far = np.flatnonzero((length > 0.0) & (length <= SHORT)), length > SHORT
        if len(near):
            there = settle(structure, z[near], p[near])
            z[near] = there.z
            if not there.found.all():
                self._note("lost", int(near[~there.found][0]))
                return None
        lanes = np.flatnonzero(far)
        if len(lanes):
            line = ParameterLine(structure, self.p[lanes].copy(), p[lanes] - self.p[lanes])
            ended = trace(
                line, z[lanes].copy(), (), TraceOptions(record=False, steps=STEPS, retries=0)
            )
            short = np.flatnonzero(ended.code != EventCode.ARRIVED)
            if len(short):
                self._note(EventCode(int(ended.code[short[0]])).kind, int(lanes[short[0]]))
                return None
            z[lanes] = ended.z
        return z

    def _note(self, kind: str, lane: int) -> None:
        """Remember why a trial was not reached; "lost" says less than what was met before."""
        if kind != "lost" or not self.failure[0]:
            self.failure = (kind, f"the branch of state {lane} ends: {kind}")


@dataclass(frozen=True, eq=False)
class Calibration:
    """Fitted unknowns, how well they are known, and the equilibria of the fit.

    Attributes
    ----------
    status
        "fitted"; "undetermined": the measurements do not determine some combination of unknowns;
        "branch ends": least squares leads beyond the end of a branch; "limit": beyond the limits of
        a parameter's meaning; "not converged".
    why
        Reason for a status other than "fitted".
    names, values
        The unknowns: what they are called and their values, also where the fit ended early.
    covariance
        Of the values, to first order in the errors of the measurements: (JᵀJ)⁻¹ with the Jacobian J
        of the residuals over σ; without σ, times the variance of the residuals. NaN unless fitted.
    residuals
        (predicted − measured)/σ, or without σ their difference, in the order of the measurements.
    freedom
        Degrees of freedom: measured numbers minus unknowns. With σ, Σ residuals² is close to it if
        the model holds.
    states
        Equilibria at the fitted parameters, one per measured state.
    """

    status: Status
    why: str
    names: tuple[str, ...]
    values: Vector
    covariance: Float[np.ndarray, "k k"]
    residuals: Float[np.ndarray, " numbers"]
    freedom: int
    states: States

    def __repr__(self) -> str:
        """Values with standard deviations, or the reason of a failure."""
        triples = zip(self.names, self.values, self.deviations, strict=True)
        values = ", ".join(f"{name} = {x:.6g} ± {error:.2g}" for name, x, error in triples)
        return (
            f"Calibration({values})" if self.fitted else f"Calibration({self.status}: {self.why})"
        )

    def __getitem__(self, name: str) -> float:
        """Value of an unknown by name."""
        return float(self.values[self.names.index(name)])

    @property
    def fitted(self) -> bool:
        """Whether there is a fit."""
        return self.status == "fitted"

    @property
    def deviations(self) -> Vector:
        """Standard deviations of the values."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def chi_squared(self) -> float:
        """Σ residuals²."""
        return float(self.residuals @ self.residuals)


@check_arguments
def calibrate(
    start: States,
    unknown: Wanted,
    measured: Sequence[Measurement],
    *,
    family: Family | None = None,
) -> Calibration:
    """Fit values, offsets or gains of parameters to measured descriptors and shapes.

    Least squares over exact equilibria by a trust-region method with the exact sensitivities of
    states, dz = −F_z⁻¹ F_p dp. Every trial is lifted from the last accepted states, so that the fit
    stays on their branches.

    Parameters
    ----------
    start
        Equilibria at the nominal parameters, one per measured state, each on the branch of the
        measured state.
    unknown
        What to fit: ``{name: kind}`` with kinds "value" (the parameter itself, the same in all
        states), "offset" (of the true parameter from the nominal one) or "gain" (true over
        nominal). A tuple of names shares one unknown: ``{("q", "f"): "gain"}``. The stiffness of a
        structure whose loads are relative to it is the inverse of their common gain. "data" are
        those of the structure itself, like a stiffness or a length; see `family`.
    measured
        `MeasuredValues` of descriptors and `MeasuredShape` points.
    family
        Structures by their data, if some of these are unknown. Derivatives by data are differences
        of fourth order; states are carried over by Newton's method with an unchanged index.

    Returns
    -------
    The `Calibration`; a fit that fails says why.

    Raises
    ------
    InputError
        If a state is no equilibrium, an unknown or a measurement has no meaning, only some
        measurements have a standard deviation, or there are fewer numbers than unknowns.

    Examples
    --------
    >>> import equimorph as em
    >>> spring = em.Spring()
    >>> rest = spring.natural_state(x_l=1.2).batch
    >>> loaded = em.lift(rest, {"F": 0.1}).states
    >>> angle = em.MeasuredValues(spring.descriptor("angle"), [-0.3])
    >>> em.calibrate(loaded, {"k": "value"}, [angle]).fitted
    True
    """
    for state in start:
        check_start(state)
    free = unknowns(start, unknown, family)
    values, sigma = _join_tables([each.table(start) for each in measured])
    count = int(np.isfinite(values).sum())
    if count < len(free.names):
        raise InputError(
            f"`measured` must hold at least as many numbers as there are unknowns, "
            f"{len(free.names)}; got {count}."
        )
    weights = np.ones_like(values) if sigma is None else sigma
    branch = Branch(free, measured, values, weights, start.z, start.p, free.start)
    with suppress(BranchEnds):
        least_squares(
            branch.residuals, free.start, branch.jacobian, x_scale="jac", ftol=1e-15,
            xtol=CONVERGED, gtol=CONVERGED, max_nfev=EVALUATIONS,
        )  # fmt: skip
    return _judge(free, branch, known=sigma is not None)


def _join_tables(tables: Sequence[Readings]) -> Readings:
    if not tables:
        raise InputError("`measured` must hold at least one measurement; got none.")
    values = np.concatenate([each.values for each in tables], axis=1)
    deviations = [each.sigma for each in tables if each.sigma is not None]
    if deviations and len(deviations) < len(tables):
        raise InputError("`sigma` must be given for all measurements or for none; got some.")
    return Readings(values, np.concatenate(deviations, axis=1) if deviations else None)


def _judge(free: Unknowns, branch: Branch, *, known: bool) -> Calibration:
    """Status of a fit, with its covariance."""
    assert branch.accepted is not None
    values, residuals, jacobian = branch.accepted
    k = len(free.names)
    freedom = len(residuals) - k
    lengths = np.linalg.norm(jacobian, axis=0)
    lengths[lengths == 0.0] = 1.0
    _, singular, right = np.linalg.svd(jacobian / lengths, full_matrices=False)
    covariance = np.full((k, k), np.nan)
    status, why = _verdict(branch, residuals, jacobian / lengths)
    if status == "fitted" and singular[-1] <= BLIND * singular[0]:
        status, why = "undetermined", _blind(free.names, right[-1] / lengths)
    if status == "fitted":
        inverse = (right.T / singular) / lengths[:, None]
        variance = 1.0 if known else float(residuals @ residuals) / freedom if freedom else np.nan
        covariance = variance * (inverse @ inverse.T)
    return Calibration(
        status, why, free.names, values, covariance, residuals, freedom, branch.states
    )


def _verdict(branch: Branch, residuals: Residuals, scaled: Jacobian) -> tuple[Status, str]:
    """Whether the fit is at a minimum; if not, what kept it from there."""
    size = float(np.linalg.norm(residuals))
    slope = np.abs(scaled.T @ residuals).max(initial=0.0)
    if slope <= max(LEVEL * size, NOTHING):
        return "fitted", ""
    kind, why = branch.failure
    if kind == "limit":
        return "limit", f"least squares leads on, but {why}"
    if kind:
        return "branch ends", f"least squares leads on, but {why}"
    return "not converged", f"{EVALUATIONS} evaluations did not suffice"


def _blind(names: Sequence[str], direction: Vector) -> str:
    """Name the combination of unknowns that the measurements do not determine."""
    share = direction / np.abs(direction).max()
    parts = [f"{x:+.3g} {name}" for name, x in zip(names, share, strict=True) if abs(x) > 1e-6]
    return f"the measurements do not depend on {' '.join(parts)}"


class BranchEnds(Exception):  # noqa: N818  # names what happened, to the fit alone
    """Too many trials were not reached."""
