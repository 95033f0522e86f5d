"""From brackets to events: what happened to lanes on their way, and exactly where.

See docs/decisions.md, "Events are judged by the point itself".
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np

from equimorph.arrays import Bool, Float, Int, Lanes, Numbers, Some, Values
from equimorph.columns import Columns
from equimorph.equilibria.curves import Curve
from equimorph.equilibria.locate import (
    Located,
    locate_branch_point,
    locate_critical,
    locate_fold,
    locate_goal,
    locate_root,
)
from equimorph.equilibria.steps import Bracket
from equimorph.equilibria.trace_options import EventCode, TraceOptions
from equimorph.marching.kernels import CONSTRAINT
from equimorph.model import Constraint, worst_excess


@dataclass(frozen=True)
class Events(Columns):
    """Located events of lanes, sorted by lane and then by arclength.

    `code` holds members of `EventCode`, `index` the index before and after the event; `found` tells
    which events were located.
    """

    lanes: Int[np.ndarray, " events"]
    code: Int[np.ndarray, " events"]
    z: Float[np.ndarray, "events size"]
    t: Float[np.ndarray, " events"]
    travelled: Float[np.ndarray, " events"]
    index: Int[np.ndarray, "events 2"]
    found: Bool[np.ndarray, " events"]

    @classmethod
    def join(cls, parts: list["Events"], size: int) -> "Events":
        """All events of some parts, sorted by lane and then by arclength."""
        some = [part for part in parts if len(part.lanes)]
        if not some:
            return _no_events(size)
        whole = some[0] if len(some) == 1 else cls.concatenate(some)
        if len(whole.lanes) == 1:
            return whole
        return whole.take(np.lexsort((whole.travelled, whole.lanes)))

    def near_side(self, events: Some) -> Some:
        """Index just before some events: a fold or branch point may lie between step and event."""
        before = np.maximum(events - 1, 0)
        passed = (events > 0) & (self.lanes[before] == self.lanes[events]) & self.found[before]
        return np.asarray(np.where(passed, self.index[before, 1], self.index[events, 0]))


@lru_cache(maxsize=64)
def _no_events(size: int) -> Events:
    """None; without any entry, so that all may share it."""
    none, zero = np.zeros(0, int), np.zeros(0)
    places, indices = np.zeros((0, size)), np.zeros((0, 2), int)
    return Events(none, none, places, zero, zero, indices, np.zeros(0, bool))


LOCATORS: Mapping[int, Callable[[Curve, Bracket], Located]] = {
    EventCode.FOLD: locate_fold,
    EventCode.BRANCH_POINT: locate_branch_point,
    EventCode.CRITICAL: locate_critical,
    EventCode.ARRIVED: partial(locate_goal, goal=1.0),
    EventCode.RETURNED: partial(locate_goal, goal=0.0),
}
"""How events are located, by their kind, in the order in which they are; constraints come last."""


def locate_all(
    curve: Curve,
    brackets: list[Bracket],
    constraints: tuple[Constraint, ...],
    options: TraceOptions,
) -> Events:
    """Locate the events in all brackets that have to be located, all of a kind at once."""
    parts, there = [], 0
    for each in brackets:
        there |= int(np.bitwise_or.reduce(each.what))
    if not options.locate_passed:
        there &= options.stops
    for bit in (*LOCATORS, CONSTRAINT):
        # the index before an end is that behind the folds of the same step
        others = bit if bit != EventCode.FOLD or options.locate_folds else options.stops
        bracket = _join(brackets, bit, others) if there & bit else None
        if bracket is None:
            continue
        parts.append(events_at(bracket, bit, _locate(curve, bracket, bit, constraints)))
    return Events.join(parts, curve.metric.size)


def events_at(bracket: Bracket, code: int, place: Located) -> Events:
    """Events of one kind at places inside steps."""
    kind, way = np.full(len(bracket.lanes), code), bracket.travelled + place.step
    index = np.stack([bracket.before.index, bracket.after.index], 1)
    return Events(bracket.lanes, kind, place.z, place.t, way, index, place.found)


def _join(brackets: list[Bracket], bit: int, others: int) -> Bracket | None:
    """All brackets in which `bit` happened, and one of `others` (maybe the same), as one."""
    chosen = [
        (bracket, ((bracket.what & bit != 0) & (bracket.what & others != 0)).nonzero()[0])
        for bracket in brackets
    ]
    parts = [
        bracket if len(at) == len(bracket.what) else bracket.take(at)
        for bracket, at in chosen
        if len(at)
    ]
    if len(parts) < 2:
        return parts[0] if parts else None
    return Bracket.concatenate(parts)


def _locate(
    curve: Curve, bracket: Bracket, bit: int, constraints: tuple[Constraint, ...]
) -> Located:
    here = curve.take(bracket.lanes)
    if bit in LOCATORS:
        return LOCATORS[bit](here, bracket)

    def worst(some: Numbers, z: Lanes, t: Values) -> Values:
        z, p = here.take(some).states(z, t)
        return worst_excess(constraints, z, p)

    return locate_root(here, bracket, worst, constraints)
