"""Newton's method for states of a set whose descriptors take given values."""

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Flags, Frames, Lanes, Parameters, Values
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.geometry.tangents import split_step
from equimorph.model import Descriptor
from equimorph.tasks.optimising.tangent_steps import SetPoints

DIFFERENCE = 1e-5
ITERATIONS, LONGEST = 30, 0.3
"""Most steps, and the length, in the metric and scaled parameters, to which they are shortened."""
EXACT = 1e-7
"""Last correction, in the metric and scaled parameters: Newton squares what is left."""


def states_with_values(
    setting: Setting,
    at: SetPoints,
    descriptors: tuple[Descriptor, ...],
    wanted: Float[np.ndarray, "lanes k"],
) -> tuple[Lanes, Parameters, Flags]:
    """Solve F(z; p) = 0 and S(z, p) = S* from guesses near a set.

    Each step is a correction onto the set and a move along its tangent space: folds are regular
    points, and descriptors are differentiated along d directions only. With fewer descriptors than
    directions the move is the shortest one.

    Parameters
    ----------
    setting
        Structure and free parameters.
    at
        Guesses, with bases of spaces near the tangent spaces.
    wanted
        S* for each lane; at most d descriptors.

    Returns
    -------
    z, p, and whether the last correction was at round-off.
    """
    z, p, rows = at.z.copy(), at.p.copy(), at.rows
    found, todo = np.zeros(len(z), bool), np.arange(len(z))
    for _ in range(ITERATIONS):
        if len(todo) == 0:
            break
        onto, frames = correction_and_tangents(setting, SetPoints(z[todo], p[todo], rows[todo]))
        step = onto + _move(setting, (z[todo], p[todo]), (onto, frames), descriptors, wanted[todo])
        size = step_lengths(setting, step)
        alive = np.isfinite(size)
        share = np.minimum(1.0, LONGEST / np.maximum(size, 1e-300))
        dz, dp = split_step(setting, share[:, None] * step)
        own = todo[alive]
        z[own] += dz[alive]
        p[own] += dp[alive]
        found[todo[alive & (size < EXACT)]] = True
        todo = todo[alive & (size >= EXACT)]
    return z, p, found


def correction_and_tangents(
    setting: Setting, at: SetPoints
) -> tuple[Float[np.ndarray, "lanes full"], Frames]:
    """Newton correction onto the set along the normal space of the rows, and tangents.

    ``[F_z F_p; R] [d t_i] = [(−F, 0) (0, e_i)]``; the tangents are orthonormal in the metric.
    """
    structure, free, n = setting.structure, setting.free, setting.structure.unknowns
    (lanes, size), d = at.z.shape, len(setting.free)
    columns = np.empty((lanes, d, size))
    for k in range(d):
        dp = np.zeros_like(at.p)
        dp[:, free[k]] = setting.scales[k]
        columns[:, k] = structure.parameter_derivative(at.z, at.p, dp)
    root = np.sqrt(structure.mass)
    by_z = np.zeros((lanes, d, size))
    by_z[:, :, :n] = at.rows[:, :, :n] * root
    rhs = np.zeros((lanes, d + 1, size + d))
    rhs[:, 0, :size] = -structure.residual(at.z, at.p)
    rhs[:, 1:, size:] = np.eye(d)
    border = (columns, by_z, np.ascontiguousarray(at.rows[:, :, n:]))
    raw = structure.solve(at.z, at.p, rhs, border).x
    kernel = raw[:, 1:]
    placed = np.concatenate([kernel[:, :, :n] * root, kernel[:, :, size:]], axis=2)
    gram = placed @ np.swapaxes(placed, 1, 2)
    whole = np.isfinite(gram).all(axis=(1, 2)) & (np.linalg.det(np.nan_to_num(gram)) > 0.0)
    gram[~whole] = np.eye(d)
    frames = np.linalg.solve(np.linalg.cholesky(gram), kernel)
    frames[~whole] = np.nan
    return raw[:, 0], frames


def step_lengths(setting: Setting, step: Float[np.ndarray, "lanes full"]) -> Values:
    """Lengths of steps in the metric and scaled parameters."""
    n, d = setting.structure.unknowns, len(setting.free)
    squared = step[:, :n] ** 2 @ setting.structure.mass
    return np.asarray(np.sqrt(squared + (step[:, step.shape[1] - d :] ** 2).sum(axis=1)))


def _move(
    setting: Setting,
    here: tuple[Lanes, Parameters],
    ahead: tuple[Float[np.ndarray, "lanes full"], Frames],
    descriptors: tuple[Descriptor, ...],
    wanted: Float[np.ndarray, "lanes k"],
) -> Float[np.ndarray, "lanes full"]:
    """Shortest move along the tangents that takes the descriptors to their values."""
    (z, p), (onto, frames) = here, ahead
    lanes, d = len(z), frames.shape[1]
    dz, dp = split_step(setting, np.concatenate([onto, *np.moveaxis(DIFFERENCE * frames, 1, 0)]))
    base_z, base_p = z + dz[:lanes], p + dp[:lanes]
    points_z, points_p = [base_z], [base_p]
    for k in range(1, d + 1):
        part = slice(k * lanes, (k + 1) * lanes)
        points_z += [base_z + dz[part], base_z - dz[part]]
        points_p += [base_p + dp[part], base_p - dp[part]]
    all_z, all_p = np.concatenate(points_z), np.concatenate(points_p)
    values = np.stack([each.function(all_z, all_p) for each in descriptors], axis=1)
    values = values.reshape(2 * d + 1, lanes, -1)
    slopes = np.moveaxis(values[1::2] - values[2::2], 0, 2) / (2.0 * DIFFERENCE)
    good = np.isfinite(slopes).all(axis=(1, 2)) & np.isfinite(values[0]).all(axis=1)
    slopes[~good] = 0.0
    along = np.einsum("ldk,lk->ld", np.linalg.pinv(slopes, rcond=1e-12), wanted - values[0])
    move = np.asarray(np.einsum("ld,ldf->lf", along, frames))
    move[~good] = np.nan
    return move
