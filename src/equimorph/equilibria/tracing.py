"""Pseudo-arclength tracing of many curves at once: the engine under every lift."""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.equilibria.curves import Curve, correction_size, dual, squared_length
from equimorph.model import Constraint

Lanes = Float[np.ndarray, "lanes size"]
Values = Float[np.ndarray, " lanes"]
Flags = Bool[np.ndarray, " lanes"]

ACCEPTED = 1e-7
"""Size of the last correction: Newton is quadratic, so the point itself is good to its square."""


@dataclass(frozen=True)
class TraceOptions:
    """Knobs of the tracer.

    first_step, largest_step, smallest_step: lengths in the metric. turning: angle between
    tangents that the step control aims at, radians. steps: limit per lane. locate_passed: whether
    folds and branch points that do not end a lane are located.
    """

    through_folds: bool = False
    through_branch_points: bool = False
    first_step: float = 0.05
    largest_step: float = 0.5
    smallest_step: float = 1e-7
    turning: float = 0.25
    steps: int = 2000
    record: bool = True
    locate_passed: bool = True


@dataclass(frozen=True)
class Front:
    """Points on the curves with unit tangents: where each lane is now."""

    z: Lanes
    t: Values
    tangent_z: Lanes
    tangent_t: Values
    index: Int[np.ndarray, " lanes"]

    def take(self, lanes: Int[np.ndarray, " some"] | Flags) -> "Front":
        """Return some of the lanes."""
        return Front(
            self.z[lanes],
            self.t[lanes],
            self.tangent_z[lanes],
            self.tangent_t[lanes],
            self.index[lanes],
        )


@dataclass(frozen=True)
class Bracket:
    """Steps in which something happened: lane numbers, both ends, step lengths, arclength before.

    what: bits of `ARRIVAL`, `RETURN`, `FOLD`, `BRANCH`, `CONSTRAINT`.
    """

    lanes: Int[np.ndarray, " some"]
    before: Front
    after: Front
    step: Float[np.ndarray, " some"]
    travelled: Float[np.ndarray, " some"]
    what: Int[np.ndarray, " some"]


ARRIVAL, RETURN, FOLD, BRANCH, CONSTRAINT = 1, 2, 4, 8, 16


@dataclass
class Traces:
    """What the tracer leaves: brackets of events, lost lanes, and the points if recorded."""

    brackets: list[Bracket] = field(default_factory=list)
    lost: dict[int, tuple[str, Front]] = field(default_factory=dict)
    points: list[tuple[Int[np.ndarray, " some"], Values, Front]] = field(default_factory=list)
    ended: dict[int, int] = field(default_factory=dict)


def initial_front(curve: Curve, z: Lanes, t: Values) -> Front:
    """Unit tangents at known points, pointing towards growing t."""
    still = np.zeros_like(z)
    one, none = np.ones(len(z)), np.zeros(len(z))
    step = curve.advance(z, t, still, one, none)
    return _unit(curve, Front(z + step.dz, t, step.tangent_z, step.tangent_t, step.index))


def _unit(curve: Curve, front: Front) -> Front:
    length = squared_length(curve.structure, curve.weight, front.tangent_z, front.tangent_t)
    norm = np.sqrt(length)
    return replace(
        front, tangent_z=front.tangent_z / norm[:, None], tangent_t=front.tangent_t / norm
    )


def step_along(curve: Curve, front: Front, length: Values, bend: Lanes) -> tuple[Front, Values, Flags]:
    """Go `length` along each curve: predict, correct, and tell the turning and the success.

    The predictor adds ½ length² times the curvature estimate `bend` (dT/ds); the corrector is
    Newton on the curve and the pseudo-arclength condition. A step counts only if the first
    correction is below a quarter of its length and the tangents stay within acos 0.9.
    """
    structure, weight = curve.structure, curve.weight
    row, corner = dual(structure, weight, front.tangent_z, front.tangent_t)
    dz = length[:, None] * front.tangent_z + 0.5 * (length**2)[:, None] * bend
    dt = length * front.tangent_t
    out = Front(front.z + dz, front.t + dt, front.tangent_z.copy(), front.tangent_t.copy(),
                front.index.copy())  # fmt: skip
    todo, good = np.arange(len(length)), np.zeros(len(length), bool)
    turning = np.full(len(length), np.pi)
    last = np.full(len(length), np.inf)
    for iteration in range(6):
        here = curve.take(todo)
        defect = np.einsum("li,li->l", row[todo], out.z[todo] - front.z[todo])
        defect += corner[todo] * (out.t[todo] - front.t[todo]) - length[todo]
        move = here.advance(out.z[todo], out.t[todo], row[todo], corner[todo], defect)
        size = correction_size(structure, here.weight, move.dz, move.dt)
        limit = 0.25 * length[todo] if iteration == 0 else 0.5 * last[todo]
        alive = size <= np.maximum(limit, ACCEPTED)
        out.z[todo[alive]] += move.dz[alive]
        out.t[todo[alive]] += move.dt[alive]
        last[todo] = size
        done = alive & (size <= ACCEPTED)
        ready = todo[done]
        out.tangent_z[ready], out.tangent_t[ready] = move.tangent_z[done], move.tangent_t[done]
        out.index[ready], good[ready] = move.index[done], True
        todo = todo[alive & ~done]
        if len(todo) == 0:
            break
    # row·tangent = 1 by construction, so the cosine of the turning is 1 over the new length
    norm = np.sqrt(squared_length(structure, weight, out.tangent_z, out.tangent_t))
    cosine = np.where(good, 1.0 / norm, -1.0)
    turning = np.arccos(np.clip(cosine, -1.0, 1.0))
    good &= cosine >= 0.9
    return _unit(curve, out), turning, good


