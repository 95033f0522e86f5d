"""Exact places of events inside bracketing steps, many at a time.

Branch points are regular solutions of minimally augmented systems [Govaerts2000]_: with
``[F_z b; bᵀ 0] [v; g] = [0; 1]`` the matrix F_z is singular exactly where g = 0, and
``∂g = −∂(vᵀF_z v)`` at fixed v. Folds, constraints and other scalars are roots along the curve,
found by inverse quadratic interpolation where the last three points allow it, else by bisection
[Chandrupatla1997]_; every trial point is corrected onto the curve.

See docs/decisions.md, "Events are roots of scalars along the curve".
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Flags, Lanes, Some, Values
from equimorph.equilibria import event_kernels as roots
from equimorph.equilibria import kernels
from equimorph.equilibria.critical import Critical, null_border
from equimorph.equilibria.curves import Curve, correction_size, dual, squared_length
from equimorph.equilibria.kernels import cubic_shares
from equimorph.equilibria.steps import Bracket, Front, new_scalars
from equimorph.structures import Advance

NEWTON_STEPS = 24
"""Largest number of Newton iterations towards a branch point."""
POLISHED = 1e-9
"""Correction after which a point is exact to round-off: Newton is quadratic."""
FAR = 1e6
"""A larger correction, in any unknown, is no step towards an event near by: the lane has failed."""


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
        cubic_shares(*ends, share)
        z[beyond], found[beyond] = polish(curve, hermite(bracket, share)[0], t[beyond])
        found[beyond] &= _inside(curve, bracket, z[beyond], t[beyond])
        step[beyond] *= share
    return Located(z, t, step, found)


def polish(curve: Curve, z: Lanes, t: Values) -> tuple[Lanes, Flags]:
    """Newton at fixed t until the correction stops shrinking; whether it reached round-off."""
    z, size = z.copy(), np.full(len(z), np.inf)
    todo = np.arange(len(z))
    for _ in range(NEWTON_STEPS):
        here, lanes = curve.take(todo), len(todo)
        still, one, none = np.zeros((lanes, z.shape[1])), np.ones(lanes), np.zeros(lanes)
        step = here.advance(z[todo], t[todo], still, one, none)
        new = correction_size(curve.metric, here.weight, step.dz, none)
        better = new < size[todo]
        todo = todo[better]
        z[todo] += step.dz[better]
        size[todo] = new[better]
        # the last correction of a quadratic iteration is squared by applying it
        todo = todo[new[better] > POLISHED]
        if len(todo) == 0:
            break
    return z, np.asarray(size <= POLISHED)


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


@dataclass(frozen=True)
class _Singular:
    """Null vector v, test function g, and the gradients (z, t) of g."""

    v: Lanes
    g: Values
    g_z: Lanes
    g_t: Values


def _test_function(curve: Curve, z: Lanes, t: Values, b: Lanes) -> _Singular:
    structure, p = curve.structure, curve.parameters(t)
    dp = curve.rate(t)
    rhs = np.zeros((len(z), 1, structure.size + 1))
    rhs[:, 0, -1] = 1.0
    border = (b[:, None], b[:, None], np.zeros((len(z), 1, 1)))
    solved = structure.solve(z, p, rhs, border).x[:, 0]
    v, g = np.ascontiguousarray(solved[:, :-1]), solved[:, -1]
    none_z, none_p = np.zeros_like(z), np.zeros_like(p)
    g_z = -structure.second_derivative(z, p, (v, none_p), (v, none_p))
    mixed = structure.second_derivative(z, p, (v, none_p), (none_z, dp))
    return _Singular(v, g, g_z, -np.einsum("li,li->l", v, mixed))


def _null_guess(curve: Curve, z: Lanes, t: Values) -> Lanes:
    """Approximate null vector of F_z: two steps of inverse iteration."""
    b = np.tile(np.cos(1.3 * np.arange(z.shape[1])) + 1.1, (len(z), 1))
    for _ in range(3):
        b = curve.structure.solve(z, curve.parameters(t), b[:, None]).x[:, 0]
        b = b / np.linalg.norm(b, axis=1, keepdims=True)
    return np.ascontiguousarray(b)


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
    root = root_inside(curve, bracket, lambda _, front: front.tangent_t, (a, b), share)
    return Located(root.z, root.t, root.at, root.found)


def locate_branch_point(curve: Curve, bracket: Bracket) -> Located:
    """Branch point of the path: ``F + βb = 0, g = 0, vᵀF_t = 0`` in (z, t, β)."""
    lanes = len(bracket.lanes)
    share = np.full(lanes, 0.5)
    z, t = hermite(bracket, share)
    beta, size = np.zeros(lanes), np.full(lanes, np.inf)
    b = _null_guess(curve, z, t)
    todo = np.arange(lanes)
    for _ in range(NEWTON_STEPS):
        here = curve.take(todo)
        step = _branch_step(here, z[todo], t[todo], b[todo], beta[todo])
        z[todo] += step[:, :-2]
        t[todo] += step[:, -2]
        beta[todo] += step[:, -1]
        size[todo] = correction_size(curve.metric, here.weight, step[:, :-2], step[:, -2])
        todo = todo[size[todo] >= 1e-13]
        if len(todo) == 0:
            break
    found = np.asarray((size < 1e-9) & (np.abs(beta) < 1e-9)) & _inside(curve, bracket, z, t)
    return Located(z, t, _arclength(curve, bracket, z, t, share), found)


def _branch_step(
    curve: Curve, z: Lanes, t: Values, b: Lanes, beta: Values
) -> Float[np.ndarray, "lanes unknowns"]:
    """Newton step (dz, dt, dβ) of the extended system of branch points."""
    structure, lanes = curve.structure, len(z)
    p, dp = curve.parameters(t), curve.rate(t)
    none_z, none_p = np.zeros_like(z), np.zeros_like(p)
    test = _test_function(curve, z, t, b)
    column = structure.parameter_derivative(z, p, dp)
    rhs = np.zeros((lanes, 1, structure.size + 1))
    rhs[:, 0, :-1] = column
    border = (b[:, None], b[:, None], np.zeros((lanes, 1, 1)))
    y = np.ascontiguousarray(structure.solve(z, p, rhs, border).x[:, 0, :-1])
    v = test.v
    mixed = structure.second_derivative(z, p, (v, none_p), (none_z, dp))
    h_z = mixed - structure.second_derivative(z, p, (v, none_p), (y, none_p))
    twice = structure.second_derivative(z, p, (none_z, dp), (none_z, dp))
    twice += structure.parameter_derivative(z, p, curve.bend(t))
    h_t = np.einsum("li,li->l", v, twice) - np.einsum("li,li->l", y, mixed)
    residual = structure.residual(z, p) + beta[:, None] * b
    h = np.einsum("li,li->l", v, column)
    rhs = np.concatenate([-residual, -test.g[:, None], -h[:, None]], axis=1)[:, None]
    corner = np.zeros((lanes, 2, 2))
    corner[:, 0, 0], corner[:, 1, 0] = test.g_t, h_t
    border = (np.stack([column, b], 1), np.stack([test.g_z, h_z], 1), corner)
    return _bounded(structure.solve(z, p, rhs, border).x[:, 0])


def _bounded(step: Lanes) -> Lanes:
    """Corrections, with those that lead nowhere replaced by large ones that cannot overflow."""
    near = (np.abs(step) < FAR).all(axis=1)
    return np.asarray(np.where(near[:, None], step, FAR))


def _arclength(curve: Curve, bracket: Bracket, z: Lanes, t: Values, share: Values) -> Values:
    """Arclength of a point of the curve from the bracket's start, by projection on the tangent."""
    along = _along(curve, bracket.before, z, t)
    clipped = np.clip(along, 0.0, bracket.step)
    return np.asarray(np.where(np.isfinite(along), clipped, share * bracket.step))


