"""States of rods in space that are not isolated."""

import numpy as np

from equimorph.arrays import Flags, Lanes, Parameters
from equimorph.structures.spatial.mechanics import SpatialMechanics
from equimorph.structures.spatial.quaternions import conjugate, exponential, matrices, product

TURN = 0.7
"""Angle in radians by which states are turned to see whether they stay equilibria."""
SAME = 1e-9
"""Residuals, and moves of the rod, that are none."""


def on_orbit(rod: SpatialMechanics, z: Lanes, p: Parameters) -> Flags:
    """Whether equilibria turned about the x axis, with sections turned back, are other equilibria.

    q → exp(e₁ α/2) q exp(−e₁ α/2), and the forces of the supports with it.
    """
    turn = exponential(np.array([TURN, 0.0, 0.0]))
    moved, m = z.copy(), rod.constraints
    q = z[:, : rod.unknowns].reshape(len(z), rod.unknowns // 4, 4)
    spun = product(product(turn, q), conjugate(turn))
    moved[:, : rod.unknowns] = spun.reshape(len(z), rod.unknowns)
    held = rod.model.reaction[:, :m]
    forces = z[:, rod.unknowns :] @ held.T @ matrices(turn).T
    moved[:, rod.unknowns :] = forces @ held
    balanced = np.abs(rod.residual(moved, p)).max(axis=1) < SAME + 2.0 * np.abs(
        rod.residual(z, p)
    ).max(axis=1)
    return np.asarray(balanced & (np.abs(spun - q).max(axis=(1, 2)) > np.sqrt(SAME)))
