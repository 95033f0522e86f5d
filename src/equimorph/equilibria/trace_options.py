"""What can happen to a curve that is traced, and how its steps are controlled."""

from dataclasses import dataclass, replace
from enum import IntEnum, StrEnum
from functools import lru_cache

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.marching import kernels


class EventKind(StrEnum):
    """What happens on a curve, or ends it; each member is equal to its text."""

    ARRIVED = "arrived"
    RETURNED = "returned"
    FOLD = "fold"
    BRANCH_POINT = "branch point"
    CONSTRAINT = "constraint"
    LATERAL_BRANCH_POINT = "lateral branch point"
    CRITICAL = "critical"
    MULTIPLE_POINT = "multiple point"
    LOST = "lost"
    CANCELLED = "cancelled"
    REGULAR = ""
    # on curves of critical states
    CUSP = "cusp"
    SWALLOWTAIL = "swallowtail"
    DEGENERATE = "degenerate"
    DOUBLE = "double"
    BOX = "box"
    CLOSED = "closed"
    # on motions of actuators
    LIMIT = "limit"

    def __repr__(self) -> str:
        """Return the text in quotes, as that of any other word."""
        return repr(self.value)


VIOLATIONS = (EventKind.CONSTRAINT, EventKind.LATERAL_BRANCH_POINT)
"""Kinds of events where a path violates a constraint."""


class EventCode(IntEnum):
    """Numbers of the kinds of events in arrays of lanes.

    Those of events that a step can hold are bits: several may happen in one step.
    """

    MULTIPLE_POINT = -3
    REGULAR = -2
    CANCELLED = -1
    LOST = 0
    ARRIVED = kernels.ARRIVAL
    RETURNED = kernels.RETURN
    FOLD = kernels.FOLD
    BRANCH_POINT = kernels.BRANCH
    CONSTRAINT = kernels.CONSTRAINT
    CRITICAL = kernels.CRITICAL

    @property
    def kind(self) -> EventKind:
        """The kind with this number."""
        return EventKind[self.name]


@check_arguments
@dataclass(frozen=True)
class TraceOptions:
    """Options of the tracer.

    first_step, largest_step, smallest_step: lengths in the metric. turning: angle between the
    tangents at both ends of a step that the step control aims at, in radians. steps: limit per
    lane. locate_passed: whether folds and branch points that do not end a lane are located.
    locate_folds: whether such folds are, too, and not only those in its last step.
    locate_jumps: whether branch points are located in steps that change the index without a turn;
    without, steps are refused until a lane that meets one is lost: only arrivals count then.
    retries: how often lanes whose events could not be located are traced again, each time with
    steps four times shorter. look_inside: whether steps that come close to a singular state are
    searched for events that their ends do not show.
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
    locate_folds: bool = True
    locate_jumps: bool = True
    retries: int = 2
    look_inside: bool = True

    @property
    def stops(self) -> int:
        """Bits of the events that end a lane."""
        stop = kernels.ARRIVAL | kernels.RETURN | kernels.CONSTRAINT | kernels.ENDING
        stop |= 0 if self.through_folds else kernels.FOLD
        return stop | (0 if self.through_branch_points else kernels.BRANCH | kernels.CRITICAL)

    @property
    def locates_branch_points(self) -> bool:
        """Whether branch points have to be located."""
        return self.locate_passed or not self.through_branch_points

    def following(self, *, one: bool, through_folds: bool = False) -> "TraceOptions":
        """Return the options of lifts that go through folds or not; of one state, or of many.

        What hides in the steps of one state is searched for afterwards, more thoroughly.
        """
        return _following(self, one, through_folds)

    def table(self) -> Float[np.ndarray, "4 levels"]:
        """First and largest step, turning and number of steps, for the first try and retries."""
        return _table(self)

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


@lru_cache(maxsize=16)
def _following(options: TraceOptions, one: bool, through: bool) -> TraceOptions:
    options = replace(options, through_folds=through, through_branch_points=through)
    return replace(options, record=True, look_inside=False) if one else options


@lru_cache(maxsize=16)
def _table(options: TraceOptions) -> Float[np.ndarray, "4 levels"]:
    levels = [options]
    for _ in range(options.retries):
        levels.append(levels[-1].finer())
    knobs = [(x.first_step, x.largest_step, x.turning, x.steps) for x in levels]
    return np.array(knobs, float).T.copy()
