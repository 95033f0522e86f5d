"""Where two smooth sheets of a set cross, as symmetry makes them in its slices: tangent spaces.

Lyapunov–Schmidt reduction with a border b [Govaerts2000]_: where the residual is r b, the set is
``r(ξ, π) = 0`` in the amplitude ξ of the null vector and steps π of the parameters. It crosses
itself where the gradient of r vanishes together with r. There ``[F_z F_p]`` has one null vector
more than a sheet has dimensions, so that a linear system does not determine its tangent space: the
two sheets are tangent to the planes on which the Hessian of r, of rank two and indefinite,
vanishes.
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float, Frames, Lanes, Parameters, Rows, Values
from equimorph.equilibria.critical import Critical, null_border
from equimorph.equilibria.settle import free_directions
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.geometry.tangents import frames_in_embedding
from equimorph.structures import Structure

Slopes = Float[np.ndarray, "lanes d"]

INDEFINITE = 1e-6
"""Least ratio of the Hessian's eigenvalues of opposite sign at which sheets cross."""


@dataclass(frozen=True)
class Reduction:
    """Reduced equation at points: tangent vectors of the reduction, gradient and Hessian of r.

    along_z, along_p: changes of z and p with ξ, and with each of the k directions of the span;
    remainder: the Newton step of z that leaves the residual parallel to b; value: r after it.
    """

    along_z: Float[np.ndarray, "lanes k1 size"]
    along_p: Float[np.ndarray, "lanes k1 parameters"]
    remainder: Lanes
    gradient: Float[np.ndarray, "lanes k1"]
    hessian: Float[np.ndarray, "lanes k1 k1"]
    value: Values

    @property
    def crosses(self) -> np.ndarray:
        """Whether the Hessian has eigenvalues of both signs."""
        values = np.linalg.eigvalsh(self.hessian)
        low, high = -values[:, 0], values[:, -1]
        return np.asarray(np.minimum(low, high) > INDEFINITE * np.maximum(low, high))


def reduction(
    structure: Structure,
    z: Lanes,
    p: Parameters,
    b: Lanes,
    directions: Float[np.ndarray, "lanes k parameters"],
) -> Reduction:
    """Lyapunov–Schmidt reduction for parameters that change along directions."""
    lanes, k = directions.shape[:2]
    moves = [np.ascontiguousarray(directions[:, i]) for i in range(k)]
    rhs = np.zeros((lanes, k + 2, structure.size + 1))
    rhs[:, 0, -1] = 1.0
    for i, move in enumerate(moves):
        rhs[:, 1 + i, :-1] = -structure.parameter_derivative(z, p, move)
    rhs[:, -1, :-1] = -structure.residual(z, p)
    x = Critical(structure, z, p, b).solve(rhs)
    v, still = np.ascontiguousarray(x[:, 0, :-1]), np.zeros_like(p)
    tangents = [(np.ascontiguousarray(x[:, i, :-1]), dp) for i, dp in enumerate((still, *moves))]
    remainder = np.ascontiguousarray(x[:, -1, :-1])
    hessian, gradient = np.empty((lanes, k + 1, k + 1)), -x[:, : k + 1, -1]
    for i, one in enumerate(tangents):
        for j, other in enumerate(tangents[: i + 1]):
            twice = structure.second_derivative(z, p, one, other)
            hessian[:, i, j] = hessian[:, j, i] = np.einsum("li,li->l", v, twice)
        twice = structure.second_derivative(z, p, one, (remainder, still))
        gradient[:, i] += np.einsum("li,li->l", v, twice)
    along_z, along_p = (np.stack([each[i] for each in tangents], axis=1) for i in range(2))
    return Reduction(along_z, along_p, remainder, gradient, hessian, -x[:, -1, -1])


def crossing_frames(setting: Setting, z: Lanes, p: Parameters, rows: Rows) -> tuple[Frames, Slopes]:
    """Orthonormal bases of the tangent spaces of sheets at their crossings.

    `rows`: bases of nearby spaces; they select one of the two sheets, and its orientation. Returns
    the bases, and the slope along them of what vanishes on the other sheet, of unit length.
    """
    kernel, hessian = _kernel(setting, z, p)
    near = np.einsum("ldc,lkc->ldk", rows, frames_in_embedding(setting, kernel))
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


def crossing_directions(setting: Setting, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes 2"]:
    """Unit vectors, in two scaled free parameters, along the curve on which two sheets cross.

    There the Hessian of the reduced equation has rank two; its null vector is the tangent.
    """
    kernel, hessian = _kernel(setting, z, p)
    values, vectors = np.linalg.eigh(hessian)
    lanes = np.arange(len(z))
    null = vectors[lanes, :, np.abs(values).argmin(axis=1)]
    along = np.einsum("lk,lkc->lc", null, kernel)[:, -2:]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    return np.asarray(along / np.maximum(length, 1e-300))


def _kernel(
    setting: Setting, z: Lanes, p: Parameters
) -> tuple[Float[np.ndarray, "lanes k full"], Float[np.ndarray, "lanes k k"]]:
    """Null vectors of ``[F_z F_p]``, orthonormal in the metric, and the Hessian along them."""
    free, scales = setting.free, setting.scales
    directions = free_directions(setting.structure, free, len(z))
    known = reduction(setting.structure, z, p, null_border(setting.structure, z, p), directions)
    raw = np.concatenate([known.along_z, known.along_p[:, :, free] / scales], axis=2)
    size = np.linalg.norm(frames_in_embedding(setting, raw), axis=2)
    raw /= size[:, :, None]
    hessian = known.hessian / (size[:, :, None] * size[:, None])
    turn = np.swapaxes(np.linalg.inv(_factor(frames_in_embedding(setting, raw))), 1, 2)
    return turn @ raw, turn @ hessian @ np.swapaxes(turn, 1, 2)


def _factor(rows: Float[np.ndarray, "lanes k coordinates"]) -> Float[np.ndarray, "lanes k k"]:
    """Upper triangle R with positive diagonal, for which ``R⁻ᵀ rows`` is orthonormal."""
    upper = np.linalg.qr(np.swapaxes(rows, 1, 2), mode="r")
    sign = np.sign(np.diagonal(upper, axis1=1, axis2=2))
    return np.asarray(upper * sign[:, :, None])
