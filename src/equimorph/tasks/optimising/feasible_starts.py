"""Feasible starts in regions thinner than the cells, where no vertex obeys all constraints.

Values of the constraints are interpolated in the cells. Where they may be obeyed, Newton's method
on the violated ones leads to states that obey all.
"""

from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from equimorph.arrays import Cells, Flags, Float, Int, Lanes, Parameters
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.queries.nearest import SetPoints, points_at_vertices
from equimorph.model import Constraint, Descriptor
from equimorph.tasks.optimising.programme import Objective, Programme
from equimorph.tasks.optimising.sqp import descend
from equimorph.tasks.optimising.tangent_steps import project_onto_set, step_along, tangents_at
from equimorph.tasks.stable_part import stable_values
from equimorph.tolerances import LONGEST_STEP

DIVISIONS = {1: 8, 2: 5, 3: 3}
"""Parts of a side of a cell between sample places, by dimension."""
MOST = 600
"""Cells in which feasible states are searched, the most promising first."""
ROUNDS = 20
"""Newton steps towards states that obey all constraints."""
PATIENCE = 4
"""Steps one after the other that do not lower the least excess by a tenth, after which a lane is
given up: it goes to and fro."""
MET = 1e-8
"""Relative excess over a bound that counts as none."""
STARTS = 24
"""Cells from which the largest excess is made as small as possible where no state obeys."""


@dataclass(frozen=True)
class FeasibleStarts:
    """Feasible states between infeasible vertices, or else the least violation."""

    spots: SetPoints
    """States from which a descent may start, none where `least` is positive."""
    least: float
    """Least largest relative excess that was found; not positive where there are states."""
    closest: SetPoints
    """Where it is."""


def feasible_points_in_cells(
    eset: EquilibriumSet,
    programme: Programme,
    constraints: tuple[Constraint, ...],
    cells: Cells,
) -> SetPoints:
    """Feasible states in stable cells without feasible corners, each better than its neighbours.

    The constraints are those that stable vertices may violate.
    """
    promising, weights = _promising(eset, constraints, cells)
    found, kept = _restore_feasibility(programme, _inside(eset, promising, weights))
    if not kept.any():
        return found.take(kept)
    own = promising[kept]
    value = programme.objective.values(found.z[kept], found.p[kept])
    return found.take(np.flatnonzero(kept)[_lowest_around(own, value, len(eset.points))])


def least_violation(
    eset: EquilibriumSet,
    programme: Programme,
    constraints: tuple[Constraint, ...],
    cells: Cells,
) -> FeasibleStarts:
    """States with the least largest excess over constraints, by descents from many cells."""
    excess = _excesses(eset, constraints)
    weights, value = _best_inside(excess[:, cells], np.zeros((len(constraints), len(cells))))
    some = _lowest_around(cells, value, len(eset.points))
    some = some[np.argsort(value[some], kind="stable")][:STARTS]
    starts = _inside(eset, cells[some], weights[some])
    goal = Objective(_largest(constraints), 1.0)
    own = Programme(programme.setting, programme.bounds, goal, programme.constraints[-1:])
    ends = descend(own, starts)
    ends = [end for end in ends if end.expansion.g.max() <= MET]
    if not ends:
        return FeasibleStarts(starts.take(np.zeros(0, int)), np.inf, starts.take(np.zeros(0, int)))
    least = [float(end.expansion.f.max()) for end in ends]
    spots = SetPoints.concatenate([end.point for end in ends])
    return FeasibleStarts(
        spots.take(np.array(least) <= MET), min(least), spots.take(np.array([np.argmin(least)]))
    )


def _excesses(
    eset: EquilibriumSet, constraints: tuple[Constraint, ...]
) -> Float[np.ndarray, "K V"]:
    """Relative excess over bounds at the vertices."""
    rows = [
        (1.0 if c.sense == "<=" else -1.0) * (stable_values(eset, c.descriptor) - c.bound) / c.size
        for c in constraints
    ]
    return np.array(rows).reshape(len(constraints), len(eset.points))


def _promising(
    eset: EquilibriumSet, constraints: tuple[Constraint, ...], cells: Cells
) -> tuple[Int[np.ndarray, "some corners"], Float[np.ndarray, "some corners"]]:
    """Cells without feasible corners that may have feasible places; shares of their corners.

    A constraint may be obeyed where its interpolated excess is less than its changes along the
    edges around.
    """
    excess = _excesses(eset, constraints)
    change = np.zeros_like(excess)
    for a, b in _sides(cells.shape[1]):
        first, second = cells[:, a], cells[:, b]
        gap = np.abs(excess[:, first] - excess[:, second])
        for row, own in zip(change, np.nan_to_num(gap), strict=True):
            np.maximum.at(row, first, own)
            np.maximum.at(row, second, own)
    feasible = np.asarray((excess <= 0.0).all(axis=0))
    cells = cells[~feasible[cells].any(axis=1)]
    allowance = change[:, cells].max(axis=2)
    at_corners = excess[:, cells]
    able = (at_corners.min(axis=2) <= allowance).all(axis=0)
    cells, at_corners, allowance = cells[able], at_corners[:, able], allowance[:, able]
    weights, value = _best_inside(at_corners, allowance)
    order = np.argsort(value, kind="stable")
    order = order[value[order] <= 0.0][:MOST]
    # where it is violated least counts, not where it is allowed most
    weights, _ = _best_inside(at_corners[:, order], np.zeros((len(constraints), len(order))))
    return cells[order], weights


