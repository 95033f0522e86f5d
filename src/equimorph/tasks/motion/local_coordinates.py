"""Stable states beside stable states: actuators as local coordinates."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Lanes, Parameters
from equimorph.equilibria.point_conditions import Values as TargetValues
from equimorph.equilibria.sensitivity import answers, slopes_along
from equimorph.equilibria.settle import Guards, Held, Settled, free_directions, settle
from equimorph.model import Descriptor
from equimorph.structures import Structure

EXACT = 1e-10
"""Last correction, in the metric and scaled parameters, of a point that counts as found."""
GUARDS = Guards(iterations=12, longest=0.3, converged=EXACT)


@dataclass(frozen=True)
class Linearisation:
    """Linearisation of the set and of descriptors at regular states, by some parameters.

    dz, dp: changes per scale of each of the parameters; slope: those of the descriptors.
    """

    dz: Float[np.ndarray, "lanes k size"]
    dp: Float[np.ndarray, "lanes k parameters"]
    slope: Float[np.ndarray, "lanes m k"]


def linearise(
    structure: Structure,
    z: Lanes,
    p: Parameters,
    which: Int[np.ndarray, " k"],
    descriptors: tuple[Descriptor, ...],
) -> Linearisation:
    """Linearise at states."""
    along = answers(structure, z, p, which)
    return Linearisation(*along, slopes_along(structure, (z, p), along, descriptors))


def shortest_change(
    slope: Float[np.ndarray, "lanes m k"], wanted: Float[np.ndarray, "lanes m"]
) -> Float[np.ndarray, "lanes k"]:
    """Shortest changes of the actuators, in their scales, that change descriptors as wanted."""
    if slope.shape[1] == slope.shape[2]:
        size = np.abs(slope).max(axis=(1, 2))
        regular = np.abs(np.linalg.det(slope)) > 1e-14 * size ** slope.shape[1]
        safe = np.where(regular[:, None, None], slope, np.eye(slope.shape[1]))
        found = np.linalg.solve(safe, wanted[:, :, None])[:, :, 0]
        return np.where(regular[:, None], found, np.nan)
    return np.asarray(np.einsum("lkm,lm->lk", np.linalg.pinv(slope), wanted))


def correct_onto_targets(
    structure: Structure,
    z: Lanes,
    p: Parameters,
    free: Int[np.ndarray, " k"],
    descriptors: tuple[Descriptor, ...],
    targets: Float[np.ndarray, "lanes m"],
) -> Settled:
    """Newton for regular states with given descriptors; with actuators to spare, the nearest."""
    values = TargetValues(tuple(each.function for each in descriptors), targets)
    directions = free_directions(structure, free, len(targets))
    return settle(structure, z, p, directions, [values], GUARDS, Held())
