"""Sequential quadratic programming on an equilibrium set, many starts at a time.

See docs/decisions.md, "Optima come from an SQP method of this package".
"""

from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Float, Frames, Int, ItemFlags, Items, Some
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.queries.nearest import SetPoints
from equimorph.structures import States
from equimorph.tasks.optimising.programme import Expansion, Programme
from equimorph.tasks.optimising.quadratic import Quadratic, QuadraticStep, solve
from equimorph.tasks.optimising.tangent_steps import project_onto_set, step_along, tangents_at
from equimorph.tolerances import FEASIBLE, LAST_STEP, LONGEST_STEP

ITERATIONS, HALVINGS = 40, 10
"""Most steps of a descent, and how often a step is halved that does not lower the merit."""
STALLED = 1e-6
"""Length of a step below which a merit that no longer falls is round-off."""
MERGED = 0.01
"""Distance in the metric and scaled parameters below which two lanes are one."""
CREEPING, CLOSE = 6, 1e-3
"""Rounds one after the other in which only a part of so short a step lowers the merit, after which
a lane stops: at kinks of constraints it would go on like this."""
PENALTY = 2.0
"""Of a violated constraint, relative to its multiplier."""
FLAT = 1e-4
"""Least curvature of the quadratic model, relative to its largest."""


@dataclass(frozen=True)
class CriticalPoint:
    """A point at which the conditions of Karush, Kuhn and Tucker hold: an optimum, or a pass."""

    point: SetPoints
    """The point, one lane."""
    frames: Frames
    """Orthonormal tangents there."""
    expansion: Expansion
    """Values and derivatives there."""
    answer: QuadraticStep
    """Multipliers."""
    converged: bool
    """Whether the last step was at round-off."""

    @property
    def binding(self) -> tuple[Int[np.ndarray, " m"], Int[np.ndarray, " k"]]:
        """Functions and bounds whose multipliers are not zero."""
        return np.flatnonzero(self.answer.weights), np.flatnonzero(self.answer.multipliers)

    def under(self, programme: Programme, some: Some) -> "CriticalPoint":
        """The same with all bounds of a programme, of which some were known so far."""
        multipliers = np.zeros(len(programme.all))
        multipliers[some] = self.answer.multipliers
        full = programme.expand(self.point, self.frames)
        bounds = {"g": full.g, "g_slope": full.g_slope, "g_bend": full.g_bend}
        expansion = replace(self.expansion, **bounds)
        answer = replace(self.answer, multipliers=multipliers)
        return replace(self, expansion=expansion, answer=answer)

    def beside(self, setting: Setting, steps: Float[np.ndarray, "n d"]) -> tuple[States, ItemFlags]:
        """States of the set above steps along its tangents, and which of them were found."""
        lanes = np.zeros(len(steps), int)
        here = self.point.take(lanes)
        guess = step_along(setting, here, self.frames[lanes], steps)
        there, good = project_onto_set(setting, *guess, here.rows)
        return States(setting.structure, there.z, there.p), good

    def inside(
        self, steps: Float[np.ndarray, "n d"], distance: Float[np.ndarray, " n"]
    ) -> Float[np.ndarray, "n d"]:
        """Steps moved to distances, in the metric, inside all active bounds; to second order."""
        e = self.expansion
        active = np.flatnonzero(np.abs(e.g[0]) < FEASIBLE)
        size = np.maximum(np.linalg.norm(e.g_slope[0, active], axis=1), 1e-300)
        bent = 0.5 * np.einsum("ni,kij,nj->kn", steps, e.g_bend[0, active], steps)
        gap = distance + bent / size[:, None]
        back, *_ = np.linalg.lstsq(e.g_slope[0, active] / size[:, None], -gap, rcond=1e-6)
        return np.asarray(steps + back.T)


