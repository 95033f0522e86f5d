"""How descriptors of regular states answer their parameters."""

from collections.abc import Callable, Sequence

import numpy as np

from equimorph.arrays import Float, Int, Lanes, Parameters, Values
from equimorph.model import Descriptor
from equimorph.structures import Structure
from equimorph.structures.metric import move_length

Function = Callable[[Lanes, Parameters], Values]
DIFFERENCE = 1e-3
"""Step of central differences of fourth order, relative to the scales of the parameters and to the
metric: their error and that of round-off are about 1e-12."""


def answers(
    structure: Structure, z: Lanes, p: Parameters, free: Int[np.ndarray, " k"]
) -> tuple[Float[np.ndarray, "lanes k size"], Float[np.ndarray, "lanes k parameters"]]:
    """Changes of z and p for each free parameter, one scale of it: ``z' = −F_z⁻¹ F_p``."""
    dp = np.zeros((len(z), len(free), p.shape[1]))
    dp[:, np.arange(len(free)), free] = structure.scales[free]
    return tangents(structure, z, p, dp), dp


def tangents(
    structure: Structure, z: Lanes, p: Parameters, dp: Float[np.ndarray, "lanes k parameters"]
) -> Float[np.ndarray, "lanes k size"]:
    """Changes of z along directions of the parameters."""
    ways = [np.ascontiguousarray(each) for each in np.moveaxis(dp, 1, 0)]
    columns = np.stack([structure.parameter_derivative(z, p, each) for each in ways], axis=1)
    return structure.solve(z, p, -columns).x


def slopes_along(
    structure: Structure,
    z: Lanes,
    p: Parameters,
    dz: Float[np.ndarray, "lanes k size"],
    dp: Float[np.ndarray, "lanes k parameters"],
    functions: Sequence[Function],
) -> Float[np.ndarray, "lanes m k"]:
    """Derivatives of functions along directions (dz, dp) from states."""
    lanes, k, _ = dz.shape
    # the softer the direction, the shorter the step, so that differences stay small in the metric
    h = (DIFFERENCE / np.maximum(move_length(structure, dz, dp), 1e-300))[:, :, None]
    shifts = np.array([-2.0, -1.0, 1.0, 2.0])
    trial_z = (z[:, None, None] + shifts[:, None] * (h * dz)[:, :, None]).reshape(-1, z.shape[1])
    trial_p = (p[:, None, None] + shifts[:, None] * (h * dp)[:, :, None]).reshape(-1, p.shape[1])
    weights = np.array([1.0, -8.0, 8.0, -1.0]) / 12.0
    out = [each(trial_z, trial_p).reshape(lanes, k, 4) @ weights / h[:, :, 0] for each in functions]
    return np.stack(out, axis=1)


def steering(
    structure: Structure,
    z: Lanes,
    p: Parameters,
    free: Int[np.ndarray, " k"],
    descriptors: Sequence[Descriptor],
) -> Float[np.ndarray, "lanes m k"]:
    """Jacobian of descriptors by free parameters along the set, per scale of these."""
    functions = [each.function for each in descriptors]
    return slopes_along(structure, z, p, *answers(structure, z, p, free), functions)
