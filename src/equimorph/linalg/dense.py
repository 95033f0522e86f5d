"""Dense bordered solves: for small structures, and where the condensed factorisation is unsafe.

See docs/decisions.md, "Unsafe pivots are refined, then replaced by pivoting".
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from equimorph.arrays import Determinants, Flags, Float, Lanes, Numbers, Values
from equimorph.linalg.dense_kernels import solve_dense
from equimorph.linalg.determinants import clear_overflows
from equimorph.linalg.kernels import multiply_lanes, orthonormal_lanes

Border = tuple[
    Float[np.ndarray, "lanes k size"],
    Float[np.ndarray, "lanes k size"],
    Float[np.ndarray, "lanes k k"],
]
"""Columns, rows and corner around a matrix."""


@lru_cache(maxsize=64)
def no_border(lanes: int, size: int) -> Border:
    """Border of no columns and no rows; without any entry, so that all may share it."""
    nothing = np.zeros((lanes, 0, size))
    return nothing, nothing, np.zeros((lanes, 0, 0))


@dataclass(frozen=True)
class BorderedSolution:
    """Solutions of ``[A C; R D] x = rhs`` for symmetric saddle-point matrices A, with inertia.

    x holds one solution per right-hand side; `negative` counts the negative eigenvalues of A;
    `pivot_ratio` is the smallest over the largest pivot (1 where pivoting made it irrelevant);
    `pivoted` flags lanes that took the pivoted dense factorisation; `determinant` is that of A
    as m and e of m·2^e, m nan where it is not at hand.
    """

    x: Float[np.ndarray, "lanes sides bordered"]
    negative: Numbers
    pivot_ratio: Values
    pivoted: Flags
    determinant: Determinants

    def take_over(self, lanes: Numbers, again: "BorderedSolution") -> None:
        """Enter what some lanes were found to have when they were solved again."""
        self.x[lanes], self.negative[lanes] = again.x, again.negative
        self.determinant[lanes] = again.determinant


def multiply(x: Lanes, matrix: Float[np.ndarray, "size ..."]) -> Float[np.ndarray, "lanes ..."]:
    """``x @ matrix`` for a matrix or vector, every lane the same bit for bit in any batch.

    Libraries choose the order of summation by the number of rows.
    """
    wide = np.ascontiguousarray(matrix.reshape(len(matrix), -1))
    out = np.empty((len(x), wide.shape[1]))
    multiply_lanes(np.ascontiguousarray(x), wide, out)
    return out.reshape(len(x), *matrix.shape[1:])


def orthonormal_rows(
    rows: Float[np.ndarray, "lanes rows width"], count: int, weights: Float[np.ndarray, " width"]
) -> Float[np.ndarray, "lanes rows width"]:
    """Make the first `count` rows of each lane orthonormal, and the others orthogonal to these.

    Gram and Schmidt in the metric with the diagonal `weights`: the first row keeps its direction.
    Rows of NaN where the first ones are dependent.
    """
    out = np.array(rows, order="C")
    orthonormal_lanes(out, count, weights)
    return out


def solve_bordered(
    matrix: Float[np.ndarray, "lanes n n"],
    columns: Float[np.ndarray, "lanes k n"],
    rows: Float[np.ndarray, "lanes k n"],
    corner: Float[np.ndarray, "lanes k k"],
    rhs: Float[np.ndarray, "lanes sides bordered"],
) -> BorderedSolution:
    """Solve ``[A Cᵀ; R D] x = rhs`` per lane by LU with partial pivoting, with the inertia of A.

    The inertia is that of LDLᵀ with rook pivoting [AshcraftGrimesLewis1998]_ within the bound of
    [BunchParlett1971]_; −1 where entries are not finite, or become so. Libraries would hand more
    than a hundred rows to threads that spin while they wait.

    Parameters
    ----------
    matrix
        Symmetric A.
    columns, rows, corner
        Border; k may be 0.
    rhs
        Right-hand sides of length n + k, one per row.

    Returns
    -------
    Solutions; lanes whose bordered matrix is singular or not finite are filled with NaN.
    """
    (lanes, n, _), k = matrix.shape, columns.shape[1]
    full = np.empty((lanes, n + k, n + k + rhs.shape[1]))
    full[:, :n, :n] = matrix
    full[:, :n, n : n + k] = columns.transpose(0, 2, 1)
    full[:, n:, :n] = rows
    full[:, n:, n : n + k] = corner
    full[:, :, n + k :] = rhs.transpose(0, 2, 1)
    whole = np.isfinite(full[:, :n, :n]).all(axis=(1, 2))
    x, determinant = np.empty(rhs.shape), np.empty((lanes, 2))
    negative = np.empty(lanes, dtype=np.int64)
    solve_dense(full, n + k, np.array(matrix, order="C"), x, negative, determinant)
    negative[~whole] = -1
    determinant[~whole] = np.nan
    clear_overflows(determinant)
    return BorderedSolution(x, negative, np.ones(lanes), np.ones(lanes, bool), determinant)
