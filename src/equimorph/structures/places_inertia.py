"""Physical mass matrices from the places of material points."""

from collections.abc import Callable

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Lanes, Parameters
from equimorph.structures.equations import Equations

STEP = 1e-3
"""Step of the differences, of unknowns of size one: errors of 1e-13 of truncation and round-off."""
RANK = 1e-10
"""Relative size below which a compliance counts as none: such constraints do not give way."""

Places = Callable[[Lanes, Parameters], Float[np.ndarray, "many points space"]]


def inertia_of_places(
    equations: Equations,
    places: Places,
    masses: Float[np.ndarray, " points"],
    z: Lanes,
    p: Parameters,
) -> Float[np.ndarray, "lanes unknowns unknowns"]:
    """Mass matrix JᵀWJ of masses at places, which are functions of unknowns and multipliers.

    J is differenced to fourth order. Where constraints ``c(u, λ) = 0`` give way, the multipliers
    follow from the unknowns: ``c_u δu + c_λ δλ = 0``.
    """
    n, m = equations.unknowns, equations.constraints
    out = np.empty((len(z), n, n))
    for lane in range(len(z)):
        here = z[lane], p[lane]
        moved = _derivative(places, *here)
        if m:
            rows = _derivative(equations.residual, *here)[n:]
            follow = -np.linalg.pinv(rows[:, n:], rcond=RANK, hermitian=True) @ rows[:, :n]
            moved = moved[..., :n] + moved[..., n:] @ follow
        flat = moved.reshape(-1, n)
        weights = np.repeat(masses, moved.shape[1])
        out[lane] = flat.T @ (weights[:, None] * flat)
    return out


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
