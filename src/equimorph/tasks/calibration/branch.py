"""Residuals of a calibration and their Jacobian, on the branches of the states it starts from."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters
from equimorph.equilibria import ParameterLine, TraceOptions, settle, trace
from equimorph.equilibria.trace_options import EventCode
from equimorph.errors import InputError
from equimorph.structures import States, Structure
from equimorph.tasks.calibration.measurements import Columns, Measurement, by_data, derivative
from equimorph.tasks.calibration.unknowns import Unknowns, Vector

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


class BranchEnds(Exception):  # noqa: N818  # names what happened, to the fit alone
    """Too many trials were not reached."""


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
