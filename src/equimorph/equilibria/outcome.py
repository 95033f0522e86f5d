"""From brackets to events: what happened to each lane of a trace, and exactly where."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.equilibria.curves import Curve
from equimorph.equilibria.location import (
    Located,
    locate_branch_point,
    locate_fold,
    locate_goal,
    locate_root,
)
from equimorph.equilibria.tracing import (
    ARRIVAL,
    BRANCH,
    CONSTRAINT,
    FOLD,
    RETURN,
    Bracket,
    Front,
    TraceOptions,
    Traces,
    initial_front,
    trace,
)
from equimorph.model import Constraint

Lanes = Float[np.ndarray, "lanes size"]
Values = Float[np.ndarray, " lanes"]

LOST = 0
KINDS = {
    ARRIVAL: "arrived",
    RETURN: "returned",
    FOLD: "fold",
    BRANCH: "branch point",
    CONSTRAINT: "constraint",
    LOST: "lost",
}


@dataclass(frozen=True)
class Happenings:
    """Located events of all lanes, sorted by lane and then by arclength.

    `code` as in `tracing`; `index` before and after; `terminal` marks the one that ended its lane.
    """

    lanes: Int[np.ndarray, " events"]
    code: Int[np.ndarray, " events"]
    z: Float[np.ndarray, "events size"]
    t: Float[np.ndarray, " events"]
    travelled: Float[np.ndarray, " events"]
    index: Int[np.ndarray, "events 2"]
    found: Bool[np.ndarray, " events"]

    def take(self, events: Int[np.ndarray, " some"] | Bool[np.ndarray, " all"]) -> "Happenings":
        """Return some of the events."""
        return Happenings(*(column[events] for column in vars(self).values()))


@dataclass(frozen=True)
class Outcome:
    """How each lane ended, the events on its way, and its points if they were recorded."""

    code: Int[np.ndarray, " lanes"]
    z: Lanes
    t: Values
    index: Int[np.ndarray, " lanes"]
    travelled: Values
    why: dict[int, str]
    passed: Happenings
    traces: Traces


def follow(
    curve: Curve,
    z: Lanes,
    constraints: tuple[Constraint, ...] = (),
    options: TraceOptions | None = None,
) -> Outcome:
    """Trace every lane from t = 0 and locate everything that happened.

    Of the events in the last step of a lane the first along the curve is its end.
    """
    options = options or TraceOptions()
    start = initial_front(curve, z, np.zeros(len(z)))
    traces = trace(curve, start, constraints, options)
    bits = [FOLD, BRANCH, ARRIVAL, RETURN, CONSTRAINT]
    if not options.locate_passed:
        bits = [bit for bit in bits if bit & options.stops]
    events = _locate_all(curve, traces.brackets, bits, constraints)
    finer = options
    while finer.retries and not events.found.all():
        again, finer = np.unique(events.lanes[~events.found]), finer.finer()
        retraced = trace(curve.take(again), start.take(again), constraints, finer).renamed(again)
        traces = traces.without(again)
        located = _locate_all(curve, retraced.brackets, bits, constraints)
        events = _merged([events.take(~np.isin(events.lanes, again)), located])
        traces.extend(retraced)
    return _settle(start, traces, events, options)


def _join(brackets: list[Bracket], bit: int) -> Bracket | None:
    """All brackets in which `bit` happened, as one."""
    parts = [(b, np.flatnonzero(b.what & bit)) for b in brackets]
    parts = [(b, at) for b, at in parts if len(at)]
    if not parts:
        return None

    def gather(name: str) -> Front:
        fronts = [vars(getattr(b, name).take(at)) for b, at in parts]
        return Front(**{key: np.concatenate([f[key] for f in fronts]) for key in fronts[0]})

    return Bracket(
        np.concatenate([b.lanes[at] for b, at in parts]),
        gather("before"),
        gather("after"),
        np.concatenate([b.step[at] for b, at in parts]),
        np.concatenate([b.travelled[at] for b, at in parts]),
        np.concatenate([b.what[at] for b, at in parts]),
    )


def _locate(
    curve: Curve, bracket: Bracket, bit: int, constraints: tuple[Constraint, ...]
) -> Located:
    here = curve.take(bracket.lanes)
    if bit == FOLD:
        return locate_fold(here, bracket)
    if bit == BRANCH:
        return locate_branch_point(here, bracket)
    if bit in {ARRIVAL, RETURN}:
        return locate_goal(here, bracket, 1.0 if bit == ARRIVAL else 0.0)

    def worst(z: Lanes, t: Values) -> Values:
        p = here.parameters(t)
        return np.asarray(np.max([c.excess(z, p) for c in constraints], axis=0))

    return locate_root(here, bracket, worst)


def _locate_all(
    curve: Curve, brackets: list[Bracket], bits: list[int], constraints: tuple[Constraint, ...]
) -> Happenings:
    size, none = curve.structure.size, np.zeros(0, int)
    nothing = Happenings(
        none, none, np.zeros((0, size)), np.zeros(0), np.zeros(0),
        np.zeros((0, 2), int), np.zeros(0, bool),
    )  # fmt: skip
    parts = [nothing]
    for bit in bits:
        bracket = _join(brackets, bit)
        if bracket is None:
            continue
        place = _locate(curve, bracket, bit, constraints)
        parts.append(
            Happenings(
                bracket.lanes,
                np.full(len(bracket.lanes), bit),
                place.z,
                place.t,
                bracket.travelled + place.step,
                np.stack([bracket.before.index, bracket.after.index], 1),
                place.found,
            )
        )
    return _merged(parts)


def _merged(parts: list[Happenings]) -> Happenings:
    """All events, sorted by lane and then by arclength."""
    columns = zip(*(vars(part).values() for part in parts), strict=True)
    whole = Happenings(*(np.concatenate(column) for column in columns))
    return whole.take(np.lexsort((whole.travelled, whole.lanes)))


def _near_side(events: Happenings, ends: Int[np.ndarray, " ends"]) -> Int[np.ndarray, " ends"]:
    """Index just before some events: a fold or branch point may lie between step and event."""
    before = np.maximum(ends - 1, 0)
    passed = (ends > 0) & (events.lanes[before] == events.lanes[ends]) & events.found[before]
    return np.asarray(np.where(passed, events.index[before, 1], events.index[ends, 0]))


def _settle(start: Front, traces: Traces, events: Happenings, options: TraceOptions) -> Outcome:
    """Choose each lane's end: its first terminal event; lanes without one are lost."""
    lanes = len(start.t)
    stop = options.stops
    terminal = np.flatnonzero(events.code & stop)
    first = terminal[np.unique(events.lanes[terminal], return_index=True)[1]]
    code, z, t = np.zeros(lanes, int), start.z.copy(), start.t.copy()
    index, travelled = start.index.copy(), np.zeros(lanes)
    why: dict[int, str] = {}
    for lane, (reason, front) in traces.lost.items():
        z[lane], t[lane], index[lane], why[lane] = front.z[0], front.t[0], front.index[0], reason
    at = events.lanes[first]
    code[at], z[at], t[at] = events.code[first], events.z[first], events.t[first]
    index[at], travelled[at] = _near_side(events, first), events.travelled[first]
    for i in first[~events.found[first]]:
        lane = int(events.lanes[i])
        code[lane] = LOST
        why[lane] = f"the {KINDS[int(events.code[i])]} could not be located"
    ends = np.full(lanes, np.inf)
    ends[at] = events.travelled[first]
    passing = ((events.code & ~stop) != 0) & (events.travelled < ends[events.lanes])
    bad = passing & ~events.found
    for i in np.flatnonzero(bad):
        lane = int(events.lanes[i])
        code[lane] = LOST
        why[lane] = f"a {KINDS[int(events.code[i])]} on the way could not be located"
    return Outcome(code, z, t, index, travelled, why, events.take(passing), traces)
