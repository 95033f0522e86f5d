"""The natural state of the arch: unloaded, continued from the straight rod."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.structures.rod.mechanics import RodMechanics

Lanes = Float[np.ndarray, "lanes size"]
Parameters = Float[np.ndarray, "lanes parameters"]
Values = Float[np.ndarray, " lanes"]
Flags = Bool[np.ndarray, " lanes"]

FIRST_STEP = 0.25
SMALLEST_STEP = 1e-8
ITERATIONS = 7
CONVERGED = 1e-6
"""Newton correction after which the error is below 1e-11, on the way."""
BEND = 0.5
"""Largest second Newton correction relative to the first: beyond, the step may change branches."""
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


def natural_arch(rod: RodMechanics, p: Parameters) -> Natural:
    """State at q = 0 reached from the straight rod, per lane.

    First λ = 0 and ν free while (Θ, Δ) grow from 0 to their values; then ν moves to its value with
    (Θ, Δ) held. Lanes with Θ ≤ 0 (no upright side) have none, nor those where either part meets a
    fold or loses stability, nor those whose bends become too sharp for the elements.
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


def _continue(
    rod: RodMechanics, p: Parameters, lanes: Int[np.ndarray, " some"], out: Natural
) -> None:
    """Fill in the natural states of some lanes."""
    stop = p[lanes] * [1.0, 1.0, 0.0, 1.0]
    x = np.zeros((len(lanes), rod.size + 1))
    x[:, -1] = 1.0
    out.scale[lanes], x = _follow(rod, _free_part(stop), x)
    out.span[lanes], free = x[:, -1], out.scale[lanes] >= 1.0
    out.outcome[lanes[~free]] = Outcome.FREE_FOLD
    lanes, x, stop = lanes[free], x[free], stop[free]
    start = stop.copy()
    start[:, 3] = x[:, -1]
    # a rod that is pulled straighter cannot fold, but bends within ever shorter ends
    stretched = stop[:, 3] > start[:, 3]
    last = _Part(start, stop, False, stretched & rod.resolved(x[:, :-1], start))
    t, x = _follow(rod, last, x)
    out.span[lanes], there = x[:, -1], t >= 1.0
    out.outcome[lanes[~there]] = np.where(stretched, Outcome.UNRESOLVED, Outcome.SPAN_FOLD)[~there]
    reached = np.flatnonzero(there)
    exact = _newton(rod, last, reached, np.ones(len(reached)), x[reached])[0].x[:, :-1]
    out.z[lanes[reached]] = exact


@dataclass(frozen=True, eq=False)
class _Part:
    """One part of the way, from `start` to `stop`: with λ = 0 and ν free, or with ν prescribed.

    `sharpening` lanes end where the elements no longer resolve them.
    """

    start: Parameters
    stop: Parameters
    free: bool
    sharpening: Flags


def _free_part(stop: Parameters) -> _Part:
    """From the straight rod to the end angles, with the span free."""
    return _Part(stop * [0.0, 0.0, 0.0, 1.0], stop, True, np.zeros(len(stop), bool))


@dataclass(frozen=True, eq=False)
class _Point:
    """Lanes on the way: share t of the part, x = (z, ν), and its slope dx/dt where ν is held."""

    t: Values
    x: Float[np.ndarray, "lanes extended"]
    slope: Float[np.ndarray, "lanes extended"]

    def __getitem__(self, lanes: np.ndarray) -> "_Point":
        return _Point(self.t[lanes], self.x[lanes], self.slope[lanes])

    def put(self, lanes: np.ndarray, other: "_Point") -> None:
        """Overwrite some lanes."""
        self.t[lanes], self.x[lanes], self.slope[lanes] = other.t, other.x, other.slope


