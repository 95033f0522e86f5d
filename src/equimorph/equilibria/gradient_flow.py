"""Gradient flow in the structure's metric, projected on the constraints, until it settles."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from equimorph.arrays import Bool, Flags, Float, Int, Lanes, Numbers, Parameters, Some, Values
from equimorph.columns import Columns
from equimorph.equilibria.settle import Guards, settle
from equimorph.equilibria.soft_modes import extents_of_guesses
from equimorph.structures import Structure
from equimorph.structures.metric import metric_length
from equimorph.tolerances import CONVERGED, SAME_STATE


class Ending(IntEnum):
    """How a flow ended."""

    OPEN = -1
    """Not yet."""
    LANDED = 0
    SADDLE = 1
    ESCAPED = 2
    STUCK = 3
    SLOW = 4
    HELD = 5
    """It never began: the energy rises."""

    @property
    def reason(self) -> str:
        """One line."""
        return REASONS[self]


REASONS = {
    Ending.OPEN: "the flow goes on",
    Ending.LANDED: "the flow settled at a stable state",
    Ending.SADDLE: "the flow settled at a saddle",
    Ending.ESCAPED: "the flow left for infinity",
    Ending.STUCK: "no step of the flow, however short, could be solved",
    Ending.SLOW: "the flow did not settle within its number of steps",
    Ending.HELD: "the energy rises in this direction",
}


@dataclass(frozen=True)
class Pace:
    """How long the steps of a flow may be, and where it ends; no length is absolute."""

    change: float
    """Largest change of the velocity in one step, relative to the larger one of both."""
    near: float
    """Newton step to a stable state, relative to the way so far, from which on it is solved for."""
    steps: int
    """Most steps of one flow."""
    longest: float = 0.5
    """Length of a step, relative to the way so far."""


FAITHFUL = Pace(change=0.4, near=1e-2, steps=3000)
"""Follows the flow in time, until it is close to its end."""
QUICK = Pace(change=0.8, near=100.0, steps=400)
"""Looks for the end only: no energy barrier is stepped over."""
SMOOTH = Pace(change=0.1, near=1e-3, steps=3000, longest=0.1)
"""Shows the way itself."""
FIRST_STEP = 0.1
"""In units of the time 1/|eigenvalue| at the start."""
AIM = 0.6
"""Change of the velocity that the next step aims at, relative to the largest one."""
FAILURES = 20
"""Steps, each a quarter of the one before, that may fail one after the other."""
ITERATIONS = 12
"""Largest number of Newton iterations in one implicit step."""
SOLVED = 1e-8
"""Newton correction in the metric that is the last: the next one would be about its square."""
CLOSE, EXACT = 1e-2, 0.003 * SAME_STATE
"""The same, relative to the step of the flow, and the length that suffices for any step."""
FINEST = 0.03 * SAME_STATE
"""Length in the metric of steps that have no direction: round-off dominates there, near folds."""
ROUND_OFF = 1e-12
"""Rise of the energy, relative to it, that is no rise."""
CONTRACTION = 0.25
"""Of Newton's steps where they lead to the state at the end of the flow."""
NEAR_SADDLE = 1e-5
"""Newton step to a saddle, relative to the way so far, at which a flow has settled there."""
FARTHEST, EXTENTS = 100.0, 10.0
"""Way in the metric after which a flow has left, and the same in extents of the guesses; the larger
one counts."""


@dataclass(frozen=True)
class Flow:
    """How flows ended, and the way there.

    code: `Ending` of each lane; z: where; lanes, time, points: configurations on the way, sorted by
    lane and then by time.
    """

    code: Numbers
    z: Lanes
    lanes: Int[np.ndarray, " points"]
    time: Float[np.ndarray, " points"]
    points: Float[np.ndarray, "points size"]

    def lane(self, lane: int) -> "Flow":
        """One of the flows."""
        one, mine = slice(lane, lane + 1), self.lanes == lane
        return Flow(
            self.code[one],
            self.z[one],
            *(column[mine] for column in (self.lanes, self.time, self.points)),
        )


