"""The library's own equations of motion, for every structure: not independent of its statics."""

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Lanes, Parameters
from equimorph.dynamics.direct import DirectModel, DirectPlant
from equimorph.dynamics.model import Plant, Row
from equimorph.structures import State, Structure

NEWTON_STEPS = 25
CONVERGED = 1e-9
"""Largest Newton step in the structure's metric that counts as none."""


class OwnModel(DirectModel):
    """M ü + C u̇ = −∂L/∂u on the constraints, with C = η ω₁² M, so that ζ₁ = ½ η ω₁."""

    simulator = "own"

    def plant(self, start: State, step: float, damping: float) -> Plant:
        """The structure at rest at a state."""
        rate = damping * self.unit * self.frequency**2
        return OwnPlant(self.structure, start, step * self.unit, rate)

    def resistance(
        self, z: Lanes, p: Parameters, mode: Float[np.ndarray, " unknowns"], damping: float
    ) -> float:
        """c along the mode."""
        heavy = float(self.structure.inertia_product(z, p)(mode[None, None])[0, 0] @ mode)
        return damping * self.unit * self.frequency**2 * heavy


class OwnPlant(DirectPlant):
    """Backward Euler: stable at any step, of first order, with damping of its own of h ω/2.

    Forces that come from the change of M along the motion are left out: they are of second order in
    the speed.
    """

    def __init__(self, structure: Structure, start: State, step: float, rate: float) -> None:
        self.structure, self._step, self._rate = structure, step, rate
        self.p = start.p.copy()
        self._z, self._velocity = start.z.copy(), np.zeros(structure.unknowns)

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
        n, h = self.structure.unknowns, self._step
        mass = self.structure.inertia(self._z[None], self.p[None])[0]
        heavy = mass * ((1.0 + self._rate * h) / h**2)
        pull = mass @ self._velocity / h
        z = self._z.copy()
        for _ in range(NEWTON_STEPS):
            residual = self.structure.residual(z[None], self.p[None])[0]
            residual[:n] += heavy @ (z[:n] - self._z[:n]) - pull
            matrix = self._matrix(z)
            matrix[:n, :n] += heavy
            move = np.linalg.solve(matrix, -residual)
            z = z + move
            if np.sqrt(self.structure.mass @ move[:n] ** 2) < CONVERGED:
                break
        else:
            raise ArithmeticError("Newton's method lost a step in time; choose a shorter step")
        self._velocity = (z[:n] - self._z[:n]) / h
        self._z = z

    def _matrix(self, z: Float[np.ndarray, " size"]) -> Float[np.ndarray, "size size"]:
        """F_z, from solves with it and a shift, which is regular at folds, too."""
        structure, size = self.structure, self.structure.size
        shift = -1.0
        inverse = structure.solve(
            z[None], self.p[None], np.eye(size)[None], None, np.array([shift])
        ).x[0]
        out = np.linalg.inv(inverse.T)
        at = np.arange(structure.unknowns)
        out[at, at] += shift * structure.mass
        return np.asarray(out)

    @property
    def z(self) -> Float[np.ndarray, " size"]:
        """Unknowns and multipliers."""
        return self._z

    @property
    def velocity(self) -> Float[np.ndarray, " unknowns"]:
        """Rates of the unknowns."""
        return self._velocity

    @property
    def speed(self) -> float:
        """Speed in the structure's metric."""
        return float(np.sqrt(self.structure.mass @ self._velocity**2))
