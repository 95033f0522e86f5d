"""Exact places of events inside bracketing steps, many at a time.

Folds and branch points are regular solutions of minimally augmented systems [Govaerts2000]_: with
``[F_z b; bᵀ 0] [v; g] = [0; 1]`` the matrix F_z is singular exactly where g = 0, and
``∂g = −∂(vᵀF_z v)`` at fixed v. Constraints are roots of a scalar along the curve.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from equimorph.equilibria.curves import (
    Curve,
    ParameterLine,
    correction_size,
    dual,
    squared_length,
)
from equimorph.equilibria.fronts import Bracket, Front, step_along

Lanes = Float[np.ndarray, "lanes size"]
Values = Float[np.ndarray, " lanes"]
Flags = Bool[np.ndarray, " lanes"]

NEWTON_STEPS = 12
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


def _share(function: Callable[[Values], Values], lanes: int) -> Values:
    """Root in [0, 1] of a function with a sign change, by bisection on the cubic."""
    low, high = np.zeros(lanes), np.ones(lanes)
    sign = np.sign(function(low))
    for _ in range(40):
        middle = 0.5 * (low + high)
        same = np.sign(function(middle)) == sign
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return 0.5 * (low + high)


def locate_goal(curve: Curve, bracket: Bracket, goal: float) -> Located:
    """Where t reaches `goal` (0 or 1): Newton at fixed parameters, from the cubic."""
    share = _share(lambda s: hermite(bracket, s)[1] - goal, len(bracket.lanes))
    z, _ = hermite(bracket, share)
    t = np.full(len(z), goal)
    z, found = polish(curve, z, t)
    found &= _inside(curve, bracket, z, t)
    return Located(z, t, share * bracket.step, found)


def polish(curve: Curve, z: Lanes, t: Values) -> tuple[Lanes, Flags]:
    """Newton at fixed t until the correction stops shrinking; whether it reached round-off."""
    still, one, none = np.zeros_like(z), np.ones(len(z)), np.zeros(len(z))
    size = np.full(len(z), np.inf)
    z = z.copy()
    for _ in range(NEWTON_STEPS):
        step = curve.advance(z, t, still, one, none)
        new = correction_size(curve.structure, curve.weight, step.dz, none)
        better = new < size
        z[better] += step.dz[better]
        size = np.where(better, new, size)
        if (~better | (new < 1e-13)).all():
            break
    return z, np.asarray(size < 1e-9)


def _inside(curve: Curve, bracket: Bracket, z: Lanes, t: Values) -> Flags:
    """Whether points lie between the ends of their step: a guard against jumps and neighbours."""
    old, new = bracket.before, bracket.after
    gap = squared_length(curve.structure, curve.weight, z - old.z, t - old.t)
    slack = 1e-3 * bracket.step + 1e-9
    along, whole = _along(curve, old, z, t), _along(curve, old, new.z, new.t)
    between = (along >= -slack) & (along <= whole + slack)
    return np.asarray(between & (np.sqrt(gap) <= bracket.step + slack))


def _along(curve: Curve, front: Front, z: Lanes, t: Values) -> Values:
    """Distance of points along the tangents of `front`."""
    row, corner = dual(curve.structure, curve.weight, front.tangent_z, front.tangent_t)
    return np.asarray(np.einsum("li,li->l", row, z - front.z) + corner * (t - front.t))


def _velocity(curve: Curve, lanes: int) -> Float[np.ndarray, "lanes parameters"]:
    if isinstance(curve, ParameterLine):
        return curve.velocity
    return np.zeros((lanes, len(curve.structure.parameters)))


@dataclass(frozen=True)
class _Singular:
    """Null vector v, test function g, and the gradients (z, t) of g."""

    v: Lanes
    g: Values
    g_z: Lanes
    g_t: Values


def _test_function(curve: Curve, z: Lanes, t: Values, b: Lanes) -> _Singular:
    structure, p = curve.structure, curve.parameters(t)
    dp = _velocity(curve, len(z))
    rhs = np.zeros((len(z), 1, structure.size + 1))
    rhs[:, 0, -1] = 1.0
    border = (b[:, None], b[:, None], np.zeros((len(z), 1, 1)))
    solved = structure.solve(z, p, rhs, border).x[:, 0]
    v, g = np.ascontiguousarray(solved[:, :-1]), solved[:, -1]
    none_z, none_p = np.zeros_like(z), np.zeros_like(p)
    g_z = -structure.second_derivative(z, p, (v, none_p), (v, none_p))
    mixed = structure.second_derivative(z, p, (v, none_p), (none_z, dp))
    return _Singular(v, g, g_z, -np.einsum("li,li->l", v, mixed))


def _column(curve: Curve, z: Lanes, t: Values) -> Lanes:
    """F_t."""
    if isinstance(curve, ParameterLine):
        return curve.structure.parameter_derivative(z, curve.parameters(t), curve.velocity)
    raise TypeError("events are located on lines in parameter space only")


def _null_guess(curve: Curve, z: Lanes, t: Values) -> Lanes:
    """Approximate null vector of F_z: two steps of inverse iteration."""
    b = np.tile(np.cos(1.3 * np.arange(z.shape[1])) + 1.1, (len(z), 1))
    for _ in range(3):
        b = curve.structure.solve(z, curve.parameters(t), b[:, None]).x[:, 0]
        b = b / np.linalg.norm(b, axis=1, keepdims=True)
    return np.ascontiguousarray(b)


def locate_fold(curve: Curve, bracket: Bracket) -> Located:
    """Fold of the path: ``F = 0, g = 0`` in (z, t), regular where the path turns back."""
    lanes = len(bracket.lanes)
    old, new = bracket.before.tangent_t, bracket.after.tangent_t
    share = old / (old - new)
    z, t = hermite(bracket, share)
    b = (1 - share)[:, None] * bracket.before.tangent_z + share[:, None] * bracket.after.tangent_z
    b = b / np.linalg.norm(b, axis=1, keepdims=True)
    size = np.full(lanes, np.inf)
    for _ in range(NEWTON_STEPS):
        test = _test_function(curve, z, t, b)
        residual = curve.structure.residual(z, curve.parameters(t))
        rhs = np.concatenate([-residual, -test.g[:, None]], axis=1)[:, None]
        border = (_column(curve, z, t)[:, None], test.g_z[:, None], test.g_t[:, None, None])
        step = _bounded(curve.structure.solve(z, curve.parameters(t), rhs, border).x[:, 0])
        z, t = z + step[:, :-1], t + step[:, -1]
        size = correction_size(curve.structure, curve.weight, step[:, :-1], step[:, -1])
        b = test.v / np.linalg.norm(test.v, axis=1, keepdims=True)
        if (size < 1e-13).all():
            break
    found = np.asarray(size < 1e-9) & _inside(curve, bracket, z, t)
    return Located(z, t, _arclength(curve, bracket, z, t, share), found)


def locate_branch_point(curve: Curve, bracket: Bracket) -> Located:
    """Branch point of the path: ``F + βb = 0, g = 0, vᵀF_t = 0`` in (z, t, β)."""
    structure, lanes = curve.structure, len(bracket.lanes)
    share = np.full(lanes, 0.5)
    z, t = hermite(bracket, share)
    dp = _velocity(curve, lanes)
    b = _null_guess(curve, z, t)
    beta, size = np.zeros(lanes), np.full(lanes, np.inf)
    for _ in range(NEWTON_STEPS):
        p = curve.parameters(t)
        none_z, none_p = np.zeros_like(z), np.zeros_like(p)
        test, column = _test_function(curve, z, t, b), _column(curve, z, t)
        rhs = np.zeros((lanes, 1, structure.size + 1))
        rhs[:, 0, :-1] = column
        border = (b[:, None], b[:, None], np.zeros((lanes, 1, 1)))
        y = np.ascontiguousarray(structure.solve(z, p, rhs, border).x[:, 0, :-1])
        v = test.v
        mixed = structure.second_derivative(z, p, (v, none_p), (none_z, dp))
        h_z = mixed - structure.second_derivative(z, p, (v, none_p), (y, none_p))
        twice = structure.second_derivative(z, p, (none_z, dp), (none_z, dp))
        h_t = np.einsum("li,li->l", v, twice) - np.einsum("li,li->l", y, mixed)
        residual = structure.residual(z, p) + beta[:, None] * b
        h = np.einsum("li,li->l", v, column)
        rhs = np.concatenate([-residual, -test.g[:, None], -h[:, None]], axis=1)[:, None]
        corner = np.zeros((lanes, 2, 2))
        corner[:, 0, 0], corner[:, 1, 0] = test.g_t, h_t
        border = (np.stack([column, b], 1), np.stack([test.g_z, h_z], 1), corner)
        step = _bounded(structure.solve(z, p, rhs, border).x[:, 0])
        z, t, beta = z + step[:, :-2], t + step[:, -2], beta + step[:, -1]
        size = correction_size(structure, curve.weight, step[:, :-2], step[:, -2])
        if (size < 1e-13).all():
            break
    found = np.asarray((size < 1e-9) & (np.abs(beta) < 1e-9)) & _inside(curve, bracket, z, t)
    return Located(z, t, _arclength(curve, bracket, z, t, share), found)


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
    curve: Curve, bracket: Bracket, function: Callable[[Lanes, Values], Values]
) -> Located:
    """First zero of a scalar that changes sign over the step: regula falsi (Illinois) on the curve.

    Every trial point is corrected onto the curve at its arclength, so that the root is exact.
    """
    front, lanes = bracket.before, len(bracket.lanes)
    low, high = np.zeros(lanes), bracket.step.copy()
    # a start on the bound may exceed it by round-off: then it is itself the root
    f_low = np.minimum(function(front.z, front.t), 0.0)
    f_high = function(bracket.after.z, bracket.after.t)
    here, found = front, np.ones(lanes, bool)
    at = high.copy()
    for _ in range(60):
        at = np.clip((low * f_high - high * f_low) / (f_high - f_low), low, high)
        here, good = step_along(curve, front, at)
        tiny = at < 1e-12
        here = here.updated(front, tiny)
        value = function(here.z, here.t)
        found = good | tiny
        same = np.sign(value) == np.sign(f_high)
        f_low = np.where(same, 0.5 * f_low, value)
        f_high = np.where(same, value, 0.5 * f_high)
        low, high = np.where(same, low, at), np.where(same, at, high)
        if ((np.abs(value) < 1e-13) | (high - low < 1e-14) | ~found).all():
            break
    return Located(here.z, here.t, at, found & _inside(curve, bracket, here.z, here.t))
