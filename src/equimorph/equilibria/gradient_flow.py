"""Gradient flow in the structure's metric, projected on the constraints, until it settles."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.arrays import Flags, Lanes, Parameters, Some, Values
from equimorph.equilibria.settle import Guards, settle
from equimorph.linalg import multiply
from equimorph.structures import Structure

LANDED, SADDLE, ESCAPED, STUCK, SLOW = range(5)
WHY = {
    LANDED: "the flow settled at a stable state",
    SADDLE: "the flow settled at a saddle",
    ESCAPED: "the flow left for infinity",
    STUCK: "no step of the flow, however short, could be solved",
    SLOW: "the flow did not settle within its number of steps",
}
STEPS = 3000
"""Largest number of implicit Euler steps of one flow."""
FIRST_STEP, SHORTEST_STEP = 0.1, 1e-12
"""In units of the time 1/|eigenvalue| at the start."""
ACCURACY = 5e-3
"""Error of one step in the metric that the step control aims at."""
ITERATIONS = 12
"""Largest number of Newton iterations in one implicit step."""
CONVERGED = 1e-8
"""Newton correction in the metric that is the last: the next one would be about its square."""
ROUND_OFF = 1e-12
"""Rise of the energy, relative to it, that is no rise."""
NEAR = 1e-2
"""Newton step to a stable state, in the metric, from which on it is solved for."""
NEAR_SADDLE = 1e-5
"""As `NEAR`, for an unstable state: a flow passes by most saddles, and ends only at one that it
comes so close to."""
FARTHEST = 100.0
"""Way in the metric after which a flow is taken to have left."""


@dataclass(frozen=True)
class Flow:
    """How flows ended, and the way there.

    code: how each lane ended; z: where; lanes, time, points: configurations on the way, sorted by
    lane and then by time.
    """

    code: Int[np.ndarray, " lanes"]
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
class _Front:
    """Where flows are: lane, point, next step in time, last velocity, time, way, whether moved."""

    lanes: Some
    z: Float[np.ndarray, "some size"]
    h: Float[np.ndarray, " some"]
    velocity: Float[np.ndarray, "some unknowns"]
    time: Float[np.ndarray, " some"]
    travelled: Float[np.ndarray, " some"]
    moved: Bool[np.ndarray, " some"]

    @classmethod
    def of(cls, z: Lanes, h: Values, unknowns: int) -> "_Front":
        """At the start."""
        count = len(z)
        nothing, still = np.zeros(count), np.zeros((count, unknowns))
        return cls(np.arange(count), z, h, still, nothing, nothing, np.zeros(count, bool))

    def take(self, at: Bool[np.ndarray, " some"]) -> "_Front":
        """Return some of the flows."""
        return _Front(*(column[at] for column in vars(self).values()))


def metric_length(structure: Structure, du: Float[np.ndarray, "lanes unknowns"]) -> Values:
    """Length of changes of the unknowns."""
    return np.asarray(np.sqrt(multiply(du**2, structure.mass)))


def implicit_step(
    structure: Structure, z: Lanes, p: Parameters, h: Values, *, guess: Lanes | None = None
) -> tuple[Lanes, Flags]:
    """One implicit Euler step: ``M (u⁺ − u)/h + ∂L/∂u(u⁺, λ⁺) = 0``, ``c(u⁺) = 0``.

    Newton from `guess`, or from z. Where the Hessian of ``E(v) + ‖v − u‖²/(2h)`` on the constraints
    is positive definite, u⁺ is its minimum, so that the energy falls by ``‖u⁺ − u‖²/(2h)`` at least
    if u obeys the constraints.

    Returns
    -------
    Points, and where Newton converged with a positive definite Hessian.
    """
    n, new = structure.unknowns, z.copy() if guess is None else guess.copy()
    solved, todo = np.zeros(len(z), bool), np.arange(len(z))
    for _ in range(ITERATIONS):
        here, pull = new[todo], 1.0 / h[todo]
        rhs = -structure.residual(here, p[todo])
        rhs[:, :n] -= structure.mass * (here[:, :n] - z[todo, :n]) * pull[:, None]
        solution = structure.solve(here, p[todo], rhs[:, None], shift=-pull)
        dz = solution.x[:, 0]
        alive = np.isfinite(dz).all(axis=1)
        new[todo[alive]] += dz[alive]
        small = alive & (metric_length(structure, dz[:, :n]) < CONVERGED)
        solved[todo[small]] = solution.negative[small] == structure.constraints
        todo = todo[alive & ~small]
        if len(todo) == 0:
            break
    return new, solved


def gradient_flow(structure: Structure, z: Lanes, p: Parameters, rate: Values) -> Flow:
    """Follow ``M u̇ = −∂L/∂u``, ``c(u) = 0`` until it settles, from points with c(u) = 0.

    Implicit Euler steps, as long as their error allows; only steps along which the energy falls are
    taken. Near a stable state Newton ends the flow there, if that costs no energy.

    Parameters
    ----------
    rate
        |eigenvalue| that rules the beginning of the flow: its inverse is the scale of time.
    """
    front = _Front.of(z.copy(), FIRST_STEP / rate, structure.unknowns)
    code, last = np.full(len(z), SLOW), z.copy()
    way = [front]
    for _ in range(STEPS):
        front = _advanced(structure, front, p[front.lanes])
        way.append(front.take(front.moved))
        end, point = _ends(structure, front, p[front.lanes], rate[front.lanes])
        ended = end >= 0
        code[front.lanes[ended]], last[front.lanes] = end[ended], point
        front = front.take(~ended)
        if len(front.lanes) == 0:
            break
    points = zip(*((each.lanes, each.time, each.z) for each in way), strict=True)
    lanes, time, configurations = (np.concatenate(column) for column in points)
    order = np.lexsort((time, lanes))
    return Flow(code, last, lanes[order], time[order], configurations[order])


def _advanced(structure: Structure, front: _Front, p: Parameters) -> _Front:
    """One step of every flow, where it is solved, accurate and downhill; and the next length."""
    n, h = structure.unknowns, front.h
    guess = front.z.copy()
    guess[:, :n] += h[:, None] * front.velocity
    new, solved = implicit_step(structure, front.z, p, h, guess=guess)
    du = new[:, :n] - front.z[:, :n]
    size = metric_length(structure, du)
    # ½ h² ü, from the velocities of this step and the one before
    error = 0.5 * metric_length(structure, du - h[:, None] * front.velocity)
    before, after = structure.energy(front.z, p), structure.energy(new, p)
    slack = ROUND_OFF * (1.0 + np.abs(before))
    # not a number is not downhill
    downhill = after + 0.5 * size**2 / h <= before + slack
    moved = solved & downhill & (error <= 2.0 * ACCURACY)
    factor = np.clip(np.sqrt(ACCURACY / np.maximum(error, 1e-300)), 0.25, 2.0)
    keep = moved[:, None]
    return _Front(
        front.lanes,
        np.where(keep, new, front.z),
        h * np.where(solved & downhill, factor, 0.25),
        np.where(keep, du / h[:, None], front.velocity),
        front.time + np.where(moved, h, 0.0),
        front.travelled + np.where(moved, size, 0.0),
        moved,
    )


def _ends(
    structure: Structure, front: _Front, p: Parameters, rate: Values
) -> tuple[Int[np.ndarray, " lanes"], Lanes]:
    """How flows end here, −1 where they go on; and the points, settled ones polished."""
    n, z = structure.unknowns, front.z.copy()
    code = np.full(len(z), -1)
    code[front.h * rate < SHORTEST_STEP] = STUCK
    code[front.travelled > FARTHEST] = ESCAPED
    solution = structure.solve(z, p, -structure.residual(z, p)[:, None])
    size = metric_length(structure, solution.x[:, 0, :n])
    index = solution.negative - structure.constraints
    near = np.flatnonzero(front.moved & (size < np.where(index == 0, NEAR, NEAR_SADDLE)))
    if len(near) == 0:
        return code, z
    newton = settle(structure, z[near], p[near], guards=Guards(iterations=12))
    there = newton.z
    close = metric_length(structure, there[:, :n] - z[near, :n]) < 2.0 * NEAR
    energy = structure.energy(z[near], p[near])
    lower = structure.energy(there, p[near]) <= energy + ROUND_OFF * (1.0 + np.abs(energy))
    same = newton.index == index[near]
    good = newton.found & close & same & (lower | (index[near] > 0))
    code[near[good]] = np.where(index[near[good]] == 0, LANDED, SADDLE)
    z[near[good]] = there[good]
    return code, z
