"""Exact places of events inside bracketing steps, many at a time.

Branch points are points with the condition `Crossing` along the curve. Folds, constraints and other
scalars are roots along the curve, found by inverse quadratic interpolation where the last three
points allow it, else by bisection [Chandrupatla1997]_; every trial point is corrected onto it.

See docs/decisions.md, "Events are roots of scalars along the curve".
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Flags, Float, Lanes, Parameters, Some, Values
from equimorph.equilibria.critical import Critical, normal_form, null_border
from equimorph.equilibria.curves import AlongCurve, Curve, along_parameters, dual, squared_length
from equimorph.equilibria.newton_step import Planes
from equimorph.equilibria.point_conditions import Crossing
from equimorph.equilibria.settle import Guards, Settled, settle
from equimorph.equilibria.steps import (
    IN_CACHE,
    Bracket,
    Front,
    Line,
    Workspace,
    compiled_steps,
    new_scalars,
)
from equimorph.linalg.simd import LANES
from equimorph.marching import (
    event_kernels as roots,
    kernels,
    search_kernels as searches,
    tick_kernels as ticks,
)
from equimorph.model import Constraint
from equimorph.structures import Advance
from equimorph.structures.contract import CompiledSteps

AT_ROUND_OFF = Guards(iterations=24, converged=1e-9)
"""A point is exact after a correction below 1e-9 in the metric: Newton squares the error."""
UNFOLDED = 1e-9
"""Square of the distance, in the metric, at which curves pass each other that count as crossing."""
TINY = 1e-300
"""Least length of a curve in the metric: curves without length have no branch points."""


@dataclass(frozen=True)
class Located:
    """Events found: points on the curves, arclength from the start of the bracket, success."""

    z: Lanes
    t: Values
    step: Values
    found: Flags


def hermite(bracket: Bracket, share: Values) -> tuple[Lanes, Values]:
    """Cubic through both ends and tangents of a step, at a share of its length."""
    s = share
    a, b = 2 * s**3 - 3 * s**2 + 1, -2 * s**3 + 3 * s**2
    c, d = (s**3 - 2 * s**2 + s) * bracket.step, (s**3 - s**2) * bracket.step
    old, new = bracket.before, bracket.after
    z = a[:, None] * old.z + b[:, None] * new.z
    z = z + c[:, None] * old.tangent_z + d[:, None] * new.tangent_z
    t = a * old.t + b * new.t + c * old.tangent_t + d * new.tangent_t
    return z, t


def locate_goal(curve: Curve, bracket: Bracket, goal: float) -> Located:
    """Where t reaches `goal` (0 or 1): Newton at fixed parameters, from the cubic.

    Most steps end there, exactly.
    """
    z, step = bracket.after.z.copy(), bracket.step.copy()
    t, found = np.full(len(z), goal), np.ones(len(z), bool)
    beyond = np.flatnonzero(bracket.after.t != goal)
    if len(beyond):
        curve, bracket = curve.take(beyond), bracket.take(beyond)
        old, new, share = bracket.before, bracket.after, np.empty(len(beyond))
        ends = (old.t - goal, new.t - goal, old.tangent_t, new.tangent_t, bracket.step)
        roots.cubic_shares(*ends, share)
        z[beyond], found[beyond] = polish(curve, hermite(bracket, share)[0], t[beyond])
        found[beyond] &= _inside(curve, bracket, z[beyond], t[beyond])
        # measured as where folds and constraints are: which of them comes first decides the end
        step[beyond] = _arclength(curve, bracket, z[beyond], t[beyond], share)
    return Located(z, t, step, found)


def polish(curve: Curve, z: Lanes, t: Values) -> tuple[Lanes, Flags]:
    """Points at fixed t near guesses, exact to round-off, and which were found."""
    shrinking = replace(AT_ROUND_OFF, contraction=1.0)
    found = settle(AlongCurve(curve), z, along_parameters(t), guards=shrinking)
    return found.z, found.found


def _inside(curve: Curve, bracket: Bracket, z: Lanes, t: Values) -> Flags:
    """Whether points lie between the ends of their step: a guard against jumps and neighbours."""
    old, new = bracket.before, bracket.after
    gap = squared_length(curve.metric, curve.weight, z - old.z, t - old.t)
    slack = 1e-3 * bracket.step + 1e-9
    along, whole = _along(curve, old, z, t), _along(curve, old, new.z, new.t)
    between = (along >= -slack) & (along <= whole + slack)
    return np.asarray(between & (np.sqrt(gap) <= bracket.step + slack))


def _along(curve: Curve, front: Front, z: Lanes, t: Values) -> Values:
    """Distance of points along the tangents of `front`."""
    row, corner = dual(curve.metric, curve.weight, front.tangent_z, front.tangent_t)
    return np.asarray(np.einsum("li,li->l", row, z - front.z) + corner * (t - front.t))


def locate_fold(curve: Curve, bracket: Bracket) -> Located:
    """Locate the fold inside each step, where dt/ds changes sign, as the zero of dt/ds.

    The path is regular there, so that neither g nor a null vector is needed. The first trial is the
    turning point of the cubic through both ends.
    """
    old, new = bracket.before, bracket.after
    a, b = old.tangent_t, new.tangent_t
    # slope of the cubic at a share s: a + 2 s bend + 3 s² bow
    rise = (new.t - old.t) / bracket.step
    bend, bow = 3 * rise - 2 * a - b, a + b - 2 * rise
    under = np.maximum(bend**2 - 3 * bow * a, 0.0)
    share = np.clip(a / (-bend + np.sign(a) * np.sqrt(under)), 1e-3, 1.0 - 1e-3)
    return root_inside(curve, bracket, lambda _, front: front.tangent_t, (a, b), share, ())


def locate_branch_point(curve: Curve, bracket: Bracket) -> Located:
    """Branch point of the path: ``F + βb = 0, g = 0, vᵀF_t = 0`` in (z, t, β)."""
    share = np.full(len(bracket.lanes), 0.5)
    z, t = hermite(bracket, share)
    equations, p = AlongCurve(curve), along_parameters(t)
    directions = np.zeros((len(t), 1, 2))
    directions[:, 0, 0] = 1.0 / np.maximum(curve.weight, TINY)
    b = null_border(equations, z, p)
    crossing, frame = (Crossing(directions),), _across(curve, b)
    found = settle(equations, z, p, directions, crossing, AT_ROUND_OFF, frame, frames=False)
    z, t = found.z, found.p[:, 0].copy()
    inside = found.found & _inside(curve, bracket, z, t)
    good = _crosses(equations, found, np.flatnonzero(inside), directions[:, 0], b)
    return Located(z, t, _arclength(curve, bracket, z, t, share), good)


def _crosses(equations: AlongCurve, found: Settled, at: Some, step: Parameters, b: Lanes) -> Flags:
    """Which of some points where F + βb = 0 are crossings of curves that do not pass at a distance.

    By the reduced equation ``β (φ·b) + ½ (Aξ² + 2Bξτ + Cτ²) = 0``, so that neither the unit of the
    energy nor the number of unknowns counts.
    """
    crosses = np.zeros(len(found.z), bool)
    form = normal_form(equations, found.z[at], found.p[at], step[at])
    rise = np.abs(found.unfolding[at] * np.einsum("li,li->l", form.phi, b[at]))
    bend = np.max(np.abs([form.quadratic, form.mixed, form.path]), axis=0)
    crosses[at] = rise < UNFOLDED * bend
    return crosses


def _across(curve: Curve, b: Lanes) -> Planes:
    """Coordinates of all paths near branch points: the share of the null vector b, and t."""
    lanes, size = b.shape
    by_z, by_p = np.zeros((lanes, 2, size)), np.zeros((lanes, 2, 2))
    by_z[:, 0], by_p[:, 1, 0] = b, curve.weight
    return Planes(by_z, by_p, np.zeros((lanes, 2)), b)


def _arclength(curve: Curve, bracket: Bracket, z: Lanes, t: Values, share: Values) -> Values:
    """Arclength of a point of the curve from the bracket's start, by projection on the tangent."""
    along = _along(curve, bracket.before, z, t)
    clipped = np.clip(along, 0.0, bracket.step)
    return np.asarray(np.where(np.isfinite(along), clipped, share * bracket.step))


