"""Exact points amid others: on a fold, on a constraint, on both, or just on the set."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Flags, Lanes, Parameters, Values
from equimorph.equilibria.critical import null_border
from equimorph.manifold.geometry.embedding import embed, principal_directions
from equimorph.manifold.geometry.points import CAP, CORNER, FOLD, Points
from equimorph.manifold.geometry.setting import Setting

Span = Float[np.ndarray, "lanes k d"]

NEWTON_STEPS = 15
DIFFERENCE = 1e-6
VANISHING = 1e-6
"""Size below which an eigenvalue at a fold is the one that vanishes."""
LED = (3, 12)
"""Steps from a known fold to the middle between several: few, else many."""
REACH = 3.0
"""How far a point may lie from the middle, relative to the farthest one around it."""


@dataclass(frozen=True)
class Pinned:
    """Points found amid groups, with their parameters, and which can be trusted."""

    z: Lanes
    p: Parameters
    found: Flags


@dataclass(frozen=True)
class Condition:
    """Scalar condition with its gradients with respect to z and to steps along the span."""

    value: Values
    by_z: Lanes
    by_step: Float[np.ndarray, "lanes k"]


@dataclass(frozen=True)
class Aim:
    """What is solved for: conditions, and the normal space through the middle of each group."""

    setting: Setting
    fold: bool
    cap: bool
    span: Span
    """Orthonormal directions, in scaled free parameters, in which the parameters may move."""
    middle: Float[np.ndarray, "lanes coordinates"]
    rows: Float[np.ndarray, "lanes m coordinates"]

    def take(self, some: Int[np.ndarray, " some"]) -> "Aim":
        """Return some of the lanes."""
        span, middle, rows = self.span[some], self.middle[some], self.rows[some]
        return Aim(self.setting, self.fold, self.cap, span, middle, rows)

    def moved(self, p: Parameters, step: Float[np.ndarray, "lanes k"]) -> Parameters:
        """Return parameters after a step along the span."""
        p = p.copy()
        p[:, self.setting.free] += np.einsum("lk,lkd->ld", step, self.span) * self.setting.scales
        return p

    def direction(self, k: int) -> Parameters:
        """Change of the parameters along one direction of the span."""
        dp = np.zeros((len(self.span), len(self.setting.base)))
        dp[:, self.setting.free] = self.span[:, k] * self.setting.scales
        return dp


def pin(
    setting: Setting,
    points: Points,
    groups: Sequence[Sequence[int]],
    kind: int,
    span: Span,
    shift: tuple[int, float] = (0, 0.0),
) -> Pinned:
    """Newton on F = 0 with further conditions, from the middle of each group of points.

    Parameters
    ----------
    groups
        Numbers of the points around the wanted one.
    kind
        `FOLD` (det F_z = 0), `CAP` (a constraint is active), `CORNER` (both), others: neither.
    span
        The k orthonormal directions, in scaled free parameters, in which the parameters may move.
        As many conditions as are left put the point into the normal space of the group through
        its middle, so that it lies amid the group.
    shift
        A member of the groups, and the share of the way towards it at which the middle is taken.
    """
    z, p, deviations = middles(setting, points, groups)
    member, share = shift
    towards = np.array([group[member] for group in groups], int)
    z += share * (points.z[towards] - z)
    p += share * (points.p[towards] - p)
    fold, cap = kind in {FOLD, CORNER}, kind in {CAP, CORNER}
    rows = principal_directions(deviations, span.shape[1] - fold - cap)
    around = np.linalg.norm(deviations, axis=2).max(axis=1, initial=0.0)
    aim = Aim(setting, fold, cap, span, embed(setting, z, p), rows)
    if not fold:
        return corrected(aim, z, p, around)
    low = np.array([points.index[list(group)].min() for group in groups], int)
    pinned = _rightly(corrected(aim, z, p, around), setting, low)
    for steps, end in product(LED, (0, -1)) if not cap else ():
        lanes = np.flatnonzero(~pinned.found)
        if len(lanes) == 0:
            break
        start = np.array([groups[lane][end] for lane in lanes.tolist()], int)
        states = (points.z[start], points.p[start])
        led = _rightly(_led(aim.take(lanes), steps, states, around[lanes]), setting, low[lanes])
        pinned.z[lanes], pinned.p[lanes], pinned.found[lanes] = led.z, led.p, led.found
    return pinned


def _rightly(pinned: Pinned, setting: Setting, low: Int[np.ndarray, " lanes"]) -> Pinned:
    """Only those folds below which there are so many negative eigenvalues.

    Where two eigenvalues nearly vanish, the other fold may be met.
    """
    found = pinned.found.copy()
    found[found] = lower_index(setting, pinned.z[found], pinned.p[found]) == low[found]
    return Pinned(pinned.z, pinned.p, found)


def _led(aim: Aim, steps: int, states: tuple[Lanes, Parameters], around: Values) -> Pinned:
    """Pin folds in small steps from known ones to the middle, where one step goes astray."""
    z, p = (each.copy() for each in states)
    found = np.ones(len(z), bool)
    start = embed(aim.setting, z, p)
    for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
        lanes = np.flatnonzero(found)
        if len(lanes) == 0:
            break
        middle = (1.0 - share) * start + share * aim.middle
        own = replace(aim, middle=middle).take(lanes)
        pinned = corrected(own, z[lanes], p[lanes], 2.0 * around[lanes] / steps)
        z[lanes], p[lanes], found[lanes] = pinned.z, pinned.p, pinned.found
    return Pinned(z, p, found)


def corrected(aim: Aim, z: Lanes, p: Parameters, around: Values) -> Pinned:
    """Newton on F = 0, the conditions of an aim, and its normal space.

    Points farther from the middle than `REACH` times `around` cannot be trusted.
    """
    z, p, setting = z.copy(), p.copy(), aim.setting
    b = null_border(setting.structure, z, p) if aim.fold else np.zeros_like(z)
    # only without further conditions are all derivatives exact, so that small steps are squared
    last = 1e-12 if aim.fold or aim.cap else 1e-8
    size, todo = np.full(len(z), np.inf), np.arange(len(z))
    for _ in range(NEWTON_STEPS):
        step, null = _newton_step(aim.take(todo), z[todo], p[todo], b[todo])
        size[todo] = np.abs(step).max(axis=1)
        share = np.minimum(1.0, 0.5 / np.maximum(size[todo], 1e-300))[:, None] * step
        z[todo] += share[:, : z.shape[1]]
        p[todo] = aim.take(todo).moved(p[todo], share[:, z.shape[1] :])
        b[todo] = null
        todo = todo[(size[todo] >= last) & np.isfinite(z[todo]).all(axis=1)]
        if len(todo) == 0:
            break
    gap = np.linalg.norm(embed(setting, z, p) - aim.middle, axis=1)
    found = (size < 1e-8) & (gap <= REACH * around + 1e-3)
    for constraint in setting.constraints:
        found[found] &= constraint.excess(z[found], p[found]) < 1e-9
    return Pinned(z, p, found)


def lower_index(setting: Setting, z: Lanes, p: Parameters) -> Int[np.ndarray, " lanes"]:
    """Index on the lower side of folds: eigenvalues below the one that vanishes."""
    structure = setting.structure
    nothing, shift = np.zeros((len(z), 0, structure.size)), np.full(len(z), -VANISHING)
    return np.asarray(structure.solve(z, p, nothing, shift=shift).negative - structure.constraints)


def middles(
    setting: Setting, points: Points, groups: Sequence[Sequence[int]]
) -> tuple[Lanes, Parameters, Float[np.ndarray, "lanes points coordinates"]]:
    """Middles of groups, and where their points lie relative to them."""
    sizes = np.array([len(group) for group in groups])
    inside = np.arange(sizes.max(initial=0)) < sizes[:, None]
    members = np.zeros(inside.shape, int)
    members[inside] = [point for group in groups for point in group]
    share = inside / sizes[:, None]
    z = np.einsum("lm,lmi->li", share, points.z[members])
    p = np.einsum("lm,lmi->li", share, points.p[members])
    flat = members.ravel()
    places = embed(setting, points.z[flat], points.p[flat]).reshape(*members.shape, -1)
    middle = embed(setting, z, p)
    return z, p, (places - middle[:, None]) * inside[:, :, None]


def _newton_step(
    aim: Aim, z: Lanes, p: Parameters, b: Lanes
) -> tuple[Float[np.ndarray, "lanes bordered"], Lanes]:
    """Step in z and along the span, and the null vector for the next round."""
    structure, k = aim.setting.structure, aim.span.shape[1]
    conditions = []
    if aim.fold:
        fold, b = _fold_condition(aim, z, p, b)
        conditions.append(fold)
    if aim.cap:
        conditions.append(cap_condition(aim, z, p))
    conditions += amid(aim, z, p)
    values = np.stack([each.value for each in conditions], axis=1)
    rhs = np.zeros((len(z), 1 + aim.cap, z.shape[1] + len(conditions)))
    rhs[:, 0] = -np.concatenate([structure.residual(z, p), values], axis=1)
    if aim.cap:
        rhs[:, 1, z.shape[1] + aim.fold] = 1.0
    columns = [structure.parameter_derivative(z, p, aim.direction(i)) for i in range(k)]
    border = (
        np.stack(columns, axis=1),
        np.stack([each.by_z for each in conditions], axis=1),
        np.stack([each.by_step for each in conditions], axis=1),
    )
    solved = structure.solve(z, p, rhs, border).x
    step = solved[:, 0]
    if aim.cap:
        step = step + _missed(aim, z, p, values[:, int(aim.fold)], solved) * solved[:, 1]
    return step, b


def _missed(
    aim: Aim, z: Lanes, p: Parameters, value: Values, steps: Float[np.ndarray, "lanes 2 bordered"]
) -> Float[np.ndarray, "lanes 1"]:
    """How much of the second step must be added to the first so that it meets the constraint.

    Where the place of the largest value lies between two elements, single unknowns raise the value
    on one side only: its gradient has a kink. Along steps that keep F = 0 it is smooth.
    """
    slopes = np.empty((len(z), 2))
    for k in range(2):
        size = DIFFERENCE / np.maximum(np.abs(steps[:, k]).max(axis=1), 1e-300)
        dz, along = np.split(size[:, None] * steps[:, k], [z.shape[1]], axis=1)
        up = worst_excess(aim, z + dz, aim.moved(p, along))
        slopes[:, k] = (up - worst_excess(aim, z - dz, aim.moved(p, -along))) / (2.0 * size)
    share = -(value + slopes[:, 0]) / np.where(slopes[:, 1] == 0.0, np.inf, slopes[:, 1])
    return np.asarray(np.nan_to_num(share, posinf=0.0, neginf=0.0)[:, None])


def _fold_condition(aim: Aim, z: Lanes, p: Parameters, b: Lanes) -> tuple[Condition, Lanes]:
    """Test function g of ``[F_z b; bᵀ 0] [v; g] = [0; 1]``, and v for the next round."""
    structure, lanes = aim.setting.structure, len(z)
    rhs = np.zeros((lanes, 1, structure.size + 1))
    rhs[:, 0, -1] = 1.0
    border = (b[:, None], b[:, None], np.zeros((lanes, 1, 1)))
    solved = structure.solve(z, p, rhs, border).x[:, 0]
    v, g = np.ascontiguousarray(solved[:, :-1]), solved[:, -1]
    none_z, none_p = np.zeros_like(z), np.zeros_like(p)
    by_z = -structure.second_derivative(z, p, (v, none_p), (v, none_p))
    directions = aim.span.shape[1]
    by_step = np.empty((lanes, directions))
    for k in range(directions):
        mixed = structure.second_derivative(z, p, (v, none_p), (none_z, aim.direction(k)))
        by_step[:, k] = -np.einsum("li,li->l", v, mixed)
    return Condition(g, by_z, by_step), v / np.linalg.norm(v, axis=1, keepdims=True)


def worst_excess(aim: Aim, z: Lanes, p: Parameters) -> Values:
    """Largest excess over the constraints."""
    return np.asarray(np.max([c.excess(z, p) for c in aim.setting.constraints], axis=0))


def cap_condition(aim: Aim, z: Lanes, p: Parameters) -> Condition:
    """Largest excess over the constraints, its gradients by central differences."""
    lanes, size = z.shape
    worst = partial(worst_excess, aim)
    shift = DIFFERENCE * np.eye(size)
    many = np.repeat(p, size, axis=0)
    up = worst((z[:, None] + shift).reshape(-1, size), many)
    down = worst((z[:, None] - shift).reshape(-1, size), many)
    by_z = (up - down).reshape(lanes, size) / (2 * DIFFERENCE)
    directions = aim.span.shape[1]
    by_step = np.empty((lanes, directions))
    for k in range(directions):
        dp = DIFFERENCE * aim.direction(k)
        by_step[:, k] = (worst(z, p + dp) - worst(z, p - dp)) / (2 * DIFFERENCE)
    return Condition(worst(z, p), by_z, by_step)


def amid(aim: Aim, z: Lanes, p: Parameters) -> list[Condition]:
    """Distances from the middle along the directions of each group."""
    setting, n = aim.setting, aim.setting.structure.unknowns
    away = embed(setting, z, p) - aim.middle
    conditions = []
    for k in range(aim.rows.shape[1]):
        row = aim.rows[:, k]
        by_z = np.zeros_like(z)
        by_z[:, :n] = row[:, :n] * np.sqrt(setting.structure.mass)
        by_step = np.einsum("ld,lkd->lk", row[:, n:], aim.span)
        conditions.append(Condition(np.einsum("li,li->l", row, away), by_z, by_step))
    return conditions
