"""Steps along curves: their control, the points at their ends, and files of both.

Where a structure compiles its loops as a whole, `Workspace` holds the arrays of these.
"""

from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Flags, Float, Int, Lanes, Numbers, Parameters, Some, Values
from equimorph.columns import Columns
from equimorph.equilibria.curves import (
    AlongCurve,
    Curve,
    ForceLine,
    ParameterLine,
    along_parameters,
    dual,
    squared_length,
)
from equimorph.equilibria.newton_step import Planes
from equimorph.equilibria.settle import Guards, settle
from equimorph.linalg.compiled import is_awaited
from equimorph.marching import kernels, tick_kernels
from equimorph.model import Constraint
from equimorph.structures import Advance
from equimorph.structures.contract import CompiledSteps

Forces = Float[np.ndarray, "forced size"]
IN_CACHE = 128
"""Most lanes in a loop that is compiled as a whole: they stay in the cache of a processor."""
Line = tuple[Parameters, Parameters, Forces, Forces]


@dataclass(frozen=True)
class Front(Columns):
    """Points on the curves with unit tangents: where each lane is now."""

    z: Lanes
    t: Values
    tangent_z: Lanes
    tangent_t: Values
    index: Numbers


@dataclass(frozen=True)
class Bracket(Columns):
    """Steps in which something happened: lane numbers, both ends, step lengths, arclength before.

    what: bits of `EventCode`.
    """

    lanes: Some
    before: Front
    after: Front
    step: Float[np.ndarray, " some"]
    travelled: Float[np.ndarray, " some"]
    what: Some


def unit_tangents(curve: Curve, front: Front) -> Front:
    """Points with tangents of length one."""
    length = squared_length(curve.metric, curve.weight, front.tangent_z, front.tangent_t)
    norm = np.sqrt(length)
    return replace(
        front, tangent_z=front.tangent_z / norm[:, None], tangent_t=front.tangent_t / norm
    )


ON_CURVE = Guards(
    iterations=kernels.MOST_ITERATIONS,
    longest=np.inf,
    converged=kernels.EXACT,
    contraction=0.5,
    multipliers=kernels.MULTIPLIER_WEIGHT,
)
"""Corrections of steps to events, as on the march: they shrink by half."""


def step_along(curve: Curve, front: Front, length: Values) -> tuple[Front, Flags]:
    """Points at pseudo-arclength `length` from `front`, and the success.

    They are predicted by the tangent and corrected in the plane across it. A point counts only if
    the first correction is below a quarter of the length and its tangent within acos 0.9 of that of
    `front`.
    """
    z = front.z + length[:, None] * front.tangent_z
    p = along_parameters(front.t + length * front.tangent_t)
    row, corner = dual(curve.metric, curve.weight, front.tangent_z, front.tangent_t)
    unit = 1.0 / np.where(curve.weight > 0.0, curve.weight, 1.0)
    directions, across = np.zeros((len(z), 1, 2)), np.zeros((len(z), 1, 2))
    directions[:, 0, 0], across[:, 0, 0] = unit, corner
    guards = replace(ON_CURVE, too_long=np.maximum(kernels.FIRST_SHARE * length, kernels.EXACT))
    plane = Planes(row[:, None], across)
    found = settle(AlongCurve(curve), z, p, directions, (), guards, plane)
    tangent_z, tangent_t = np.ascontiguousarray(found.frames[:, 0, :-1]), found.frames[:, 0, -1]
    there = Front(found.z, found.p[:, 0].copy(), tangent_z, tangent_t * unit, found.index)
    return there, found.found & (along_tangents(curve, front, there) >= kernels.LEAST_COSINE)


def along_tangents(curve: Curve, front: Front, there: Front) -> Values:
    """Cosines of the angles between tangents of points and those of `front`."""
    row, corner = dual(curve.metric, curve.weight, front.tangent_z, front.tangent_t)
    return np.asarray(kernels.row_sums(row, there.tangent_z) + corner * there.tangent_t)


