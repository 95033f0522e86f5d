"""Pseudo-arclength tracing of many curves at once: the engine under every lift."""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.equilibria.curves import Curve
from equimorph.equilibria.fronts import (
    ARRIVAL,
    BRANCH,
    CONSTRAINT,
    FOLD,
    RETURN,
    Bracket,
    Front,
    initial_front,
    step_along,
)
from equimorph.equilibria.location import locate_branch_point
from equimorph.model import Constraint

__all__ = [
    "ARRIVAL",
    "BRANCH",
    "CONSTRAINT",
    "FOLD",
    "RETURN",
    "Bracket",
    "Front",
    "March",
    "TraceOptions",
    "Traces",
    "init",
    "initial_front",
    "step",
    "trace",
]

Lanes = Float[np.ndarray, "lanes size"]
Values = Float[np.ndarray, " lanes"]
Flags = Bool[np.ndarray, " lanes"]

LEVEL = 1e-6
"""Slope dt/ds of a start that counts as zero: it lies on a fold, and leads nowhere in t."""


@dataclass(frozen=True)
class TraceOptions:
    """Knobs of the tracer.

    first_step, largest_step, smallest_step: lengths in the metric. turning: angle between
    tangents that the step control aims at, radians. steps: limit per lane. locate_passed: whether
    folds and branch points that do not end a lane are located. retries: how often lanes whose
    events could not be located are traced again, each time with steps four times shorter.
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
    retries: int = 2

    @property
    def stops(self) -> int:
        """Bits of the events that end a lane."""
        stop = ARRIVAL | RETURN | CONSTRAINT
        stop |= 0 if self.through_folds else FOLD
        return stop | (0 if self.through_branch_points else BRANCH)

    @property
    def locates_branch_points(self) -> bool:
        """Whether branch points have to be located."""
        return self.locate_passed or not self.through_branch_points

    def finer(self) -> "TraceOptions":
        """Return the options of a retry."""
        return replace(
            self,
            first_step=self.first_step / 4,
            largest_step=self.largest_step / 4,
            turning=self.turning / 2,
            steps=self.steps * 4,
            retries=self.retries - 1,
        )


@dataclass
class Traces:
    """What the tracer leaves: brackets of events, lost lanes, and the points if recorded."""

    brackets: list[Bracket] = field(default_factory=list)
    lost: dict[int, tuple[str, Front]] = field(default_factory=dict)
    points: list[tuple[Int[np.ndarray, "..."], Float[np.ndarray, "..."], Front]] = field(
        default_factory=list
    )

    def extend(self, more: "Traces") -> None:
        """Take up what another trace left."""
        self.brackets.extend(more.brackets)
        self.lost.update(more.lost)
        self.points.extend(more.points)

    def renamed(self, lanes: Int[np.ndarray, " lanes"]) -> "Traces":
        """Return the same with lane i called ``lanes[i]``."""
        return Traces(
            [replace(bracket, lanes=lanes[bracket.lanes]) for bracket in self.brackets],
            {int(lanes[lane]): entry for lane, entry in self.lost.items()},
            [(lanes[names], travelled, front) for names, travelled, front in self.points],
        )

    def without(self, lanes: Int[np.ndarray, " some"]) -> "Traces":
        """Return the same without some of the lanes."""
        brackets = [b.take(np.flatnonzero(~np.isin(b.lanes, lanes))) for b in self.brackets]
        kept = [(point, np.flatnonzero(~np.isin(point[0], lanes))) for point in self.points]
        return Traces(
            [bracket for bracket in brackets if len(bracket.lanes)],
            {lane: entry for lane, entry in self.lost.items() if lane not in lanes},
            [
                (names[at], travelled[at], front.take(at))
                for (names, travelled, front), at in kept
                if len(at)
            ],
        )


@dataclass(frozen=True)
class March:
    """Lanes on their way: where they are, and the step that each tries next."""

    lanes: Int[np.ndarray, " lanes"]
    curve: Curve
    front: Front
    length: Values
    travelled: Values
    steps: Int[np.ndarray, " lanes"]
    bend: Lanes

    def take(self, keep: Int[np.ndarray, " some"]) -> "March":
        """Return some of the lanes."""
        return March(
            self.lanes[keep],
            self.curve.take(keep),
            self.front.take(keep),
            self.length[keep],
            self.travelled[keep],
            self.steps[keep],
            self.bend[keep],
        )


@dataclass(frozen=True)
class _Step:
    """One attempted step of the active lanes."""

    after: Front
    turning: Values
    good: Flags
    what: Int[np.ndarray, " lanes"]


def init(curve: Curve, front: Front, options: TraceOptions) -> tuple[March, Traces]:
    """Start the lanes that can start; singular starts are lost at once."""
    count = len(front.z)
    march = March(
        np.arange(count),
        curve,
        front,
        np.full(count, options.first_step),
        np.zeros(count),
        np.zeros(count, int),
        np.zeros_like(front.z),
    )
    able = np.isfinite(front.tangent_z).all(axis=1) & (front.tangent_t > LEVEL)
    why = "the start is singular: it lies on a fold or a branch point"
    stuck = np.flatnonzero(~able)
    lost = {int(lane): (why, front.take(np.array([lane]))) for lane in stuck}
    return march.take(np.flatnonzero(able)), Traces(lost=lost)


def step(
    march: March, constraints: tuple[Constraint, ...], options: TraceOptions
) -> tuple[March, Traces]:
    """Attempt one step of every lane; return the lanes that go on, and what was learnt."""
    tried = _attempt(march, constraints, options)
    good, front, after = tried.good, march.front, tried.after
    ended = good & ((tried.what & options.stops) != 0)
    moved = good & ~ended
    travelled = march.travelled + np.where(good, march.length, 0.0)
    bend = (after.tangent_z - front.tangent_z) / march.length[:, None]
    growth = np.clip(options.turning / np.maximum(tried.turning, 1e-3), 0.5, 2.0)
    longer = np.minimum(march.length * growth, options.largest_step)
    following = March(
        march.lanes,
        march.curve,
        front.updated(after, moved),
        np.where(good, longer, 0.4 * march.length),
        travelled,
        march.steps + 1,
        np.where(good[:, None], bend, march.bend),
    )
    happened = np.flatnonzero(good & (tried.what != 0))
    news = Traces(brackets=[_bracket(march, tried, happened)] if len(happened) else [])
    if options.record and moved.any():
        at = np.flatnonzero(moved)
        news.points.append((march.lanes[at], travelled[at], after.take(at)))
    given_up = _given_up(following, ended, options, news)
    return following.take(np.flatnonzero(~ended & ~given_up)), news


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
    march, traces = init(curve, front, options)
    while len(march.lanes):
        march, news = step(march, constraints, options)
        traces.extend(news)
    return traces


def _attempt(march: March, constraints: tuple[Constraint, ...], options: TraceOptions) -> _Step:
    front, length = march.front, march.length
    after, turning, good = step_along(march.curve, front, length, march.bend)
    flipped = np.sign(after.tangent_t) != np.sign(front.tangent_t)
    changed = np.abs(after.index - front.index)
    # at a fold the path turns and the index changes; at a branch point one without the other
    fold, branch = flipped & (changed == 1), flipped ^ (changed == 1)
    what = np.where(fold, FOLD, 0) | np.where(branch, BRANCH, 0)
    what = what | np.where(after.t >= 1.0, ARRIVAL, 0) | np.where(after.t < 0.0, RETURN, 0)
    good = good & (changed <= 1)
    if not options.locates_branch_points:
        good = good & (flipped == fold)
    # a turn hides an arrival if t went beyond 1 (or below 0) and came back within the step;
    # a step this short cannot go beyond by more than round-off
    reach = front.t + front.tangent_t * length
    hidden = np.where(front.tangent_t > 0.0, reach >= 1.0, reach <= 0.0)
    hidden = (hidden | ((what & (ARRIVAL | RETURN)) != 0)) & (length > 10 * options.smallest_step)
    good = good & ~(flipped & hidden) & ~_turns_twice(front, after, length)
    if constraints and good.any():
        lanes = np.flatnonzero(good)
        z, p = after.z[lanes], march.curve.take(lanes).parameters(after.t[lanes])
        for constraint in constraints:
            violated = lanes[constraint.excess(z, p) > 0.0]
            what[violated] = what[violated] | CONSTRAINT
    tried = _Step(after, turning, good, what)
    if options.locates_branch_points and (good & branch).any():
        return replace(tried, good=good & _genuine(march, tried, branch))
    return tried


def _turns_twice(front: Front, after: Front, length: Values) -> Flags:
    """Whether t runs back inside a step that leaves it rising, or falling, at both ends.

    By the least slope of the cubic through both ends and slopes: near a cusp two folds lie close
    together, with the same index before and behind.
    """
    old, new = front.tangent_t, after.tangent_t
    rise = np.sign(old) * (after.t - front.t) / length
    a, b = np.sign(old) * old, np.sign(old) * new
    # slope at share s: a + 2 s (3 rise - 2 a - b) + 3 s² (a + b - 2 rise)
    bend, bow = 3 * rise - 2 * a - b, a + b - 2 * rise
    share = np.clip(-bend / np.where(bow > 0.0, 3 * bow, np.inf), 0.0, 1.0)
    least = a + 2 * share * bend + 3 * share**2 * bow
    return np.asarray((b > 0.0) & (least < 0.0))


def _genuine(march: March, tried: _Step, branch: Flags) -> Flags:
    """Whether a change of index or direction without a fold has a branch point in the step.

    If not, the step jumped to another branch, as it does past the narrow gap of a slightly
    imperfect pitchfork, or passed two folds: a shorter one will not.
    """
    at = np.flatnonzero(tried.good & branch)
    genuine = np.ones(len(march.lanes), bool)
    genuine[at] = locate_branch_point(march.curve.take(at), _bracket(march, tried, at)).found
    return genuine


def _bracket(march: March, tried: _Step, at: Int[np.ndarray, " some"]) -> Bracket:
    return Bracket(
        march.lanes[at],
        march.front.take(at),
        tried.after.take(at),
        march.length[at],
        march.travelled[at],
        tried.what[at],
    )


def _given_up(march: March, ended: Flags, options: TraceOptions, news: Traces) -> Flags:
    """Lanes whose step is too short or that took too many; noted as lost."""
    short, long = march.length < options.smallest_step, march.steps >= options.steps
    given_up = np.asarray((short | long) & ~ended)
    for i in np.flatnonzero(given_up):
        why = "the step became too small" if short[i] else f"no end in {options.steps} steps"
        news.lost[int(march.lanes[i])] = (why, march.front.take(np.array([i])))
    return given_up
