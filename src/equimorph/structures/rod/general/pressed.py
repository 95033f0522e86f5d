"""The matrix of a rod under pressure, in which every angle works on every other one."""

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Entries

Angles = Float[np.ndarray, "lanes unknowns"]
Square = Float[np.ndarray, "unknowns unknowns"]

BLOCK = 128
"""Matrices put together at a time: calls cost little beside them."""


def lower_triangle(
    theta: Angles,
    pull: Float[np.ndarray, "lanes 1"],
    matrices: tuple[Square, Square],
    parts: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> Entries:
    """Entries of F_z, row by row: ``K_ij − p W_ij sin(θ_j − θ_i)``, then the multipliers' rows.

    Parameters
    ----------
    theta
        Unknown angles.
    pull
        Pressure p.
    matrices
        Stiffness K and W of the enclosed area.
    parts
        What the diagonal has besides, the multipliers' gradients, and their own block.
    """
    diagonal, border, trailing = parts
    (lanes, n), m = theta.shape, border.shape[1]
    entries = np.empty((lanes, (n + m) * (n + m + 1) // 2))
    for start in range(0, lanes, BLOCK):
        some = slice(start, start + BLOCK)
        entries[some, : n * (n + 1) // 2] = _angles(theta[some], pull[some], matrices).T
    entries[:, _row_ends(0, n)] += diagonal
    for k, stop in enumerate(_row_ends(n, n + m)):
        first = stop - n - k
        entries[:, first : first + n] = border[:, k]
        entries[:, first + n : stop + 1] = trailing[:, k, : k + 1]
    return entries


def _angles(
    theta: Angles, pull: Float[np.ndarray, "lanes 1"], matrices: tuple[Square, Square]
) -> Float[np.ndarray, "entries lanes"]:
    """Rows of the angles, lanes last, so that every operation runs along memory."""
    stiff, area = matrices
    sine, cosine = np.ascontiguousarray(np.sin(theta).T), np.ascontiguousarray(np.cos(theta).T)
    pressed_sine, pressed_cosine = (-pull[:, 0] * field for field in (sine, cosine))
    out = np.empty((len(stiff) * (len(stiff) + 1) // 2, len(theta)))
    for i, stop in enumerate(_row_ends(0, len(stiff))):
        row, before = out[stop - i : stop + 1], slice(0, i + 1)
        np.multiply(pressed_cosine[i], sine[before], out=row)
        row -= pressed_sine[i] * cosine[before]
        row *= area[i, before, None]
        row += stiff[i, before, None]
    return out


def _row_ends(first: int, stop: int) -> Int[np.ndarray, " rows"]:
    """Entries on the diagonal of some rows of a lower triangle."""
    rows = np.arange(first, stop)
    return rows * (rows + 3) // 2
