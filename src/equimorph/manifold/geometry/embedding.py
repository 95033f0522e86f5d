"""Where points of the set lie in the metric: the space in which distances are measured."""

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Lanes, Parameters
from equimorph.manifold.geometry.setting import Setting

Coordinates = Float[np.ndarray, "lanes coordinates"]


def embed(setting: Setting, z: Lanes, p: Parameters) -> Coordinates:
    """Configuration in the metric and scaled free parameters: Euclidean distances measure."""
    structure = setting.structure
    u = z[:, : structure.unknowns] * np.sqrt(structure.mass)
    return np.concatenate([u, p[:, setting.free] / setting.scales], axis=1)


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
