"""How curves are traced: step control, what ends a lane, and the points on the way."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.equilibria.kernels import (
    ARRIVAL,
    BRANCH,
    CONSTRAINT,
    CRITICAL,
    ENDING,
    FOLD,
    RETURN,
)

__all__ = [
    "ARRIVAL",
    "BRANCH",
    "CONSTRAINT",
    "CRITICAL",
    "FOLD",
    "RETURN",
    "Points",
    "TraceOptions",
]


@dataclass(frozen=True)
class TraceOptions:
    """Knobs of the tracer.

    first_step, largest_step, smallest_step: lengths in the metric. turning: angle between
    tangents that the step control aims at, radians. steps: limit per lane. locate_passed: whether
    folds and branch points that do not end a lane are located. retries: how often lanes whose
    events could not be located are traced again, each time with steps four times shorter.
    look_inside: whether steps that come close to a singular state are searched for events that
    their ends do not show.
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
    look_inside: bool = True

    @property
    def stops(self) -> int:
        """Bits of the events that end a lane."""
        stop = ARRIVAL | RETURN | CONSTRAINT | ENDING
        stop |= 0 if self.through_folds else FOLD
        return stop | (0 if self.through_branch_points else BRANCH | CRITICAL)

    @property
    def locates_branch_points(self) -> bool:
        """Whether branch points have to be located."""
        return self.locate_passed or not self.through_branch_points

    def table(self) -> Float[np.ndarray, "4 levels"]:
        """First and largest step, turning and number of steps, for the first try and retries."""
        levels = [self]
        for _ in range(self.retries):
            levels.append(levels[-1].finer())
        knobs = [(x.first_step, x.largest_step, x.turning, x.steps) for x in levels]
        return np.array(knobs, float).T.copy()

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


@dataclass(frozen=True)
class Points:
    """Regular points of many lanes: lane, length from its start, place, index."""

    lanes: Int[np.ndarray, " points"]
    travelled: Float[np.ndarray, " points"]
    z: Float[np.ndarray, "points size"]
    t: Float[np.ndarray, " points"]
    index: Int[np.ndarray, " points"]

    def take(self, at: Int[np.ndarray, " some"] | Bool[np.ndarray, " points"]) -> "Points":
        """Return some of the points."""
        return Points(*(column[at] for column in vars(self).values()))

    @classmethod
    def joined(cls, parts: list["Points"], size: int) -> "Points":
        """All points of some parts, sorted by lane and then by length."""
        count = sum(len(part.t) for part in parts)
        lanes, index, travelled, t = np.zeros(0, int), np.zeros(0, int), np.zeros(0), np.zeros(0)
        lanes = np.concatenate([lanes, *(part.lanes for part in parts)])
        index = np.concatenate([index, *(part.index for part in parts)])
        travelled = np.concatenate([travelled, *(part.travelled for part in parts)])
        t = np.concatenate([t, *(part.t for part in parts)])
        order = np.lexsort((travelled, lanes))
        place = np.empty(count, int)
        place[order] = np.arange(count)
        # by far the most bytes: each part goes to its places at once
        z, start = np.empty((count, size)), 0
        for part in parts:
            stop = start + len(part.t)
            z[place[start:stop]], start = part.z, stop
        return cls(lanes[order], travelled[order], z, t[order], index[order])
