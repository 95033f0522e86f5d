"""On which side of a fold its two sheets lie."""

import numpy as np
from jaxtyping import Float, Int

from equimorph.equilibria.critical import null_border
from equimorph.manifold.geometry.points import Points
from equimorph.manifold.geometry.setting import Setting


def existence_normals(
    setting: Setting, points: Points, folds: Int[np.ndarray, " n"]
) -> Float[np.ndarray, "n d"]:
    """Vectors, in scaled free parameters, towards the side of a fold where sheets exist.

    Near a fold with null vector φ the set is ``φᵀF_p δp + ½ φᵀF_zz[φ, φ] ξ² = 0``. The vector is
    continuous along a fold and turns round only at a cusp.
    """
    structure, free = setting.structure, setting.free
    z, p = points.z[folds], points.p[folds]
    phi = null_border(structure, z, p)
    none = np.zeros_like(p)
    bend = np.einsum("li,li->l", phi, structure.second_derivative(z, p, (phi, none), (phi, none)))
    slope = np.empty((len(folds), len(free)))
    for k in range(len(free)):
        dp = np.zeros_like(p)
        dp[:, free[k]] = setting.scales[k]
        slope[:, k] = np.einsum("li,li->l", phi, structure.parameter_derivative(z, p, dp))
    return np.asarray(-slope * np.sign(bend)[:, None])
