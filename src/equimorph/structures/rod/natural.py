"""The natural state of the arch: unloaded, continued from the straight rod."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from jaxtyping import Int

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.structures.rod.continuation import Part, follow, newton
from equimorph.structures.rod.interface import Mechanics

SMALLEST = 1e-3
"""End angles, √(Θ² + Δ²), below which the way leads over larger ones with the same ratio: the rod
buckles at once, within round-off of the straight one, and small ones are regular afterwards."""
BLOCK = 1024
"""Lanes continued together: their arrays stay in the cache."""


class Outcome(IntEnum):
    """How the continuation to a natural state ended."""

    FOUND = 0
    NOT_UPRIGHT = 1
    FREE_FOLD = 2
    SPAN_FOLD = 3
    UNRESOLVED = 4


@dataclass(frozen=True, eq=False)
class Natural:
    """Natural states, how each was met, and where the continuation ended.

    `scale` is the share of the end angles that the free rod has borne, `span` the last span.
    """

    z: Lanes
    outcome: Int[np.ndarray, " lanes"]
    scale: Values
    span: Values


def natural_arch(rod: Mechanics, p: Parameters) -> Natural:
    """State at q = 0 reached from the straight rod, per lane.

    First λ = 0 and ν free while (Θ, Δ) grow from 0 to their values; then ν moves to its value with
    (Θ, Δ) held. Very small (Θ, Δ) are enlarged on this way, and reached from there with ν held.
    Lanes with Θ ≤ 0 (no upright side) have none, nor those where either part meets a fold or loses
    stability, nor those whose bends become too sharp for the elements.
    """
    lanes = len(p)
    out = Natural(
        np.full((lanes, rod.size), np.nan), np.zeros(lanes, int), np.zeros(lanes), np.ones(lanes)
    )
    upright = p[:, 0] > 0.0
    out.outcome[~upright] = Outcome.NOT_UPRIGHT
    for block in np.array_split(np.flatnonzero(upright), lanes // BLOCK + 1):
        _continue(rod, p, block, out)
    return out


def _continue(rod: Mechanics, p: Parameters, lanes: Int[np.ndarray, " some"], out: Natural) -> None:
    """Fill in the natural states of some lanes."""
    size, goal = np.hypot(p[lanes, 0], p[lanes, 1]), p[lanes] * [1.0, 1.0, 0.0, 1.0]
    stop = goal.copy()
    stop[:, :2] *= np.maximum(1.0, SMALLEST / size)[:, None]
    x = np.zeros((len(lanes), rod.size + 1))
    x[:, -1] = 1.0
    out.scale[lanes], x = follow(rod, free_part(stop), x)
    out.span[lanes], free = x[:, -1], out.scale[lanes] >= 1.0
    out.outcome[lanes[~free]] = Outcome.FREE_FOLD
    lanes, x, stop, goal = lanes[free], x[free], stop[free], goal[free]
    start = stop.copy()
    start[:, 3] = x[:, -1]
    # a rod that is pulled straighter cannot fold, but bends within ever shorter ends
    stretched = stop[:, 3] > start[:, 3]
    sharpening = stretched & rod.resolved(x[:, :-1], start)
    last = Part(start, stop, free=False, sharpening=sharpening)
    t, x = follow(rod, last, x)
    out.span[lanes], there = x[:, -1], t >= 1.0
    out.outcome[lanes[~there]] = np.where(stretched, Outcome.UNRESOLVED, Outcome.SPAN_FOLD)[~there]
    small = np.flatnonzero(there & (stop != goal).any(axis=1))
    if len(small):
        none = np.zeros(len(small), bool)
        t, x[small] = follow(rod, Part(stop[small], goal[small], False, none), x[small])
        there[small] = t >= 1.0
        out.outcome[lanes[small[t < 1.0]]] = Outcome.SPAN_FOLD
    last = Part(start, goal, free=False, sharpening=sharpening)
    reached = np.flatnonzero(there)
    exact = newton(rod, last, reached, np.ones(len(reached)), x[reached])[0].x[:, :-1]
    out.z[lanes[reached]] = exact


def free_part(stop: Parameters) -> Part:
    """From the straight rod to the end angles, with the span free."""
    still = np.zeros(len(stop), bool)
    return Part(stop * [0.0, 0.0, 0.0, 1.0], stop, free=True, sharpening=still)
