"""Passes: states where the largest value along a path is least, by Newton's method.

At a pass a combination of the gradients of the active branches of the objective and of the active
bounds (sides of the box, constraints, the edge of stability) vanishes along the set, with weights
that are not negative, and the Lagrangian curves down in exactly one of the directions that leave
all of them as they are. The KKT system is solved for every set of functions that may be active.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, islice

import numpy as np

from equimorph.arrays import Float, Some, Values
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.queries.nearest import SetPoints
from equimorph.structures import States
from equimorph.tasks.optimising.certificates import curvatures
from equimorph.tasks.optimising.programme import Expansion, Programme, is_stability
from equimorph.tasks.optimising.quadratic import Quadratic, QuadraticStep, kkt_points
from equimorph.tasks.optimising.sqp import CriticalPoint, Iterate
from equimorph.tasks.optimising.tangent_steps import project_onto_set, step_along
from equimorph.tolerances import FEASIBLE

ITERATIONS = 12
"""Newton steps."""
STILL = 1e-6
"""Length of a step after which there is none: its error is about its square."""
ROUND_OFF = 1e-11
"""Length of a step that is round-off."""
AROUND = 3.0
"""How far functions may be from active, and passes from where they are sought, in cell sizes."""
MOST = 24
"""Sets of functions that are tried, the smallest first."""
NEGATIVE = 1e-6
"""Size of a negative multiplier that counts as zero."""
SHARES = (0.5, 0.1, 0.02, 4e-3, 8e-4, 1.6e-4)
"""Shares, tried in turn, of the room above a pass that are spent on the distance from bounds."""
DOWN = 0.9
"""How far both ends of the way over a pass lie below its allowed height, relative to the room."""
WIDENED = 3.0
"""Largest distance from active bounds down a pass, relative to that on it."""
STATIONS = 41
"""Number of states that lead over a pass."""


@dataclass(frozen=True)
class _Active:
    """Branches of the objective that are held equal, and bounds that are held."""

    branches: tuple[int, ...]
    bounds: tuple[int, ...]

    @classmethod
    def like(cls, known: CriticalPoint, some: Some) -> "_Active":
        """Those of a known pass; bounds are counted among some."""
        own, bounds = known.binding
        return cls(tuple(own.tolist()), tuple(np.searchsorted(some, bounds).tolist()))

    def newton(self, expansion: Expansion, k: int) -> QuadraticStep | None:
        """Newton's step at a point; second derivatives are weighed by multipliers of least squares.

        None where it is not unique.
        """
        f, a, g, b = (
            each[k] for each in (expansion.f, expansion.f_slope, expansion.g, expansion.g_slope)
        )
        known = self._solve(Quadratic(f, a, g, b, np.eye(a.shape[1])))
        if known is None or not expansion.known[k]:
            return None
        return self._solve(Quadratic(f, a, g, b, expansion.bend(k, known)))

    def _solve(self, model: Quadratic) -> QuadraticStep | None:
        """Step and multipliers of a model; None where these are not unique."""
        own, rows = (np.array([each], int) for each in (self.branches, self.bounds))
        x, regular = kkt_points(model, own, rows)
        d, size = model.a.shape[1], len(self.branches)
        weights, multipliers = np.zeros(len(model.f)), np.zeros(len(model.g))
        weights[own[0]], multipliers[rows[0]] = x[0, d + 1 : d + 1 + size], x[0, d + 1 + size :]
        return QuadraticStep(x[0, :d], weights, multipliers) if regular[0] else None


@dataclass(frozen=True)
class _Lane:
    """Number of the point from which a pass is sought, and what is held there."""

    start: int
    active: _Active


def passes_near(
    programme: Programme, starts: SetPoints, reach: Values, like: CriticalPoint | None = None
) -> list[list[CriticalPoint]]:
    """Passes near each of some points, the nearest first; all are sought in one batch.

    Bounds that cannot be active there are left out, and examined at the passes that are found.
    `reach` is the size of the cells around each point, in the metric and scaled parameters. The
    functions that hold a similar pass `like` are held, right or not.
    """
    starts, found = project_onto_set(programme.setting, starts.z, starts.p, starts.rows)
    good = np.flatnonzero(found)
    if len(good) == 0:
        return [[] for _ in found]
    first = Iterate.at(programme, starts.take(good))
    far = AROUND * reach[good]
    able = [_near_bounds(first.expansion, k, each) for k, each in enumerate(far.tolist())]
    if like is not None:
        able.append(like.binding[1])
    some = np.unique(np.concatenate(able))
    few, first = programme.with_bounds(some), first.with_bounds(some)
    lanes = [
        _Lane(k, each)
        for k in range(len(good))
        for each in (
            [_Active.like(like, some)]
            if like is not None
            else islice(_possible(first.expansion, k, float(far[k])), MOST)
        )
    ]
    ended = list[list[CriticalPoint]]([] for _ in found)
    for lane, each in _newton(few, first, lanes, reach[good]):
        if like is not None or _holds(few, each):
            full = each.under(programme, some)
            if like is not None or _holds(programme, full):
                ended[good[lane.start]].append(full)
    return [
        sorted(passes, key=lambda at: float(_distances(programme, at.point, start)[0]))
        for passes, start in ((own, starts.take(np.array([k]))) for k, own in enumerate(ended))
    ]


def _newton(
    programme: Programme, first: Iterate, lanes: list[_Lane], reach: Values
) -> Iterator[tuple[_Lane, CriticalPoint]]:
    """Newton's method from the points where lanes start, until steps are round-off."""
    own = np.array([each.start for each in lanes], int)
    at, starts, last = first.take(own), first.points, np.full(len(lanes), np.inf)
    for _ in range(ITERATIONS):
        newton = [each.active.newton(at.expansion, k) for k, each in enumerate(lanes)]
        steps = {k: each for k, each in enumerate(newton) if each is not None}
        size = {k: float(np.linalg.norm(each.step)) for k, each in steps.items()}
        still = [k for k, each in size.items() if last[k] <= STILL or each <= ROUND_OFF]
        yield from ((lanes[k], at.minimum(k, steps[k], converged=True)) for k in still)
        going = np.setdiff1d(list(steps), still).astype(int)
        if len(going) == 0:
            return
        own, last = own[going], np.array([size[k] for k in going.tolist()])
        moves = np.array([steps[k].step for k in going.tolist()])
        moves *= np.minimum(1.0, reach[own] / last)[:, None]
        before = at.points.take(going)
        moved = step_along(programme.setting, before, at.frames[going], moves)
        here, near = project_onto_set(programme.setting, *moved, before.rows)
        near &= _distances(programme, here, starts.take(own)) <= AROUND * reach[own]
        lanes, here = [lanes[k] for k in going[near].tolist()], here.take(np.flatnonzero(near))
        last, own = last[near], own[near]
        if not lanes:
            return
        at = Iterate.at(programme, here)


