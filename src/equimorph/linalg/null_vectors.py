"""Unit vectors near the null vectors of nearly singular matrices, by bordered solves."""

from collections.abc import Callable

import numpy as np

from equimorph.arrays import Float, Lanes
from equimorph.linalg.dense import Border, BorderedSolution

ROUNDS = 4
"""Solves, each of which turns the border towards the null vector."""

Sides = Float[np.ndarray, "lanes sides bordered"]


def near_null(
    solve: Callable[[Sides, Border], BorderedSolution], lanes: int, size: int
) -> Float[np.ndarray, "lanes size"]:
    """Unit vectors by rounds of ``[A b; bᵀ 0] [v; g] = [0; 1]``, b the direction of the v before.

    The bordered matrix stays regular where A is singular.
    """
    v, corner, rhs = first_guess(lanes, size), np.zeros((lanes, 1, 1)), unit_sides(lanes, size)
    for _ in range(ROUNDS):
        b = unit_rows(v)[:, None]
        v = solve(rhs, (b, b, corner)).x[:, 0, :-1]
    return unit_rows(v)


def first_guess(lanes: int, size: int) -> Float[np.ndarray, "lanes size"]:
    """Vectors that no null vector is likely to be orthogonal to."""
    return np.asarray((np.cos(1.3 * np.arange(size)) + 1.1)[None].repeat(lanes, axis=0))


def unit_sides(lanes: int, size: int) -> Float[np.ndarray, "lanes 1 bordered"]:
    """Right-hand sides (0, 1)."""
    rhs = np.zeros((lanes, 1, size + 1))
    rhs[:, 0, -1] = 1.0
    return rhs


def unit_rows(vectors: Lanes) -> Lanes:
    """Vectors over their lengths."""
    return np.asarray(vectors / np.sqrt((vectors * vectors).sum(axis=1, keepdims=True)))
