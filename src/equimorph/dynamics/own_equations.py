"""The library's own equations of motion, for every structure: not independent of its statics."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from equimorph.arrays import Bool, Flags, Float, Lanes, Parameters, Values, Velocity
from equimorph.columns import Columns
from equimorph.dynamics.direct import DirectModel, DirectPlant
from equimorph.dynamics.model import Plant, Row
from equimorph.structures import State, Structure
from equimorph.structures.added_load import dense_matrices
from equimorph.structures.metric import metric_length

NEWTON_STEPS = 25
CONVERGED = 1e-9
"""Largest Newton step in the structure's metric that counts as none."""
SLOW = 0.1
"""Ratio of successive Newton steps above which the matrix is computed anew."""


@dataclass(frozen=True)
class Motion(Columns):
    """Where structures are in time: unknowns and rates now, and one step ago.

    ``M ü + Γ[u̇, u̇] + C u̇ = −∂L/∂u`` on the constraints, with the physical mass matrix M, the
    forces Γ that come from its change, and C = `rate` M. Steps are backward differences of second
    order (BDF2), the first one, where nothing is known of before, of first order; M and Γ are taken
    where the motion leads to without forces. Steps of length h damp a frequency ω by about (ωh)³/4.
    """

    z: Lanes
    velocity: Velocity
    before: Velocity
    """Unknowns one step ago; not a number at the start."""
    velocity_before: Velocity

    @classmethod
    def of(cls, z: Lanes, velocity: Velocity) -> "Motion":
        """At the start."""
        nothing = np.full_like(velocity, np.nan)
        return cls(z, velocity, nothing, nothing)

    @cached_property
    def _begun(self) -> Bool[np.ndarray, "lanes 1"]:
        return np.asarray(np.isfinite(self.before[:, :1]))

    def _before(self, now: Velocity, before: Velocity) -> Velocity:
        """What a difference quotient of the next value takes from the last ones, times h."""
        return np.where(self._begun, -2.0 * now + 0.5 * before, -now)

    def step(
        self,
        structure: Structure,
        p: Parameters,
        h: float,
        rate: float,
        drive: tuple[Parameters, Parameters] | None = None,
    ) -> tuple["Motion", Flags]:
        """Motions one step later, and which of them Newton's method found.

        drive: rates and accelerations of the parameters; None: they rest.
        """
        n, ahead = structure.unknowns, self.z.copy()
        u = self.z[:, :n].copy()
        first = np.where(self._begun, 1.5, 1.0)
        ahead[:, :n] += h * self.velocity
        z = ahead.copy()
        faster = np.where(self._begun, 2.0 * self.velocity - self.velocity_before, self.velocity)
        mass = structure.inertia(ahead, p)
        gamma = structure.inertial_force(ahead, p, faster)
        if drive is not None:
            gamma = gamma + structure.driven_force(ahead, p, faster, *drive)
        rest = self._before(u, self.before)
        rest_v = self._before(self.velocity, self.velocity_before)
        heavy = mass * ((first / h) * (first / h + rate))[:, :, None]
        force = gamma + _times(mass, (first / h + rate) * rest / h + rest_v / h)
        todo, found = np.arange(len(z)), np.zeros(len(z), bool)
        inverse, size = np.zeros((len(z), z.shape[1], z.shape[1])), np.full(len(z), np.inf)
        renew = np.ones(len(z), bool)
        for _ in range(NEWTON_STEPS):
            fresh = todo[renew[todo]]
            matrix = dense_matrices(structure, z[fresh], p[fresh])
            matrix[:, :n, :n] += heavy[fresh]
            inverse[fresh] = np.linalg.inv(matrix)
            residual = structure.residual(z[todo], p[todo])
            residual[:, :n] += _times(heavy[todo], z[todo, :n]) + force[todo]
            move = -_times(inverse[todo], residual)
            z[todo] += move
            length = metric_length(structure, move)
            renew[todo] = length > SLOW * size[todo]
            size[todo] = length
            found[todo] = length < CONVERGED
            todo = todo[(length >= CONVERGED) & np.isfinite(length)]
            if len(todo) == 0:
                break
        velocity = (first * z[:, :n] + rest) / h
        return Motion(z, velocity, u, self.velocity), found

    def energy(self, structure: Structure, p: Parameters) -> Values:
        """Potential and kinetic energy, in units of `structure.energy`."""
        moving = structure.inertia_product(self.z, p)(self.velocity[:, None])[:, 0]
        kinetic = 0.5 * (moving * self.velocity).sum(axis=1)
        return np.asarray(structure.energy(self.z, p) + kinetic)


def _times(
    matrix: Float[np.ndarray, "lanes m m"], x: Float[np.ndarray, "lanes m"]
) -> Float[np.ndarray, "lanes m"]:
    return np.asarray((matrix @ x[:, :, None])[:, :, 0])


class OwnModel(DirectModel):
    """M ü + C u̇ = −∂L/∂u on the constraints, with C = η ω₁² M, so that ζ₁ = ½ η ω₁."""

    simulator = "own"

    def plant(self, start: State, step: float, damping: float) -> Plant:
        """The structure at rest at a state."""
        rate = self.damping_rate(damping)
        return OwnPlant(self.structure, start, step * self.unit, rate)


class OwnPlant(DirectPlant):
    """One lane of `Motion` under parameters that change."""

    def __init__(self, structure: Structure, start: State, step: float, rate: float) -> None:
        self.structure, self._step, self._rate = structure, step, rate
        self.p = start.p.copy()
        self._motion = Motion.of(start.z[None], np.zeros((1, structure.unknowns)))
        nothing = np.full_like(start.p, np.nan)
        self._rows, self._rates = (start.p, nothing), (np.zeros_like(start.p), nothing)

    def set(self, p: Row) -> None:
        """Set the parameters."""
        self.p = p.copy()

    def step(self) -> None:
        """One step in time.

        Raises `ArithmeticError` if Newton's method does not converge.
        """
        rate = self._difference(self.p, self._rows)
        drive = rate[None], self._difference(rate, self._rates)[None]
        self._motion, found = self._motion.step(
            self.structure, self.p[None], self._step, self._rate, drive
        )
        self._rows, self._rates = (self.p, self._rows[0]), (rate, self._rates[0])
        if not found[0]:
            raise ArithmeticError("Newton's method lost a step in time; choose a shorter step")

    def _difference(self, now: Row, before: tuple[Row, Row]) -> Row:
        """Rate by values now, one step ago and two steps ago, as in `Motion`."""
        first = now - before[0]
        second = 1.5 * now - 2.0 * before[0] + 0.5 * before[1]
        return np.where(np.isfinite(before[1]), second, first) / self._step

    @property
    def z(self) -> Float[np.ndarray, " size"]:
        """Unknowns and multipliers."""
        return np.asarray(self._motion.z[0])

    @property
    def velocity(self) -> Float[np.ndarray, " unknowns"]:
        """Rates of the unknowns."""
        return np.asarray(self._motion.velocity[0])

    @property
    def speed(self) -> float:
        """Speed in the structure's metric."""
        return float(metric_length(self.structure, self.velocity))
