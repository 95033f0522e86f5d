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

from equimorph.arrays import Some, Values
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.queries.nearest import SetPoints
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


@dataclass(frozen=True)
class _Active:
    """Branches of the objective that are held equal, and bounds that are held."""

    branches: tuple[int, ...]
    bounds: tuple[int, ...]

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


def passes_near(
    programme: Programme, start: SetPoints, reach: float, like: CriticalPoint | None = None
) -> list[CriticalPoint]:
    """Passes near a point, the nearest first.

    Parameters
    ----------
    programme
        Objective and bounds.
    start
        One point.
    reach
        Size of the cells around it, in the metric and scaled parameters.
    like
        A pass of a similar problem: the same functions are then held, right or not.
    """
    start, found = project_onto_set(programme.setting, start.z, start.p, start.rows)
    if not found[0]:
        return []
    first = Iterate.at(programme, start)
    if like is None:
        lanes = list(islice(_possible(first.expansion, AROUND * reach), MOST))
    else:
        lanes = [_Active(*(tuple(each.tolist()) for each in like.binding))]
    at, ended = first.take(np.zeros(len(lanes), int)), list[CriticalPoint]()
    last = np.full(len(lanes), np.inf)
    for _ in range(ITERATIONS):
        newton = [each.newton(at.expansion, k) for k, each in enumerate(lanes)]
        steps = {k: each for k, each in enumerate(newton) if each is not None}
        size = {k: float(np.linalg.norm(each.step)) for k, each in steps.items()}
        still = [k for k, each in size.items() if last[k] <= STILL or each <= ROUND_OFF]
        ended += [at.minimum(k, steps[k], converged=True) for k in still]
        going = np.setdiff1d(list(steps), still).astype(int)
        if len(going) == 0:
            break
        moves = np.array([steps[k].step for k in going.tolist()])
        last = np.array([size[k] for k in going.tolist()])
        moves *= np.minimum(1.0, reach / last)[:, None]
        own = at.points.take(going)
        moved = step_along(programme.setting, own, at.frames[going], moves)
        here, near = project_onto_set(programme.setting, *moved, own.rows)
        near &= _distances(programme, here, start) <= AROUND * reach
        here, lanes = here.take(np.flatnonzero(near)), [lanes[k] for k in going[near].tolist()]
        last = last[near]
        if not lanes:
            break
        at = Iterate.at(programme, here)
    passes = [each for each in ended if like is not None or _holds(programme, each)]
    return sorted(passes, key=lambda each: float(_distances(programme, each.point, start)[0]))


def _possible(expansion: Expansion, far: float) -> Iterator[_Active]:
    """Sets of functions that may be active within a distance, the smallest first.

    One direction is left in which the pass leads down.
    """
    f, slope, d = expansion.f[0], expansion.f_slope[0], expansion.f_slope.shape[2]
    apart = np.linalg.norm(slope - slope[f.argmax()], axis=1)
    branches = _within(f.max() - f, apart, far)
    bounds = _within(np.abs(expansion.g[0]), np.linalg.norm(expansion.g_slope[0], axis=1), far)
    for size in range(d):
        for held in range(size + 1):
            for own in combinations(branches.tolist(), size - held + 1):
                yield from (_Active(own, rows) for rows in combinations(bounds.tolist(), held))


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
    inside = e.g.max() <= FEASIBLE and e.f.max() <= level + room
    return bool(down == 1 and (stable or on_edge) and signs and inside)
