"""Equilibria of a mechanism along a motion of its parameters, and the fold at which they end.

`fold_delay` says how late a structure snaps when its parameters move through a fold at a finite
rate. Near a fold the motion follows ``m ẍ + c ẋ = a t + b x²`` along the critical mode, with t
since the fold. With damping alone it reaches infinity at ``2.338 (c²/(a b))^⅓``, 2.338 the first
zero of the Airy function: as a ∝ rate, the delay of the parameter grows with rate^⅔. Inertia adds
to it. See [BerglundGentz2006]_, section 2.2.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import eigh, null_space

from equimorph.arrays import Float
from equimorph.dynamics.mechanism import Mechanism, Pulls, Settings, Vector

NEWTON_STEPS = 40
CONVERGED = 1e-10
"""Largest Newton step, in radians and lengths of the structure, that counts as none."""
LARGEST_STEP = 0.5
"""Largest change in one Newton step."""
SAME_BRANCH = 0.5
"""Largest difference of a move from the first Newton steps forth and back between its ends,
relative to it. Across a pair of folds, ``x³ − x = t``, the one back is a third at most."""
PENALTY = 1.0
"""Stiffness of closures relative to all others with which a stable equilibrium shows itself."""
NEAR = 1e-3
"""Difference from the first Newton steps, in radians and lengths of the structure, that is none."""
NARROWEST = 1e-7
"""Shortest step in time, relative to the whole, with which equilibria are followed to a fold."""
FOLD_STEPS = 8
"""Extrapolations to a fold by the square of the smallest eigenvalue."""
SHARPEST = 1e-13
"""Relative change of the time of a fold that is round-off."""
SMALL = 0.1
"""Share of ω² at the start below which an end of equilibria is a fold."""
Course = Callable[[float], Settings]
"""Settings by time."""
BEFORE = 6.0
"""Where the motion begins, in units of the time of the normal form before the fold."""
PROBE = 1e-4
"""Step of difference quotients along the critical mode, relative to a turn of one radian."""


@dataclass(frozen=True, eq=False)
class Balance:
    """An equilibrium of a mechanism: entries, multipliers, settings; its time on a course."""

    linkage: Mechanism
    v: Vector
    multipliers: Pulls
    y: Settings
    time: float = 0.0

    @property
    def places(self) -> Float[np.ndarray, "members joints space"]:
        """Places of the joints between links."""
        return self.linkage.places(self.v)

    def reduce(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Stiffness and mass on the null space of the constraints, and its basis."""
        linkage, size = self.linkage, self.linkage.size
        whole = linkage.jacobian(self.v, self.multipliers, self.y)
        free = linkage.free
        inner = null_space(whole[size:, :size][:, free])
        basis = np.zeros((size, inner.shape[1]))
        basis[free] = inner
        stiff = basis.T @ whole[:size, :size] @ basis
        mass = basis.T @ linkage.mass(self.v) @ basis
        return 0.5 * (stiff + stiff.T), mass, basis

    def modes(self) -> tuple[Float[np.ndarray, " modes"], Float[np.ndarray, "entries modes"]]:
        """Squares of angular frequencies, ascending, and modes of unit mass."""
        stiff, mass, basis = self.reduce()
        values, vectors = eigh(stiff, mass)
        return values, basis @ vectors

    @property
    def stable(self) -> bool:
        """Whether it is stable.

        So it is where the stiffness is positive definite with some penalty on the constraints.
        """
        linkage, size = self.linkage, self.linkage.size
        whole = linkage.jacobian(self.v, self.multipliers, self.y)
        free = np.flatnonzero(linkage.free)
        stiff, closed = whole[np.ix_(free, free)], whole[size:, free]
        try:
            np.linalg.cholesky(stiff + PENALTY * np.trace(stiff) * closed.T @ closed)
        except np.linalg.LinAlgError:
            return self.least > 0.0
        return True

    @property
    def least(self) -> float:
        """Square of the lowest angular frequency; negative where the equilibrium is unstable."""
        stiff, mass, _ = self.reduce()
        return float(eigh(stiff, mass, eigvals_only=True, subset_by_index=(0, 0))[0])


