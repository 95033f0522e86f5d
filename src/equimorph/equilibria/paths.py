"""What a lift of one state finds: a path with its events."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from equimorph.arrays import Float, Int, Lanes, Numbers, Parameters, Some, Values
from equimorph.equilibria.critical import criticality
from equimorph.equilibria.curves import Curve, ParameterLine
from equimorph.equilibria.hidden_events import (
    NOT_LOCATED,
    fronts,
    recorded_points,
    with_hidden_events,
    with_multiple_points,
)
from equimorph.equilibria.legs import Leg, Prepared, legs_of, prepare_leg
from equimorph.equilibria.locate import locate_root
from equimorph.equilibria.steps import Bracket, Points
from equimorph.equilibria.trace import Traces, trace
from equimorph.equilibria.trace_options import EventCode, EventKind, TraceOptions
from equimorph.errors import InputError
from equimorph.model import Constraint, Descriptor, Progress
from equimorph.structures import State, States, join_states
from equimorph.structures.metric import metric_length
from equimorph.tables import Table, Tabular
from equimorph.tolerances import FEASIBLE

JOINED = 1e-8
"""Distance in the metric within which a leg ends where the next one begins."""
AHEAD = 1e-9
"""Part of a leg beyond the end of a lift where constraints are looked at that jump there."""
KINDS = frozenset(EventKind)
"""Kinds that have a member; others belong to tasks."""
NOTHING = 1e-9
"""Value, relative to the largest on the path, that counts as zero: it may begin or end there."""


@dataclass(frozen=True)
class Event:
    """Something that happened on a lift, at an exact state.

    kind: an `EventKind`, equal to its text: "arrived", "fold", "branch point", "constraint",
    "lateral branch point" (the structure begins to leave its plane), "returned" (a path that turned
    at a fold came back to the parameters of its start), "critical" (stability changes where a path
    with unknown parameters goes on), "multiple point" (several eigenvalues vanish at once, so that
    the path has no direction; it ends within round-off of it) or "lost"; `at`: number of the leg +
    share of it; `criticality` of branch points; `detail`: one line.
    """

    kind: str
    state: State
    at: float
    criticality: str | None = None
    detail: str = ""

    def __post_init__(self) -> None:
        """Name the kind by its member, where there is one."""
        if self.kind in KINDS:
            object.__setattr__(self, "kind", EventKind(self.kind))


@dataclass(frozen=True)
class Path(Tabular):
    """A lifted curve: exact states in order, what happened on the way, and how it ended.

    Parameters
    ----------
    states
        Equilibria along the curve, start and end included.
    at
        Segment number + share of the segment, per state.
    length
        Length from the start in the structure's metric and scaled parameters, per state.
    index
        Negative eigenvalues of the constrained Hessian per state; at an end that is critical, the
        index on the near side.
    events
        Events passed, in order, and the end.
    """

    states: States
    at: Float[np.ndarray, " points"]
    length: Float[np.ndarray, " points"]
    index: Int[np.ndarray, " points"]
    events: tuple[Event, ...]

    def __repr__(self) -> str:
        """Number of states and how the lift ended."""
        end = self.end.state
        return f"Path({len(self.states)} states; {self.end.kind} at {end})"

    @property
    def table(self) -> Table:
        """All states with ``at``, ``length`` and ``index``, as of `States`; see `frame`."""
        return self.states.table_with({"at": self.at, "length": self.length, "index": self.index})

    @property
    def end(self) -> Event:
        """How the lift ended."""
        return self.events[-1]

    @property
    def arrived(self) -> bool:
        """Whether the curve was lifted to its end."""
        return self.end.kind == "arrived"


def lift_one(
    state: State,
    to: Leg | Sequence[Leg],
    within: tuple[Constraint, ...],
    options: TraceOptions,
    progress: Progress | None,
) -> Path:
    """Follow all legs from one state; see `lift`."""
    pieces: list[_Segment] = []
    here = state
    for number, leg in enumerate(legs_of(to)):
        begun = prepare_leg(here.batch, leg)
        if not begun.curve.weight[0] > 0.0:
            continue
        # the phase of states on orbits is picked anew
        index = here.batch.index if begun.z is here.batch.z else None
        outcome = _trace_one(begun, index, within, options, progress)
        outcome = with_multiple_points(begun.curve, begun.z, outcome)
        aside = _vanishing_events(begun.curve, begun.z, outcome)
        pieces.append(_segment(begun.curve, outcome, number, within, aside))
        if pieces[-1].events[-1].kind != "arrived":
            break
        here = pieces[-1].events[-1].state
    if not pieces:
        raise InputError("`to` must change at least one parameter; got the start itself.")
    return _join(state, pieces)


def _trace_one(
    leg: Prepared,
    index: Numbers | None,
    within: tuple[Constraint, ...],
    options: TraceOptions,
    progress: Progress | None,
) -> Traces:
    """Trace of the only lane of a leg with its hidden events, in finer steps if need be."""
    while True:
        outcome = trace(leg.curve, leg.z, within, options, progress=progress)
        if not leg.curve.folds_change_index:
            return outcome
        outcome = with_hidden_events(leg.curve, leg.z, outcome, options, index)
        if outcome.why.get(0) != NOT_LOCATED or not options.retries:
            return outcome
        options = options.finer()


def lift_legs(
    chains: Sequence[States], within: tuple[Constraint, ...], options: TraceOptions
) -> list[Path | None]:
    """Paths through states that are known, their straight legs followed side by side.

    As from the first state of each in turn, in the time of the longest leg. None unless every leg
    leads from one state to the next and passes nothing on its way.
    """
    structure = chains[0].structure
    options = replace(options, record=True, look_inside=False)
    begin, end = (
        join_states(structure, [each[part] for each in chains])
        for part in (slice(None, -1), slice(1, None))
    )
    owner = np.repeat(np.arange(len(chains)), [len(each) - 1 for each in chains])
    curve = ParameterLine(structure, begin.p.copy(), end.p - begin.p)
    still = np.isin(owner, owner[~(curve.weight > 0.0)])
    moving = np.flatnonzero(~still)
    if len(moving) == 0:
        return [None] * len(chains)
    owner, curve, begin, end = owner[moving], curve.take(moving), begin[moving], end[moving]
    outcome = trace(curve, begin.z.copy(), within, options)
    outcome = with_hidden_events(curve, begin.z, outcome, options)
    outcome = with_multiple_points(curve, begin.z, outcome)
    joined = metric_length(structure, outcome.z - end.z) < JOINED
    good = (outcome.code == EventCode.ARRIVED) & joined
    good[outcome.passed.lanes] = False
    paths = list[Path | None]()
    for number, chain in enumerate(chains):
        legs = np.flatnonzero(owner == number)
        whole = len(legs) > 0 and bool(good[legs].all())
        own = _lanes(outcome, legs) if whole else None
        paths.append(_chain(chain[0], curve.take(legs), own, within) if own else None)
    return paths


def _chain(start: State, curve: Curve, outcome: Traces, within: tuple[Constraint, ...]) -> Path:
    """Path over lanes that arrived where the next one starts."""
    count, travelled = len(outcome.code), outcome.travelled
    points = outcome.points.take(outcome.points.travelled < travelled[outcome.points.lanes])
    lane = np.concatenate([points.lanes, np.arange(count)])
    length = np.concatenate([points.travelled, travelled])
    order = np.lexsort((length, lane))
    lane, length = lane[order], length[order]
    t = np.concatenate([points.t, outcome.t])[order]
    z, p = curve.take(lane).states(np.concatenate([points.z, outcome.z])[order], t)
    index = np.concatenate([points.index, outcome.index])[order]
    length += np.concatenate([[0.0], np.cumsum(travelled)])[lane]
    last = np.array([count - 1])
    end = _end(curve.take(last), _lanes(outcome, last), count - 1, within)
    return _join(start, [_Segment(z, p, lane + t, length, index, (end,))])


class Passed(NamedTuple):
    """An event that does not stop a path, and the length of the path up to it."""

    length: float
    event: Event


@dataclass(frozen=True)
class _Segment:
    """One leg of a path, without its first point."""

    z: Float[np.ndarray, "points size"]
    p: Float[np.ndarray, "points parameters"]
    at: Float[np.ndarray, " points"]
    length: Float[np.ndarray, " points"]
    index: Int[np.ndarray, " points"]
    events: tuple[Event, ...]


def _segment(
    curve: Curve,
    outcome: Traces,
    number: int,
    within: tuple[Constraint, ...],
    aside: Sequence[Passed],
) -> _Segment:
    """The only lane of an outcome, as leg number so much of a path.

    `aside`: events that do not stop a path, by their length on it; their `at` counts from 0.
    """
    passed = [*zip(outcome.passed.travelled, _events_passed(curve, outcome, number), strict=True)]
    passed += [(length, replace(one, at=number + one.at)) for length, one in aside]
    passed.sort(key=lambda each: each[0])
    events = (*(event for _, event in passed), _end(curve, outcome, number, within))
    last = outcome.travelled[0] if outcome.code[0] != EventCode.LOST else np.inf
    points = outcome.points.take(outcome.points.travelled < last)
    ended = slice(0, int(outcome.code[0] != EventCode.LOST))
    t = np.concatenate([points.t, outcome.t[ended]])
    z, p = _states(curve, np.concatenate([points.z, outcome.z[ended]]), t)
    length = np.concatenate([points.travelled, outcome.travelled[ended]])
    index = np.concatenate([points.index, outcome.index[ended]])
    return _Segment(z, p, number + t, length, index, events)


def _lanes(outcome: Traces, lanes: Some) -> Traces:
    """Traces of some lanes in growing order, numbered anew."""
    passed = outcome.passed.take(np.isin(outcome.passed.lanes, lanes))
    points = outcome.points.take(np.isin(outcome.points.lanes, lanes))
    number = {lane: k for k, lane in enumerate(lanes.tolist())}
    return Traces(
        outcome.code[lanes],
        outcome.z[lanes],
        outcome.t[lanes],
        outcome.index[lanes],
        outcome.travelled[lanes],
        {number[lane]: why for lane, why in outcome.why.items() if lane in number},
        replace(passed, lanes=np.searchsorted(lanes, passed.lanes)),
        replace(points, lanes=np.searchsorted(lanes, points.lanes)),
    )


def _states(
    curve: Curve, z: Float[np.ndarray, "points extended"], t: Float[np.ndarray, " points"]
) -> tuple[Float[np.ndarray, "points size"], Float[np.ndarray, "points parameters"]]:
    """Unknowns and parameters at points of the only lane."""
    return curve.take(np.zeros(len(t), int)).states(z, t)


def _events_passed(curve: Curve, outcome: Traces, number: int) -> list[Event]:
    passed = outcome.passed
    z, p = _states(curve, passed.z, passed.t)
    return [
        Event(
            EventCode(code).kind,
            State(curve.structure, z[i], p[i]),
            number + float(passed.t[i]),
            criticality(curve, z[i : i + 1], passed.t[i : i + 1])[0]
            if code == EventCode.BRANCH_POINT
            else None,
        )
        for i, code in enumerate(passed.code)
    ]


def _vanishing_events(curve: Curve, z: Lanes, outcome: Traces) -> list[Passed]:
    """Events of the only lane that do not stop it: where descriptors that are watched vanish."""
    found = []
    for descriptor in curve.structure.watched:
        assert descriptor.vanishing is not None
        at = vanishing_points(curve, recorded_points(curve, z, outcome), descriptor)
        states = _states(curve, at.z, at.t)
        critical = descriptor.vanishing.criticality(*states)
        for i, length in enumerate(at.travelled):
            state = State(curve.structure, states[0][i], states[1][i])
            kind = descriptor.vanishing.event
            found.append(Passed(float(length), Event(kind, state, float(at.t[i]), critical[i])))
    return found


def active_constraints(
    within: tuple[Constraint, ...], z: Lanes, p: Parameters, ahead: Parameters
) -> Numbers:
    """Which constraint ends each lane; one that jumps may show it just beyond the end only."""
    excess = np.array([each.excess(z, p) for each in within])
    jumps = np.flatnonzero(excess.max(axis=0) < -FEASIBLE)
    if len(jumps):
        excess[:, jumps] = [each.excess(z[jumps], ahead[jumps]) for each in within]
    return np.asarray(excess.argmax(axis=0))


def _end(curve: Curve, outcome: Traces, number: int, within: tuple[Constraint, ...]) -> Event:
    code, t = int(outcome.code[0]), outcome.t
    z, p = _states(curve, outcome.z, t)
    state = State(curve.structure, z[0], p[0])
    kind: str = EventCode(code).kind
    detail, critical = outcome.why.get(0, ""), None
    if code == EventCode.CONSTRAINT:
        ahead = _states(curve, outcome.z, t + AHEAD)[1]
        worst = within[int(active_constraints(within, z, p, ahead)[0])]
        kind, detail, critical = worst.event, str(worst), worst.criticality(z, p)[0] or None
    if code == EventCode.FOLD and not curve.folds_change_index:
        detail = "the Jacobian of the descriptors by the unknown parameters is singular"
    if code == EventCode.BRANCH_POINT:
        critical = criticality(curve, z, t)[0]
        detail = critical
    if code != EventCode.LOST and not detail and not state.resolved:
        detail = curve.structure.unresolved
    return Event(kind, state, number + float(t[0]), critical, detail)


def _join(start: State, pieces: list[_Segment]) -> Path:
    z = np.concatenate([start.z[None], *(piece.z for piece in pieces)])
    p = np.concatenate([start.p[None], *(piece.p for piece in pieces)])
    at = np.concatenate([[0.0], *(piece.at for piece in pieces)])
    lengths, travelled = [np.zeros(1)], 0.0
    for piece in pieces:
        lengths.append(travelled + piece.length)
        travelled = lengths[-1][-1] if len(piece.length) else travelled
    index = np.concatenate([[start.index], *(piece.index for piece in pieces)]).astype(int)
    passed = [event for piece in pieces for event in piece.events[:-1]]
    middle = [piece.events[-1] for piece in pieces[-1:]]
    states = States(start.structure, z, p)
    return Path(states, at, np.concatenate(lengths), index, (*passed, *middle))


def vanishing_points(curve: Curve, points: Points, descriptor: Descriptor) -> Points:
    """Exact states between the points of paths at which a descriptor changes its sign.

    Parameters
    ----------
    curve
        The curves of all lanes.
    points
        Their points, from the start on, sorted by lane and length. Where the sign changes twice
        between two of them, it is not seen.
    descriptor
        Any that is continuous along the paths.
    """
    values = descriptor.function(*curve.take(points.lanes).states(points.z, points.t))
    known = np.abs(values) > NOTHING * np.abs(values).max(initial=0.0)
    step = (np.diff(points.lanes) == 0) & known[1:] & known[:-1]
    first = np.flatnonzero(step & (values[1:] * values[:-1] < 0.0))
    if len(first) == 0:
        return points.take(first)
    here, sign = curve.take(points.lanes[first]), np.sign(values[first])

    def against(some: Some, z: Lanes, t: Values) -> Values:
        return np.asarray(-sign[some] * descriptor.function(*here.take(some).states(z, t)))

    before, after = (fronts(curve.take(points.lanes[at]), points, at) for at in (first, first + 1))
    way, what = points.travelled[first + 1] - points.travelled[first], np.zeros(len(first), int)
    numbers, begun = np.arange(len(first)), points.travelled[first]
    bracket = Bracket(numbers, before, after, way, begun, what)
    root = locate_root(here, bracket, against)
    found = Points(
        points.lanes[first], points.travelled[first] + root.step, root.z, root.t,
        points.index[first],
    )  # fmt: skip
    return found.take(np.flatnonzero(root.found))
