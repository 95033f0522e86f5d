"""Tangent spaces of two smooth sheets where they cross.

There ``[F_z F_p]`` has one null vector more than a sheet has dimensions, so that a linear system
does not tell its tangent space: both sheets touch the planes on which the Hessian of the reduced
equation vanishes (see `crossing_points`).
"""

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Frames, Lanes, Parameters, Rows
from equimorph.equilibria.critical import null_border
from equimorph.manifold.geometry.crossing_points import reduction
from equimorph.manifold.geometry.embedding import embed
from equimorph.manifold.geometry.exact_points import Aim
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.geometry.tangents import placed_frames

Slopes = Float[np.ndarray, "lanes d"]


def crossing_frames(setting: Setting, z: Lanes, p: Parameters, rows: Rows) -> tuple[Frames, Slopes]:
    """Orthonormal bases of the tangent spaces of sheets at their crossings.

    Parameters
    ----------
    rows
        Bases of nearby spaces; they tell which of both sheets is meant, and its orientation.

    Returns
    -------
    The bases, and the slope along them of what vanishes on the other sheet, of unit length.
    """
    kernel, hessian = _kernel(setting, z, p)
    near = np.einsum("ldc,lkc->ldk", rows, placed_frames(setting, kernel))
    values, vectors = np.linalg.eigh(hessian)
    low, high = (np.sqrt(np.maximum(sign * values[:, k], 0.0)) for sign, k in ((-1, 0), (1, -1)))
    normals = np.stack(
        [
            high[:, None] * vectors[:, :, -1] + sign * low[:, None] * vectors[:, :, 0]
            for sign in (1.0, -1.0)
        ],
        axis=1,
    )
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-300)
    off = np.linalg.norm(np.einsum("ldk,lsk->lsd", near, normals), axis=2)
    own, lanes = off.argmin(axis=1), np.arange(len(z))
    # the columns after the first are orthogonal to the normal
    inside = np.linalg.qr(normals[lanes, own][:, :, None], mode="complete")[0][:, :, 1:]
    share = np.linalg.inv(np.swapaxes(near @ inside, 1, 2))
    raw = share @ np.swapaxes(inside, 1, 2)
    within = np.swapaxes(np.linalg.inv(_factor(raw)), 1, 2) @ raw
    slopes = np.einsum("ldk,lk->ld", within, normals[lanes, 1 - own])
    slopes /= np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), 1e-300)
    return within @ kernel, slopes


def _kernel(
    setting: Setting, z: Lanes, p: Parameters
) -> tuple[Float[np.ndarray, "lanes k full"], Float[np.ndarray, "lanes k k"]]:
    """Null vectors of ``[F_z F_p]``, orthonormal in the metric, and the Hessian along them."""
    free, scales, d = setting.free, setting.scales, len(setting.free)
    place = embed(setting, z, p)
    span = np.tile(np.eye(d), (len(z), 1, 1))
    aim = Aim(setting, False, False, span, place, place[:, None][:, :0])
    known = reduction(aim, z, p, null_border(setting.structure, z, p))
    raw = np.concatenate([known.along_z, known.along_p[:, :, free] / scales], axis=2)
    size = np.linalg.norm(placed_frames(setting, raw), axis=2)
    raw /= size[:, :, None]
    hessian = known.hessian / (size[:, :, None] * size[:, None])
    turn = np.swapaxes(np.linalg.inv(_factor(placed_frames(setting, raw))), 1, 2)
    return turn @ raw, turn @ hessian @ np.swapaxes(turn, 1, 2)


def _factor(rows: Float[np.ndarray, "lanes k coordinates"]) -> Float[np.ndarray, "lanes k k"]:
    """Upper triangle R with positive diagonal, for which ``R⁻ᵀ rows`` is orthonormal."""
    upper = np.linalg.qr(np.swapaxes(rows, 1, 2), mode="r")
    sign = np.sign(np.diagonal(upper, axis1=1, axis2=2))
    return np.asarray(upper * sign[:, :, None])
