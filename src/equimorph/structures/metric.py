"""The structure's metric: lengths of changes and distances of points.

The mass matrix measures changes of the unknowns, scales those of the parameters. Lengths have the
same bits in any batch.
"""

from typing import Protocol, runtime_checkable

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters, Values
from equimorph.linalg.kernels import metric_lengths
from equimorph.structures.equations import Equations


@runtime_checkable
class Metric(Protocol):
    """What measures changes of states."""

    unknowns: int
    mass: Float[np.ndarray, " unknowns"]


def metric_length(
    structure: Metric, dz: Float[np.ndarray, "*lanes size"]
) -> Float[np.ndarray, "*lanes"]:
    """Lengths of changes of states; entries behind the unknowns do not count."""
    out = np.empty(dz.shape[:-1])
    rows = np.ascontiguousarray(dz).reshape(out.size, dz.shape[-1])
    metric_lengths(rows, structure.mass, out.reshape(-1))
    return out


def move_length(
    structure: Equations,
    dz: Float[np.ndarray, "*lanes size"],
    dp: Float[np.ndarray, "*lanes parameters"],
) -> Float[np.ndarray, "*lanes"]:
    """Lengths of changes of states and parameters."""
    scaled = ((dp / structure.scales) ** 2).sum(axis=-1)
    return np.asarray(np.sqrt(metric_length(structure, dz) ** 2 + scaled))


def distances(
    structure: Equations, z: Lanes, p: Parameters, other_z: Lanes, other_p: Parameters
) -> Values:
    """Distances of points in the metric and in the scaled parameters."""
    return move_length(structure, z - other_z, p - other_p)


def metric_coordinates(
    structure: Metric, z: Float[np.ndarray, "*lanes size"]
) -> Float[np.ndarray, "*lanes unknowns"]:
    """Configurations, or changes of them, such that Euclidean distances measure."""
    return np.asarray(z[..., : structure.unknowns] * np.sqrt(structure.mass))


def metric_places(
    structure: Equations, z: Lanes, p: Parameters
) -> Float[np.ndarray, "lanes coordinates"]:
    """Configurations and parameters such that Euclidean distances measure."""
    return np.concatenate([metric_coordinates(structure, z), p / structure.scales], axis=1)


def products_with(
    structure: Equations, rows: Float[np.ndarray, "lanes m coordinates"]
) -> Float[np.ndarray, "lanes m size"]:
    """What changes of states are multiplied by to give the products of their coordinates."""
    out = np.zeros((*rows.shape[:2], structure.size))
    out[:, :, : structure.unknowns] = metric_coordinates(structure, rows)
    return out
