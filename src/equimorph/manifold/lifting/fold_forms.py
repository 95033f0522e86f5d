"""Folds to second order: on which side of them the set exists, and how they turn."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Lanes, Values
from equimorph.equilibria.critical import null_border
from equimorph.manifold.geometry.points import Points
from equimorph.manifold.geometry.setting import Setting


@dataclass(frozen=True)
class FoldForms:
    """Coefficients of ``φᵀF_p δp + ½ φᵀF_zz[φ, φ] ξ² = 0``, the set near folds.

    null: φ, of either sign; slope: φᵀF_p along the scaled free parameters; bend: φᵀF_zz[φ, φ].
    """

    null: Lanes
    slope: Float[np.ndarray, "n d"]
    bend: Values

    @property
    def existence(self) -> Float[np.ndarray, "n d"]:
        """Vectors, in scaled free parameters, towards the side of a fold where sheets exist.

        They are continuous along a fold and turn round only at a cusp.
        """
        return np.asarray(-self.slope * np.sign(self.bend)[:, None])


def fold_forms(setting: Setting, points: Points, folds: Int[np.ndarray, " n"]) -> FoldForms:
    """Coefficients at points on folds."""
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
    return FoldForms(phi, slope, bend)
