"""Maxima of functions of two parameters that are smooth in pieces, and of the least of several."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float, Pair, Values
from equimorph.model import Box
from equimorph.tasks.optimising.quadratic import Quadratic, solve

Function = Callable[[Float[np.ndarray, "lanes 2"]], Values]

NINE = np.stack(np.meshgrid((-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0), indexing="ij"), -1).reshape(-1, 2)
"""Settings around and in the middle of a square, for parabolas."""
DIRECTIONS = 12
"""Settings on a circle that are tried at once; as many again at 0.3 of its radius."""
SMALLEST_RADIUS = 1e-5
"""Radius of the search, in its first one, at which it ends."""
ROUNDS = 40
"""Most circles."""
MISFIT = 0.05
"""Share of the range of values that a parabola misses at most where the ground is smooth."""

Pieces = Callable[[Float[np.ndarray, "lanes 2"]], Float[np.ndarray, "lanes m"]]

ITERATIONS = 30
"""Most steps."""
DIFFERENCE = 1e-4
"""Step of differences, in radii."""
GENTLE = 1e-3
"""Curvature that makes the model strictly convex, in slopes per radius."""
SMALLEST_REACH = 1e-7
"""Reach, in radii, at which the search ends."""
SHORTER = 0.3 ** np.arange(4.0)
"""Shares of the reach that are tried at once; the longest step that gains something is made."""


@dataclass(frozen=True)
class LocalMaximum:
    """A local maximum: setting, value, remaining slope, whether the function is smooth there."""

    setting: Pair
    value: float
    slope: Pair
    smooth: bool


def climb(
    function: Function, start: Pair, radius: Pair, box: Box, smallest: float = SMALLEST_RADIUS
) -> LocalMaximum:
    """Local maximum of a function in a box, from a start; not a number counts as lowest.

    Settings on a circle, turned in every round, are tried; the radius is halved where none is
    better. On smooth ground the top of a parabola through nine values finishes.

    `smallest`: radius of the search, in its first one, at which it ends.
    """
    here, value, size = start, float(_values(function, start[None], box)[0]), 1.0
    for number in range(ROUNDS):
        if size < smallest:
            break
        angle = 2.0 * np.pi * (np.arange(DIRECTIONS) + 0.382 * number) / DIRECTIONS
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        tried = here + size * radius * np.concatenate([ring, 0.3 * ring])
        values = _values(function, tried, box)
        best = int(values.argmax())
        if values[best] > value + 1e-13 * abs(value):
            here, value = np.clip(tried[best], box.lower, box.upper), float(values[best])
        else:
            size *= 0.5
            # a parabola that misses the values around misses those at half the distance, too
            if not _is_smooth(0.3 * ring, values[DIRECTIONS:], value):
                continue
            done = _parabola(function, here, value, size * radius, box)
            if done is not None:
                return done
    return LocalMaximum(here, value, np.full(2, np.nan), False)


def _values(function: Function, settings: Float[np.ndarray, "lanes 2"], box: Box) -> Values:
    inside = np.clip(settings, box.lower, box.upper)
    return np.nan_to_num(function(inside), nan=-np.inf)


def _is_smooth(
    places: Float[np.ndarray, "n 2"], values: Float[np.ndarray, " n"], middle: float
) -> bool:
    """Whether a parabola fits values around a place and in its middle."""
    at, found = np.vstack([places, np.zeros(2)]), np.append(values, middle)
    if not np.isfinite(found).all():
        return False
    terms = _terms(at / np.abs(at).max())
    fit, *_ = np.linalg.lstsq(terms, found, rcond=None)
    return bool(np.abs(terms @ fit - found).max() <= MISFIT * np.ptp(found))


def _terms(at: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 6"]:
    """Terms of a parabola at places."""
    columns = np.ones(len(at)), at, at[:, 0] ** 2, at.prod(1), at[:, 1] ** 2
    return np.column_stack(columns)


def _parabola(
    function: Function, place: Pair, value: float, radius: Pair, box: Box
) -> LocalMaximum | None:
    """Top by Newton's method on parabolas, if the ground is smooth and the top inside."""
    share = 1.0
    slope = np.full(2, np.nan)
    for _ in range(6):
        at = place + share * radius * NINE
        if not box.holds(at).all():
            return None
        found = function(at)
        terms = _terms(NINE)
        if not np.isfinite(found).all():
            return None
        fit, *_ = np.linalg.lstsq(terms, found, rcond=None)
        if np.abs(terms @ fit - found).max() > MISFIT * np.ptp(found):
            return None
        bend = np.array([[2 * fit[3], fit[4]], [fit[4], 2 * fit[5]]])
        if np.linalg.eigvalsh(bend).max() >= 0.0:
            return None
        step = -np.linalg.solve(bend, fit[1:3])
        if np.abs(step).max() > 3.0:
            return None
        place = place + share * radius * step
        slope = fit[1:3] / (share * radius)
        if np.abs(step).max() < 1e-3 and share < 0.3:
            break
        share = max(0.3 * share, 0.02)
    top = float(_values(function, place[None], box)[0])
    return LocalMaximum(place, top, slope, True) if top >= value - 1e-9 * abs(value) else None


def maximise_least(
    pieces: Pieces, start: Pair, radius: Pair, box: Box, smallest: float = SMALLEST_REACH
) -> tuple[Pair, float]:
    """Setting near a start whose smallest value is largest, and that value.

    Not a number counts as zero. Jumps are no obstacle for the steps, but no ridge to follow either.

    `smallest`: reach, in radii, at which the search ends.
    """
    here, reach = start, 0.5
    around = _around(pieces, here[None], radius, box)[0]
    for _ in range(ITERATIONS):
        if reach < smallest:
            break
        # the next points come with their neighbours: a call costs more than its lanes
        reaches = reach * SHORTER
        steps = [_step(around, here, radius, each, box) for each in reaches]
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
    """Values at places and around them, for central differences; not a number counts as zero."""
    ways = DIFFERENCE * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    many = np.clip(places[:, None] + ways * radius, box.lower, box.upper)
    values = np.nan_to_num(pieces(many.reshape(-1, 2)), nan=0.0)
    return np.asarray(values.reshape(len(places), len(ways), -1))


def _step(
    values: Float[np.ndarray, "5 m"], here: Pair, radius: Pair, reach: float, box: Box
) -> Float[np.ndarray, " 2"] | None:
    """Step, in radii, to the largest least value of the linear models."""
    slopes = np.stack([values[1] - values[2], values[3] - values[4]], axis=1) / (2.0 * DIFFERENCE)
    steepest = max(float(np.abs(slopes).max()), 1e-12)
    sides = np.array([(box.lower - here) / radius, (here - box.upper) / radius]).ravel()
    walls = np.concatenate([-np.eye(2), np.eye(2)])
    model = Quadratic(-values[0], -slopes, sides, walls, GENTLE * steepest * np.eye(2))
    answer = solve(model, reach)
    return None if answer is None else answer.step