def balance(linkage: Mechanism, v: Vector, multipliers: Pulls, y: Settings) -> Balance | None:
    """Equilibrium near a guess, by Newton's method; None if it does not converge."""
    steps: list[float] = []
    v, multipliers = linkage.prescribe(v, y), multipliers.copy()
    free = int(linkage.free.sum())
    for _ in range(NEWTON_STEPS):
        step = _newton_step(linkage, v, multipliers, y)
        if step is None:
            return None
        largest = float(np.abs(step[:free]).max())
        steps.append(largest)
        step *= min(1.0, LARGEST_STEP / max(largest, 1e-300))
        v[linkage.free] += step[:free]
        multipliers += step[free:]
        if largest < CONVERGED or (len(steps) > 1 and largest**3 < CONVERGED * steps[-2] ** 2):
            return Balance(linkage, v, multipliers, y)
    return None


def _newton_step(
    linkage: Mechanism, v: Vector, multipliers: Pulls, y: Settings
) -> Float[np.ndarray, " unknown"] | None:
    """Newton step of free entries and multipliers; None where there is none."""
    unknown = linkage.unknown
    residual = linkage.residual(v, multipliers, y)[unknown]
    if not np.isfinite(residual).all():
        return None
    matrix = linkage.jacobian(v, multipliers, y)[np.ix_(unknown, unknown)]
    try:
        return np.asarray(np.linalg.solve(matrix, -residual))
    except np.linalg.LinAlgError:
        return None


@dataclass(frozen=True, eq=False)
class Quasistatics:
    """Equilibria at times, as far as they are stable.

    fold: time of the fold at which they end; None where there is none, nan where Newton's method
    lost them for another reason.
    last: the equilibrium nearest to it.
    """

    balances: tuple[Balance, ...]
    fold: float | None
    last: Balance


def follow(start: Balance, course: Course, times: Float[np.ndarray, " times"]) -> Quasistatics:
    """Stable equilibria at all times, each from the ones before."""
    found, here = [start], replace(start, time=float(times[0]))
    before: Balance | None = None
    for time in times[1:].tolist():
        step = time - here.time
        while here.time < time:
            new = _next(here, before, min(time, here.time + step), course)
            if new is None:
                step *= 0.5
                if step < NARROWEST * (times[-1] - times[0]):
                    fold, last = fold_time(here, before, course, start.least)
                    return Quasistatics(tuple(found), fold, last)
                continue
            before, here = here, new
        found.append(here)
    return Quasistatics(tuple(found), None, here)


def _next(here: Balance, before: Balance | None, time: float, course: Course) -> Balance | None:
    """The stable equilibrium at a time, if the one before leads to it."""
    v, multipliers = here.v, here.multipliers
    if before is not None and here.time > before.time:
        share = (time - here.time) / (here.time - before.time)
        v = v + share * (v - before.v)
        multipliers = multipliers + share * (multipliers - before.multipliers)
    new = balance(here.linkage, v, multipliers, course(time))
    if new is None or not (new.stable and _leads(here, new) and _leads(new, here)):
        return None
    return replace(new, time=time)


def _leads(here: Balance, there: Balance) -> bool:
    """Whether the move from one equilibrium to another is about what its tangent predicts."""
    linkage = here.linkage
    v = linkage.prescribe(here.v, there.y)
    step = _newton_step(linkage, v, here.multipliers, there.y)
    if step is None:
        return False
    moved = (there.v - v)[linkage.free]
    gap, way = (float(np.abs(each).max()) for each in (step[: len(moved)] - moved, moved))
    return way < LARGEST_STEP and gap <= SAME_BRANCH * way + NEAR


def fold_time(
    here: Balance, before: Balance | None, course: Course, rest: float
) -> tuple[float, Balance]:
    """Time at which equilibria end, where ω² vanishes as the square root of the time left.

    nan where ω² does not fall to a small share of its value `rest` at the start, as when Newton's
    method fails elsewhere.
    """
    known = [(each.time, each.least**2) for each in (before, here) if each is not None]
    end = here.time
    for _ in range(FOLD_STEPS):
        if len(known) < 2:
            break
        (t0, e0), (t1, e1) = known[-2:]
        if e1 >= e0 or t1 <= t0:
            break
        end = t1 + (t1 - t0) * e1 / (e0 - e1)
        new = balance(here.linkage, here.v, here.multipliers, course(end - 0.1 * (end - t1)))
        if new is None or new.least <= 0.0 or end - t1 < SHARPEST * max(abs(end), 1.0):
            break
        here = new
        known.append((end - 0.1 * (end - t1), new.least**2))
    return (end if here.least < SMALL * rest else float("nan")), here


