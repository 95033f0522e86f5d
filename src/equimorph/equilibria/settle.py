"""One corrector for points with conditions: Newton's method with named guards, in lanes.

A point of a lane solves F(z; p) = 0 and as many conditions as the parameters have free directions.
Each step goes onto the equilibrium set and along its tangent space: folds are regular points, and
conditions are differentiated along the set only. With fewer conditions than directions the step
along the set is the shortest, with more the one of least squares.

See docs/decisions.md, "One corrector".
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from equimorph.arrays import (
    Directions,
    Flags,
    Float,
    Int,
    Lanes,
    Numbers,
    Parameters,
    Rows,
    Some,
    Values,
)
from equimorph.columns import Columns
from equimorph.equilibria.newton_kernels import judge_lanes
from equimorph.equilibria.newton_step import (
    Frame,
    Held,
    Planes,
    Points,
    Problem,
    Step,
    Tangents,
    free_directions,
    start_at,
    weights_of,
)
from equimorph.equilibria.onto_set import settle_onto
from equimorph.equilibria.point_conditions import Condition
from equimorph.linalg.lanes import SMALLEST_SHARE
from equimorph.model import Constraint
from equimorph.structures import Equations, Structure, newton_kernels
from equimorph.structures.margin import count_below
from equimorph.structures.metric import distances, metric_length, products_with
from equimorph.structures.newton import Limits, Newton, Through, newton
from equimorph.structures.newton_kernels import FOUND, NEAR, OPEN

__all__ = [
    "Guards",
    "Held",
    "Planes",
    "Settled",
    "Status",
    "Tangents",
    "distances",
    "embedded_planes",
    "free_directions",
    "lower_index",
    "settle",
]

SMALL_EIGENVALUE = 1e-6
"""Size below which an eigenvalue at a fold is the one that vanishes."""
SLACK = 1e-9
"""By how much points may exceed constraints."""
BATCH = 2**18
"""Unknowns of the lanes that are corrected together: more would leave the caches, and their arrays
go back to the system after each step."""
FEWEST = 2 * SMALLEST_SHARE
"""Lanes that are corrected together in any case, for two threads."""


Known = Float[np.ndarray, "lanes roots unknowns"] | None


class Status(IntEnum):
    """How Newton's method ended on a lane."""

    OPEN = newton_kernels.OPEN
    """Not yet."""
    FOUND = newton_kernels.FOUND
    UNFINISHED = newton_kernels.UNFINISHED
    """The iterations were used up."""
    SINGULAR = newton_kernels.SINGULAR
    """A correction was not finite: the system is singular, or the structure is undefined there."""
    TOO_LONG = newton_kernels.TOO_LONG
    """A correction was longer than guesses near by would need."""
    NOT_SHRINKING = newton_kernels.NOT_SHRINKING
    """Corrections did not shrink as demanded."""
    FAR = 5
    """The point is farther from where it was looked for than is trusted."""
    WRONG_INDEX = 6
    """The point has another index, or belongs to another fold."""
    VIOLATED = 7
    """The point violates a constraint."""


@dataclass(frozen=True)
class Guards(Limits):
    """When corrections are shortened, when a lane ends, and which points are believed.

    Parameters
    ----------
    known
        Known solutions u of each lane to be pushed away from (deflation); rows of NaN where a lane
        has fewer than others.
    trust
        Distance from the start, or from `middle`, within which points are believed.
    middle
        Points (z, p) from which distances are measured, where that is not the start.
    lower_index
        Number of negative eigenvalues below the one that vanishes, on folds.
    index
        Index of the point.
    within
        Constraints that the point must obey.
    """

    known: Known = None
    trust: Values | None = None
    middle: tuple[Lanes, Parameters] | None = None
    lower_index: Numbers | None = None
    index: Numbers | None = None
    within: tuple[Constraint, ...] = ()


@dataclass(frozen=True)
class Settled(Columns):
    """Points with conditions, and how sure they are.

    Parameters
    ----------
    z, p
        The points; the last ones where nothing was found.
    status
        `Status` of each lane.
    size
        Length of the last step in the metric.
    first
        Length of the first step.
    index
        Negative eigenvalues of the constrained Hessian, from the last factorisation; −1 if none.
    sure
        Whether pivots of the last factorisation were large enough for the index.
    frames
        Directions (dz, steps along the directions) of the tangent space at the last step, if they
        were asked for.
    slopes
        Those of the conditions along these directions.
    unfolding
        β of F + βb = 0, zero at points that exist without it.
    """

    z: Lanes
    p: Parameters
    status: Numbers
    size: Values
    first: Values
    index: Numbers
    sure: Flags
    frames: Float[np.ndarray, "lanes k bordered"]
    slopes: Float[np.ndarray, "lanes m k"]
    unfolding: Values

    @property
    def found(self) -> Flags:
        """Which lanes ended at a point that is believed."""
        return np.asarray(self.status == FOUND)


