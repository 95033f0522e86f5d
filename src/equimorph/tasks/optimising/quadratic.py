"""Small quadratic programmes with the largest of several linear functions, by active sets."""

from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np

from equimorph.arrays import Bool, Float, Int

Vector = Float[np.ndarray, " d"]

SLACK = 1e-9
"""Violation of a linear constraint, relative to its slope, that counts as none."""
PARALLEL = 1e-5
"""Relative difference of rows that count as one."""
NEGATIVE = 1e-9
"""Size of a negative multiplier that counts as zero."""
SINGULAR = 1e-14
"""Determinant of a KKT matrix that counts as zero."""
MOST = 14
"""Functions and constraints that are tried, those that bind first."""


@dataclass(frozen=True)
class Quadratic:
    """Least ``max_i (f_i + a_i·c) + ½ cᵀHc`` with ``g_j + b_j·c ≤ 0``; H positive definite."""

    f: Float[np.ndarray, " m"]
    a: Float[np.ndarray, "m d"]
    g: Float[np.ndarray, " k"]
    b: Float[np.ndarray, "k d"]
    hessian: Float[np.ndarray, "d d"]


@dataclass(frozen=True)
class QuadraticStep:
    """Step, multipliers of the functions (their sum is 1) and of the constraints."""

    step: Vector
    weights: Float[np.ndarray, " m"]
    multipliers: Float[np.ndarray, " k"]


def solve(problem: Quadratic, reach: float) -> QuadraticStep | None:
    """Solve by trying sets of up to d + 1 active rows; None without a feasible step.

    The programme is strictly convex: the first set whose KKT point is feasible, with multipliers
    that are not negative, is the answer. Small sets are tried first; d is at most a few. `reach`
    bounds each coordinate of the step.
    """
    d = problem.a.shape[1]
    # functions become the largest relative to the one that is so now
    highest = int(problem.f.argmax())
    functions = _binding(problem.f - problem.f.max(), problem.a - problem.a[highest], reach)
    functions = np.union1d(functions, highest)
    functions = functions[_different(problem.f[functions], problem.a[functions])]
    constraints = _binding(problem.g, problem.b, reach)
    small = Quadratic(
        problem.f[functions],
        problem.a[functions],
        np.concatenate([problem.g[constraints], np.full(2 * d, -reach)]),
        np.concatenate([problem.b[constraints], np.eye(d), -np.eye(d)]),
        problem.hessian,
    )
    for total in range(1, d + 2):
        for size in range(1, min(total, len(functions)) + 1):
            found = _first(small, size, total - size)
            if found is not None:
                weights, multipliers = np.zeros(len(problem.f)), np.zeros(len(problem.g))
                weights[functions] = found.weights
                multipliers[constraints] = found.multipliers[: len(constraints)]
                return QuadraticStep(found.step, weights, multipliers)
    return None


def _binding(
    value: Float[np.ndarray, " n"], slope: Float[np.ndarray, "n d"], reach: float
) -> Int[np.ndarray, " some"]:
    """Rows that may become active within reach, the most violated first."""
    size = np.linalg.norm(slope, axis=1)
    able = np.isfinite(value) & (value + 2.0 * reach * size + 1e-12 >= 0.0)
    some = np.flatnonzero(able)
    pressing = np.argsort(-value[some] / np.maximum(size[some], 1e-12), kind="stable")
    return np.asarray(some[pressing][:MOST])


def _different(
    value: Float[np.ndarray, " n"], slope: Float[np.ndarray, "n d"]
) -> Int[np.ndarray, " some"]:
    """Rows that repeat no earlier one: equal extrema of an inflectional rod, say."""
    rows = np.concatenate([value[:, None], slope], axis=1)
    gap = np.abs(rows[:, None] - rows[None]).max(axis=2)
    close = gap <= PARALLEL * (1.0 + np.abs(rows).max(axis=1))
    return np.flatnonzero(~np.tril(close, -1).any(axis=1))


def _first(problem: Quadratic, size: int, more: int) -> QuadraticStep | None:
    """KKT point with `size` functions and `more` constraints active, if it is the solution."""
    (m, d), k = problem.a.shape, len(problem.g)
    own = np.array(list(combinations(range(m), size)), int).reshape(comb(m, size), size)
    rows = np.array(list(combinations(range(k), more)), int).reshape(comb(k, more), more)
    first, second = np.divmod(np.arange(len(own) * len(rows)), max(len(rows), 1))
    own, rows = own[first], rows[second]
    x, regular = kkt_points(problem, own, rows)
    step, level = x[:, :d], x[:, d]
    good = regular & (x[:, d + 1 :] >= -NEGATIVE).all(axis=1)
    room = SLACK * (1.0 + np.abs(problem.f).max())
    good &= (problem.f + step @ problem.a.T - level[:, None] <= room).all(axis=1)
    room_g = SLACK * (1.0 + np.linalg.norm(problem.b, axis=1))
    good &= (problem.g + step @ problem.b.T <= room_g).all(axis=1)
    hits = np.flatnonzero(good)
    if len(hits) == 0:
        return None
    at = hits[0]
    weights, multipliers = np.zeros(m), np.zeros(k)
    weights[own[at]], multipliers[rows[at]] = x[at, d + 1 : d + 1 + size], x[at, d + 1 + size :]
    return QuadraticStep(step[at], weights, multipliers)


def kkt_points(
    problem: Quadratic, own: Int[np.ndarray, "sets size"], rows: Int[np.ndarray, "sets more"]
) -> tuple[Float[np.ndarray, "sets unknowns"], Bool[np.ndarray, " sets"]]:
    """Step, level and multipliers with functions and constraints active; where they are unique."""
    d, size = problem.a.shape[1], own.shape[1]
    count = d + 1 + size + rows.shape[1]
    matrix, rhs = np.zeros((len(own), count, count)), np.zeros((len(own), count))
    f, g = slice(d + 1, d + 1 + size), slice(d + 1 + size, count)
    matrix[:, :d, :d] = problem.hessian
    matrix[:, f, :d], matrix[:, g, :d] = problem.a[own], problem.b[rows]
    matrix[:, f, d] = -1.0
    matrix[:, : d + 1, d + 1 :] = np.swapaxes(matrix[:, d + 1 :, : d + 1], 1, 2)
    rhs[:, d], rhs[:, f], rhs[:, g] = -1.0, -problem.f[own], -problem.g[rows]
    regular = np.abs(np.linalg.det(matrix)) > SINGULAR
    matrix[~regular] = np.eye(count)
    return np.linalg.solve(matrix, rhs[:, :, None])[:, :, 0], regular