@dataclass(frozen=True)
class _Step:
    """One attempted step of the active lanes."""

    after: Front
    turning: Values
    good: Flags
    what: Int[np.ndarray, " lanes"]


def _attempt(
    curve: Curve,
    front: Front,
    length: Values,
    bend: Lanes,
    constraints: tuple[Constraint, ...],
) -> _Step:
    after, turning, good = step_along(curve, front, length, bend)
    flipped = np.sign(after.tangent_t) != np.sign(front.tangent_t)
    changed = np.abs(after.index - front.index)
    fold, branch = flipped & (changed == 1), ~flipped & (changed == 1)
    what = np.where(fold, FOLD, 0) | np.where(branch, BRANCH, 0)
    what |= np.where(after.t >= 1.0, ARRIVAL, 0) | np.where(after.t < 0.0, RETURN, 0)
    good &= (changed <= 1) & (flipped == fold)
    # a fold hides an arrival if t went beyond 1 (or below 0) and came back within the step
    reach = front.t + front.tangent_t * length
    hidden = np.where(front.tangent_t > 0.0, reach >= 1.0, reach <= 0.0)
    good &= ~(fold & (hidden | (what > FOLD)))
    if constraints and good.any():
        lanes = np.flatnonzero(good)
        z, p = after.z[lanes], curve.take(lanes).parameters(after.t[lanes])
        for constraint in constraints:
            violated = constraint.excess(z, p) > 0.0
            what[lanes[violated]] |= CONSTRAINT
    return _Step(after, turning, good, what)


def trace(
    curve: Curve,
    front: Front,
    constraints: tuple[Constraint, ...] = (),
    options: TraceOptions | None = None,
) -> Traces:
    """Follow each curve from its point at t = 0 until it arrives, returns or something ends it.

    Lanes march together; finished ones leave the batch. Events are bracketed here and located
    afterwards (`location`), all of a kind at once.
    """
    options = options or TraceOptions()
    traces = Traces()
    lanes = np.arange(len(front.z))
    length = np.full(len(lanes), options.first_step)
    travelled, steps = np.zeros(len(lanes)), np.zeros(len(lanes), int)
    bend = np.zeros_like(front.z)
    broken = ~np.isfinite(front.tangent_z).all(axis=1)
    for lane in np.flatnonzero(broken):
        traces.lost[int(lane)] = ("the start is singular", front.take(np.array([lane])))
    keep = np.flatnonzero(~broken)
    stop = ARRIVAL | RETURN | CONSTRAINT
    stop |= 0 if options.through_folds else FOLD
    stop |= 0 if options.through_branch_points else BRANCH
    whole = curve
    curve, front, lanes = whole.take(keep), front.take(keep), lanes[keep]
    length, travelled, steps, bend = length[keep], travelled[keep], steps[keep], bend[keep]
    while len(lanes):
        step = _attempt(curve, front, length, bend, constraints)
        good = step.good
        happened = good & (step.what != 0)
        if happened.any():
            traces.brackets.append(
                Bracket(
                    lanes[happened],
                    front.take(happened),
                    step.after.take(happened),
                    length[happened],
                    travelled[happened],
                    step.what[happened],
                )
            )
        ended = good & ((step.what & stop) != 0)
        moved = good & ~ended
        if options.record and moved.any():
            at = np.flatnonzero(moved)
            traces.points.append(
                (lanes[at], travelled[at] + length[at], step.after.take(at))
            )
        steps += 1
        travelled = travelled + np.where(good, length, 0.0)
        bend = np.where(
            good[:, None], (step.after.tangent_z - front.tangent_z) / length[:, None], bend
        )
        front = Front(*(
            np.where(moved[:, None] if new.ndim == 2 else moved, new, old)
            for new, old in (
                (step.after.z, front.z),
                (step.after.t, front.t),
                (step.after.tangent_z, front.tangent_z),
                (step.after.tangent_t, front.tangent_t),
                (step.after.index, front.index),
            )
        ))  # fmt: skip
        growth = np.clip(options.turning / np.maximum(step.turning, 1e-3), 0.5, 2.0)
        length = np.where(good, np.minimum(length * growth, options.largest_step), 0.4 * length)
        short, long = length < options.smallest_step, steps >= options.steps
        for i in np.flatnonzero((short | long) & ~ended):
            why = "the step became too small" if short[i] else f"no end in {options.steps} steps"
            traces.lost[int(lanes[i])] = (why, front.take(np.array([i])))
        keep = np.flatnonzero(~ended & ~short & ~long)
        if len(keep) < len(lanes):
            curve, front, lanes = curve.take(keep), front.take(keep), lanes[keep]
            length, travelled, steps, bend = length[keep], travelled[keep], steps[keep], bend[keep]
    return traces