def locate_root(
    curve: Curve, bracket: Bracket, function: Callable[[Some, Lanes, Values], Values]
) -> Located:
    """Zero of a scalar of the state that changes sign over the step.

    `function` gets the numbers of lanes, z and t.
    """
    everyone = np.arange(len(bracket.lanes))
    # a start on the bound may exceed it by round-off: then it is itself the root
    low = np.minimum(function(everyone, bracket.before.z, bracket.before.t), 0.0)
    high = function(everyone, bracket.after.z, bracket.after.t)
    share = np.clip(low / (low - high), 1e-3, 1.0 - 1e-3)

    def scalar(some: Some, front: Front) -> Values:
        return function(some, front.z, front.t)

    root = root_inside(curve, bracket, scalar, (low, high), share)
    return Located(root.z, root.t, root.at, root.found)


def locate_critical(curve: Curve, bracket: Bracket) -> Located:
    """Where an eigenvalue of F_z vanishes on a curve that is regular there."""
    structure = curve.structure
    z, p = curve.states(bracket.after.z, bracket.after.t)
    b = null_border(structure, z, p)

    def gap(some: Some, z: Lanes, t: Values) -> Values:
        z, p = curve.take(some).states(z, t)
        return Critical(structure, z, p, b[some]).g

    everyone = np.arange(len(bracket.lanes))
    ends = tuple(gap(everyone, front.z, front.t) for front in (bracket.before, bracket.after))
    share = np.clip(ends[0] / (ends[0] - ends[1]), 1e-3, 1.0 - 1e-3)
    change = np.sign(ends[0]) != np.sign(ends[1])

    def scalar(some: Some, front: Front) -> Values:
        return gap(some, front.z, front.t)

    root = root_inside(curve, bracket, scalar, (ends[0], ends[1]), share)
    return Located(root.z, root.t, root.at, root.found & change)


