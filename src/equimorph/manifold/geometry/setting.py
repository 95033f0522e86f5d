"""What is lifted: the structure, its free parameters and constraints; and its metric."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from equimorph.arrays import Float, Int, Lanes, Parameters, Place
from equimorph.model import Constraint
from equimorph.structures import Structure
from equimorph.structures.metric import metric_coordinates


@dataclass(frozen=True)
class Setting:
    """The structure and how points of the box become its parameters."""

    structure: Structure
    base: Float[np.ndarray, " parameters"]
    free: Int[np.ndarray, " d"]
    constraints: tuple[Constraint, ...]

    def parameters(self, points: Float[np.ndarray, "some d"]) -> Float[np.ndarray, "some P"]:
        """All parameters over points of the box."""
        p = np.empty((len(points), len(self.base)))
        p[:] = self.base
        for k, place in enumerate(self.free.tolist()):
            p[:, place] = points[:, k]
        return p

    @cached_property
    def scales(self) -> Place:
        """Scales of the free parameters."""
        return np.asarray(self.structure.scales[self.free])

    @property
    def limits(self) -> Float[np.ndarray, "2 d"]:
        """Open limits of the meaning of the free parameters."""
        chosen = [self.structure.parameters[k] for k in self.free]
        return np.array([[each.lower for each in chosen], [each.upper for each in chosen]])


Coordinates = Float[np.ndarray, "lanes coordinates"]


def embed(setting: Setting, z: Lanes, p: Parameters) -> Coordinates:
    """Configuration in the metric and scaled free parameters: Euclidean distances measure."""
    n = setting.structure.unknowns
    out = np.empty((len(z), n + len(setting.free)))
    out[:, :n] = metric_coordinates(setting.structure, z)
    out[:, n:] = p[:, setting.free] / setting.scales
    return out


def principal_directions(
    deviations: Float[np.ndarray, "lanes points coordinates"], count: int
) -> Float[np.ndarray, "lanes count coordinates"]:
    """Orthonormal directions in which clouds of points around their middles extend most.

    From the eigenvectors of the points' inner products, which are fewer than the coordinates.
    """
    products = deviations @ np.swapaxes(deviations, 1, 2)
    values, vectors = np.linalg.eigh(products)
    chosen = np.swapaxes(vectors[:, :, ::-1][:, :, :count], 1, 2)
    lengths = np.sqrt(np.maximum(values[:, ::-1][:, :count], 1e-300))
    return np.asarray(chosen @ deviations / lengths[:, :, None])
