"""Lanes that march together along their curves: the engine under every lift."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int

from equimorph.equilibria import kernels
from equimorph.equilibria.curves import Curve
from equimorph.equilibria.fronts import Bracket, Front, initial_front, new_scalars
from equimorph.equilibria.kernels import BRANCH, CONSTRAINT, CONVERGED, ENDED, REFUSED
from equimorph.equilibria.location import locate_branch_point
from equimorph.equilibria.tracing import Points, TraceOptions
from equimorph.model import Constraint
from equimorph.structures import Advance

Lanes = Float[np.ndarray, "lanes size"]
Names = Int[np.ndarray, " lanes"]
Some = Int[np.ndarray, " some"]

LEVEL = 1e-6
"""Slope dt/ds of a start that counts as zero: it lies on a fold, and leads nowhere in t."""


@dataclass(frozen=True)
class Loss:
    """A lane that cannot go on: its number, why, and the last point."""

    lane: int
    why: str
    front: Front


@dataclass
class News:
    """What was learnt in one round: events bracketed, lanes lost, points if they are recorded."""

    brackets: list[Bracket] = field(default_factory=list)
    lost: list[Loss] = field(default_factory=list)
    points: list[Points] = field(default_factory=list)


class Block:
    """Lanes side by side, each somewhere in a step of its own; finished ones make room for others.

    Every round asks the structure for one Newton step of all lanes; the kernels then take each lane
    on: to its next correction, or over an accepted step to the prediction of the next. So no lane
    ever waits for another, and what it does never depends on others.

    Parameters
    ----------
    curve
        Curves of all lanes that may be admitted.
    capacity
        Most lanes that march together.
    """

    def __init__(
        self,
        curve: Curve,
        constraints: tuple[Constraint, ...],
        options: TraceOptions,
        capacity: int,
    ) -> None:
        self.curve, self.constraints, self.options = curve, constraints, options
        self.capacity, self.active = capacity, 0
        size = curve.structure.size
        self._places = tuple(np.empty((capacity, size)) for _ in range(6))
        self._numbers, self._counts = new_scalars(capacity)
        self._excess = np.zeros((2 * len(constraints), capacity))
        self._here = curve.take(np.zeros(0, int))
        self._levels = [options]
        for _ in range(options.retries):
            self._levels.append(self._levels[-1].finer())

    @property
    def room(self) -> int:
        """How many more lanes fit."""
        return self.capacity - self.active

    @property
    def lanes(self) -> Names:
        """Numbers of the lanes on their way."""
        return np.asarray(self._counts[kernels.LANE, : self.active])

    def admit(self, lanes: Some, z: Lanes, levels: Some) -> News:
        """Start lanes at t = 0; singular starts are lost at once. `levels` counts their retries."""
        front = initial_front(self.curve.take(lanes), z, np.zeros(len(lanes)))
        able = np.isfinite(front.tangent_z).all(axis=1) & (front.tangent_t > LEVEL)
        why = "the start is singular: it lies on a fold or a branch point"
        stuck = np.flatnonzero(~able)
        lost = [Loss(int(lanes[i]), why, front.take(np.array([i]))) for i in stuck]
        self._seat(lanes[able], front.take(able), levels[able])
        return News(lost=lost)

    def _seat(self, lanes: Some, front: Front, levels: Some) -> None:
        start, stop = self.active, self.active + len(lanes)
        new = slice(start, stop)
        _, _, z, tangent, _, _ = self._places
        z[new], tangent[new] = front.z, front.tangent_z
        numbers, counts = self._numbers[:, new], self._counts[:, new]
        numbers[:], counts[:] = 0.0, 0
        here = self.curve.take(lanes)
        numbers[kernels.T], numbers[kernels.SLOPE] = front.t, front.tangent_t
        numbers[kernels.WEIGHT] = here.weight**2
        for row, name in (
            (kernels.LENGTH, "first_step"),
            (kernels.LARGEST, "largest_step"),
            (kernels.TURNING, "turning"),
        ):
            numbers[row] = np.array([getattr(each, name) for each in self._levels])[levels]
        counts[kernels.MOST] = np.array([each.steps for each in self._levels])[levels]
        counts[kernels.LANE], counts[kernels.INDEX] = lanes, front.index
        mass, scalars = self.curve.structure.mass, (self._numbers, self._counts)
        kernels.predict_all(mass, self._places, *scalars, start, stop)
        self.active = stop
        self._here = self.curve.take(self.lanes)

    def tick(self) -> News:
        """One Newton step of every lane, and all that follows from it."""
        active, numbers, counts = self.active, self._numbers, self._counts
        _, _, _, _, trial, row = self._places
        closing = numbers[kernels.CORNER, :active], numbers[kernels.DEFECT, :active]
        t = numbers[kernels.TRIAL, :active]
        move = self._here.advance(trial[:active], t, row[:active], *closing)
        mass, smallest = self.curve.structure.mass, self.options.smallest_step
        state = (numbers, counts, active)
        steps = (move.dz, move.dt, move.tangent_z, move.tangent_t)
        kernels.correct(*steps, mass, trial, *state, kernels.ACCEPTED, kernels.NEARLY)
        kernels.judge(move.index, *state, smallest, self.options.locates_branch_points)
        news = News()
        good = np.flatnonzero(counts[kernels.STAGE, :active] == CONVERGED)
        if len(good):
            self._constrain(good)
            self._note(self._without_jumps(good, move), move, news)
        kernels.proceed(move.tangent_z, mass, self._places, *state, smallest)
        self._retire(news)
        return news

    def _constrain(self, good: Some) -> None:
        if not self.constraints:
            return
        z = self._places[4][good]
        p = self._here.take(good).parameters(self._numbers[kernels.TRIAL, good])
        for constraint in self.constraints:
            violated = good[constraint.excess(z, p) > 0.0]
            self._counts[kernels.WHAT, violated] |= CONSTRAINT

    def _without_jumps(self, good: Some, move: Advance) -> Int[np.ndarray, " fewer"]:
        """Refuse changes of index or direction without a fold or branch point; return the others.

        Such a step jumped to another branch, as it does past the narrow gap of a slightly imperfect
        pitchfork, or passed two folds: a shorter one will not.
        """
        if not self.options.locates_branch_points:
            return good
        doubtful = (self._counts[kernels.WHAT, good] & BRANCH) != 0
        if not doubtful.any():
            return good
        at = good[doubtful]
        found = locate_branch_point(self._here.take(at), self._bracket(at, move)).found
        self._counts[kernels.STAGE, at[~found]] = REFUSED
        return np.asarray(good[self._counts[kernels.STAGE, good] == CONVERGED])

    def _note(self, good: Some, move: Advance, news: News) -> None:
        """Bracket events, end lanes, and record points."""
        what = self._counts[kernels.WHAT, good]
        ended = (what & self.options.stops) != 0
        self._counts[kernels.STAGE, good[ended]] = ENDED
        if what.any():
            news.brackets.append(self._bracket(good[what != 0], move))
        moved = good[~ended]
        if self.options.record and len(moved):
            numbers, counts = self._numbers, self._counts
            news.points.append(
                Points(
                    counts[kernels.LANE, moved],
                    numbers[kernels.TRAVELLED, moved] + numbers[kernels.LENGTH, moved],
                    self._places[4][moved],
                    numbers[kernels.TRIAL, moved],
                    counts[kernels.NEW_INDEX, moved],
                )
            )

    def _front(self, at: Some) -> Front:
        """Where lanes are."""
        _, _, z, tangent, _, _ = self._places
        numbers = self._numbers[:, at]
        index = self._counts[kernels.INDEX, at]
        return Front(z[at], numbers[kernels.T], tangent[at], numbers[kernels.SLOPE], index)

    def _bracket(self, at: Some, move: Advance) -> Bracket:
        numbers, counts = self._numbers[:, at], self._counts[:, at]
        after = Front(
            self._places[4][at],
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

    def _retire(self, news: News) -> None:
        """Note lanes that were given up, and close the gaps of those that are finished."""
        stage = self._counts[kernels.STAGE, : self.active]
        if (stage <= REFUSED).all():
            return
        for i in np.flatnonzero(stage > ENDED):
            short = stage[i] == kernels.SHORT
            limit = self._counts[kernels.MOST, i]
            why = "the step became too small" if short else f"no end in {limit} steps"
            lane = int(self._counts[kernels.LANE, i])
            news.lost.append(Loss(lane, why, self._front(np.array([i]))))
        self._close()

    def drop(self, lanes: Some) -> None:
        """Take lanes out, wherever they are."""
        self._counts[kernels.STAGE, np.flatnonzero(np.isin(self.lanes, lanes))] = ENDED
        self._close()

    def _close(self) -> None:
        state = (self._numbers, self._counts, self._excess)
        self.active = kernels.close_gaps(self._places, *state, self.active)
        self._here = self.curve.take(self.lanes)
