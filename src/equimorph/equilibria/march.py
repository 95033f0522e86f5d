"""Lanes that march together along their curves: the engine under every lift."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.equilibria import kernels
from equimorph.equilibria.curves import Curve
from equimorph.equilibria.fronts import Bracket, Front, new_scalars
from equimorph.equilibria.kernels import BRANCH, CONSTRAINT, CONVERGED, ENDED, REFUSED
from equimorph.equilibria.location import locate_branch_point
from equimorph.equilibria.records import EventFile, PointFile
from equimorph.equilibria.stepping import kernels as stepping
from equimorph.equilibria.tracing import TraceOptions
from equimorph.model import Constraint
from equimorph.structures import Advance

Lanes = Float[np.ndarray, "lanes size"]
Names = Int[np.ndarray, " lanes"]
Some = Int[np.ndarray, " some"]

WHY = {
    kernels.SHORT: "the step became too small",
    kernels.LONG: "no end in {most} steps",
    kernels.STUCK: "the start is singular: it lies on a fold or a branch point",
}


@dataclass(frozen=True)
class Loss:
    """A lane that cannot go on: its number, why, and the last point."""

    lane: int
    why: str
    front: Front


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
        size = curve.structure.size
        self.events = EventFile(size, events + capacity)
        self.points = PointFile(size, capacity if options.record else 0)
        self._places = tuple(np.empty((capacity, size)) for _ in range(6))
        self._scalars = new_scalars(capacity)
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
        state = (self.curve.structure.mass, here.weight, self._places, *self._scalars, self.active)
        stuck = stepping.seat(lanes, levels, self._knobs, z, start, *state)
        self.active += count
        lost = self._given_up() if stuck else []
        self._close()
        return lost

    def tick(self) -> list[Loss]:
        """One Newton step of every lane, and all that follows from it; lanes that are lost."""
        active, (numbers, counts) = self.active, self._scalars
        _, _, _, _, trial, row = self._places
        closing = numbers[kernels.CORNER, :active], numbers[kernels.DEFECT, :active]
        t = numbers[kernels.TRIAL, :active]
        move = self._here.advance(trial[:active], t, row[:active], *closing)
        mass, smallest = self.curve.structure.mass, self.options.smallest_step
        state = (numbers, counts, active)
        steps = (move.dz, move.dt, move.tangent_z, move.tangent_t)
        kernels.correct(*steps, mass, trial, *state, kernels.ACCEPTED, kernels.NEARLY)
        ends = (move.dz, move.tangent_z, move.tangent_t, mass, self._places)
        kernels.correct_arrivals(*ends, *state)
        locates = self.options.locates_branch_points
        good, doubtful = kernels.judge(move.index, move.determinant, *state, smallest, locates)
        if good:
            self._constrain()
            if doubtful and locates:
                self._refuse_jumps(move)
            record = (self._places, self._scalars, active)
            self.events.add(move.tangent_z, self.options.stops, *record)
            if self.options.record:
                self.points.add(trial, *record[1:])
        finished, given_up = stepping.proceed(move.tangent_z, mass, self._places, *state, smallest)
        lost = self._given_up() if given_up else []
        if finished:
            self._close()
        return lost

    def _constrain(self) -> None:
        if not self.constraints:
            return
        numbers, counts = self._scalars
        good = np.flatnonzero(counts[kernels.STAGE, : self.active] == CONVERGED)
        z = self._places[4][good]
        p = self._here.take(good).parameters(numbers[kernels.TRIAL, good])
        for constraint in self.constraints:
            violated = good[constraint.excess(z, p) > 0.0]
            counts[kernels.WHAT, violated] |= CONSTRAINT

    def _refuse_jumps(self, move: Advance) -> None:
        """Refuse changes of index or direction without a fold or branch point.

        Such a step jumped to another branch, as it does past the narrow gap of a slightly imperfect
        pitchfork, or passed two folds: a shorter one will not.
        """
        _, counts = self._scalars
        doubtful: Bool[np.ndarray, " lanes"] = counts[kernels.STAGE, : self.active] == CONVERGED
        doubtful &= (counts[kernels.WHAT, : self.active] & BRANCH) != 0
        at = np.flatnonzero(doubtful)
        found = locate_branch_point(self._here.take(at), self._bracket(at, move)).found
        counts[kernels.STAGE, at[~found]] = REFUSED

    def _front(self, at: Some) -> Front:
        """Where lanes are."""
        _, _, z, tangent, _, _ = self._places
        numbers, counts = self._scalars
        index = counts[kernels.INDEX, at]
        t, slope = numbers[kernels.T, at], numbers[kernels.SLOPE, at]
        return Front(z[at], t, tangent[at], slope, index)

    def _bracket(self, at: Some, move: Advance) -> Bracket:
        numbers, counts = (scalars[:, at] for scalars in self._scalars)
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

    def _given_up(self) -> list[Loss]:
        """Lanes that cannot go on."""
        counts, lost = self._scalars[1], []
        stage = counts[kernels.STAGE, : self.active]
        for i in np.flatnonzero(stage > ENDED):
            why = WHY[int(stage[i])].format(most=counts[kernels.MOST, i])
            lost.append(Loss(int(counts[kernels.LANE, i]), why, self._front(np.array([i]))))
        return lost

    def drop(self, lanes: Some) -> None:
        """Take lanes out, wherever they are."""
        self._scalars[1][kernels.STAGE, np.flatnonzero(np.isin(self.lanes, lanes))] = ENDED
        self._close()

    def _close(self) -> None:
        """Close the gaps of lanes that are finished."""
        state = (*self._scalars, self._excess)
        self.active = kernels.close_gaps(self._places, *state, self.active)
        self._here = self.curve.take(self.lanes)
