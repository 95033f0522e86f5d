"""Steps of the march that need more than its kernels: doubtful ones, and what steps may hide.

See docs/decisions.md, "Lanes march in compiled kernels".
"""

from dataclasses import replace

import numpy as np

from equimorph.arrays import Some
from equimorph.equilibria.curves import Curve
from equimorph.equilibria.events import Events, events_at
from equimorph.equilibria.inside_steps import NARROW, Span, inside_spans
from equimorph.equilibria.locate import locate_branch_point
from equimorph.equilibria.rows import Rows
from equimorph.equilibria.short_violations import hidden_violations
from equimorph.equilibria.trace_options import EventCode, TraceOptions
from equimorph.marching import kernels
from equimorph.marching.judgement_kernels import NEAR
from equimorph.marching.kernels import BRANCH, CONVERGED, EARLY, ENDING, HIDDEN, REFUSED
from equimorph.model import Constraint
from equimorph.structures import Advance


class RareSteps:
    """Judgement of rare steps of the lanes of a block; events that it locates are in `hidden`."""

    def __init__(
        self, curve: Curve, constraints: tuple[Constraint, ...], options: TraceOptions, rows: Rows
    ) -> None:
        self.curve, self.constraints, self.options, self.rows = curve, constraints, options, rows
        self.hidden: list[Events] = []
        self._last: dict[int, float] = {}

    def forget(self, lanes: Some) -> None:
        """Forget what was found in the steps of lanes that start anew."""
        for lane in lanes.tolist() if self._last else ():
            self._last.pop(lane, None)

    def judge(self, move: Advance) -> None:
        """Refuse steps that jumped or violate constraints; locate what others hide."""
        locates, what = self.options.locates_branch_points, self.rows.what
        good = self.rows.stage == CONVERGED
        branched = None
        if locates and (good & (what & BRANCH != 0)).any():
            branched = self._refuse_jumps(move)
        for k, row in enumerate(self.rows.grazing):
            at = np.flatnonzero((self.rows.stage == CONVERGED) & row[: len(what)])
            if len(at):
                self._refuse_violating(k, at, move)
        if branched is not None:
            self._note_branch_points(branched)
        if locates and (what & (HIDDEN | EARLY) != 0).any():
            self._look_inside(move)

    def _refuse_violating(self, k: int, at: Some, move: Advance) -> None:
        """Refuse steps inside which a constraint is violated; the next try ends where it is."""
        rows, bracket = self.rows, self.rows.bracket(at, move)
        curve = self.curve.take(bracket.lanes)
        found = hidden_violations(curve, self.constraints[k], bracket)
        over = np.isfinite(found)
        rows.stage[at[over]] = REFUSED
        rows.numbers[kernels.LENGTH, at[over]] = found[over] / kernels.BACK

    def _refuse_jumps(self, move: Advance) -> Events:
        """Refuse changes of index or direction without a fold or branch point; the branch points.

        Such a step jumped to another branch, as it does past the narrow gap of a slightly imperfect
        pitchfork, or passed two folds: a shorter one will not.
        """
        rows = self.rows
        at = np.flatnonzero((rows.stage == CONVERGED) & (rows.what & BRANCH != 0))
        if not self.options.locate_jumps:
            rows.stage[at] = REFUSED
            return Events.join([], self.curve.metric.size)
        bracket = rows.bracket(at, move)
        place = locate_branch_point(self.curve.take(bracket.lanes), bracket)
        rows.stage[at[~place.found]] = REFUSED
        return events_at(bracket, EventCode.BRANCH_POINT, place).take(place.found)

    def _note_branch_points(self, events: Events) -> None:
        """Note located branch points of steps that were not refused for another reason."""
        rows, what = self.rows, self.rows.what
        at = np.flatnonzero(rows.stage == CONVERGED)
        at = at[np.isin(rows.lanes[at], events.lanes)]
        ends = bool(self.options.stops & BRANCH)
        what[at] = what[at] & ~BRANCH | (ENDING if ends else 0)
        if len(at):
            events = events.take(np.isin(events.lanes, rows.lanes[at]))
            self._last.update(zip(events.lanes.tolist(), events.travelled.tolist(), strict=True))
            self.hidden.append(events)

    def _look_inside(self, move: Advance) -> None:
        """Search steps that come close to a singular state.

        A step whose start is the singular one is searched together with the step before. What
        cannot be located around a known event is that event: on a side branch that turns where it
        crosses the symmetric one, the eigenvalue touches zero there, and the curve is singular.
        """
        rows, what = self.rows, self.rows.what
        at = np.flatnonzero((rows.stage == CONVERGED) & (what & (HIDDEN | EARLY) != 0))
        events = Events.join([], self.curve.metric.size)
        if self.options.look_inside and len(at):
            span = self._spans(at, move)
            events = inside_spans(self.curve.take(rows.lanes), span, self.options)
            lanes = rows.lanes[events.lanes]
            known = np.array([self._last.get(lane, -np.inf) for lane in lanes.tolist()])
            low, high = np.full((2, len(what)), [[np.inf], [-np.inf]])
            np.minimum.at(low, span.lane, span.start)
            np.maximum.at(high, span.lane, span.stop)
            around = (low[events.lanes] <= known) & (known <= high[events.lanes])
            fresh = (np.abs(events.travelled - known) > NARROW) & (events.found | ~around)
            events, lanes = events.take(fresh), lanes[fresh]
            self._last.update(zip(lanes.tolist(), events.travelled.tolist(), strict=True))
            self.hidden.append(replace(events, lanes=lanes))
        what[np.setdiff1d(at, events.lanes)] &= ~(HIDDEN | EARLY)
        what[events.lanes[events.code & self.options.stops != 0]] |= ENDING

    def _spans(self, at: Some, move: Advance) -> Span:
        """Steps of lanes that may hide events: the one before if it is the first, the present."""
        rows, what = self.rows, self.rows.what[at]
        early = at[what & EARLY != 0]
        none, unknown = np.zeros(len(early)), np.full(len(early), np.nan)
        ends, stop = (rows.front(early, back=1), rows.front(early)), kernels.TRAVELLED
        first = Span(early, *ends, none, rows.numbers[stop, early], unknown)
        return Span.concatenate([first, self._around(at[what & HIDDEN != 0], move)])

    def _around(self, at: Some, move: Advance) -> Span:
        """The present steps of lanes, together with those before if the least may lie there."""
        rows, numbers = self.rows, self.rows.numbers[:, at]
        bracket, start = rows.bracket(at, move), numbers[kernels.TRAVELLED]
        there = np.abs(numbers[kernels.NEW_DET])
        last, here = np.abs(numbers[[kernels.DET_OLD, kernels.DET]])
        rise = (here - last) * numbers[kernels.LENGTH] ** 2
        rise += (there - here) * numbers[kernels.ARC] ** 2
        low = (rows.counts[kernels.KNOWN, at] > 0) & ((here < NEAR * there) | (rise > 0.0))
        turn = numbers[kernels.BEND] * numbers[kernels.ARC]
        behind = start - numbers[kernels.ARC] * np.sinc(turn / np.pi)
        before = bracket.before.with_rows(np.flatnonzero(low), rows.front(at[low], back=1))
        first = np.where(low, start, np.nan)
        begun = np.where(low, behind, start)
        return Span(at, before, bracket.after, begun, start + bracket.step, first)
