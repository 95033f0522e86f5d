"""Residuals of a calibration and their Jacobian, on the branches of the states it starts from."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from equimorph.equilibria import ParameterLine, TraceOptions, follow, newton
from equimorph.equilibria.outcome import KINDS
from equimorph.equilibria.tracing import ARRIVAL
from equimorph.structures import States
from equimorph.tasks.calibration.measured import Columns, Lanes, Measurement, derivative
from equimorph.tasks.calibration.unknowns import Parameters, Unknowns, Vector

Residuals = Float[np.ndarray, " numbers"]
Jacobian = Float[np.ndarray, "numbers k"]

SHORT = 1e-6
"""Moves in the parameter space, in scales, over which Newton's method needs no steps."""

STEPS = 200
"""Of one lift; a trial further away is not worth more, since the trust region shrinks."""
FAILURES = 20
"""Trials that are not reached, after which a fit is given up: it ends at the end of a branch."""


class BranchEnds(Exception):  # noqa: N818  # names what happened, to the fit alone
    """Too many trials were not reached."""


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
    trial: tuple[Lanes, Parameters] | None = None
    accepted: tuple[Vector, Residuals, Jacobian] | None = None
    failure: tuple[str, str] = ("", "")
    failures: int = 0

    @property
    def states(self) -> States:
        """States at the last accepted unknowns."""
        return States(self.unknowns.structure, self.z, self.p)

    def residuals(self, x: Vector) -> Residuals:
        """(predicted − measured)/σ where there is a measurement."""
        p = self.unknowns.parameters(x)
        z = self._lifted(p)
        if z is None:
            self.failures += 1
            if self.failures > FAILURES:
                raise BranchEnds
            return np.full(np.isfinite(self.measured).sum(), np.inf)
        self.trial = z, p
        return self._missed(z, p)

    def _missed(self, z: Lanes, p: Parameters) -> Residuals:
        structure = self.unknowns.structure
        predicted = [each.predicted(structure, z, p) for each in self.measurements]
        return self._selected(np.concatenate(predicted, axis=1) - self.measured)

    def jacobian(self, x: Vector) -> Jacobian:
        """Derivatives of the residuals at the last trial, which is thereby accepted.

        Sensitivities of the states: dz = −F_z⁻¹ F_p dp.
        """
        assert self.trial is not None
        self.z, self.p = self.trial
        assert np.array_equal(self.p, self.unknowns.parameters(x))
        structure, z, p = self.unknowns.structure, self.z, self.p
        changes = self.unknowns.columns
        columns = np.stack([structure.parameter_derivative(z, p, dp) for dp in changes], axis=1)
        moves = -structure.solve(z, p, columns).x
        slopes = [
            np.concatenate(
                [
                    derivative(each, structure, (z, p), np.ascontiguousarray(moves[:, k]), dp)
                    for each in self.measurements
                ],
                axis=1,
            )
            for k, dp in enumerate(changes)
        ]
        jacobian = np.stack([self._selected(slope) for slope in slopes], axis=1)
        self.accepted = x.copy(), self._missed(z, p), jacobian
        return jacobian

    def _selected(self, table: Columns) -> Residuals:
        return np.asarray((table / self.sigma)[np.isfinite(self.measured)])

    def _lifted(self, p: Parameters) -> Lanes | None:
        """States at parameters on the branches of the accepted ones; None if one is not reached."""
        name = self.unknowns.outside(p)
        if name:
            self.failure = ("limit", f"{name} leaves the limits of its meaning")
            return None
        structure, z = self.unknowns.structure, self.z.copy()
        length = np.linalg.norm((p - self.p) / structure.scales, axis=1)
        near, far = np.flatnonzero((length > 0.0) & (length <= SHORT)), length > SHORT
        if len(near):
            z[near], found = newton(structure, z[near], p[near])
            if not found.all():
                self._note("lost", int(near[~found][0]))
                return None
        lanes = np.flatnonzero(far)
        if len(lanes):
            line = ParameterLine(structure, self.p[lanes].copy(), p[lanes] - self.p[lanes])
            ended = follow(
                line, z[lanes].copy(), (), TraceOptions(record=False, steps=STEPS, retries=0)
            )
            short = np.flatnonzero(ended.code != ARRIVAL)
            if len(short):
                self._note(KINDS[int(ended.code[short[0]])], int(lanes[short[0]]))
                return None
            z[lanes] = ended.z
        return z

    def _note(self, kind: str, lane: int) -> None:
        """Remember why a trial was not reached; "lost" says less than what was met before."""
        if kind != "lost" or not self.failure[0]:
            self.failure = (kind, f"the branch of state {lane} ends: {kind}")