def new_scalars(
    lanes: int,
) -> tuple[Float[np.ndarray, "numbers lanes"], Int[np.ndarray, "counts lanes"]]:
    """Empty scalars of lanes: the rows are named in `kernels`."""
    return np.zeros((kernels.NUMBERS, lanes)), np.zeros((kernels.COUNTS, lanes), np.int64)


@dataclass(frozen=True)
class Points(Columns):
    """Regular points of many lanes: lane, length from its start, place, index."""

    lanes: Int[np.ndarray, " points"]
    travelled: Float[np.ndarray, " points"]
    z: Float[np.ndarray, "points size"]
    t: Float[np.ndarray, " points"]
    index: Int[np.ndarray, " points"]

    @classmethod
    def join(cls, parts: list["Points"], size: int) -> "Points":
        """All points of some parts, sorted by lane and then by length."""
        parts = [part for part in parts if len(part.t)]
        if not parts:
            none, zero = np.zeros(0, int), np.zeros(0)
            return cls(none, zero, np.zeros((0, size)), zero, none)
        small = ((each.lanes, each.index, each.travelled, each.t) for each in parts)
        lanes, index, travelled, t = map(np.concatenate, zip(*small, strict=True))
        order, count = np.lexsort((travelled, lanes)), len(t)
        place = np.empty(count, int)
        place[order] = np.arange(count)
        # by far the most bytes: each part goes to its places at once
        z, start = np.empty((count, size)), 0
        for part in parts:
            stop = start + len(part.t)
            z[place[start:stop]], start = part.z, stop
        return cls(lanes[order], travelled[order], z, t[order], index[order])


def least_inside(
    values: tuple[Values, Values], slopes: tuple[Values, Values], length: Values
) -> tuple[Values, Values]:
    """Place and least value of the cubics; places are shares of the length, ends included."""
    (f, g), (a, b) = values, (slopes[0] * length, slopes[1] * length)
    c2, c3 = 3.0 * (g - f) - 2.0 * a - b, a + b - 2.0 * (g - f)
    # roots of the slope a + 2 c2 s + 3 c3 s², without cancellation
    root = np.sqrt(np.maximum(c2**2 - 3.0 * a * c3, 0.0))
    sum_ = -(c2 + np.where(c2 >= 0.0, root, -root))
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.array([np.zeros_like(f), np.ones_like(f), a / sum_, sum_ / (3.0 * c3)])
    shares = np.fmin(np.fmax(shares, 0.0), 1.0)  # where there is no turn, an end again
    heights = f + shares * (a + shares * (c2 + shares * c3))
    least = heights.argmin(axis=0), np.arange(len(f))
    return shares[least], heights[least]


Places = tuple[np.ndarray, ...]
Names = Int[np.ndarray, " points"]


class EventFile:
    """Steps in which something happened, until they are located: room for `room` of them.

    `state` of the march counts them.
    """

    def __init__(self, size: int, room: int, state: Names) -> None:
        self._state = state
        ends = tuple(np.empty((room, size)) for _ in range(4))
        self.buffer = (*ends, np.empty((9, room)), np.empty((4, room), np.int64))

    @property
    def count(self) -> int:
        """How many there are."""
        return int(self._state[tick_kernels.EVENTS])

    def drain(self) -> tuple[Bracket, Float[np.ndarray, "3 some"]]:
        """Hand out everything; determinants at both ends of the steps, and their power of two."""
        count, self._state[tick_kernels.EVENTS] = self.count, 0
        z0, tangent0, z1, tangent1 = (each[:count].copy() for each in self.buffer[:4])
        values, (lanes, what, before, after) = (each[:, :count].copy() for each in self.buffer[4:])
        bracket = Bracket(
            lanes,
            Front(z0, values[0], tangent0, values[1], before),
            Front(z1, values[2], tangent1, values[3], after),
            values[4],
            values[5],
            what,
        )
        return bracket, values[6:]