@dataclass(frozen=True)
class FoldDelay:
    """The normal form of a fold along a motion."""

    inertia: float
    resistance: float
    drive: float
    curvature: float
    """m, c, a, b."""
    reach: float
    """Largest displacement of a point for x = 1."""

    def lateness(self, departure: float) -> float:
        """Time after the fold at which a point has moved by `departure` from where the fold is.

        nan where the coefficients are no fold that the motion leaves.
        """
        product = self.drive * self.curvature
        if not (product > 0.0 and self.inertia > 0.0 and self.reach > 0.0):
            return float("nan")
        damped = (self.resistance**2 / product) ** (1.0 / 3.0)
        inertial = (self.inertia**2 / product) ** 0.2
        unit = max(damped, inertial)
        far = departure / self.reach
        early = -BEFORE * unit
        rest = -np.sqrt(-self.drive * early / self.curvature)

        def rates(t: float, state: Any) -> list[float]:
            x, velocity = state
            force = self.drive * t + self.curvature * x * x - self.resistance * velocity
            return [velocity, force / self.inertia]

        def left(t: float, state: Any) -> float:
            return float(state[0] - far)

        left.terminal = True  # type: ignore[attr-defined]  # how solve_ivp takes it
        creep = 0.5 * self.drive / (self.curvature * abs(rest))
        found = solve_ivp(
            rates, (early, 40.0 * unit), [rest, creep], events=left, rtol=1e-8, atol=1e-12 * far,
            method="LSODA",
        )  # fmt: skip
        return float(found.t_events[0][0]) if len(found.t_events[0]) else float("nan")


def fold_delay(
    last: Balance, time: float, course: Course, damping: float, unit: float = 1.0
) -> FoldDelay:
    """Normal form of the fold near an equilibrium, for a motion that passes it at a time.

    The equilibrium is close to the fold, on the stable side. Damping is that of elastic joints over
    their stiffness, in the linkage's unit of time, whose value in the time of the course is `unit`.
    """
    linkage, unknown = last.linkage, last.linkage.unknown
    size = linkage.size
    _, modes = last.modes()
    mode = modes[:, 0]
    mode = mode / np.abs(mode).max()
    whole = linkage.jacobian(last.v, last.multipliers, last.y)
    forces = np.linalg.lstsq(
        whole[:size, size:][linkage.free], -(whole[:size, :size] @ mode)[linkage.free], rcond=None
    )[0]
    wide = np.concatenate([mode, forces])

    def along(step: float) -> np.ndarray:
        v, multipliers = last.v + step * mode, last.multipliers + step * forces
        return np.asarray(linkage.jacobian(v, multipliers, last.y))

    third = wide @ (along(PROBE) - along(-PROBE)) @ wide / (2.0 * PROBE)
    step = 1e-5 * max(abs(time), 1.0)
    rate = np.zeros(len(unknown))
    for sign in (1.0, -1.0):
        y = course(time + sign * step)
        v = linkage.prescribe(last.v, y)
        rate += sign * linkage.residual(v, last.multipliers, y) / (2.0 * step)
    drive, curvature = -float(wide @ rate), -0.5 * float(third)
    if curvature < 0.0:  # the mode points to the stable side
        drive, curvature = -drive, -curvature
    joints = linkage.stiffness
    moved = linkage.places(last.v + PROBE * mode) - linkage.places(last.v - PROBE * mode)
    reach = float(np.linalg.norm(moved, axis=2).max()) / (2.0 * PROBE)
    return FoldDelay(
        float(unit**2 * (mode @ linkage.mass(last.v) @ mode)),
        float(unit * damping * (mode @ joints @ mode)),
        drive,
        curvature,
        reach,
    )
