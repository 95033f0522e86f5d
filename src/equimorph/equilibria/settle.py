"""One corrector for points with conditions: Newton's method with named guards, in lanes.

A point of a lane solves F(z; p) = 0 and as many conditions as the parameters have free directions.
Each step goes onto the equilibrium set and along its tangent space: folds are regular points, and
conditions are differentiated along the set only. With fewer conditions than directions the step
along the set is the shortest, with more the one of least squares.

See docs/decisions.md, "One corrector".
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Flags, Lanes, Parameters, Rows, Values
from equimorph.equilibria.newton_step import (
    Frame,
    Held,
    Numbers,
    Planes,
    Points,
    Problem,
    Step,
    Tangents,
    distances,
    free_directions,
    length,
    start_at,
)
from equimorph.equilibria.point_conditions import Condition, Directions, Some
from equimorph.model import Constraint
from equimorph.structures import Equations, Structure
from equimorph.tolerances import CONVERGED

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

NEAR = 1e-5
"""Last correction at whose start tangent space and index are those of its end."""
SMALL_EIGENVALUE = 1e-6
"""Size below which an eigenvalue at a fold is the one that vanishes."""
SLACK = 1e-9
"""By how much points may exceed constraints."""


class Status(IntEnum):
    """How Newton's method ended on a lane."""

    OPEN = -1
    """Not yet."""
    FOUND = 0
    UNFINISHED = 1
    """The iterations were used up."""
    SINGULAR = 2
    """A correction was not finite: the system is singular, or the structure is undefined there."""
    TOO_LONG = 3
    """A correction was longer than guesses near by would need."""
    NOT_SHRINKING = 4
    """Corrections did not shrink as demanded."""
    FAR = 5
    """The point is farther from where it was looked for than is trusted."""
    WRONG_INDEX = 6
    """The point has another index, or belongs to another fold."""
    VIOLATED = 7
    """The point violates a constraint."""


