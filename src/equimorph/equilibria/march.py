"""Lanes that march together along their curves: the engine under every lift.

See docs/decisions.md, "Lanes march in compiled kernels".
"""

from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Flags, Float, Lanes, Numbers, Some, Values
from equimorph.equilibria import kernels, step_kernels as stepping
from equimorph.equilibria.curves import Curve, squared_length
from equimorph.equilibria.events import Events, events_at
from equimorph.equilibria.inside_steps import NARROW, Span, inside_spans
from equimorph.equilibria.kernels import (
    ARRIVAL,
    BRANCH,
    CONSTRAINT,
    CONVERGED,
    EARLY,
    ENDED,
    ENDING,
    HIDDEN,
    REFUSED,
    RETURN,
)
from equimorph.equilibria.legs import ON_BOUND
from equimorph.equilibria.locate import locate_branch_point, polish
from equimorph.equilibria.steps import (
    Bracket,
    EventFile,
    Front,
    PointFile,
    least_inside,
    new_scalars,
)
from equimorph.equilibria.trace_options import EventCode, TraceOptions
from equimorph.model import Constraint
from equimorph.structures import Advance
from equimorph.tolerances import METRIC_DIFFERENCE

Names = Numbers

MISS = 0.1
"""Error of the largest value of a cubic inside a step, as a share of its rise above the ends."""
AT_GOAL, FROM_GOAL = 1e-9, 1e-6
"""Distance from an end of t, and of the states in the metric, from which Newton's method takes
lanes there whose steps became too small."""
PATIENCE = 40
"""Reciprocal share of finished lanes at which the gaps that they leave in the block are closed."""
WHY = {
    kernels.SHORT: "the step became too small",
    kernels.LONG: "no end in {most} steps",
    kernels.STUCK: "the start is singular: it lies on a fold or a branch point",
}
UNRESOLVED = "the discretisation does not resolve the state: refine it"


@dataclass(frozen=True)
class Loss:
    """A lane that cannot go on: its number, why, the last point, and the length of its way."""

    lane: int
    why: str
    front: Front
    travelled: float