def _follow(
    rod: RodMechanics, part: _Part, x: Float[np.ndarray, "lanes extended"]
) -> tuple[Values, Float[np.ndarray, "lanes extended"]]:
    """Move x = (z, ν) along a part: the share of it that was reached, 1 if all, and x there."""
    here = _newton(rod, part, np.arange(len(x)), np.zeros(len(x)), x)[0]
    before = _Point(here.t.copy(), here.x.copy(), here.slope.copy())
    step = np.full(len(x), FIRST_STEP)
    for _ in range(400):
        active = np.flatnonzero((here.t < 1.0) & (step > SMALLEST_STEP))
        if len(active) == 0:
            break
        old = here[active]
        target = np.minimum(old.t + step[active], 1.0)
        guess = old.x if part.free else _predicted(before[active], old, target)
        new, bend = _newton(rod, part, active, target, guess)
        if not part.free:
            way, off = (np.abs(new.x - x).max(axis=1) for x in (old.x, guess))
            bend = np.maximum(bend, off / np.maximum(way, 1e-6))
        good = bend <= BEND
        before.put(active[good], old[good])
        here.put(active[good], new[good])
        step[active] *= np.clip(np.sqrt(0.5 * BEND / np.maximum(bend, 1e-12)), 0.3, 3.0)
    return here.t, here.x


def _predicted(before: _Point, here: _Point, t: Values) -> Float[np.ndarray, "lanes extended"]:
    """Cubic through two points with their slopes; the line where there is one point only."""
    width = here.t - before.t
    alone = width == 0.0
    width = np.where(alone, 1.0, width)[:, None]
    s = (t[:, None] - before.t[:, None]) / width
    cubic = before.x + s * s * (3.0 - 2.0 * s) * (here.x - before.x)
    cubic += width * s * (s - 1.0) * ((s - 1.0) * before.slope + s * here.slope)
    line = here.x + (t - here.t)[:, None] * here.slope
    return np.asarray(np.where(alone[:, None], line, cubic))


def _newton(
    rod: RodMechanics,
    part: _Part,
    lanes: Int[np.ndarray, " lanes"],
    t: Values,
    guess: Float[np.ndarray, "lanes extended"],
) -> tuple[_Point, Values]:
    """Solve at share t of the part; the point, and the second correction relative to the first.

    Infinite where Newton does not converge, the equilibrium is not stable (the free span also needs
    dν/dλ < 0), or the elements no longer resolve it.
    """
    change = part.stop[lanes] - part.start[lanes]
    at = part.start[lanes] + t[:, None] * change
    z, nu, span = np.ascontiguousarray(guess[:, :-1]), guess[:, -1].copy(), at[:, 3].copy()
    velocity, row = np.zeros_like(at), np.zeros_like(z)
    velocity[:, 3] = 1.0
    row[:, -2] = float(part.free)
    corner = np.full(len(z), float(not part.free))
    first, worst = np.zeros(len(z)), np.zeros(len(z))
    for k in range(ITERATIONS):
        at[:, 3] = nu
        step = rod.advance(z, at, velocity, row, corner, z[:, -2] if part.free else nu - span)
        z, nu = z + step.dz, nu + step.dt
        size = np.abs(step.dz).max(axis=1)
        first = size if k == 0 else first
        worst = worst if k == 0 else np.maximum(worst, size)
        if not (size > CONVERGED).any():
            break
    stable = (step.index == 0) & ((step.tangent_t < 0.0) if part.free else True)
    good = stable & (size <= CONVERGED)
    if part.sharpening[lanes].any():
        good &= rod.resolved(z, at) | ~part.sharpening[lanes]
    bend = np.where(good, worst / np.maximum(first, 1e-6), np.inf)
    slope = np.zeros_like(guess)
    if not part.free:  # the last matrix is that of the point, but for a correction below 1e-6
        slope[:, :-1] = step.tangent_z * change[:, 3:]
        slope[:, -1] = change[:, 3]
    return _Point(t, np.concatenate([z, nu[:, None]], axis=1), slope), bend