Scalar = Callable[[Some, Front], Float[np.ndarray, " some"]]

VALUE = 1e-13
"""Value of the scalar over that at the ends of the step that counts as zero."""


@dataclass(frozen=True)
class Root:
    """Points where the scalar vanishes, their lengths from the start of the step, and success."""

    z: Lanes
    t: Values
    at: Values
    found: Flags


def root_inside(
    curve: Curve, bracket: Bracket, scalar: Scalar, ends: tuple[Values, Values], guess: Values
) -> Root:
    """Zero of a scalar with values of opposite signs at the ends of a step.

    Parameters
    ----------
    scalar
        Values at points on some of the lanes, whose numbers come first.
    ends
        Values at both ends of the step; a zero at the start is the root.
    guess
        Share of the step that is tried first.
    """
    search = _Search(curve, bracket, ends, guess)
    while search.active:
        search.round(scalar)
    return search.root


class _Search:
    """All lanes of one search, each somewhere in an iteration of its own."""

    def __init__(
        self, curve: Curve, bracket: Bracket, ends: tuple[Values, Values], guess: Values
    ) -> None:
        lanes, (old, new) = len(guess), (bracket.before, bracket.after)
        self.curve, self.active = curve, lanes
        ends_of_steps = (old.z, new.z, new.tangent_z, old.z, old.tangent_z)
        work = (np.empty_like(old.z), np.empty_like(old.z))
        self._places = (*(each.copy() for each in ends_of_steps), *work)
        self._scalars, self._ends = new_scalars(lanes), np.empty((roots.ENDS, lanes))
        self._scalars[1][kernels.LANE] = np.arange(lanes)
        for row_number, column in (
            (roots.X1, bracket.step), (roots.F1, ends[1]), (roots.T1, new.t),
            (roots.SLOPE1, new.tangent_t), (roots.X2, 0.0), (roots.F2, ends[0]),
            (roots.T2, old.t), (roots.SLOPE2, old.tangent_t), (roots.T0, old.t),
            (roots.SHARE, 1.0 - guess),
            (roots.SMALL, VALUE * (np.abs(ends[0]) + np.abs(ends[1]))),
        ):  # fmt: skip
            self._ends[row_number] = column
        self.root = Root(old.z.copy(), np.empty(lanes), np.empty(lanes), np.zeros(lanes, bool))
        mass = curve.metric.mass
        roots.begin(curve.weight, mass, self._places, *self._scalars, self._ends, lanes)
        self._here = curve
        self._close()

    def round(self, scalar: Scalar) -> None:
        """One Newton step of every lane, and all that follows from it."""
        active, (numbers, counts) = self.active, self._scalars
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
        root, counts = self.root, self._scalars[1]
        state = (self._places, counts, self._ends, self.active)
        roots.hand_out(*state, root.z, root.t, root.at, root.found)
        left = (self._places, *self._scalars, self._ends, self.active)
        self.active = kernels.close_gaps(*left)
        self._here = self.curve.take(counts[kernels.LANE, : self.active])