def settle(
    structure: Equations,
    z: Lanes,
    p: Parameters,
    directions: Directions | None = None,
    conditions: Sequence[Condition] = (),
    guards: Guards | None = None,
    frame: Frame | None = None,
    *,
    frames: bool = True,
) -> Settled:
    """Correct guesses to points with F(z; p) = 0 at which conditions hold.

    Parameters
    ----------
    structure, z, p
        The structure and guesses.
    directions
        Changes of the parameters that are free, k for each lane, orthonormal in their scales; none:
        the parameters are fixed. See `free_directions`.
    conditions
        As many scalars as directions; see `equimorph.equilibria.point_conditions`.
    guards
        How steps are limited, when a lane ends, and which points are believed.
    frame
        Coordinates along the set: `Tangents` (if not given), `Planes` or `Held`.
    frames
        Whether the tangent spaces are returned, too.

    Returns
    -------
    The points and a status for each lane: one that fails leaves the others as they are.
    """
    guards = Guards() if guards is None else guards
    frame = Tangents() if frame is None else frame
    held = directions is None
    if directions is None:
        directions = np.zeros((len(z), 0, p.shape[1]))
    problem = Problem(structure, directions, tuple(conditions), frame)
    if held and not conditions and problem.width == 0 and guards.known is None:
        return _apply_guards(structure, _as_settled(newton(structure, z, p, guards)), z, p, guards)
    if problem.in_one_plane and guards.known is None:
        return _apply_guards(structure, _in_one_plane(problem, z, p, guards), z, p, guards)
    if problem.onto_set and guards.known is None:
        told, sure = settle_onto(problem, z, p, guards)
        settled = _as_settled(told, sure, frames=frames)
        return _apply_guards(structure, settled, z, p, guards)
    settled = _by_steps(problem, z, p, guards, guards.known, frames=frames)
    return _apply_guards(structure, settled, z, p, guards)


def _in_one_plane(problem: Problem, z: Lanes, p: Parameters, guards: Guards) -> Settled:
    """The same where parameters move along one direction, or are held."""
    dp, frame = np.ascontiguousarray(problem.directions[:, 0]), problem.frame
    row, corner = np.zeros_like(z), np.ones(len(z))
    if isinstance(frame, Planes):
        row = np.ascontiguousarray(frame.by_z[:, 0])
        corner = np.einsum("li,li->l", frame.by_p[:, 0], dp)
    found = newton(problem.structure, z, p, guards, Through(dp, row, corner))
    if isinstance(frame, Planes):  # directions along the set are orthonormal
        weights = weights_of(problem.structure, z.shape[1] + 1)
        length = np.sqrt(found.tangents**2 @ weights)
        np.divide(found.tangents, length[:, :, None], found.tangents)
    return _as_settled(found)


def _as_settled(found: Newton, sure: Flags | None = None, *, frames: bool = True) -> Settled:
    tangents = found.tangents if frames else found.tangents[:, :0]
    lanes, k = tangents.shape[:2]
    sure, slopes = np.ones(lanes, bool) if sure is None else sure, np.zeros((lanes, 0, k))
    told = (found.status, found.size, found.first, found.index, sure, tangents, slopes)
    return Settled(found.z, found.p, *told, np.zeros(lanes))


