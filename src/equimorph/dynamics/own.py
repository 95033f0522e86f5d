"""The library's own equations of motion, for every structure: not independent of its statics."""

import numpy as np

from equimorph.array_types import Float
from equimorph.dynamics.direct import DirectModel, DirectPlant
from equimorph.dynamics.model import Plant, Row
from equimorph.dynamics.time_steps import Motion
from equimorph.structures import State, Structure


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

    def set(self, p: Row) -> None:
        """Set the parameters."""
        self.p = p.copy()

    def step(self) -> None:
        """One step in time.

        Raises
        ------
        ArithmeticError
            If Newton's method does not converge.
        """
        self._motion, found = self._motion.step(
            self.structure, self.p[None], self._step, self._rate
        )
        if not found[0]:
            raise ArithmeticError("Newton's method lost a step in time; choose a shorter step")

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
        return float(np.sqrt(self.structure.mass @ self.velocity**2))