class PointFile:
    """Regular points of all lanes, with the number of the try in which they were found."""

    def __init__(self, size: int, most: int, state: Names) -> None:
        self._size, self._most, self._room = size, most, FIRST_ROOM * most
        self._state, self.buffer = state, self._new()
        self._parts: list[tuple[Points, Names]] = []

    def _new(self) -> Places:
        room = self._room
        return np.empty((room, self._size)), np.empty((2, room)), np.empty((3, room), np.int64)

    def make_room(self) -> None:
        """Make room for one point of every lane."""
        if self._state[tick_kernels.POINTS] + self._most > self._room:
            self._seal()
            self._room = max(self._room, min(2 * self._room, ROOM))
            self.buffer = self._new()

    def _seal(self) -> None:
        z, values, names = self.buffer
        count = slice(0, int(self._state[tick_kernels.POINTS]))
        lanes, index, tries = names[:, count]
        points = Points(lanes, values[0, count], z[count], values[1, count], index)
        self._parts.append((points, tries))
        self._state[tick_kernels.POINTS] = 0

    def parts(self) -> list[tuple[Points, Names]]:
        """Everything so far, in parts."""
        self._seal()
        return self._parts


FIRST_ROOM, ROOM = 8, 4096
"""Points in the first part for each lane, and in later ones: each has twice the room of the one
before."""


def compiled_steps(
    curve: Curve, z: Lanes, constraints: tuple[Constraint, ...]
) -> tuple[CompiledSteps, Line] | None:
    """Loops of the structure, and straight lines: starts, velocities, and forces at both ends.

    None where the arrays do not fit, or another process still compiles the loops.
    """
    line = _line_of(curve)
    if line is None:
        return None
    structure, (lanes, size) = curve.structure, z.shape
    start, velocity, *forces = line
    fits = (
        start.shape == velocity.shape == (len(start), len(structure.parameters))
        and size == structure.size
    )
    fits &= all(each.shape in ((0, size), (lanes, size)) for each in forces)
    steps = structure.compiled_steps(constraints) if fits else None
    if steps and (is_awaited(steps.march) or is_awaited(steps.search)):
        return None
    return None if steps is None else (steps, line)


def _line_of(curve: Curve) -> Line | None:
    """A curve as a straight line, which may be a point, with forces; None if it is none."""
    if isinstance(curve, ParameterLine):
        none = np.zeros((0, curve.metric.size))
        line = curve.start, curve.velocity, none, none
    elif isinstance(curve, ForceLine):
        line = curve.p, np.zeros_like(curve.p), curve.first, curve.last
    else:
        return None
    start, velocity, first, last = (np.ascontiguousarray(each) for each in line)
    return start, velocity, first, last


class Workspace:
    """Arrays for Newton steps of rows of lanes, and for values of constraints there."""

    def __init__(self, rows: int, line: Line, constraints: int) -> None:
        parameters, (forces, size) = line[0].shape[1], line[2].shape
        dz, tangent, there = np.empty((3, rows, size))
        dt, slope, residual, self._ratio = np.empty((4, rows))
        determinant, (index, at) = np.empty((rows, 2)), np.empty((2, rows), np.int64)
        p, dp, p_there = np.empty((3, rows, parameters))
        self.move = Advance(dz, dt, tangent, slope, residual, index, determinant)
        self.columns = (dz, dt, tangent, slope, residual, index, determinant, self._ratio)
        force, growth = np.empty((2, rows if forces else 0, size))
        found = np.empty((constraints, rows))
        self.scratch = (p, dp, there, p_there, at, found, force, growth)

    def step_again(
        self,
        curve: Curve,
        trial: Lanes,
        row: Lanes,
        numbers: Float[np.ndarray, "numbers padded"],
        lanes: Int[np.ndarray, " active"],
        guard: float,
    ) -> None:
        """Let the structure take steps whose pivots are unsafe."""
        at = np.flatnonzero(~(self._ratio[: len(lanes)] >= guard))
        t, corner, defect = numbers[[kernels.TRIAL, kernels.CORNER, kernels.DEFECT]][:, at]
        again = curve.take(lanes[at]).advance(trial[at], t, row[at], corner, defect)
        for name, column in vars(again).items():
            getattr(self.move, name)[at] = column
