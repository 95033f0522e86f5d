"""Largest worst case of several functions of two numbers: linear models within a growing reach."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Pair
from equimorph.model import Box
from equimorph.tasks.optimising.quadratic import Quadratic, solve

Pieces = Callable[[Float[np.ndarray, "lanes 2"]], Float[np.ndarray, "lanes m"]]

ITERATIONS = 30
DIFFERENCE = 1e-4
"""Step of differences, in radii."""
GENTLE = 1e-3
"""Curvature that makes the model strictly convex, in slopes per radius."""
SMALLEST = 1e-7
"""Reach, in radii, at which the search ends."""
SHORTER = 0.3 ** np.arange(4.0)
"""Shares of the reach that are tried at once; the longest step that gains something is made."""


def raised(pieces: Pieces, start: Pair, radius: Pair, box: Box) -> tuple[Pair, float]:
    """Setting near a start whose smallest value is largest, and that value.

    Not a number counts as zero. Jumps are no obstacle for the steps, but no ridge to follow either.
    """
    here, reach = start, 0.5
    around = _around(pieces, here[None], radius, box)[0]
    for _ in range(ITERATIONS):
        if reach < SMALLEST:
            break
        # the next points come with what is around them: a call costs more than its lanes
        reaches = reach * SHORTER
        steps = [_step(around, here, (radius, each), box) for each in reaches]
        tried = [
            (each, step) for each, step in zip(reaches, steps, strict=True) if step is not None
        ]
        if not tried:
            reach *= SHORTER[-1]
            continue
        there = np.clip(here + np.array([step for _, step in tried]) * radius, box.lower, box.upper)
        found = _around(pieces, there, radius, box)
        after, value = found[:, 0].min(axis=1), around[0].min()
        better = np.flatnonzero(after > value)
        if len(better) == 0:
            reach = 0.3 * reaches[-1]
            continue
        first = better[0]
        gained, here, around = after[first] - value, there[first], found[first]
        reach = min(1.0, 1.7 * tried[first][0])
        if gained < 1e-12 * abs(after[first]):
            break
    return here, float(around[0].min())


def _around(
    pieces: Pieces, places: Float[np.ndarray, "lanes 2"], radius: Pair, box: Box
) -> Float[np.ndarray, "lanes 5 m"]:
    """Values at places and beside them, for differences; not a number counts as zero."""
    ways = DIFFERENCE * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    many = np.clip(places[:, None] + ways * radius, box.lower, box.upper)
    values = np.nan_to_num(pieces(many.reshape(-1, 2)), nan=0.0)
    return np.asarray(values.reshape(len(places), len(ways), -1))


def _step(
    values: Float[np.ndarray, "5 m"], here: Pair, size: tuple[Pair, float], box: Box
) -> Float[np.ndarray, " 2"] | None:
    """Step, in radii, to the largest least value of the linear models."""
    radius, reach = size
    slopes = np.stack([values[1] - values[2], values[3] - values[4]], axis=1) / (2.0 * DIFFERENCE)
    steepest = max(float(np.abs(slopes).max()), 1e-12)
    sides = np.array([(box.lower - here) / radius, (here - box.upper) / radius]).ravel()
    walls = np.concatenate([-np.eye(2), np.eye(2)])
    model = Quadratic(-values[0], -slopes, sides, walls, GENTLE * steepest * np.eye(2))
    answer = solve(model, reach)
    return None if answer is None else answer.step