@dataclass(frozen=True)
class Iterate:
    """Points of all lanes that still move, with tangents and derivatives there."""

    points: SetPoints
    frames: Frames
    expansion: Expansion

    @classmethod
    def at(cls, programme: Programme, points: SetPoints) -> "Iterate":
        """Expand the programme at points."""
        frames, points = tangents_at(programme.setting, points)
        return cls(points, frames, programme.expand(points, frames))

    def take(self, lanes: Items) -> "Iterate":
        """Some of the lanes."""
        expansion = Expansion(*(column[lanes] for column in vars(self.expansion).values()))
        return Iterate(self.points.take(lanes), self.frames[lanes], expansion)

    def with_bounds(self, some: Some) -> "Iterate":
        """The same with some of the bounds."""
        return replace(self, expansion=self.expansion.with_bounds(some))

    def minimum(self, k: int, answer: QuadraticStep, converged: bool) -> CriticalPoint:
        """Lane `k` as a point from which no step is made."""
        one = self.take(np.array([k]))
        return CriticalPoint(one.points, one.frames, one.expansion, answer, converged)


@dataclass
class _Lane:
    """One start on its way."""

    point: SetPoints
    reach: float = LONGEST_STEP
    penalty: float = 1.0
    creeping: int = 0
    answer: QuadraticStep | None = None
    done: CriticalPoint | None = None
    best: SetPoints | None = None
    least: float = np.inf

    def go_on(self, whole: bool, length: float) -> None:
        """Note whether the whole step was made, and its length."""
        self.creeping = 0 if whole or length > CLOSE else self.creeping + 1
        if whole:
            self.reach = min(LONGEST_STEP, 2.0 * self.reach)


def descend(
    programme: Programme, starts: SetPoints, rounds: int = ITERATIONS
) -> list[CriticalPoint]:
    """Local minima from starts; those that lead nowhere are left out.

    Those that still move after all rounds end at their best feasible points, not converged.
    """
    lanes = [_Lane(starts.take(np.array([k]))) for k in range(len(starts))]
    for _ in range(rounds):
        todo = [
            lane
            for lane in lanes
            if lane.done is None and lane.reach > 0.0 and lane.creeping < CREEPING
        ]
        if not todo:
            break
        here = SetPoints.concatenate([lane.point for lane in todo])
        alone = _first_of_each(programme, here)
        for k in set(range(len(todo))) - set(alone):
            todo[k].reach = 0.0
        todo, here = [todo[k] for k in alone], here.take(np.array(alone))
        iterate = Iterate.at(programme, here)
        _remember(todo, iterate)
        answers = [_answer(iterate.expansion, k, lane) for k, lane in enumerate(todo)]
        _advance(programme, todo, iterate, answers)
    _stop(programme, lanes)
    return [lane.done for lane in lanes if lane.done is not None]


def _remember(todo: list[_Lane], at: Iterate) -> None:
    """Keep the best feasible point of each lane."""
    for k, lane in enumerate(todo):
        value = float(at.expansion.f[k].max())
        if value < lane.least and at.expansion.g[k].max() <= FEASIBLE:
            lane.best, lane.least = at.points.take(np.array([k])), value


def _stop(programme: Programme, lanes: list[_Lane]) -> None:
    """Leave lanes at their best feasible points: at kinks of constraints steps never end.

    Lanes that were merged into other lanes count only if no other lane has ended.
    """
    ended = any(lane.done is not None for lane in lanes)
    left = [lane for lane in lanes if lane.done is None and (lane.reach > 0.0 or not ended)]
    left = [lane for lane in left if lane.best is not None]
    if not left:
        return
    best = [lane.best for lane in left if lane.best is not None]
    iterate = Iterate.at(programme, SetPoints.concatenate(best))
    for k, lane in enumerate(left):
        answer = _answer(iterate.expansion, k, lane)
        if answer is not None:
            lane.done = iterate.minimum(k, answer, converged=False)


def _first_of_each(programme: Programme, here: SetPoints) -> list[int]:
    """Lanes that are not close to an earlier one, which would end where that one does."""
    places = embed(programme.setting, here.z, here.p)
    kept: list[int] = []
    for lane, place in enumerate(places):
        if not kept or np.linalg.norm(places[kept] - place, axis=1).min() > MERGED:
            kept.append(lane)
    return kept


def _answer(expansion: Expansion, k: int, lane: _Lane) -> QuadraticStep | None:
    """Step of the quadratic model; where constraints contradict each other, towards these."""
    d = expansion.f_slope.shape[2]
    f, g, known = expansion.f[k], expansion.g[k], lane.answer
    model = Quadratic(f, expansion.f_slope[k], g, expansion.g_slope[k], np.eye(d))
    if known is None or len(known.weights) != len(f):
        # multipliers of the plain model weigh the second derivatives
        known = solve(model, lane.reach)
    if known is None:
        return _restoration_step(model, lane.reach)
    if expansion.known[k]:
        model = replace(model, hessian=_positive(expansion.bend(k, known)))
    return solve(model, lane.reach) or _restoration_step(model, lane.reach)