@dataclass(frozen=True)
class _Front(Columns):
    """Where flows are: lane, point, next step in time, last velocity, time, way, failed steps."""

    lanes: Some
    z: Float[np.ndarray, "some size"]
    h: Float[np.ndarray, " some"]
    velocity: Float[np.ndarray, "some unknowns"]
    time: Float[np.ndarray, " some"]
    travelled: Float[np.ndarray, " some"]
    failed: Some

    @property
    def moved(self) -> Bool[np.ndarray, " some"]:
        """Whether the last step was taken."""
        return np.asarray((self.failed == 0) & (self.time > 0.0))

    @classmethod
    def of(cls, z: Lanes, h: Values, length: Values, unknowns: int) -> "_Front":
        """At the start."""
        count = len(z)
        nothing, still = np.zeros(count), np.zeros((count, unknowns))
        return cls(np.arange(count), z, h, still, nothing, length, np.zeros(count, int))


def implicit_step(
    structure: Structure, z: Lanes, p: Parameters, h: Values, *, guess: Lanes | None = None
) -> tuple[Lanes, Flags]:
    """One implicit Euler step: ``M (u⁺ − u)/h + ∂L/∂u(u⁺, λ⁺) = 0``, ``c(u⁺) = 0``.

    Newton from `guess`, or from z. Where the Hessian of ``E(v) + ‖v − u‖²/(2h)`` on the constraints
    is positive definite, u⁺ is its minimum, so that the energy falls by ``‖u⁺ − u‖²/(2h)`` at least
    if u obeys the constraints.

    Returns points, and where Newton converged with a positive definite Hessian.
    """
    n, new = structure.unknowns, z.copy() if guess is None else guess.copy()
    solved, todo = np.zeros(len(z), bool), np.arange(len(z))
    before = np.full(len(z), np.inf)
    for _ in range(ITERATIONS):
        here, pull = new[todo], 1.0 / h[todo]
        rhs = -structure.residual(here, p[todo])
        rhs[:, :n] -= structure.mass * (here[:, :n] - z[todo, :n]) * pull[:, None]
        solution = structure.solve(here, p[todo], rhs[:, None], shift=-pull)
        dz = solution.x[:, 0]
        alive = np.isfinite(dz).all(axis=1)
        new[todo[alive]] += dz[alive]
        size = metric_length(structure, dz)
        step = metric_length(structure, new[todo] - z[todo])
        small = alive & (size < SOLVED) & (size <= np.maximum(CLOSE * step, EXACT))
        solved[todo[small]] = solution.negative[small] == structure.constraints
        # corrections that grow lead to another minimum, if to any
        alive &= size <= before[todo]
        before[todo] = size
        todo = todo[alive & ~small]
        if len(todo) == 0:
            break
    return new, solved


def gradient_flow(
    structure: Structure,
    z: Lanes,
    p: Parameters,
    rate: Values,
    length: Values,
    pace: Pace = FAITHFUL,
) -> Flow:
    """Follow ``M u̇ = −∂L/∂u``, ``c(u) = 0`` until it settles, from points with c(u) = 0.

    Implicit Euler steps, as long as the change of the velocity allows, and shorter than the way
    so far; only steps along which the energy falls are taken. Newton ends the flow where it
    contracts to a state of the same kind.

    Parameters
    ----------
    rate
        |eigenvalue| that rules the beginning of the flow: its inverse is the scale of time.
    length
        Way in the metric along which the energy is known to be smooth at the beginning.
    pace
        How long the steps may be, and how near the end must be.
    """
    front = _Front.of(z.copy(), FIRST_STEP / rate, length, structure.unknowns)
    code, last = np.full(len(z), Ending.SLOW.value), z.copy()
    far = np.maximum(FARTHEST, EXTENTS * extents_of_guesses(structure, p))
    way = [front]
    for _ in range(pace.steps):
        if len(front.lanes) == 0:
            break
        front = _advance(structure, front, p[front.lanes], pace)
        way.append(front.take(front.moved))
        end, last[front.lanes] = _ends(structure, front, p[front.lanes], pace)
        end[(end < 0) & (front.travelled > far[front.lanes])] = Ending.ESCAPED
        end[(end < 0) & (front.failed > FAILURES)] = Ending.STUCK
        ended = end >= 0
        code[front.lanes[ended]] = end[ended]
        front = front.take(~ended)
    points = zip(*((each.lanes, each.time, each.z) for each in way), strict=True)
    lanes, time, configurations = (np.concatenate(column) for column in points)
    order = np.lexsort((time, lanes))
    return Flow(code, last, lanes[order], time[order], configurations[order])


