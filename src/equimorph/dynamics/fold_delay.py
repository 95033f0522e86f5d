"""How late a structure snaps when its parameters move through a fold at a finite rate.

Near a fold the motion follows ``m ẍ + c ẋ = a t + b x²`` along the critical mode, with t since the
fold. With damping alone it reaches infinity at ``2.338 (c²/(a b))^⅓``, 2.338 the first zero of
the Airy function: as a ∝ rate, the delay of the parameter grows with rate^⅔. Inertia adds to it.
See [BerglundGentz2006]_, section 2.2.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from equimorph.dynamics.balance import Balance, Course

BEFORE = 6.0
"""Where the motion begins, in units of the time of the normal form before the fold."""
PROBE = 1e-4
"""Step of difference quotients along the critical mode, relative to a turn of one radian."""


@dataclass(frozen=True)
class FoldDelay:
    """The normal form of a fold along a motion.

    Attributes
    ----------
    inertia, resistance, drive, curvature
        m, c, a, b.
    reach
        Largest displacement of a point for x = 1.
    """

    inertia: float
    resistance: float
    drive: float
    curvature: float
    reach: float

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
            del t
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