def locate_root(
    curve: Curve,
    bracket: Bracket,
    function: Callable[[Some, Lanes, Values], Values],
    constraints: tuple[Constraint, ...] | None = None,
) -> Located:
    """Zero of a scalar of the state that changes sign over the step.

    `function` gets the numbers of lanes, z and t; `constraints` are those whose largest excess it
    is, if it is one.
    """
    everyone = np.arange(len(bracket.lanes))
    # a start on the bound may exceed it by round-off: then it is itself the root
    low = np.minimum(function(everyone, bracket.before.z, bracket.before.t), 0.0)
    high = function(everyone, bracket.after.z, bracket.after.t)
    share = np.clip(low / (low - high), 1e-3, 1.0 - 1e-3)

    def scalar(some: Some, front: Front) -> Values:
        return function(some, front.z, front.t)

    return root_inside(curve, bracket, scalar, (low, high), share, constraints or None)


def locate_critical(curve: Curve, bracket: Bracket) -> Located:
    """Where an eigenvalue of F_z vanishes on a curve that is regular there."""
    structure = curve.structure
    z, p = curve.states(bracket.after.z, bracket.after.t)
    b = null_border(structure, z, p)

    def gap(some: Some, z: Lanes, t: Values) -> Values:
        z, p = curve.take(some).states(z, t)
        return np.asarray(sign[some] * Critical(structure, z, p, b[some]).g)

    everyone, sign = np.arange(len(bracket.lanes)), np.ones(len(bracket.lanes))
    ends = [gap(everyone, front.z, front.t) for front in (bracket.before, bracket.after)]
    sign = np.where(ends[0] > 0.0, -1.0, 1.0)
    root = locate_root(curve, bracket, gap)
    return replace(root, found=root.found & (np.sign(ends[0]) != np.sign(ends[1])))


