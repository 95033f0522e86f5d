"""Continuation of natural states along straight lines in the parameters."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Flags, Parameters, Values
from equimorph.structures.rod.interface import Mechanics

FIRST_STEP = 0.25
SMALLEST_STEP = 1e-8
ITERATIONS = 7
CONVERGED = 1e-6
"""Newton correction after which the error is below 1e-11, on the way."""
BEND = 0.5
"""Largest second Newton correction relative to the first: beyond, the step may change branches."""


@dataclass(frozen=True, eq=False)
class Part:
    """One part of the way, from `start` to `stop`: with λ = 0 and the span free, or prescribed.

    `sharpening` lanes end where the elements no longer resolve them; span: number of the parameter
    that is the span; multiplier: place of λ in z.
    """

    start: Parameters
    stop: Parameters
    free: bool
    sharpening: Flags
    span: int = 3
    multiplier: int = -2


@dataclass(frozen=True, eq=False)
class Point:
    """Lanes on the way: share t of the part, x = (z, span), and dx/dt where the span is held."""

    t: Values
    x: Float[np.ndarray, "lanes extended"]
    slope: Float[np.ndarray, "lanes extended"]

    def __getitem__(self, lanes: np.ndarray) -> "Point":
        """Some lanes."""
        return Point(self.t[lanes], self.x[lanes], self.slope[lanes])

    def put(self, lanes: np.ndarray, other: "Point") -> None:
        """Overwrite some lanes."""
        self.t[lanes], self.x[lanes], self.slope[lanes] = other.t, other.x, other.slope


def follow(
    rod: Mechanics, part: Part, x: Float[np.ndarray, "lanes extended"]
) -> tuple[Values, Float[np.ndarray, "lanes extended"]]:
    """Move x = (z, span) along a part: the share of it that was reached, 1 if all, and x there."""
    here = newton(rod, part, np.arange(len(x)), np.zeros(len(x)), x)[0]
    before = Point(here.t.copy(), here.x.copy(), here.slope.copy())
    step = np.full(len(x), FIRST_STEP)
    for _ in range(400):
        active = np.flatnonzero((here.t < 1.0) & (step > SMALLEST_STEP))
        if len(active) == 0:
            break
        old = here[active]
        target = np.minimum(old.t + step[active], 1.0)
        guess = old.x if part.free else _predicted(before[active], old, target)
        new, bend = newton(rod, part, active, target, guess)
        if not part.free:
            way, off = (np.abs(new.x - x).max(axis=1) for x in (old.x, guess))
            bend = np.maximum(bend, off / np.maximum(way, 1e-6))
        good = bend <= BEND
        before.put(active[good], old[good])
        here.put(active[good], new[good])
        step[active] *= np.clip(np.sqrt(0.5 * BEND / np.maximum(bend, 1e-12)), 0.3, 3.0)
    return here.t, here.x


def _predicted(before: Point, here: Point, t: Values) -> Float[np.ndarray, "lanes extended"]:
    """Cubic through two points with their slopes; the line where there is one point only."""
    width = here.t - before.t
    alone = width == 0.0
    width = np.where(alone, 1.0, width)[:, None]
    s = (t[:, None] - before.t[:, None]) / width
    cubic = before.x + s * s * (3.0 - 2.0 * s) * (here.x - before.x)
    cubic += width * s * (s - 1.0) * ((s - 1.0) * before.slope + s * here.slope)
    line = here.x + (t - here.t)[:, None] * here.slope
    return np.asarray(np.where(alone[:, None], line, cubic))


def newton(
    rod: Mechanics,
    part: Part,
    lanes: Int[np.ndarray, " lanes"],
    t: Values,
    guess: Float[np.ndarray, "lanes extended"],
) -> tuple[Point, Values]:
    """Solve at share t of the part; the point, and the second correction relative to the first.

    Infinite where Newton does not converge, the equilibrium is not stable (the free span also needs
    dν/dλ < 0), or the elements no longer resolve it.
    """
    change = part.stop[lanes] - part.start[lanes]
    at = part.start[lanes] + t[:, None] * change
    z, nu = np.ascontiguousarray(guess[:, :-1]), at[:, part.span].copy()
    velocity, row, corner = change, np.zeros_like(z), np.ones(len(z))
    if part.free:
        nu, velocity, corner = guess[:, -1].copy(), np.zeros_like(at), np.zeros(len(z))
        velocity[:, part.span], row[:, part.multiplier] = 1.0, 1.0
    first, worst = np.zeros(len(z)), np.zeros(len(z))
    for k in range(ITERATIONS):
        at[:, part.span] = nu
        defect = z[:, part.multiplier] if part.free else np.zeros(len(z))
        step = rod.advance(z, at, velocity, row, corner, defect)
        z = z + step.dz
        nu = nu + step.dt if part.free else nu
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
        slope[:, :-1] = step.tangent_z
        slope[:, -1] = change[:, part.span]
    return Point(t, np.concatenate([z, nu[:, None]], axis=1), slope), bend