def _possible(expansion: Expansion, k: int, far: float) -> Iterator[_Active]:
    """Sets of functions that may be active within a distance of point k, the smallest first.

    One direction is left in which the pass leads down.
    """
    f, slope, d = expansion.f[k], expansion.f_slope[k], expansion.f_slope.shape[2]
    apart = np.linalg.norm(slope - slope[f.argmax()], axis=1)
    branches = _within(f.max() - f, apart, far)
    bounds = _near_bounds(expansion, k, far)
    for size in range(d):
        for held in range(size + 1):
            for own in combinations(branches.tolist(), size - held + 1):
                yield from (_Active(own, rows) for rows in combinations(bounds.tolist(), held))


def _near_bounds(expansion: Expansion, k: int, far: float) -> Some:
    """Bounds that may be active within a distance of point k, the nearest first."""
    return _within(np.abs(expansion.g[k]), np.linalg.norm(expansion.g_slope[k], axis=1), far)


def _within(gap: Values, slope: Values, far: float) -> Some:
    """Functions whose gap closes within a distance, the nearest first."""
    some = np.flatnonzero(np.isfinite(gap) & (gap <= far * slope + FEASIBLE))
    return np.asarray(some[np.argsort(gap[some], kind="stable")])


def _distances(programme: Programme, here: SetPoints, start: SetPoints) -> Values:
    place, middle = (embed(programme.setting, each.z, each.p) for each in (here, start))
    return np.asarray(np.linalg.norm(place - middle, axis=1))