def _positive(bend: Float[np.ndarray, "d d"]) -> Float[np.ndarray, "d d"]:
    """Curvatures made positive: where they are not, long steps are tried."""
    values, vectors = np.linalg.eigh(0.5 * (bend + bend.T))
    size = np.maximum(values, FLAT * (1e-3 + np.abs(values).max()))
    return np.asarray((vectors * size) @ vectors.T)


def _restoration_step(model: Quadratic, reach: float) -> QuadraticStep:
    """Shortest step that meets the violated constraints, or a part of it."""
    bad = model.g > 0.0
    step = np.linalg.lstsq(model.b[bad], -model.g[bad], rcond=None)[0]
    step = step * min(1.0, reach / max(float(np.linalg.norm(step)), 1e-300))
    return QuadraticStep(step, np.full(len(model.f), 1.0 / len(model.f)), np.zeros(len(model.g)))


def _advance(
    programme: Programme, todo: list[_Lane], at: Iterate, answers: list[QuadraticStep | None]
) -> None:
    """Move every lane by its step, shortened until its merit falls."""
    steps: dict[int, QuadraticStep] = {}
    for k, (lane, answer) in enumerate(zip(todo, answers, strict=True)):
        lane.answer = answer
        if answer is None:
            lane.reach = 0.0
        elif np.linalg.norm(answer.step) < LAST_STEP:
            lane.done = at.minimum(k, answer, converged=True)
        else:
            own = PENALTY * max(float(answer.multipliers.sum()), _steepness(at.expansion, k))
            lane.penalty = max(lane.penalty, own)
            steps[k] = answer
    waiting = list(steps)
    # few steps take nearly as long as many: all shorter ones are tried at once
    for shares in np.split(0.5 ** np.arange(HALVINGS), [1]):
        if not waiting:
            return
        waiting = _try_steps(programme, todo, at, {k: steps[k].step for k in waiting}, shares)
    for k in waiting:
        small = bool(np.linalg.norm(steps[k].step) < STALLED)
        todo[k].done = at.minimum(k, steps[k], small)


def _steepness(expansion: Expansion, k: int) -> float:
    """Slope of the objective relative to those of violated constraints: what restoring may cost."""
    bad = expansion.g[k] > 0.0
    if not bad.any():
        return 0.0
    slopes = np.linalg.norm(expansion.g_slope[k, bad], axis=1)
    steepest = np.linalg.norm(expansion.f_slope[k], axis=1).max()
    return float(steepest / np.maximum(slopes, 1e-6).min())


def _try_steps(
    programme: Programme,
    todo: list[_Lane],
    at: Iterate,
    steps: dict[int, Float[np.ndarray, " d"]],
    shares: Float[np.ndarray, " shares"],
) -> list[int]:
    """Make the largest share of the steps of some lanes with which the merit falls.

    Lanes whose merit does not fall are returned.
    """
    count = len(shares)
    lanes = np.repeat(list(steps), count)
    here, expansion = at.points.take(lanes), at.expansion
    moves = (np.stack(list(steps.values()))[:, None] * shares[:, None]).reshape(len(lanes), -1)
    guess = step_along(programme.setting, here, at.frames[lanes], moves)
    there, found = project_onto_set(programme.setting, *guess, here.rows)
    value = programme.objective.values(there.z, there.p)
    excess = np.maximum(programme.excess(there.z, there.p), 0.0).sum(axis=1)
    left = []
    for i, k in enumerate(steps):
        lane, own = todo[k], np.arange(i * count, (i + 1) * count)
        before = expansion.f[k].max() + lane.penalty * np.maximum(expansion.g[k], 0.0).sum()
        falls = own[found[own] & (value[own] + lane.penalty * excess[own] < before)]
        if len(falls):
            lane.point = there.take(falls[:1])
            lane.go_on(shares[0] == 1.0, float(np.linalg.norm(steps[k])))
        else:
            left.append(k)
    return left
