"""Stable states beside stable states: actuators as local coordinates."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Flags, Lanes, Parameters, Values
from equimorph.equilibria.sensitivity import answers, slopes_along
from equimorph.model import Descriptor
from equimorph.structures import Structure

EXACT = 1e-10
"""Last correction, in the metric and scaled parameters, of a point that counts as found."""
ITERATIONS, LONGEST = 12, 0.3


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


@dataclass(frozen=True)
class Corrected:
    """States at targets, how long the first correction was, and which were found."""

    z: Lanes
    p: Parameters
    first: Values
    good: Flags


def correct_onto_targets(
    structure: Structure,
    guess: tuple[Lanes, Parameters],
    free: Int[np.ndarray, " k"],
    descriptors: tuple[Descriptor, ...],
    targets: Float[np.ndarray, "lanes m"],
) -> Corrected:
    """Newton for regular states with given descriptors; with actuators to spare, the nearest.

    A step that is wanted along ``w = −F_z⁻¹F`` and the shortest one in the actuators.
    """
    z, p = guess[0].copy(), guess[1].copy()
    first, good, todo = np.full(len(z), np.inf), np.zeros(len(z), bool), np.arange(len(z))
    for _ in range(ITERATIONS):
        dz, dp = _correction(structure, (z[todo], p[todo]), free, descriptors, targets[todo])
        size = _length(structure, dz, dp)
        alive = np.isfinite(size)
        first[todo] = np.where(np.isinf(first[todo]), size, first[todo])
        share = np.where(alive, np.minimum(1.0, LONGEST / np.maximum(size, 1e-300)), 0.0)[:, None]
        z[todo] += share * np.where(alive[:, None], dz, 0.0)
        p[todo] += share * np.where(alive[:, None], dp, 0.0)
        good[todo] = alive & (size < EXACT)
        todo = todo[alive & (size >= EXACT)]
        if len(todo) == 0:
            break
    return Corrected(z, p, first, good)


def _correction(
    structure: Structure,
    here: tuple[Lanes, Parameters],
    free: Int[np.ndarray, " k"],
    descriptors: tuple[Descriptor, ...],
    targets: Float[np.ndarray, "lanes m"],
) -> tuple[Lanes, Parameters]:
    z, p = here
    away = structure.solve(z, p, -structure.residual(z, p)[:, None]).x
    dz, dp = answers(structure, z, p, free)
    none = np.zeros((len(z), 1, p.shape[1]))
    along = (np.concatenate([dz, away], axis=1), np.concatenate([dp, none], axis=1))
    slope = slopes_along(structure, here, along, descriptors)
    now = np.stack([each.function(z, p) for each in descriptors], axis=1)
    step = shortest_change(slope[:, :, :-1], targets - now - slope[:, :, -1])
    return away[:, 0] + np.einsum("lk,lki->li", step, dz), np.einsum("lk,lki->li", step, dp)


def _length(structure: Structure, dz: Lanes, dp: Parameters) -> Values:
    """Length of changes in the metric and scaled parameters."""
    u = dz[:, : structure.unknowns] ** 2 @ structure.mass
    return np.asarray(np.sqrt(u + ((dp / structure.scales) ** 2).sum(axis=1)))


def step_distances(structure: Structure, z: Lanes, p: Parameters) -> Float[np.ndarray, " between"]:
    """Distances of successive states in the metric and scaled parameters."""
    return _length(structure, np.diff(z, axis=0), np.diff(p, axis=0))