def _sides(corners: int) -> list[tuple[int, int]]:
    return [(a, b) for b in range(corners) for a in range(b)]


def _best_inside(
    at_corners: Float[np.ndarray, "K C corners"], allowance: Float[np.ndarray, "K C"]
) -> tuple[Float[np.ndarray, "C corners"], Float[np.ndarray, " C"]]:
    """Shares of the corners of each cell with the least largest excess; that, less an allowance."""
    corners = at_corners.shape[2]
    parts = DIVISIONS[corners - 1]
    picks = np.array(list(combinations_with_replacement(range(corners), parts)))
    shares = np.stack([(picks == k).sum(axis=1) for k in range(corners)], axis=1) / parts
    best = np.full(at_corners.shape[1], np.inf)
    weights = np.tile(shares[0], (at_corners.shape[1], 1))
    for share in shares:
        value = (at_corners @ share - allowance).max(axis=0, initial=-np.inf)
        better = value < best
        best[better], weights[better] = value[better], share
    return weights, best


def _inside(
    eset: EquilibriumSet, cells: Cells, weights: Float[np.ndarray, "C corners"]
) -> SetPoints:
    """Points of cells, with the planes of their nearest corners: not on the set yet."""
    nearest = cells[np.arange(len(cells)), weights.argmax(axis=1)]
    used, place = np.unique(nearest, return_inverse=True)
    rows = points_at_vertices(eset, used).rows[place]
    z = np.einsum("cks,ck->cs", eset.points.z[cells], weights)
    p = np.einsum("cks,ck->cs", eset.points.p[cells], weights)
    return SetPoints(z, p, rows)


def _restore_feasibility(programme: Programme, guess: SetPoints) -> tuple[SetPoints, Flags]:
    """States that obey all constraints, near points; and where there are any."""
    here, alive = project_onto_set(programme.setting, guess.z, guess.p, guess.rows)
    kept = np.zeros(len(guess), bool)
    z, p, rows = here.z.copy(), here.p.copy(), here.rows.copy()
    todo = np.flatnonzero(alive)
    least, idle = np.full(len(guess), np.inf), np.zeros(len(guess), int)
    for _ in range(ROUNDS):
        if len(todo) == 0:
            break
        frames, at = tangents_at(programme.setting, SetPoints(z[todo], p[todo], rows[todo]))
        excess, slopes = programme.linearise(at, frames)
        worst = excess.max(axis=1)
        kept[todo[worst <= MET]] = True
        idle[todo] = np.where(worst < 0.9 * least[todo], 0, idle[todo] + 1)
        least[todo] = np.minimum(least[todo], worst)
        on = np.flatnonzero((worst > MET) & (idle[todo] < PATIENCE))
        step = _towards(excess[on], slopes[on])
        todo, at = todo[on], at.take(on)
        guess_z, guess_p = step_along(programme.setting, at, frames[on], step)
        there, found = project_onto_set(programme.setting, guess_z, guess_p, at.rows)
        todo, there = todo[found], there.take(found)
        z[todo], p[todo], rows[todo] = there.z, there.p, there.rows
    kept[kept] = _stable(programme, z[kept], p[kept])
    return SetPoints(z, p, rows), kept


def _stable(
    programme: Programme,
    z: Lanes,
    p: Parameters,
) -> Flags:
    """Whether states are stable, or on the boundary."""
    edge = np.abs(programme.constraints[-1].excess(z, p)) <= MET
    return np.asarray(edge | (programme.setting.structure.index(z, p) == 0))


def _towards(
    excess: Float[np.ndarray, "lanes k"], slopes: Float[np.ndarray, "lanes k d"]
) -> Float[np.ndarray, "lanes d"]:
    """Shortest steps that meet violated constraints to first order, no longer than the longest."""
    bad = excess > 0.0
    rows, rhs = np.where(bad[:, :, None], slopes, 0.0), np.where(bad, -excess, 0.0)
    step = np.einsum("ldk,lk->ld", np.linalg.pinv(rows, rcond=1e-6), rhs)
    size = np.linalg.norm(step, axis=1, keepdims=True)
    return np.asarray(step * np.minimum(1.0, LONGEST_STEP / np.maximum(size, 1e-300)))


def _lowest_around(
    cells: Cells, value: Float[np.ndarray, " C"], vertices: int
) -> Int[np.ndarray, " some"]:
    """Cells that none beats with which they share a corner."""
    least = np.full(vertices, np.inf)
    for corner in cells.T:
        np.minimum.at(least, corner, value)
    return np.flatnonzero(np.isfinite(value) & (value <= least[cells].min(axis=1)))


def _largest(constraints: tuple[Constraint, ...]) -> Descriptor:
    """Largest relative excess, with all as branches."""

    def each(z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes K"]:
        return np.stack([c.excess(z, p) / c.size for c in constraints], axis=1)

    return Descriptor(
        "excess",
        "1",
        lambda z, p: each(z, p).max(axis=1),
        branches=lambda z, p: (
            each(z, p),
            np.tile(np.arange(float(len(constraints))), (len(z), 1)),
        ),
    )