@dataclass(frozen=True)
class Guards:
    """When corrections are shortened, when a lane ends, and which points are believed.

    Parameters
    ----------
    iterations
        Most steps.
    longest
        Length in the metric to which steps are shortened.
    too_long
        Length of a step at which a lane is given up: the guess was not near.
    converged
        A shorter step is the last; Newton squares what is left.
    following
        Estimate of the next step, from the last two, below which it is not taken.
    contraction, free
        Each step must be at most so much of the one before, after so many steps that need not.
    multipliers
        Weight of squared multipliers in the length of steps.
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

    iterations: int = 60
    longest: float = 0.7
    too_long: float = np.inf
    converged: float = CONVERGED
    following: float = 0.0
    contraction: float = np.inf
    free: int = 0
    multipliers: float = 0.0
    known: Float[np.ndarray, "lanes roots unknowns"] | None = None
    trust: Values | None = None
    middle: tuple[Lanes, Parameters] | None = None
    lower_index: Numbers | None = None
    index: Numbers | None = None
    within: tuple[Constraint, ...] = ()

    @property
    def plain(self) -> bool:
        """Whether lanes go on until they converge, whatever their steps."""
        endless = self.contraction == self.too_long == np.inf
        return endless and self.known is None and not (self.following or self.multipliers)


@dataclass(frozen=True)
class Settled:
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
        return np.asarray(self.status == Status.FOUND)


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
    if directions is None and frame is None and guards.plain:
        return _believed(structure, _at_fixed_parameters(structure, z, p, guards), (z, p), guards)
    frame = Tangents() if frame is None else frame
    if directions is None:
        directions = np.zeros((len(z), 0, p.shape[1]))
    here = start_at(Problem(structure, directions, tuple(conditions), frame), z, p)
    run = _Run(here, guards, frames=frames)
    while len(run.lanes):
        step = here.step()  # onto the set, and along it to the conditions
        status, share = run.judge(here, step)
        here = run.without_ended(here.moved(step, share), step, status)
    return _believed(structure, run.settled(), (z, p), guards)


def embedded_planes(structure: Structure, free: Int[np.ndarray, " d"], rows: Rows) -> Planes:
    """Planes whose rows are given in the metric: √mass·u, then free parameters in their scales."""
    n = structure.unknowns
    by_z = np.zeros((*rows.shape[:2], structure.size))
    by_p = np.zeros((*rows.shape[:2], len(structure.parameters)))
    by_z[:, :, :n] = rows[:, :, :n] * np.sqrt(structure.mass)
    by_p[:, :, free] = rows[:, :, n:] / structure.scales[free]
    return Planes(by_z, by_p)


def _at_fixed_parameters(structure: Equations, z: Lanes, p: Parameters, guards: Guards) -> Settled:
    """The same without directions, conditions and most guards: for few lanes twice as fast."""
    count, n = len(z), structure.unknowns
    z, status = z.copy(), np.full(count, Status.UNFINISHED.value)
    size, first, index = np.full(count, np.inf), np.full(count, np.inf), np.full(count, -1)
    todo = np.arange(count)
    still, fixed, none, one = np.zeros_like(z), np.zeros_like(p), np.zeros(count), np.ones(count)
    for number in range(guards.iterations):
        m = len(todo)
        if m == 0:
            break
        step = structure.advance(z[todo], p[todo], fixed[:m], still[:m], one[:m], none[:m])
        long = np.sqrt(step.dz[:, :n] ** 2 @ structure.mass)
        alive = np.isfinite(long)
        own = np.minimum(1.0, guards.longest / np.maximum(long, 1e-300))[:, None] * step.dz
        z[todo] += own if alive.all() else np.where(alive[:, None], own, 0.0)
        size[todo], index[todo] = long, step.index
        if number == 0:
            first[:] = long
        small = long < guards.converged
        status[todo[small]], status[todo[~alive]] = Status.FOUND, Status.SINGULAR
        todo = todo[alive & ~small]
    sure, frames = np.ones(count, bool), np.zeros((count, 0, structure.size))
    slopes, unfolding = np.zeros((count, 0, 0)), np.zeros(count)
    return Settled(z, p.copy(), status, size, first, index, sure, frames, slopes, unfolding)


class _Run:
    """The lanes that are still on their way, and what became of the others."""

    def __init__(self, here: Points, guards: Guards, *, frames: bool) -> None:
        """Begin with all lanes."""
        count, width = len(here.z), here.problem.width
        self.lanes, self.guards, self.number = np.arange(count), guards, 0
        self.size, self.first = np.full(count, np.inf), np.full(count, np.inf)
        self.known = guards.known
        self.z, self.p, self.beta = here.z.copy(), here.p.copy(), here.beta.copy()
        self.status = np.full(count, Status.OPEN.value)
        self.index, self.sure = np.full(count, -1), np.zeros(count, bool)
        self.frames = np.zeros((count, width if frames else 0, here.z.shape[1] + width))
        self.slopes = np.zeros((count, 0, self.frames.shape[1]))

    def judge(self, here: Points, step: Step) -> tuple[Numbers, Values]:
        """Status of each lane after a step, and the share of the step that is taken."""
        guards, before = self.guards, self.size[self.lanes]
        size = length(here.problem.structure, step, guards.multipliers)
        small = size < guards.converged
        if guards.following > 0.0 and self.number:
            small |= (size < NEAR) & (size**3 < guards.following * before**2)
        self.number += 1
        goes_on = Status.OPEN if self.number < guards.iterations else Status.UNFINISHED
        status = np.where(small, Status.FOUND.value, goes_on.value)
        if guards.contraction < np.inf and self.number > guards.free:
            status[~small & ~(size <= guards.contraction * before)] = Status.NOT_SHRINKING
        if guards.too_long < np.inf:
            status[~(size < guards.too_long)] = Status.TOO_LONG
        long, share = size, np.ones(len(size))
        if self.known is not None:
            share = _lengthening(here, step, self.known)
            long = np.abs(share) * size
        status[~np.isfinite(long)] = Status.SINGULAR
        if guards.longest < np.inf and not (long <= guards.longest).all():
            share *= np.minimum(1.0, guards.longest / np.maximum(long, 1e-300))
        share[status > Status.UNFINISHED] = 0.0
        self.size[self.lanes] = size
        if self.number == 1:
            self.first = size
        return status, share

    def without_ended(self, here: Points, step: Step, status: Numbers) -> Points:
        """Record the lanes that ended, and go on with the others."""
        ended = np.flatnonzero(status != Status.OPEN)
        if len(ended):
            self.record(here, step, status, ended)
            if len(ended) == len(status):
                self.lanes = self.lanes[:0]
                return here
            left = np.flatnonzero(status == Status.OPEN)
            self.lanes, here = self.lanes[left], here.take(left)
            self.known = None if self.known is None else self.known[left]
        return here

    def record(self, here: Points, step: Step, status: Numbers, some: Some) -> None:
        """Note where some of the lanes are, and what is known there."""
        at = self.lanes[some]
        self.status[at] = status[some]
        self.z[at], self.p[at], self.beta[at] = here.z[some], here.p[some], here.beta[some]
        told = step.tangent
        self.index[at], self.sure[at] = told.index[some], told.sure[some]
        if self.frames.shape[1]:
            self.frames[at] = told.frames[some]
            if self.slopes.shape[1] != step.slopes.shape[1]:  # it is only known now
                self.slopes = np.zeros((len(self.slopes), *step.slopes.shape[1:]))
            self.slopes[at] = step.slopes[some]

    def settled(self) -> Settled:
        """Points and status of all lanes."""
        told = (self.index, self.sure, self.frames, self.slopes, self.beta)
        return Settled(self.z, self.p, self.status, self.size, self.first, *told)


def _lengthening(
    here: Points, step: Step, known: Float[np.ndarray, "lanes roots unknowns"]
) -> Values:
    """Factor of Newton steps for m(u) F = 0 with m = Π (1 + 1/‖u − uᵢ‖²), uᵢ known solutions.

    The Newton step of the product is that of F, lengthened by 1/(1 − ∇(log m)·du)
    [FarrellBirkissonFunke2015]_.
    """
    structure, n = here.problem.structure, here.problem.structure.unknowns
    gap = here.z[:, None, :n] - known
    squared = gap**2 @ structure.mass
    along = np.einsum("lri,i,li->lr", gap, structure.mass, step.dz[:, :n])
    slopes = -2.0 * along / (squared * (1.0 + squared))
    return np.asarray(1.0 / (1.0 - np.nansum(slopes, axis=1)))


def _believed(
    structure: Equations, settled: Settled, start: tuple[Lanes, Parameters], guards: Guards
) -> Settled:
    """The points, with those that are not believed marked."""
    z, p, status, index = settled.z, settled.p, settled.status.copy(), settled.index.copy()
    doubtful = (status == Status.FOUND) & ~(settled.sure & (settled.size < NEAR))
    if doubtful.any():
        index[doubtful] = structure.index(z[doubtful], p[doubtful])

    def refuse(bad: Flags, why: Status) -> None:
        status[(status == Status.FOUND) & bad] = why

    if guards.trust is not None:
        middle = start if guards.middle is None else guards.middle
        refuse(~(distances(structure, (z, p), middle) <= guards.trust), Status.FAR)
    if guards.index is not None:
        refuse(index != guards.index, Status.WRONG_INDEX)
    if guards.lower_index is not None:
        some = np.flatnonzero(status == Status.FOUND)
        low = np.full(len(z), -1)
        low[some] = lower_index(structure, z[some], p[some])
        refuse(low != guards.lower_index, Status.WRONG_INDEX)
    for constraint in guards.within:
        some = np.flatnonzero(status == Status.FOUND)
        bad = np.zeros(len(z), bool)
        bad[some] = ~(constraint.excess(z[some], p[some]) < SLACK)
        refuse(bad, Status.VIOLATED)
    return replace(settled, status=status, index=index)


def lower_index(structure: Equations, z: Lanes, p: Parameters) -> Numbers:
    """Index on the lower side of folds: eigenvalues below the one that vanishes."""
    nothing, shift = np.zeros((len(z), 0, structure.size)), np.full(len(z), -SMALL_EIGENVALUE)
    return np.asarray(structure.solve(z, p, nothing, shift=shift).negative - structure.constraints)
