"""Physical mass matrices from the places of material points."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Lanes, Parameters, Velocity
from equimorph.structures.equations import Equations

STEP = 1e-3
"""Step of the differences, of unknowns of size one: errors of 1e-13 of truncation and round-off."""
RANK = 1e-10
"""Relative size below which a compliance counts as none: such constraints do not give way."""

Places = Callable[[Lanes, Parameters], Float[np.ndarray, "many points space"]]


@dataclass(frozen=True)
class MaterialPoints:
    """Masses at places, which are functions of unknowns and multipliers.

    Derivatives are differenced to fourth order. Where constraints ``c(u, λ) = 0`` give way, the
    multipliers follow from the unknowns: ``c_u δu + c_λ δλ = 0``.
    """

    equations: Equations
    places: Places
    masses: Float[np.ndarray, " points"]

    def inertia(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """Mass matrix JᵀWJ."""
        n = self.equations.unknowns
        out = np.empty((len(z), n, n))
        for lane in range(len(z)):
            flat, weights, _ = self._moved(z[lane], p[lane])
            out[lane] = flat.T @ (weights[:, None] * flat)
        return out

    def inertial_force(self, z: Lanes, p: Parameters, velocity: Velocity) -> Velocity:
        """``JᵀW D²x[u̇, u̇]``, with the second derivative of all places along the velocity."""
        out = np.zeros_like(velocity)
        for lane, rate in enumerate(velocity):
            size = float(np.abs(rate).max())
            if size == 0.0:
                continue
            flat, weights, follow = self._moved(z[lane], p[lane])
            way = STEP * np.concatenate([rate, follow @ rate]) / size
            at = z[lane] + np.array([-2.0, -1.0, 0.0, 1.0, 2.0])[:, None] * way
            x = self.places(at, np.repeat(p[lane][None], 5, axis=0)).reshape(5, -1)
            bend = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) @ x / (12.0 * (STEP / size) ** 2)
            out[lane] = flat.T @ (weights * bend)
        return out

    def _moved(
        self, z: Float[np.ndarray, " size"], p: Float[np.ndarray, " parameters"]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Derivatives of all coordinates by the unknowns, their masses, rates of multipliers."""
        n = self.equations.unknowns
        moved = _derivative(self.places, z, p)
        follow = np.zeros((self.equations.constraints, n))
        if self.equations.constraints:
            rows = _derivative(self.equations.residual, z, p)[n:]
            follow = -np.linalg.pinv(rows[:, n:], rcond=RANK, hermitian=True) @ rows[:, :n]
            moved = moved[..., :n] + moved[..., n:] @ follow
        return moved.reshape(-1, n), np.repeat(self.masses, moved.shape[1]), follow


def _derivative(
    function: Callable[[Lanes, Parameters], np.ndarray],
    z: Float[np.ndarray, " size"],
    p: Float[np.ndarray, " parameters"],
) -> Float[np.ndarray, "... size"]:
    """Derivatives of values at one state by all entries of z, along the last axis."""
    steps = STEP * np.eye(len(z))
    at = np.concatenate([z + share * steps for share in (1.0, -1.0, 2.0, -2.0)])
    values = function(at, np.repeat(p[None], len(at), axis=0))
    ahead, behind, twice, back = values.reshape(4, len(z), *values.shape[1:])
    slope = (8.0 * (ahead - behind) - (twice - back)) / (12.0 * STEP)
    return np.asarray(np.moveaxis(slope, 0, -1))
