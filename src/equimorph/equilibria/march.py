"""Lanes that march together along their curves: the engine under every lift.

See docs/decisions.md, "Lanes march in compiled kernels".
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float, Lanes, Numbers, Some, Values
from equimorph.equilibria.curves import Curve, squared_length
from equimorph.equilibria.events import Events
from equimorph.equilibria.locate import polish
from equimorph.equilibria.rare_steps import RareSteps
from equimorph.equilibria.rows import Rows
from equimorph.equilibria.steps import IN_CACHE, Front, Line, Workspace, compiled_steps
from equimorph.equilibria.trace_options import TraceOptions
from equimorph.errors import InputError
from equimorph.marching import constraint_kernels as violations, kernels, tick_kernels as ticks
from equimorph.marching.judgement_kernels import judge
from equimorph.marching.kernels import ARRIVAL, CONVERGED, ENDED, RETURN, STARTING
from equimorph.model import Constraint
from equimorph.structures import Advance
from equimorph.structures.contract import CompiledSteps

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


@dataclass(frozen=True)
class Loss:
    """A lane that cannot go on: its number, why, the last point, and the length of its way."""

    lane: int
    why: str
    front: Front
    travelled: float


class Block:
    """Lanes that march independently; waiting ones take the places of finished ones.

    In every tick the structure takes one Newton step of all lanes; the kernels then take each lane
    on: to its next correction, or over an accepted step to the prediction of the next. So no lane
    ever waits for another, and its result never depends on other lanes. Where the structure offers
    `CompiledSteps`, many ticks are one call.

    Parameters
    ----------
    curve, z
        Curves of all lanes that may be admitted, and their starts.
    capacity
        Most lanes that march together.
    events
        Events that may wait until they are taken out of `rows.events`.
    """

    def __init__(
        self,
        curve: Curve,
        z: Lanes,
        constraints: tuple[Constraint, ...],
        options: TraceOptions,
        capacity: int,
        events: int,
    ) -> None:
        if z.shape[1] != curve.metric.size:  # kernels do not check what they read
            raise InputError(
                f"`z` must have {curve.metric.size} columns; got {z.shape[1]}. States belong to "
                "the structure, and the resolution, that made them."
            )
        self.curve, self.constraints, self.options = curve, constraints, options
        self._start, self._weight = np.ascontiguousarray(z), curve.weight
        compiled = compiled_steps(curve, z, constraints)
        capacity = min(capacity, IN_CACHE) if compiled else capacity
        self.rows = Rows(capacity, curve.metric.size, len(constraints), events, options)
        self.rare = RareSteps(curve, constraints, options, self.rows)
        self.most_events, none = events, np.zeros(0, np.int64)
        self._waiting, self._knobs, self._here = (none, none), options.table(), curve.take(none)
        self._rules = (
            options.smallest_step, options.locates_branch_points, curve.folds_change_index,
            options.stops, options.record,
        )  # fmt: skip
        self._loop = None
        if compiled:
            self._workspace = Workspace(self.rows.capacity, compiled[1], len(constraints))
            self._loop = self._loop_of(*compiled)

    @property
    def wanted(self) -> int:
        """How many more lanes it takes; none until a share of the rows is free."""
        rows, waits = self.rows, self._waits
        room = rows.capacity - rows.active
        if waits or (rows.active and ticks.ENOUGH * room < rows.capacity):
            return 0
        return room if self._loop is None else room + rows.capacity

    @property
    def _waits(self) -> int:
        return len(self._waiting[0]) - int(self.rows.state[ticks.WAITING])

    @property
    def busy(self) -> bool:
        """Whether any lane is on its way or waits."""
        return self.rows.active > 0 or self._waits > 0

    def admit(self, lanes: Some, levels: Some) -> None:
        """Let lanes start at t = 0, as soon as there is room. `levels` counts their retries."""
        assert self._waits == 0
        self._waiting, self.rows.state[ticks.WAITING] = (lanes, levels), 0
        self.rare.forget(lanes)

    def begin_at(self, lanes: Some, z: Lanes) -> None:
        """Starts of lanes that are not admitted yet."""
        self._start[lanes] = z

    def drop(self, lanes: Some) -> None:
        """Take lanes out."""
        self.rows.stage[np.isin(self.rows.lanes, lanes)] = ENDED
        self._close()

    def run(self, more: bool) -> list[Loss]:
        """One tick of every lane, or many; lanes that are lost. `more`: whether others may come."""
        self.rows.points.make_room()
        return self._tick() if self._loop is None else self._march(self._loop, more)

    # --- ticks that are compiled as a whole -----------------------------------------------------

    def _loop_of(self, steps: CompiledSteps, line: Line) -> Callable[[bool], int]:
        """The structure's loop with all that stays the same from call to call."""
        rows, space = self.rows, self._workspace
        mass, guard = self.curve.metric.mass, steps.guard
        problem = (line, self._weight, mass, self._knobs, self._start, guard)
        block = (
            rows.places, rows.flat, rows.numbers, rows.counts, rows.values, rows.grazing, rows.state
        )  # fmt: skip

        def march(more: bool) -> int:
            queue = (*self._waiting, self.most_events, more)
            files = rows.events.buffer, rows.points.buffer
            given = (problem, queue, block, space.columns, files, space.scratch, self._rules)
            why = steps.march(steps.tables, steps.bounds, *given)
            if why == ticks.UNSAFE:
                around = rows.places[2], rows.places[3], rows.numbers, rows.lanes
                space.step_again(self.curve, *around, guard)
            return why

        return march

    def _march(self, loop: Callable[[bool], int], more: bool) -> list[Loss]:
        """Ticks until nothing is left to do, files are full, or more lanes are wanted."""
        lost: list[Loss] = []
        while (why := loop(more)) != ticks.IDLE:
            if why == ticks.RARE:
                self.rare.judge(self._workspace.move)
            elif why == ticks.LOST:
                lost += self._lost_lanes()
        return lost

    # --- ticks of any structure -----------------------------------------------------------------

    def _tick(self) -> list[Loss]:
        """One tick by the structure's methods."""
        rows, state = self.rows, self.rows.state
        places, scalars = rows.places, (rows.numbers, rows.counts)
        before = rows.active
        ticks.refill(self._start, self._weight, *self._waiting, places, *scalars, state)
        if rows.active > before:
            self._here = self.curve.take(rows.lanes)
        if (active := rows.active) == 0:
            return []
        _, _, trial, row = places
        t, corner, defect = rows.numbers[[kernels.TRIAL, kernels.CORNER, kernels.DEFECT], :active]
        move = self._here.advance(trial[:active], t, row[:active], corner, defect)
        mass, smallest = self.curve.metric.mass, self.options.smallest_step
        steps = (move.dz, move.dt, move.tangent_z, move.tangent_t, mass)
        kernels.correct(*steps, trial, *scalars, active, kernels.ACCEPTED, kernels.NEARLY)
        ends = (move.dz, move.tangent_z, move.tangent_t, mass, places)
        kernels.correct_arrivals(*ends, *scalars, active)
        locates, plain = self._rules[1:3]
        _, doubtful, close = judge(
            move.index, move.determinant, *scalars, active, smallest, locates, plain
        )
        if self._measure(move) or (locates and doubtful + close):
            self.rare.judge(move)
        moved = (move.dz, move.tangent_z, move.tangent_t, move.index, move.determinant)
        files = rows.events.buffer, rows.points.buffer
        control = (rows.values, files, state, self._rules)
        finished, given_up = ticks.finish(moved, mass, self._knobs, places, *scalars, *control)
        lost = self._lost_lanes() if given_up else []
        if given_up or finished > active // PATIENCE:
            self._close()
        return lost

    def _measure(self, move: Advance) -> int:
        """Values of constraints at starts and ends of steps; how many may hide a violation."""
        rows = self.rows
        at = np.flatnonzero((rows.stage == CONVERGED) | (rows.stage == STARTING))
        if len(self.constraints) == 0 or len(at) == 0:
            rows.grazing[:] = False
            return 0
        given = rows.values, rows.numbers, rows.counts, rows.active, rows.grazing
        t = rows.numbers[kernels.TRIAL, at]
        rows.values[violations.NEW :: violations.VALUES, at] = self._excess(
            at, rows.places[2][at], t
        )
        if violations.note_excess(*given) == 0:
            return 0
        doubt = np.flatnonzero(rows.grazing[:, : rows.active].any(axis=0))
        for row, end in enumerate((rows.front(doubt), rows.ahead(doubt, move)), violations.RISE):
            dz, dt = violations.BOTH_WAYS * end.tangent_z, violations.BOTH_WAYS * end.tangent_t
            ahead, behind = (
                self._excess(doubt, end.z + s * dz, end.t + s * dt) for s in (1.0, -1.0)
            )
            slopes = (ahead - behind) / (2.0 * violations.BOTH_WAYS)
            rows.values[row :: violations.VALUES, doubt] = slopes
        return int(violations.weigh(*given))

    def _excess(self, at: Some, z: Lanes, t: Values) -> Float[np.ndarray, "constraints some"]:
        """Excess over all bounds."""
        states = self._here.take(at).states(z, t)
        return np.array([constraint.excess(*states) for constraint in self.constraints])

    def _close(self) -> None:
        self.rows.close()
        if self._loop is None:
            self._here = self.curve.take(self.rows.lanes)

    # --- lanes that cannot go on ----------------------------------------------------------------

    def _lost_lanes(self) -> list[Loss]:
        """Lanes that cannot go on; those that are at their goal but for round-off arrive."""
        rows, lost = self.rows, list[Loss]()
        for i in np.flatnonzero(rows.stage > ENDED):
            why = WHY[int(rows.stage[i])].format(most=rows.counts[kernels.MOST, i])
            front = rows.front(np.array([i]))
            if rows.stage[i] == kernels.SHORT and self._arrives(int(i), front):
                continue
            state = self.curve.take(rows.lanes[[i]]).states(front.z, front.t)
            if not self.curve.structure.resolved(*state)[0]:
                why = f"{why}, where {self.curve.structure.unresolved}"
            length = float(rows.numbers[kernels.TRAVELLED, i])
            lost.append(Loss(int(rows.lanes[i]), why, front, length))
        return lost

    def _arrives(self, i: int, front: Front) -> bool:
        """Whether Newton's method takes a lane that is next to its goal there; notes the event."""
        rows, up = self.rows, front.tangent_t > 0.0
        goal, mark = np.where(up, 1.0, 0.0), np.where(up, ARRIVAL, RETURN)
        if rows.counts[kernels.STEPS, i] == 0 or np.abs(goal - front.t)[0] > AT_GOAL:
            return False
        lane: Numbers = rows.lanes[[i]]
        curve = self.curve.take(lane)
        z, found = polish(curve, front.z, goal)
        gap = squared_length(curve.metric, curve.weight, z - front.z, goal - front.t)
        there = bool(found[0] and np.sqrt(gap[0]) < FROM_GOAL)
        if there:
            index = np.stack([front.index, front.index], 1)
            way = rows.numbers[kernels.TRAVELLED, [i]] + np.sqrt(gap)
            self.rare.hidden.append(Events(lane, mark, z, goal, way, index, found))
        return there
