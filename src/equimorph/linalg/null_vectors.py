"""Unit vectors near the null vectors of nearly singular matrices, by bordered solves."""

from collections.abc import Callable

import numpy as np

from equimorph.arrays import Float, Lanes
from equimorph.linalg.dense import Border

ROUNDS = 4
"""Solves, each of which turns the border towards the null vector."""

Sides = Float[np.ndarray, "lanes sides bordered"]


def near_null(
    solve: Callable[[Sides, Border], Sides], lanes: int, size: int
) -> Float[np.ndarray, "lanes size"]:
    """Unit vectors by rounds of ``[A b; bᵀ 0] [v; g] = [0; 1]``, b the direction of the v before.

    The bordered matrix stays regular where A is singular.
    """
    # hardly any null vector is orthogonal to these
    v = np.asarray((np.cos(1.3 * np.arange(size)) + 1.1)[None].repeat(lanes, axis=0))
    corner, rhs = np.zeros((lanes, 1, 1)), np.zeros((lanes, 1, size + 1))
    rhs[:, 0, -1] = 1.0
    for _ in range(ROUNDS):
        b = _unit_rows(v)[:, None]
        v = solve(rhs, (b, b, corner))[:, 0, :-1]
    return _unit_rows(v)


def _unit_rows(vectors: Lanes) -> Lanes:
    """Vectors over their lengths."""
    return np.asarray(vectors / np.sqrt((vectors * vectors).sum(axis=1, keepdims=True)))
