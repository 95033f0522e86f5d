"""Dense bordered solves: for small structures, and where the condensed factorisation is unsafe."""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Flags, Float, Lanes, Numbers, Values
from equimorph.linalg.kernels import count_negative, multiply_lanes, orthonormal_lanes

Border = tuple[
    Float[np.ndarray, "lanes k size"],
    Float[np.ndarray, "lanes k size"],
    Float[np.ndarray, "lanes k k"],
]
"""Columns, rows and corner around a matrix."""


def no_border(lanes: int, size: int) -> Border:
    """Border of no columns and no rows."""
    nothing = np.zeros((lanes, 0, size))
    return nothing, nothing, np.zeros((lanes, 0, 0))


@dataclass(frozen=True)
class BorderedSolution:
    """Solutions of ``[A C; R D] x = rhs`` for symmetric saddle-point matrices A, with inertia.

    x holds one solution per right-hand side; `negative` counts the negative eigenvalues of A;
    `pivot_ratio` is the smallest over the largest pivot (1 where pivoting made it irrelevant);
    `pivoted` flags lanes that took the pivoted dense factorisation; `determinant` is that of A,
    nan where it is not at hand or beyond the range of numbers.
    """

    x: Float[np.ndarray, "lanes sides bordered"]
    negative: Numbers
    pivot_ratio: Values
    pivoted: Flags
    determinant: Values


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


def negative_eigenvalues(matrix: Float[np.ndarray, "lanes n n"]) -> Numbers:
    """Count the negative eigenvalues of symmetric matrices.

    LDLᵀ with complete pivoting [BunchParlett1971]_ and Sylvester's law of inertia. A matrix with
    entries that are not finite, or become so, counts as −1.
    """
    out = np.full(len(matrix), -1, dtype=np.int64)
    finite = np.isfinite(matrix)
    if finite.all():
        count_negative(np.ascontiguousarray(matrix), out)
    elif (usable := finite.all(axis=(1, 2))).any():
        out[usable] = negative_eigenvalues(matrix[usable])
    return out


def solve_bordered(
    matrix: Float[np.ndarray, "lanes n n"],
    columns: Float[np.ndarray, "lanes k n"],
    rows: Float[np.ndarray, "lanes k n"],
    corner: Float[np.ndarray, "lanes k k"],
    rhs: Float[np.ndarray, "lanes sides bordered"],
) -> BorderedSolution:
    """Solve ``[A Cᵀ; R D] x = rhs`` per lane by LU with partial pivoting, with the inertia of A.

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
    n, k = matrix.shape[1], columns.shape[1]
    full = np.empty((len(matrix), n + k, n + k))
    full[:, :n, :n] = matrix
    full[:, :n, n:] = columns.transpose(0, 2, 1)
    full[:, n:, :n] = rows
    full[:, n:, n:] = corner
    x = _solve(full, rhs.transpose(0, 2, 1)).transpose(0, 2, 1)
    ratio, pivoted = np.ones(len(matrix)), np.ones(len(matrix), bool)
    x, negative = np.ascontiguousarray(x), negative_eigenvalues(matrix)
    return BorderedSolution(x, negative, ratio, pivoted, _determinant(matrix))


def _determinant(matrix: Float[np.ndarray, "lanes n n"]) -> Values:
    with np.errstate(all="ignore"):
        product = np.asarray(np.linalg.det(matrix))
    if not np.isfinite(product).all():
        product[~np.isfinite(product)] = np.nan
    return product


def _solve(
    full: Float[np.ndarray, "lanes b b"], rhs: Float[np.ndarray, "lanes b sides"]
) -> Float[np.ndarray, "lanes b sides"]:
    every = np.isfinite(full).all() and np.isfinite(rhs).all()
    usable = (
        slice(None)
        if every
        else np.isfinite(full).all(axis=(1, 2)) & np.isfinite(rhs).all(axis=(1, 2))
    )
    x = np.full(rhs.shape, np.nan)
    x[usable] = _solve_in_halves(full[usable], rhs[usable])
    return x


def _solve_in_halves(
    full: Float[np.ndarray, "lanes b b"], rhs: Float[np.ndarray, "lanes b sides"]
) -> Float[np.ndarray, "lanes b sides"]:
    """Solutions, NaN in singular lanes: one of these fails its batch, which is halved then."""
    try:
        return np.asarray(np.linalg.solve(full, rhs))
    except np.linalg.LinAlgError:
        if len(full) == 1:
            return np.full(rhs.shape, np.nan)
    half = len(full) // 2
    parts = [_solve_in_halves(full[part], rhs[part]) for part in (slice(half), slice(half, None))]
    return np.concatenate(parts)
