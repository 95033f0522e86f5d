"""`lift`: follow curves in parameter space from known equilibria, on the equilibrium set."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import overload

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Flags, Float, Int, Lanes, Numbers, Parameters, Shaped, Some, Values
from equimorph.columns import Columns
from equimorph.equilibria.critical import criticality
from equimorph.equilibria.curves import Curve
from equimorph.equilibria.hidden_events import with_multiple_points
from equimorph.equilibria.legs import (
    Leg,
    check_start,
    check_starts,
    legs_of,
    of_some,
    prepare_leg,
    violations,
    way_points,
)
from equimorph.equilibria.paths import AHEAD, Event, Path, active_constraints, lift_one
from equimorph.equilibria.trace import Traces, trace
from equimorph.equilibria.trace_options import EventCode, EventKind, TraceOptions
from equimorph.errors import InputError
from equimorph.model import Constraint, Progress
from equimorph.structures import State, States

Words = Shaped[np.ndarray, " lanes"]
UNRECORDED = TraceOptions(record=False)
"""Options of lifts if none are given."""
WORD = "U24"
"""Array of kinds of events and of criticality: room for the longest."""
__all__ = ["Event", "Lifts", "Path", "check_start", "lift", "way_points"]


@dataclass(frozen=True, eq=False)
class Marks:
    """Events or points on the way of many lifts, sorted by lane and then along each."""

    lane: Int[np.ndarray, " marks"]
    """Number of the state that was lifted."""
    states: States
    """Exact states."""
    at: Float[np.ndarray, " marks"]
    """Number of the leg plus the fraction of it."""
    kind: Shaped[np.ndarray, " marks"]
    """A kind of `Event`; "" for a regular point."""
    index: Int[np.ndarray, " marks"]
    """Negative eigenvalues of the constrained Hessian; just before an event."""
    criticality: Shaped[np.ndarray, " marks"]
    """Criticality of branch points; "" otherwise."""

    def __len__(self) -> int:
        """How many."""
        return len(self.lane)


@dataclass(frozen=True, eq=False)
class Lifts:
    """How the lifts of many states ended, in the order of the states.

    Parameters
    ----------
    states
        Where each lift ended.
    kind
        How each lift ended: a kind of `Event`, or "cancelled".
    at
        Number of the leg plus the fraction of it.
    length
        Length of the path in the structure's metric and scaled parameters.
    index
        Negative eigenvalues of the constrained Hessian; at a critical end, on the near side.
    criticality
        Criticality of branch points; "" otherwise.
    detail
        One line for lanes that need it: the constraint that was met, why a lane was lost.
    events
        Events that were passed; see `Marks`.
    points
        Points on the way if they were recorded, else None.
    """

    states: States
    kind: Words
    at: Values
    length: Values
    index: Numbers
    criticality: Words
    detail: dict[int, str]
    events: Marks
    points: Marks | None = None

    def __len__(self) -> int:
        """Number of lifts."""
        return len(self.kind)

    def __repr__(self) -> str:
        """How many ended in which way."""
        kinds, counts = np.unique(self.kind, return_counts=True)
        ends = ", ".join(f"{n} {kind}" for kind, n in zip(kinds, counts, strict=True))
        return f"Lifts({len(self)}: {ends})"

    def __getitem__(self, lane: int) -> Event:
        """How one of the lifts ended."""
        words = str(self.criticality[lane]) or None, self.detail.get(lane, "")
        return Event(EventKind(self.kind[lane]), self.states[lane], float(self.at[lane]), *words)

    @property
    def arrived(self) -> Flags:
        """Which lifts arrived."""
        return np.asarray(self.kind == "arrived")


def lift_many(
    states: States,
    to: Leg | Sequence[Leg],
    within: tuple[Constraint, ...],
    options: TraceOptions,
    progress: Progress | None,
) -> Lifts:
    """Follow all legs from many states; see `lift`."""
    ledger = _Ledger(states, within)
    moved = False
    for number, leg in enumerate(legs_of(to)):
        going = np.flatnonzero(ledger.code == EventCode.ARRIVED)
        if len(going) == 0:
            break
        everyone = len(going) == len(states)
        here = ledger.states if everyone else ledger.states[going]
        begun = prepare_leg(here, leg if everyone else of_some(leg, going, len(states)))
        far = np.flatnonzero(begun.curve.weight > 0.0)
        moved = moved or len(far) > 0
        if len(far) < len(going):
            begun = replace(begun, curve=begun.curve.take(far), z=begun.z[far])
        if len(far):
            outcome = trace(begun.curve, begun.z, within, options, progress=progress)
            outcome = with_multiple_points(begun.curve, begun.z, outcome)
            ledger.enter(going[far], begun.curve, outcome, number)
        ledger.at[ledger.code == EventCode.ARRIVED] = number + 1.0
        if (ledger.code == EventCode.CANCELLED).any():
            break
    if not moved and (ledger.code == EventCode.ARRIVED).any():
        raise InputError("`to` must change at least one parameter; got the starts themselves.")
    return ledger.lifts(within, options.record)


@dataclass(frozen=True)
class _Part(Columns):
    """Events or points of one leg."""

    lane: Some
    z: Lanes
    p: Parameters
    at: Float[np.ndarray, " some"]
    code: Some
    index: Some
    words: Shaped[np.ndarray, " some"]


@dataclass
class _Ledger:
    """How each lane stands."""

    begun: States
    within: tuple[Constraint, ...]
    code: Numbers = field(init=False)

    def __post_init__(self) -> None:
        lanes = len(self.begun)
        self.z, self.p = self.begun.z.copy(), self.begun.p.copy()
        self._ahead = self.p.copy()
        self.at, self.length = np.zeros(lanes), np.zeros(lanes)
        self.index = self.begun.index.copy()
        self.over = violations(self.begun, self.within)
        self.code, self.words = (
            np.where(self.over, EventCode.CONSTRAINT, EventCode.ARRIVED),
            np.full(lanes, "", WORD),
        )
        self.detail: dict[int, str] = {}
        self.events: list[_Part] = []
        self.points: list[_Part] = []

    @property
    def states(self) -> States:
        """Where the lanes are."""
        return States(self.begun.structure, self.z, self.p)

    def enter(self, lanes: Some, curve: Curve, outcome: Traces, number: int) -> None:
        """Take up the outcome of a leg."""
        self.z[lanes], self.p[lanes] = curve.states(outcome.z, outcome.t)
        met = np.flatnonzero(outcome.code == EventCode.CONSTRAINT)
        self._ahead[lanes[met]] = curve.take(met).states(outcome.z[met], outcome.t[met] + AHEAD)[1]
        self.code[lanes], self.index[lanes] = outcome.code, outcome.index
        self.at[lanes] = number + outcome.t
        self.length[lanes] += outcome.travelled
        self.detail.update({int(lanes[lane]): why for lane, why in outcome.why.items()})
        branched = np.flatnonzero(outcome.code == EventCode.BRANCH_POINT)
        self.words[lanes[branched]] = _criticality(
            curve.take(branched), outcome.z[branched], outcome.t[branched]
        )
        passed = outcome.passed
        words = np.full(len(passed.code), "", WORD)
        at = np.flatnonzero(passed.code == EventCode.BRANCH_POINT)
        words[at] = _criticality(curve.take(passed.lanes[at]), passed.z[at], passed.t[at])
        z, p = curve.take(passed.lanes).states(passed.z, passed.t)
        event = (passed.code, passed.index[:, 0], words)
        self.events.append(_Part(lanes[passed.lanes], z, p, number + passed.t, *event))
        points = outcome.points
        if len(points.t):
            z, p = curve.take(points.lanes).states(points.z, points.t)
            none = np.full(len(points.t), "", "U1")
            regular = (np.full(len(points.t), EventCode.REGULAR), points.index, none)
            self.points.append(_Part(lanes[points.lanes], z, p, number + points.t, *regular))

    def lifts(self, within: tuple[Constraint, ...], recorded: bool) -> Lifts:
        """Everything together."""
        kind = _kinds(self.code)
        met = np.flatnonzero(self.code == EventCode.CONSTRAINT)
        if len(met):
            given = self.z[met], self.p[met], self._ahead[met]
            worst = active_constraints(within, *given)
            names = np.array([str(each) for each in within])
            self.detail.update(zip(met.tolist(), names[worst].tolist(), strict=True))
            for which in np.unique(worst):  # lanes that begin beyond have met nothing
                lanes = met[(worst == which) & ~self.over[met]]
                kind[lanes] = within[which].event
                self.words[lanes] = within[which].criticality(self.z[lanes], self.p[lanes])
        ends = (self.at, self.length, self.index, self.words, self.detail)
        points = self._marks(self.points) if recorded else None
        return Lifts(self.states, kind, *ends, self._marks(self.events), points)

    def _marks(self, parts: list[_Part]) -> Marks:
        size, count = self.z.shape[1], self.p.shape[1]
        none = np.zeros(0, int)
        first = _Part(
            none, np.zeros((0, size)), np.zeros((0, count)), np.zeros(0), none, none,
            np.zeros(0, "U1"),
        )  # fmt: skip
        whole = _Part.concatenate([first, *parts])
        if len(parts) > 1:
            whole = whole.take(np.lexsort((whole.at, whole.lane)))
        states = States(self.begun.structure, whole.z, whole.p)
        kind = _kinds(whole.code)
        return Marks(whole.lane, states, whole.at, kind, whole.index, whole.words)


def _kinds(code: Some) -> Shaped[np.ndarray, " some"]:
    known, which = np.unique(code, return_inverse=True)
    names = np.array([EventCode(each).kind for each in known], WORD)
    return np.asarray(names[which])


def _criticality(
    curve: Curve, z: Lanes, t: Float[np.ndarray, " some"]
) -> Shaped[np.ndarray, " some"]:
    if len(t) == 0:
        return np.zeros(0, WORD)
    return np.array(criticality(curve, z, t), WORD)


@overload
def lift(
    state: State,
    to: Leg | Sequence[Leg],
    *,
    within: Sequence[Constraint] = (),
    through_folds: bool = False,
    options: TraceOptions | None = None,
    progress: Progress | None = None,
) -> Path: ...
@overload
def lift(
    state: States,
    to: Leg | Sequence[Leg],
    *,
    within: Sequence[Constraint] = (),
    through_folds: bool = False,
    options: TraceOptions | None = None,
    progress: Progress | None = None,
) -> Lifts: ...
@check_arguments
def lift(
    state: State | States,
    to: Leg | Sequence[Leg],
    *,
    within: Sequence[Constraint] = (),
    through_folds: bool = False,
    options: TraceOptions | None = None,
    progress: Progress | None = None,
) -> Path | Lifts:
    """Follow curves from one state, or from each of many, on the equilibrium set.

    Error-controlled predictor–corrector in pseudo-arclength; folds and constraints by root finding
    on the curve, branch points by minimally augmented systems. Without `through_folds` a lift ends
    at the first event, as a quasi-static motion would. Many states are lifted side by side on all
    processors; the result of each is the same, bit for bit, independent of the other lanes and
    their order.

    Parameters
    ----------
    state
        Equilibrium from which to start, or `States` (lanes).
    to
        One leg, or several that are followed in turn. A leg is

        * a way-point ``{name: value}``, approached on a straight line; parameters that are not
          named keep their values;
        * a smooth curve: a function of t from 0 to 1 that returns such a mapping, with the values
          of the start at t = 0;
        * a `Spline` through samples.

        For many states a value may be an array (lanes), a sample of a spline one (knots, lanes).

        A leg may prescribe descriptors as well: ``{arch.height(0.5): 0.2, "Theta": None}``. As many
        parameters, given as None, are then unknown and found on the way. A way-point for a
        descriptor is approached at a constant rate from its present value.
    within
        Constraints, like ``[arch.max_curvature <= 10]``; the first violation ends the lift, also
        one that begins and ends inside a step, by more than 1e-9 of the bound or, if that is
        smaller, of one. Only where a constraint has kinks, or varies over much less than a step
        without a trace at its ends, may one be missed: shorter steps help (`options`).
    through_folds
        Continue around folds (and through branch points) instead of ending there. A path that
        turns back passes its start on another sheet: this ends it ("returned").
    options
        Step control. `record` keeps all points of the lifts of many states (default: none); those
        of one state are always kept.
    progress
        Receives the number of finished lanes. If it raises `CancelledError` the lifts end: those
        of many states keep finished lanes, the rest are "cancelled".

    Returns
    -------
    The `Path` of one state; for many states `Lifts`, whose ends and events are arrays (lanes). A
    numerical failure is an end of kind "lost" with the reason.

    Raises
    ------
    InputError
        If a state is not an equilibrium, a single state violates a constraint (of many states,
        those that do end at once), or `to` has no meaning: an unknown parameter, a value outside
        its limits, a curve that is not smooth or begins elsewhere, more or fewer unknown parameters
        than descriptors, or nothing that moves.

    Examples
    --------
    >>> import equimorph as em
    >>> rest = em.Spring().natural_state(x_l=1.5)
    >>> em.lift(rest, {"F": 0.5}).end.kind
    'arrived'
    """
    one = isinstance(state, State)
    options = (options or UNRECORDED).following(one=one, through_folds=through_folds)
    if isinstance(state, States):
        check_starts(state)
        return lift_many(state, to, tuple(within), options, progress)
    check_start(state, within)
    return lift_one(state, to, tuple(within), options, progress)
