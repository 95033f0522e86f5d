"""On which side of a fold curve its two sheets lie."""

import numpy as np
from jaxtyping import Float, Int

from equimorph.manifold.pairing import Setting
from equimorph.manifold.points import Points


def existence_normals(
    setting: Setting, points: Points, folds: Int[np.ndarray, " n"]
) -> Float[np.ndarray, "n 2"]:
    """Unit vectors, in scaled free parameters, towards the side of a fold where sheets exist.

    Near a fold with null vector φ the set is ``φᵀF_p δp + ½ φᵀF_zz[φ, φ] ξ² = 0``. The vector is
    continuous along a fold curve and turns round only at a cusp.
    """
    structure, free = setting.structure, setting.free
    z, p = points.z[folds], points.p[folds]
    phi = _null_vectors(setting, z, p)
    none = np.zeros_like(p)
    bend = np.einsum("li,li->l", phi, structure.second_derivative(z, p, (phi, none), (phi, none)))
    slope = np.empty((len(folds), 2))
    for k in range(2):
        dp = np.zeros_like(p)
        dp[:, free[k]] = setting.scales[k]
        slope[:, k] = np.einsum("li,li->l", phi, structure.parameter_derivative(z, p, dp))
    normal = -slope * np.sign(bend)[:, None]
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300))


def _null_vectors(
    setting: Setting, z: Float[np.ndarray, "n size"], p: Float[np.ndarray, "n P"]
) -> Float[np.ndarray, "n size"]:
    """Null vectors of F_z by bordered solves, which stay regular on folds."""
    b = np.tile(np.cos(1.3 * np.arange(z.shape[1])) + 1.1, (len(z), 1))
    rhs = np.zeros((len(z), 1, z.shape[1] + 1))
    rhs[:, 0, -1] = 1.0
    for _ in range(4):
        b = b / np.linalg.norm(b, axis=1, keepdims=True)
        border = (b[:, None], b[:, None], np.zeros((len(z), 1, 1)))
        b = np.ascontiguousarray(setting.structure.solve(z, p, rhs, border).x[:, 0, :-1])
    return np.asarray(b / np.linalg.norm(b, axis=1, keepdims=True))
