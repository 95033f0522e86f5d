"""Exact points with two conditions: on a fold and a constraint, or on one of them midway."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.manifold.pairing import Setting
from equimorph.manifold.points import CAP, CORNER, FOLD, Points

Lanes = Float[np.ndarray, "lanes size"]
Parameters = Float[np.ndarray, "lanes parameters"]
Place = tuple[Lanes, Parameters]
Values = Float[np.ndarray, " lanes"]

NEWTON_STEPS = 15
DIFFERENCE = 1e-6


@dataclass(frozen=True)
class Pinned:
    """Points found between pairs of points, with their parameters, and which can be trusted."""

    z: Lanes
    p: Parameters
    found: Bool[np.ndarray, " lanes"]


@dataclass(frozen=True)
class _Condition:
    """Scalar conditions with their gradients with respect to z and the two free parameters."""

    value: Values
    by_z: Lanes
    by_x: Float[np.ndarray, "lanes 2"]


def pin(
    setting: Setting,
    points: Points,
    pairs: Int[np.ndarray, "lanes 2"],
    kinds: Int[np.ndarray, " lanes"],
) -> Pinned:
    """Newton on F = 0 with two conditions, from the middle of each pair.

    kinds: `CORNER` (det F_z = 0 and the constraint active), `FOLD` (det F_z = 0, midway) or `CAP`
    (constraint active, midway). Midway: in the plane through the middle, normal to the pair in the
    embedding.
    """
    structure, free = setting.structure, setting.free
    first, second = points.z[pairs[:, 0]], points.z[pairs[:, 1]]
    p_first, p_second = points.p[pairs[:, 0]], points.p[pairs[:, 1]]
    z, p = 0.5 * (first + second), 0.5 * (p_first + p_second)
    middle = (z.copy(), p.copy())
    b = _difference(first, second)
    size = np.full(len(z), np.inf)
    for _ in range(NEWTON_STEPS):
        fold, b = _fold_condition(setting, z, p, b)
        cap = _cap_condition(setting, z, p)
        half = _middle_condition(setting, (z, p), middle, (first - second, p_first - p_second))
        one = _choose(kinds == CAP, cap, fold)
        two = _choose(kinds == CORNER, cap, half)
        residual = structure.residual(z, p)
        rhs = np.concatenate([-residual, -one.value[:, None], -two.value[:, None]], axis=1)
        columns = np.stack([_by_parameter(setting, z, p, k) for k in range(2)], axis=1)
        border = (columns, np.stack([one.by_z, two.by_z], 1), np.stack([one.by_x, two.by_x], 1))
        step = structure.solve(z, p, rhs[:, None], border).x[:, 0]
        size = np.abs(step).max(axis=1)
        share = np.minimum(1.0, 0.5 / np.maximum(size, 1e-300))
        z = z + share[:, None] * step[:, :-2]
        p[:, free] += share[:, None] * step[:, -2:]
        if (size < 1e-12).all():
            break
    return Pinned(z, p, _trusted(setting, (z, p), middle, (first, p_first), size))


def _trusted(
    setting: Setting,
    found: Place,
    middle: Place,
    end: Place,
    size: Values,
) -> Bool[np.ndarray, " lanes"]:
    """Converged, and not farther from the middle than three half-lengths of the pair."""

    def gap(a: Place, b: Place) -> Values:
        n = setting.structure.unknowns
        square = (a[0] - b[0])[:, :n] ** 2 @ setting.structure.mass
        by_scale = (a[1] - b[1]) / setting.structure.scales
        return np.asarray(np.sqrt(square + (by_scale**2).sum(axis=1)))

    near = gap(found, middle) <= 3.0 * gap(end, middle) + 1e-3
    return np.asarray((size < 1e-8) & near)


def _difference(first: Lanes, second: Lanes) -> Lanes:
    b = first - second
    return np.asarray(b / np.maximum(np.linalg.norm(b, axis=1, keepdims=True), 1e-300))


def _choose(which: Bool[np.ndarray, " lanes"], yes: _Condition, no: _Condition) -> _Condition:
    return _Condition(
        np.where(which, yes.value, no.value),
        np.where(which[:, None], yes.by_z, no.by_z),
        np.where(which[:, None], yes.by_x, no.by_x),
    )


def _unit_parameter(setting: Setting, lanes: int, k: int) -> Float[np.ndarray, "lanes P"]:
    dp = np.zeros((lanes, len(setting.base)))
    dp[:, setting.free[k]] = 1.0
    return dp


def _by_parameter(setting: Setting, z: Lanes, p: Parameters, k: int) -> Lanes:
    return setting.structure.parameter_derivative(z, p, _unit_parameter(setting, len(z), k))


def _fold_condition(
    setting: Setting, z: Lanes, p: Parameters, b: Lanes
) -> tuple[_Condition, Lanes]:
    """Test function g of ``[F_z b; bᵀ 0] [v; g] = [0; 1]``, and v for the next round."""
    structure, lanes = setting.structure, len(z)
    rhs = np.zeros((lanes, 1, structure.size + 1))
    rhs[:, 0, -1] = 1.0
    border = (b[:, None], b[:, None], np.zeros((lanes, 1, 1)))
    solved = structure.solve(z, p, rhs, border).x[:, 0]
    v, g = np.ascontiguousarray(solved[:, :-1]), solved[:, -1]
    none_z, none_p = np.zeros_like(z), np.zeros_like(p)
    by_z = -structure.second_derivative(z, p, (v, none_p), (v, none_p))
    by_x = np.empty((lanes, 2))
    for k in range(2):
        mixed = structure.second_derivative(
            z, p, (v, none_p), (none_z, _unit_parameter(setting, lanes, k))
        )
        by_x[:, k] = -np.einsum("li,li->l", v, mixed)
    return _Condition(g, by_z, by_x), v / np.linalg.norm(v, axis=1, keepdims=True)


def _cap_condition(setting: Setting, z: Lanes, p: Parameters) -> _Condition:
    """Largest excess over the constraints, its gradients by central differences."""
    lanes, size = z.shape

    def worst(z: Lanes, p: Parameters) -> Values:
        return np.asarray(np.max([c.excess(z, p) for c in setting.constraints], axis=0))

    if not setting.constraints:
        return _Condition(np.zeros(lanes), np.zeros_like(z), np.zeros((lanes, 2)))
    shift = DIFFERENCE * np.eye(size)
    many = np.repeat(p, size, axis=0)
    up = worst((z[:, None] + shift).reshape(-1, size), many)
    down = worst((z[:, None] - shift).reshape(-1, size), many)
    by_z = (up - down).reshape(lanes, size) / (2 * DIFFERENCE)
    by_x = np.empty((lanes, 2))
    for k in range(2):
        dp = DIFFERENCE * _unit_parameter(setting, lanes, k)
        by_x[:, k] = (worst(z, p + dp) - worst(z, p - dp)) / (2 * DIFFERENCE)
    return _Condition(worst(z, p), by_z, by_x)


def _middle_condition(
    setting: Setting,
    at: Place,
    middle: Place,
    along: Place,
) -> _Condition:
    """Inner product of the pair's direction with the distance from its middle."""
    n, free = setting.structure.unknowns, setting.free
    by_z = np.zeros_like(at[0])
    by_z[:, :n] = along[0][:, :n] * setting.structure.mass
    by_x = along[1][:, free] / setting.scales**2
    value = np.einsum("li,li->l", by_z, at[0] - middle[0])
    value = value + np.einsum("lk,lk->l", by_x, (at[1] - middle[1])[:, free])
    return _Condition(value, by_z, by_x)


__all__ = ["CAP", "CORNER", "FOLD", "Pinned", "pin"]