Scalar = Callable[[Some, Front], Float[np.ndarray, " some"]]


def root_inside(
    curve: Curve,
    bracket: Bracket,
    scalar: Scalar,
    ends: tuple[Values, Values],
    guess: Values,
    constraints: tuple[Constraint, ...] | None = None,
) -> Located:
    """Zero of a scalar with values of opposite signs at the ends of a step.

    Parameters
    ----------
    scalar
        Values at points on the lanes whose numbers are the first argument.
    ends
        Values at both ends of the step; a zero at the start is the root.
    guess
        Share of the step that is tried first.
    constraints
        Those whose largest excess is the scalar; none of them, if it is dt/ds.
    """
    search = _Search(curve, bracket, ends, guess)
    compiled = None
    if constraints is not None:
        compiled = compiled_steps(curve, bracket.before.z, constraints)
    if compiled:
        search.run(*compiled)
    else:
        search.run_by_rounds(scalar)
    return search.root


class _Search:
    """All lanes of one search, each in an independent iteration.

    This is no corrector by itself: while trial points are on their way onto the curve, by the steps
    of the march, the search chooses where along it they are tried.
    """

    def __init__(
        self, curve: Curve, bracket: Bracket, ends: tuple[Values, Values], guess: Values
    ) -> None:
        lanes, (old, new) = len(guess), (bracket.before, bracket.after)
        values = np.empty((8, lanes))
        for row, each in enumerate(
            (bracket.step, *ends, old.t, new.t, old.tangent_t, new.tangent_t, guess)
        ):
            values[row] = each
        points = (old.z, old.tangent_z, new.z, new.tangent_z)
        self._steps = (*(np.ascontiguousarray(each) for each in points), values)
        self.curve, self._state = curve, np.zeros(3, np.int64)
        self.root = Located(old.z.copy(), np.empty(lanes), np.empty(lanes), np.zeros(lanes, bool))

    def _make_room(self, most: int) -> None:
        """Make room for so many lanes at a time."""
        lanes, size = self.root.z.shape
        rows = max(min(lanes, most), LANES)
        self._places = tuple(np.empty((rows, size)) for _ in range(7))
        self._scalars, self._ends = new_scalars(rows), np.empty((roots.ENDS, rows))

    def run(self, steps: CompiledSteps, line: Line) -> None:
        """All rounds in the structure's loop."""
        self._make_room(IN_CACHE)
        (numbers, counts), root, rows = self._scalars, self.root, len(self._places[0])
        trial, row = self._places[5:]
        space, state = Workspace(rows, line, len(steps.bounds)), self._state
        problem = (line, self.curve.weight, self.curve.metric.mass, steps.guard)
        block = (self._places, numbers, counts, self._ends, state)
        found = (root.z, root.t, root.step, root.found)
        given = (problem, self._steps, block, space.columns, space.scratch, np.empty(rows), found)
        while steps.search(steps.tables, steps.bounds, *given) == ticks.UNSAFE:
            lanes = counts[kernels.LANE, : state[ticks.ACTIVE]]
            space.step_again(self.curve, trial, row, numbers, lanes, steps.guard)

    def run_by_rounds(self, scalar: Scalar) -> None:
        """All rounds by the methods of any structure."""
        self._make_room(len(self.root.t))
        around = (self.curve.weight, self.curve.metric.mass, self._steps)
        searches.admit(*around, self._places, *self._scalars, self._ends, self._state)
        self._close()
        while self._state[ticks.ACTIVE] > 0:
            self._round(scalar)

    def _round(self, scalar: Scalar) -> None:
        """One Newton step of every lane, and all that follows from it."""
        active, (numbers, counts) = int(self._state[ticks.ACTIVE]), self._scalars
        trial, row = (place[:active] for place in self._places[5:])
        closing = numbers[kernels.CORNER, :active], numbers[kernels.DEFECT, :active]
        move = self._here.advance(trial, numbers[kernels.TRIAL, :active], row, *closing)
        mass, steps = self.curve.metric.mass, (move.dz, move.dt, move.tangent_z, move.tangent_t)
        kernels.correct(*steps, mass, trial, numbers, counts, active, kernels.EXACT, 0.0)
        values = np.zeros(active)
        there = np.flatnonzero(counts[kernels.STAGE, :active] == kernels.CONVERGED)
        if len(there):
            values[there] = scalar(counts[kernels.LANE, there], self._front(there, move))
            state = (self._places, numbers, counts, self._ends, active)
            roots.shrink(values, move.tangent_z, mass, *state)
        if (counts[kernels.STAGE, :active] != kernels.CORRECTING).any():
            self._close()

    def _front(self, at: Some, move: Advance) -> Front:
        """Trial points that converged, with unit tangents."""
        numbers = self._scalars[0][:, at]
        tangent = move.tangent_z[at] / numbers[kernels.NORM][:, None]
        t, slope = numbers[kernels.TRIAL], numbers[kernels.NEW_SLOPE]
        return Front(self._places[5][at], t, tangent, slope, move.index[at])

    def _close(self) -> None:
        """Write down what is finished and close the gaps."""
        root, counts, active = self.root, self._scalars[1], int(self._state[ticks.ACTIVE])
        state = (self._places, counts, self._ends, active)
        roots.hand_out(*state, root.z, root.t, root.step, root.found)
        left = kernels.close_gaps(self._places, *self._scalars, self._ends, active)
        self._state[ticks.ACTIVE] = left
        self._here = self.curve.take(counts[kernels.LANE, :left])