class Block:
    """Lanes that march independently; finished ones make room for waiting ones.

    Every round asks the structure for one Newton step of all lanes; the kernels then take each lane
    on: to its next correction, or over an accepted step to the prediction of the next. So no lane
    ever waits for another, and its result never depends on other lanes.

    Parameters
    ----------
    curve
        Curves of all lanes that may be admitted.
    capacity
        Most lanes that march together.
    events
        Events that may wait until they are taken out of `events`.
    """

    def __init__(
        self,
        curve: Curve,
        constraints: tuple[Constraint, ...],
        options: TraceOptions,
        capacity: int,
        events: int,
    ) -> None:
        self.curve, self.constraints, self.options = curve, constraints, options
        self.capacity, self.active = capacity, 0
        size = curve.metric.size
        self.events = EventFile(size, events + capacity)
        self.hidden: list[Events] = []
        self._last: dict[int, float] = {}
        self.points = PointFile(size, capacity if options.record else 0)
        shapes = (2 * [(capacity, stepping.MEMORY, size)]) + (2 * [(capacity, size)])
        self._places = tuple(np.zeros(shape) for shape in shapes)
        self._flat = tuple(place.reshape(capacity, -1) for place in self._places)
        self._scalars = new_scalars(_apart(capacity))
        self._excess = np.zeros((2 * len(constraints), capacity))
        self._here = curve.take(np.zeros(0, int))
        self._knobs = options.table()

    @property
    def room(self) -> int:
        """How many more lanes fit."""
        return self.capacity - self.active

    @property
    def lanes(self) -> Names:
        """Numbers of the lanes on their way."""
        return np.asarray(self._scalars[1][kernels.LANE, : self.active])

    def admit(self, lanes: Some, z: Lanes, levels: Some) -> list[Loss]:
        """Start lanes at t = 0; singular starts are lost at once. `levels` counts their retries."""
        here, count = self.curve.take(lanes), len(lanes)
        none = np.zeros(count)
        move = here.advance(z, none, np.zeros_like(z), np.ones(count), none)
        start = (move.dz, move.tangent_z, move.tangent_t, move.index, move.determinant)
        state = (self.curve.metric.mass, here.weight, self._places, *self._scalars, self.active)
        new = slice(self.active, self.active + count)
        for k, constraint in enumerate(self.constraints):
            self._excess[2 * k, new] = np.nan
            self._excess[2 * k + 1, new] = constraint.excess(*here.states(z, none))
        for lane in lanes if self._last else ():
            self._last.pop(int(lane), None)
        stuck = stepping.seat(lanes, levels, self._knobs, z, start, *state)
        self.active += count
        lost = self._lost_lanes() if stuck else []
        self._close()
        return lost

    def tick(self) -> list[Loss]:
        """One Newton step of every lane, and all that follows from it; lanes that are lost."""
        active, (numbers, counts) = self.active, self._scalars
        _, _, trial, row = self._places
        closing = numbers[kernels.CORNER, :active], numbers[kernels.DEFECT, :active]
        t = numbers[kernels.TRIAL, :active]
        move = self._here.advance(trial[:active], t, row[:active], *closing)
        mass, smallest = self.curve.metric.mass, self.options.smallest_step
        state = (numbers, counts, active)
        steps = (move.dz, move.dt, move.tangent_z, move.tangent_t)
        kernels.correct(*steps, mass, trial, *state, kernels.ACCEPTED, kernels.NEARLY)
        ends = (move.dz, move.tangent_z, move.tangent_t, mass, self._places)
        kernels.correct_arrivals(*ends, *state)
        locates, plain = self.options.locates_branch_points, self.curve.folds_change_index
        good, doubtful, close = kernels.judge(
            move.index, move.determinant, *state, smallest, locates, plain
        )
        if good:
            branched = self._refuse_jumps(move) if doubtful and locates else None
            if self.constraints:
                self._constrain(move)
            if close and locates:
                self._look_inside(move)
            if branched is not None:
                self._note_branch_points(branched)
            record = (self._places, self._scalars, active)
            self.events.add(move.tangent_z, self.options.stops, *record)
            if self.options.record:
                self.points.add(trial, *record[1:])
        finished, given_up = stepping.proceed(move.tangent_z, mass, self._places, *state, smallest)
        lost = self._lost_lanes() if given_up else []
        if given_up or finished > active // PATIENCE:
            self._close()
        return lost

    def _constrain(self, move: Advance) -> None:
        """Note violated constraints; refuse steps inside which one may be violated for a while."""
        numbers, counts = self._scalars
        good = np.flatnonzero(counts[kernels.STAGE, : self.active] == CONVERGED)
        z, t = self._places[2][good], numbers[kernels.TRIAL, good]
        here = self._here if len(good) == self.active else self._here.take(good)
        states = here.states(z, t)
        last, old = self._excess[::2, good], self._excess[1::2, good]
        new = np.array([constraint.excess(*states) for constraint in self.constraints])
        counts[kernels.WHAT, good[(new > 0.0).any(axis=0)]] |= CONSTRAINT
        close = np.empty(new.shape, bool)
        if kernels.may_graze(last, old, new, good, numbers, close):
            for k, constraint in enumerate(self.constraints):
                near, values = good[close[k]], (old[k, close[k]], new[k, close[k]])
                self._refuse_grazing(constraint, near, values, move)
        kept = counts[kernels.STAGE, good] == CONVERGED
        self._excess[::2, good[kept]] = old[:, kept]
        self._excess[1::2, good[kept]] = new[:, kept]

    def _refuse_grazing(
        self,
        constraint: Constraint,
        at: Some,
        values: tuple[Float[np.ndarray, " some"], Float[np.ndarray, " some"]],
        move: Advance,
    ) -> None:
        """Refuse steps inside which the cubic through values and slopes may exceed the bound.

        The next try ends where the cubic is largest, where it is exact after a few tries.
        """
        if len(at) == 0:
            return
        numbers, counts = self._scalars
        (z, tangent), here = self._present(at), self._here.take(at)
        length = numbers[kernels.LENGTH, at]
        norm = numbers[kernels.NORM, at]
        ends = (
            (z, numbers[kernels.T, at], tangent, numbers[kernels.SLOPE, at]),
            (self._places[2][at], numbers[kernels.TRIAL, at], move.tangent_z[at] / norm[:, None],
             numbers[kernels.NEW_SLOPE, at]),
        )  # fmt: skip
        slopes = [_slope(here, constraint, *end) for end in ends]
        share, least = least_inside((-values[0], -values[1]), (-slopes[0], -slopes[1]), length)
        rise = -least - np.maximum(*values)
        grazing = (rise > ON_BOUND * constraint.size) & (least < MISS * rise)
        counts[kernels.STAGE, at[grazing]] = REFUSED
        wanted = np.clip(share, 0.1, 0.9) * length / kernels.BACK
        numbers[kernels.LENGTH, at[grazing]] = wanted[grazing]

    def _refuse_jumps(self, move: Advance) -> Events:
        """Refuse changes of index or direction without a fold or branch point; the branch points.

        Such a step jumped to another branch, as it does past the narrow gap of a slightly imperfect
        pitchfork, or passed two folds: a shorter one will not.
        """
        counts = self._scalars[1]
        doubtful: Flags = counts[kernels.STAGE, : self.active] == CONVERGED
        doubtful &= (counts[kernels.WHAT, : self.active] & BRANCH) != 0
        at = np.flatnonzero(doubtful)
        bracket = self._bracket(at, move)
        place = locate_branch_point(self._here.take(at), bracket)
        counts[kernels.STAGE, at[~place.found]] = REFUSED
        return events_at(bracket, EventCode.BRANCH_POINT, place).take(place.found)

    def _note_branch_points(self, events: Events) -> None:
        """Note located branch points of steps that were not refused for another reason."""
        counts = self._scalars[1]
        at = np.flatnonzero(counts[kernels.STAGE, : self.active] == CONVERGED)
        at = at[np.isin(counts[kernels.LANE, at], events.lanes)]
        ends = bool(self.options.stops & BRANCH)
        counts[kernels.WHAT, at] = counts[kernels.WHAT, at] & ~BRANCH | (ENDING if ends else 0)
        if len(at):
            self.hidden.append(events.take(np.isin(events.lanes, counts[kernels.LANE, at])))

    def _look_inside(self, move: Advance) -> None:
        """Search steps that come close to a singular state.

        A step whose start is the singular one is searched together with the step before.
        """
        counts = self._scalars[1]
        stage, what = counts[kernels.STAGE, : self.active], counts[kernels.WHAT, : self.active]
        at = np.flatnonzero((stage == CONVERGED) & (what & (HIDDEN | EARLY) != 0))
        events = Events.join([], self.curve.metric.size)
        if self.options.look_inside and len(at):
            events = inside_spans(self._here, self._spans(at, move), self.options)
            lanes = counts[kernels.LANE, events.lanes]
            known = np.array([self._last.get(lane, -np.inf) for lane in lanes.tolist()])
            fresh = np.abs(events.travelled - known) > NARROW
            events, lanes = events.take(fresh), lanes[fresh]
            self._last.update(zip(lanes.tolist(), events.travelled.tolist(), strict=True))
            self.hidden.append(replace(events, lanes=lanes))
        what[np.setdiff1d(at, events.lanes)] &= ~(HIDDEN | EARLY)
        what[events.lanes[events.code & self.options.stops != 0]] |= ENDING

    def _spans(self, at: Some, move: Advance) -> Span:
        """Steps of lanes that may hide events: the one before if it is the first, the present."""
        numbers, what = self._scalars[0], self._scalars[1][kernels.WHAT, at]
        early = at[what & EARLY != 0]
        none, unknown = np.zeros(len(early)), np.full(len(early), np.nan)
        ends = self._front(early, back=1), self._front(early)
        first = Span(early, *ends, none, numbers[kernels.TRAVELLED, early], unknown)
        return Span.concatenate([first, self._around(at[what & HIDDEN != 0], move)])

    def _around(self, at: Some, move: Advance) -> Span:
        """The present steps of lanes, together with those before if they start at the least."""
        numbers, counts = (scalars[:, at] for scalars in self._scalars)
        bracket, start = self._bracket(at, move), numbers[kernels.TRAVELLED]
        low = np.abs(numbers[kernels.DET]) < kernels.NEAR * np.abs(numbers[kernels.NEW_DET])
        low &= counts[kernels.KNOWN] > 0
        turn = numbers[kernels.BEND] * numbers[kernels.ARC]
        behind = start - numbers[kernels.ARC] * np.sinc(turn / np.pi)
        before = bracket.before.with_rows(np.flatnonzero(low), self._front(at[low], back=1))
        first = np.where(low, start, np.nan)
        begun = np.where(low, behind, start)
        return Span(at, before, bracket.after, begun, start + bracket.step, first)

    def _front(self, at: Some, back: int = 0) -> Front:
        """Where lanes are, or were one step before."""
        numbers, counts = self._scalars
        (z, tangent), index = self._present(at, back), counts[kernels.INDEX, at]
        t, slope = numbers[kernels.T + 2 * back, at], numbers[kernels.SLOPE + 2 * back, at]
        return Front(z, t, tangent, slope, index)

    def _present(self, at: Some, back: int = 0) -> tuple[Lanes, Lanes]:
        """Present points and tangents, of the three that are remembered, or those before."""
        head = (self._scalars[1][kernels.HEAD, at] - back) % stepping.MEMORY
        return self._places[0][at, head], self._places[1][at, head]

    def _bracket(self, at: Some, move: Advance) -> Bracket:
        numbers, counts = (scalars[:, at] for scalars in self._scalars)
        after = Front(
            self._places[2][at],
            numbers[kernels.TRIAL],
            move.tangent_z[at] / numbers[kernels.NORM][:, None],
            numbers[kernels.NEW_SLOPE],
            counts[kernels.NEW_INDEX],
        )
        return Bracket(
            counts[kernels.LANE],
            self._front(at),
            after,
            numbers[kernels.LENGTH],
            numbers[kernels.TRAVELLED],
            counts[kernels.WHAT],
        )

    def _lost_lanes(self) -> list[Loss]:
        """Lanes that cannot go on; those that are at their goal but for round-off arrive."""
        (numbers, counts), lost = self._scalars, list[Loss]()
        stage = counts[kernels.STAGE, : self.active]
        for i in np.flatnonzero(stage > ENDED):
            why = WHY[int(stage[i])].format(most=counts[kernels.MOST, i])
            front = self._front(np.array([i]))
            if stage[i] == kernels.SHORT and self._arrives(int(i), front):
                continue
            state = self.curve.take(counts[kernels.LANE, [i]]).states(front.z, front.t)
            if not self.curve.structure.resolved(*state)[0]:
                why = f"{why}, where {UNRESOLVED}"
            length = float(numbers[kernels.TRAVELLED, i])
            lost.append(Loss(int(counts[kernels.LANE, i]), why, front, length))
        return lost

    def _arrives(self, i: int, front: Front) -> bool:
        """Whether Newton's method takes a lane that is next to its goal there; notes the event."""
        (numbers, counts), up = self._scalars, front.tangent_t > 0.0
        goal, mark = np.where(up, 1.0, 0.0), np.where(up, ARRIVAL, RETURN)
        if counts[kernels.STEPS, i] == 0 or np.abs(goal - front.t)[0] > AT_GOAL:
            return False
        lane = counts[kernels.LANE, [i]]
        curve = self.curve.take(lane)
        z, found = polish(curve, front.z, goal)
        gap = squared_length(curve.metric, curve.weight, z - front.z, goal - front.t)
        there = bool(found[0] and np.sqrt(gap[0]) < FROM_GOAL)
        if there:
            index = np.stack([front.index, front.index], 1)
            way = numbers[kernels.TRAVELLED, [i]] + np.sqrt(gap)
            self.hidden.append(Events(lane, mark, z, goal, way, index, found))
        return there

    def drop(self, lanes: Some) -> None:
        """Take lanes out, wherever they are."""
        self._scalars[1][kernels.STAGE, np.flatnonzero(np.isin(self.lanes, lanes))] = ENDED
        self._close()

    def _close(self) -> None:
        """Close the gaps of lanes that are finished."""
        state = (*self._scalars, self._excess)
        self.active = kernels.close_gaps(self._flat, *state, self.active)
        self._here = self.curve.take(self.lanes)


def _apart(lanes: int) -> int:
    """Padded length of rows of lanes: rows an even number of cache lines apart share cache sets."""
    return 8 * (-(-lanes // 8) | 1)


def _slope(
    curve: Curve, constraint: Constraint, z: Lanes, t: Values, tangent_z: Lanes, tangent_t: Values
) -> Values:
    """Change of a constraint's excess per length along curves."""
    h = METRIC_DIFFERENCE
    ahead, behind = (
        constraint.excess(*curve.states(z + s * h * tangent_z, t + s * h * tangent_t))
        for s in (1.0, -1.0)
    )
    return np.asarray((ahead - behind) / (2.0 * h))