def _by_steps(
    problem: Problem,
    z: Lanes,
    p: Parameters,
    limits: Limits,
    known: Known = None,
    *,
    frames: bool = True,
) -> Settled:
    """Newton's method for any directions and conditions, in batches of lanes."""
    lanes, most = len(z), max(FEWEST, BATCH // z.shape[1])
    if lanes > most:
        parts = []
        for some in np.split(np.arange(lanes), range(most, lanes, most)):
            own = None if known is None else known[some]
            given = problem.take(some), z[some], p[some], limits.take(some), own
            parts.append(_by_steps(*given, frames=frames))
        return Settled.concatenate(parts)
    here = start_at(problem, z, p)
    run = _Run(here, limits, known, frames=frames)
    while len(run.lanes):
        step = here.step()  # onto the set, and along it to the conditions
        status, share = run.judge(here, step)
        there = here.move(step, share)
        here = there.renew(step, run.record(there, step, status))
    return run.settled()


def embedded_planes(structure: Structure, free: Int[np.ndarray, " d"], rows: Rows) -> Planes:
    """Planes whose rows are given in the metric: √mass·u, then free parameters in their scales."""
    by_p = np.zeros((*rows.shape[:2], len(structure.parameters)))
    by_p[:, :, free] = rows[:, :, structure.unknowns :] / structure.scales[free]
    return Planes(products_with(structure, rows), by_p)


class _Run:
    """The lanes that are still on their way, and what became of the others."""

    def __init__(self, here: Points, limits: Limits, known: Known, *, frames: bool) -> None:
        """Begin with all lanes."""
        count, width = len(here.z), here.problem.width
        self.lanes, self.limits, self.number = np.arange(count), limits, 0
        self.size, self.first = np.full(count, np.inf), np.full(count, np.inf)
        self.known = known
        structure, bordered = here.problem.structure, here.z.shape[1] + width
        self.weights = weights_of(structure, bordered, limits.multipliers)
        self.too_long = limits.too_long_of(count)
        self.z, self.p, self.beta = here.z.copy(), here.p.copy(), here.beta.copy()
        self.status = np.full(count, OPEN)
        self.index, self.sure = np.full(count, -1), np.zeros(count, bool)
        self.frames = np.zeros((count, width if frames else 0, bordered))
        self.slopes = np.zeros((count, 0, self.frames.shape[1]))

    def judge(self, here: Points, step: Step) -> tuple[Numbers, Values]:
        """Status of each lane after a step, and the share of the step that is taken."""
        limits, lanes = self.limits, self.lanes
        size, share, status = np.empty(len(lanes)), np.empty(len(lanes)), np.empty(len(lanes), int)
        factor = _lengthening(here, step, self.known)
        self.number += 1
        free = limits.contraction == np.inf or self.number <= limits.free
        rule = (free, self.number >= limits.iterations)
        lengths = (limits.lengths, self.too_long[lanes], float(limits.longest))
        given = (step.change, self.weights, factor, self.size[lanes], *lengths, rule)
        judge_lanes(*given, size, status, share)
        self.size[lanes] = size
        if self.number == 1:
            self.first = size
        return status, share

    def record(self, here: Points, step: Step, status: Numbers) -> Some:
        """Note where the lanes are that ended, and what is known there; which lanes go on."""
        left = np.asarray((status == OPEN).nonzero()[0])
        if len(left) == len(status):
            return left
        some = np.flatnonzero(status != OPEN) if len(left) else slice(None)
        at, told = self.lanes[some], step.tangent
        self.status[at] = status[some]
        self.z[at], self.p[at], self.beta[at] = here.z[some], here.p[some], here.beta[some]
        self.index[at], self.sure[at] = told.index[some], told.sure[some]
        if self.frames.shape[1]:
            self.frames[at] = told.along[some]
            if self.slopes.shape[1] != step.slopes.shape[1]:  # it is only known now
                self.slopes = np.zeros((len(self.slopes), *step.slopes.shape[1:]))
            self.slopes[at] = step.slopes[some]
        self.lanes = self.lanes[left]
        self.known = None if self.known is None else self.known[left]
        return left

    def settled(self) -> Settled:
        """Points and status of all lanes."""
        told = (self.index, self.sure, self.frames, self.slopes, self.beta)
        return Settled(self.z, self.p, self.status, self.size, self.first, *told)


def _lengthening(here: Points, step: Step, known: Known) -> Values:
    """Factor of Newton steps for m(u) F = 0 with m = Π (1 + 1/‖u − uᵢ‖²), uᵢ known solutions.

    The Newton step of the product is that of F, lengthened by 1/(1 − ∇(log m)·du)
    [FarrellBirkissonFunke2015]_. Without known solutions it is one. A solution at which a lane
    begins has no side to which it pushes, and does not: it is found again.
    """
    if known is None:
        return np.ones(len(here.z))
    structure, n = here.problem.structure, here.problem.structure.unknowns
    gap = here.z[:, None, :n] - known
    squared = metric_length(structure, gap) ** 2
    along = np.einsum("lri,i,li->lr", gap, structure.mass, step.change[:, :n])
    slopes = np.zeros_like(squared)
    np.divide(-2.0 * along, squared * (1.0 + squared), slopes, where=squared > 0.0)
    with np.errstate(divide="ignore"):  # the step of the product may be endless
        return np.asarray(1.0 / (1.0 - slopes.sum(axis=1)))


def _apply_guards(
    structure: Equations, settled: Settled, start_z: Lanes, start_p: Parameters, guards: Guards
) -> Settled:
    """The points, those that are not believed marked in place."""
    z, p, status, index = settled.z, settled.p, settled.status, settled.index
    sure = settled.sure if guards.converged <= NEAR else settled.sure & (settled.size < NEAR)
    if not sure.all():
        doubtful = (status == FOUND) & ~sure
        index[doubtful] = structure.index(z[doubtful], p[doubtful])

    def refuse(bad: Flags, why: Status) -> None:
        status[(status == FOUND) & bad] = why

    if guards.trust is not None:
        middle = (start_z, start_p) if guards.middle is None else guards.middle
        refuse(~(distances(structure, z, p, *middle) <= guards.trust), Status.FAR)
    if guards.index is not None:
        refuse(index != guards.index, Status.WRONG_INDEX)
    if guards.lower_index is not None:
        some = np.flatnonzero(status == FOUND)
        low = np.full(len(z), -1)
        low[some] = lower_index(structure, z[some], p[some])
        refuse(low != guards.lower_index, Status.WRONG_INDEX)
    for constraint in guards.within:
        some = np.flatnonzero(status == FOUND)
        bad = np.zeros(len(z), bool)
        bad[some] = ~(constraint.excess(z[some], p[some]) < SLACK)
        refuse(bad, Status.VIOLATED)
    return settled


def lower_index(structure: Equations, z: Lanes, p: Parameters) -> Numbers:
    """Index on the lower side of folds: eigenvalues below the one that vanishes."""
    return count_below(structure, z, p, -SMALL_EIGENVALUE)