def _holds(programme: Programme, found: CriticalPoint) -> bool:
    """Whether a point is a pass: stable or on the edge, within all bounds, and pushed by none."""
    e, answer, (own, bounds) = found.expansion, found.answer, found.binding
    down = int((curvatures(found, own, bounds)[0] < 0.0).sum())
    on_edge = any(
        is_stability(each) and abs(excess) <= FEASIBLE
        for each, excess in zip(programme.all, e.g[0], strict=True)
    )
    stable = programme.setting.structure.index(found.point.z, found.point.p)[0] == 0
    level = e.f[0, own].min()
    signs = min(answer.weights.min(), answer.multipliers.min(initial=0.0)) >= -NEGATIVE
    room = FEASIBLE * (1.0 + abs(level))
    inside = e.g.max(initial=-np.inf) <= FEASIBLE and e.f.max() <= level + room
    return bool(down == 1 and (stable or on_edge) and signs and inside)


def states_over(
    programme: Programme, found: CriticalPoint, reach: float, room: float
) -> States | None:
    """States over a pass from one side to the other, inside active bounds, and hardly higher.

    With ``f ≈ c − ½ |λ| s² + ν δ + ½ η δ²`` a step s down the pass leaves room for a distance δ
    from the bounds. Stations are denser where there is less of it. They lead as far as `reach`, in
    the metric and scaled parameters, and exceed the pass by `room` at most; None where no share of
    it leads down on both sides.
    """
    own, bounds = found.binding
    curvature, ways = curvatures(found, own, bounds)
    scale = np.sqrt(2.0 * room / -curvature[0])
    turn = np.arcsinh(reach / scale)
    along = scale * np.sinh(turn * np.linspace(-1.0, 1.0, STATIONS))
    gain = room - 0.5 * curvature[0] * along**2
    highest = float(found.expansion.f[0].max()) + room
    for share in SHARES if len(bounds) else (0.0,):
        distance = _clearances(found, share * gain)
        distance = np.minimum(distance, WIDENED * min(distance.min(), share * reach))
        steps = found.inside(along[:, None] * ways[:, 0], distance)
        states, good = found.beside(programme.setting, steps)
        value = programme.objective.values(states.z, states.p)
        good &= (value <= highest) & (states.index == 0)
        good &= programme.excess(states.z, states.p).max(axis=1) <= 0.0
        run = _run_between_lows(np.where(good, value, np.inf))
        # far from the bounds the expansion may have no meaning: no way down on one side
        if good[STATIONS // 2] and value[[run.start, run.stop - 1]].max() <= highest - DOWN * room:
            return states[run]
    return None


def _clearances(found: CriticalPoint, gain: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Distances δ from the active bounds with ``ν δ + ½ η δ² = gain``."""
    bounds, e = found.binding[1], found.expansion
    if len(bounds) == 0:
        return np.zeros(len(gain))
    inwards = found.inside(np.zeros((1, len(found.frames[0]))), np.ones(1))[0]
    pressure = max(float(-found.answer.multipliers @ e.g_slope[0] @ inwards), 0.0)
    bend = max(float(inwards @ e.bend(0, found.answer) @ inwards), 0.0)
    rise = pressure + np.sqrt(pressure**2 + 2.0 * bend * gain)
    return np.asarray(2.0 * gain / np.maximum(rise, 1e-300))


def _run_between_lows(value: Float[np.ndarray, " n"]) -> slice:
    """Numbers around the middle without infinite ones, from the lowest on one side to the other."""
    middle, shut = len(value) // 2, np.flatnonzero(np.isinf(value))
    first = int(shut[shut < middle].max(initial=-1)) + 1
    end = int(shut[shut > middle].min(initial=len(value)))
    low, high = value[first : middle + 1].argmin(), value[middle:end].argmin()
    return slice(first + int(low), middle + int(high) + 1)
