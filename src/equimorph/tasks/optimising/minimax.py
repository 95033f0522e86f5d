"""Largest worst case of several functions of two numbers: linear models within a growing reach."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from equimorph.model import Box
from equimorph.tasks.optimising.quadratic import Quadratic, solve

Pair = Float[np.ndarray, " 2"]
Pieces = Callable[[Float[np.ndarray, "lanes 2"]], Float[np.ndarray, "lanes m"]]

ITERATIONS = 30
DIFFERENCE = 1e-4
"""Step of differences, in radii."""
GENTLE = 1e-3
"""Curvature that makes the model strictly convex, in slopes per radius."""
SMALLEST = 1e-7
"""Reach, in radii, at which the search ends."""


def raised(pieces: Pieces, start: Pair, radius: Pair, box: Box) -> tuple[Pair, float]:
    """Setting near a start whose smallest value is largest, and that value.

    Not a number counts as zero. Jumps are no obstacle for the steps, but no ridge to follow either.
    """
    here, reach = start, 0.5
    value = float(_known(pieces(here[None]))[0].min())
    for _ in range(ITERATIONS):
        if reach < SMALLEST:
            break
        step = _step(pieces, here, (radius, reach), box)
        if step is None:
            reach *= 0.3
            continue
        there = np.clip(here + step * radius, box.lower, box.upper)
        after = float(_known(pieces(there[None]))[0].min())
        if after > value:
            gained, here, value = after - value, there, after
            reach = min(1.0, 1.7 * reach)
            if gained < 1e-12 * abs(value):
                break
        else:
            reach *= 0.3
    return here, value


def _known(values: Float[np.ndarray, "lanes m"]) -> Float[np.ndarray, "lanes m"]:
    return np.asarray(np.nan_to_num(values, nan=0.0))


def _step(
    pieces: Pieces, here: Pair, size: tuple[Pair, float], box: Box
) -> Float[np.ndarray, " 2"] | None:
    """Step, in radii, to the largest least value of the linear models."""
    radius, reach = size
    ways = DIFFERENCE * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    values = _known(pieces(np.clip(here + ways * radius, box.lower, box.upper)))
    slopes = np.stack([values[1] - values[2], values[3] - values[4]], axis=1) / (2.0 * DIFFERENCE)
    steepest = max(float(np.abs(slopes).max()), 1e-12)
    sides = np.array([(box.lower - here) / radius, (here - box.upper) / radius]).ravel()
    walls = np.concatenate([-np.eye(2), np.eye(2)])
    model = Quadratic(-values[0], -slopes, sides, walls, GENTLE * steepest * np.eye(2))
    answer = solve(model, reach)
    return None if answer is None else answer.step