def _advance(structure: Structure, front: _Front, p: Parameters, pace: Pace) -> _Front:
    """One step of every flow, where it is solved, downhill and short enough; the next length."""
    n, h = structure.unknowns, front.h
    guess = front.z.copy()
    guess[:, :n] += h[:, None] * front.velocity
    new, solved = implicit_step(structure, front.z, p, h, guess=guess)
    du = new[:, :n] - front.z[:, :n]
    size = metric_length(structure, du)
    velocity = du / h[:, None]
    speed, speed_before = size / h, metric_length(structure, front.velocity)
    faster = np.maximum(np.maximum(speed, speed_before), FINEST / h)
    change = metric_length(structure, velocity - front.velocity) / faster
    change[~front.velocity.any(axis=1)] = 0.0  # the first step has none to compare with
    before, after = structure.energy(front.z, p), structure.energy(new, p)
    slack = ROUND_OFF * (1.0 + np.abs(before))
    # not a number is not downhill
    downhill = after + 0.5 * size**2 / h <= before + slack
    # else states could be stepped over that lie closer together than the step is long
    short = size <= pace.longest * front.travelled
    moved = solved & downhill & short & (change <= pace.change)
    # where the flow speeds up, the energy bends down ever more
    growing = np.where(speed > speed_before, 1.0 - change, 1.0)
    factor = np.clip(AIM * pace.change * growing / np.maximum(change, 1e-300), 0.25, 2.0)
    factor[front.failed > 0] = np.minimum(factor[front.failed > 0], 1.0)
    keep = moved[:, None]
    return _Front(
        front.lanes,
        np.where(keep, new, front.z),
        h * np.where(solved & downhill, np.where(short, factor, 0.5), 0.25),
        np.where(keep, velocity, front.velocity),
        front.time + np.where(moved, h, 0.0),
        front.travelled + np.where(moved, size, 0.0),
        np.where(moved, 0, front.failed + 1),
    )


def _ends(structure: Structure, front: _Front, p: Parameters, pace: Pace) -> tuple[Numbers, Lanes]:
    """How flows end here, −1 where they go on; and the points, settled ones polished."""
    z = front.z.copy()
    code = np.full(len(z), Ending.OPEN.value)
    solution = structure.solve(z, p, -structure.residual(z, p)[:, None])
    size = metric_length(structure, solution.x[:, 0])
    index = solution.negative - structure.constraints
    near = np.where(index == 0, pace.near, NEAR_SADDLE) * front.travelled
    some = np.flatnonzero(front.moved & (size <= near))
    if len(some) == 0:
        return code, z
    # the Newton point belongs to the flow if the landscape is of one kind all along the step
    there, own, step = z[some] + solution.x[some, 0], index[some], size[some]
    again = structure.solve(there, p[some], -structure.residual(there, p[some])[:, None])
    left = metric_length(structure, again.x[:, 0])
    contracts = left <= np.maximum(CONTRACTION * step, CONVERGED)
    energy = structure.energy(z[some], p[some])
    falls = structure.energy(there, p[some]) <= energy + ROUND_OFF * (1.0 + np.abs(energy))
    good = contracts & (again.negative - structure.constraints == own) & (falls | (own > 0))
    halfway = 0.5 * (z[some[good]] + there[good])
    good[good] = structure.index(halfway, p[some[good]]) == own[good]
    newton = settle(structure, there[good], p[some[good]], guards=Guards(iterations=15))
    away = metric_length(structure, newton.z - there[good])
    same = (
        newton.found
        & (newton.index == own[good])
        & (away <= 2.0 * np.maximum(CONTRACTION * step[good], CONVERGED))
    )
    done = some[good][same]
    code[done] = np.where(index[done] == 0, Ending.LANDED, Ending.SADDLE)
    z[done] = newton.z[same]
    return code, z
