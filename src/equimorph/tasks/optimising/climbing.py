"""Climbing functions of two numbers that are smooth in places: parabolas, else a search."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Pair, Values
from equimorph.model import Box

Function = Callable[[Float[np.ndarray, "lanes 2"]], Values]

NINE = np.stack(np.meshgrid((-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0), indexing="ij"), -1).reshape(-1, 2)
DIRECTIONS = 12
SMALLEST = 1e-5
"""Radius of the search, in its first one, at which it ends."""
ROUNDS = 40


@dataclass(frozen=True)
class Top:
    """A local maximum: where, its value, what is left of the slope, whether it is smooth there."""

    setting: Pair
    value: float
    slope: Pair
    smooth: bool


def climb(function: Function, start: Pair, radius: Pair, box: Box) -> Top:
    """Local maximum of a function in a box, from a start; not a number counts as lowest.

    Settings on a circle, turned in every round, are tried; the radius is halved where none is
    better. On smooth ground the top of a parabola through nine values finishes.
    """
    here, value, size = start, float(_values(function, start[None], box)[0]), 1.0
    for number in range(ROUNDS):
        if size < SMALLEST:
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
            done = _parabola(function, (here, value), size * radius, box)
            if done is not None:
                return done
    return Top(here, value, np.full(2, np.nan), False)


def _values(function: Function, settings: Float[np.ndarray, "lanes 2"], box: Box) -> Values:
    inside = np.clip(settings, box.lower, box.upper)
    return np.nan_to_num(function(inside), nan=-np.inf)


def _parabola(function: Function, here: tuple[Pair, float], radius: Pair, box: Box) -> Top | None:
    """Top by Newton's method on parabolas, if the ground is smooth and the top inside."""
    place, value = here
    share = 1.0
    slope = np.full(2, np.nan)
    for _ in range(6):
        at = place + share * radius * NINE
        if not box.contains(at).all():
            return None
        found = function(at)
        terms = np.column_stack([np.ones(9), NINE, NINE[:, 0] ** 2, NINE.prod(1), NINE[:, 1] ** 2])
        if not np.isfinite(found).all():
            return None
        fit, *_ = np.linalg.lstsq(terms, found, rcond=None)
        if np.abs(terms @ fit - found).max() > 0.05 * np.ptp(found):
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
    return Top(place, top, slope, True) if top >= value - 1e-9 * abs(value) else None
