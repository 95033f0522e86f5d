"""One Newton step onto the equilibrium set and along it to the conditions of points."""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Directions, Flags, Float, Int, Lanes, Numbers, Parameters, Some, Values
from equimorph.columns import Columns
from equimorph.equilibria.critical import Critical, null_border
from equimorph.equilibria.newton_kernels import amount_lanes, move_lanes, null_lanes
from equimorph.equilibria.point_conditions import Condition, Linear, Move
from equimorph.linalg import orthonormal_rows
from equimorph.structures import Equations, LinearSystem, Structure

DOUBTFUL = 1e-4
"""Pivot ratio below which the index is counted anew."""
RANK = 1e-12
"""Smallest singular value of slopes, relative to the largest one, that counts as zero; their
determinant is `DEPENDENT` then."""


@dataclass(frozen=True)
class Tangents(Columns):
    """Coordinates along the set: its tangent spaces, found on the way. Regular at folds, too."""

    unfolded: bool = False
    """Solve F + βb = 0 with one more unknown β, b near the null vector: regular at branch points
    and where sheets cross, too. There β is zero."""
    border: Lanes | None = None
    """b, if it is given: then it is kept."""


@dataclass(frozen=True)
class Planes(Columns):
    """Coordinates along the set: projections to given planes that are near its tangent spaces."""

    by_z: Float[np.ndarray, "lanes k size"]
    by_p: Float[np.ndarray, "lanes k parameters"]
    """k rows for each lane, whose products with (dz, dp) are the coordinates."""
    by_beta: Float[np.ndarray, "lanes k"] | None = None
    """Their products with β, if F + βb = 0 is solved with this unknown, too."""
    border: Lanes | None = None
    """b, if it is given: then it is kept."""

    @property
    def unfolded(self) -> bool:
        """Whether β is one more unknown."""
        return self.by_beta is not None


@dataclass(frozen=True)
class Held(Columns):
    """Coordinates along the set: the parameters along the directions. Singular at folds."""


Frame = Tangents | Planes | Held


@dataclass(frozen=True)
class Tangent:
    """The set near points: a step onto it, directions along it, and what the factorisation told.

    Steps and directions are changes of z, then of the other unknowns. null: (v, g), see `Critical`,
    if it is needed.
    """

    onto: Float[np.ndarray, "lanes bordered"]
    along: Float[np.ndarray, "lanes k bordered"]
    index: Numbers
    sure: Flags
    system: LinearSystem | None = None
    null: Float[np.ndarray, "lanes extended"] | None = None


@dataclass(frozen=True)
class Problem:
    """What is solved for: directions, conditions, coordinates along the set."""

    structure: Equations
    directions: Directions
    conditions: tuple[Condition, ...]
    frame: Frame

    @property
    def unfolded(self) -> bool:
        """Whether β is one more unknown."""
        return not isinstance(self.frame, Held) and self.frame.unfolded

    @property
    def width(self) -> int:
        """Unknowns in addition to z: steps along the directions, and β."""
        return int(self.directions.shape[1]) + self.unfolded

    @property
    def in_one_plane(self) -> bool:
        """Whether F = 0 is all, with one direction free in planes, or held."""
        alone = self.directions.shape[1] == 1 and not self.conditions
        return alone and not (self.unfolded or isinstance(self.frame, Tangents))

    @property
    def onto_set(self) -> bool:
        """Whether F = 0 is all, in few enough free directions for the structure's fused steps."""
        alone = not (self.conditions or self.unfolded or isinstance(self.frame, Held))
        return alone and 0 < self.width <= self.structure.fused_directions

    @property
    def critical(self) -> bool:
        """Whether a border of F_z is needed."""
        return self.unfolded or any(each.critical for each in self.conditions)

    @property
    def renews_border(self) -> bool:
        """Whether the border follows the null vector."""
        return self.critical and (isinstance(self.frame, Held) or self.frame.border is None)

    def take(self, some: Some) -> "Problem":
        """Return the problem of some of the lanes."""
        if self.width == 0 and not self.conditions:
            return self
        conditions = tuple(each.take(some) for each in self.conditions)
        frame = self.frame.take(some)
        return Problem(self.structure, self.directions[some], conditions, frame)

    def linear(self, at: Critical, tangent: Tangent) -> Linear:
        """Return all conditions after the step onto the set, and their slopes along it."""
        size, k = self.structure.size, self.directions.shape[1]
        onto, along = tangent.onto, tangent.along
        onto_p = (onto[:, None, size : size + k] @ self.directions)[:, 0]
        along_p = along[:, :, size : size + k] @ self.directions
        move = Move(onto[:, :size], onto_p, along[:, :, :size], along_p)
        found = [condition.linear(at, move) for condition in self.conditions]
        if len(found) == 1:
            return found[0]
        value = np.concatenate([each.value for each in found], axis=1)
        return Linear(value, np.concatenate([each.slopes for each in found], axis=1))


@dataclass(frozen=True)
class Step:
    """A Newton step of z and the other unknowns, and the set where it starts.

    slopes: those of the conditions along the directions; null: null vectors that renew the border.
    """

    change: Float[np.ndarray, "lanes bordered"]
    tangent: Tangent
    slopes: Float[np.ndarray, "lanes m k"]
    null: Lanes | None


Bordered = tuple[
    Float[np.ndarray, "lanes columns bordered"],
    Numbers,
    Flags,
    LinearSystem,
    Float[np.ndarray, "lanes extended"] | None,
]
"""Directions and step, index, whether it is sure, the system and (v, g), as in `Tangent`."""


@dataclass(frozen=True)
class Points(Columns):
    """Where the lanes are: points, β, the border b of F_z, rows that see the tangent space."""

    problem: Problem
    z: Lanes
    p: Parameters
    beta: Values
    b: Float[np.ndarray, "lanes border"]
    rows: Float[np.ndarray, "lanes rows bordered"]

    def move(self, step: Step, share: Values) -> "Points":
        """Points after shares of a step, with the border and the rows of the points before."""
        problem = self.problem
        z, p, beta = np.empty_like(self.z), np.empty_like(self.p), np.empty_like(self.beta)
        given = (step.change, problem.directions, share)
        move_lanes(self.z, self.p, self.beta, *given, z, p, beta)
        return Points(problem, z, p, beta, self.b, self.rows)

    def renew(self, step: Step, some: Some) -> "Points":
        """Some of the lanes after a step, with the border and the rows that it found."""
        if len(some) == 0:
            return self
        whole = len(some) == len(self.z)
        here = self if whole else self.take(some)
        problem, b, rows = here.problem, here.b, here.rows
        if step.null is not None:
            null = step.null if whole else step.null[some]
            b = np.ascontiguousarray(null / np.linalg.norm(null, axis=1, keepdims=True))
        if isinstance(problem.frame, Tangents) and problem.width:
            along = step.tangent.along if whole else step.tangent.along[some]
            rows = along * weights_of(problem.structure, along.shape[2])
        return Points(problem, here.z, here.p, here.beta, b, rows)

    def step(self) -> Step:
        """Newton step onto the set and along it to the conditions."""
        problem, tangent = self.problem, self.tangent()
        if not problem.conditions:
            none = np.zeros((len(self.z), 0, problem.width))
            return Step(tangent.onto, tangent, none, None)
        # conditions without use for the border get any vector in its place
        border = self.b if problem.critical else self.z
        at = Critical(problem.structure, self.z, self.p, border, tangent.system, tangent.null)
        linear = problem.linear(at, tangent)
        amount = _amount(linear.slopes, linear.value)
        change = tangent.onto + (amount[:, None] @ tangent.along)[:, 0]
        return Step(change, tangent, linear.slopes, at.v if problem.renews_border else None)

    def tangent(self) -> Tangent:
        """Newton step onto the set where the rows vanish, and directions along the set."""
        if self.problem.width == 0 or isinstance(self.problem.frame, Held):
            return self._over_parameters()
        return self._frame(*self.bordered())

    def _frame(
        self,
        x: Float[np.ndarray, "lanes columns bordered"],
        index: Numbers,
        sure: Flags,
        system: LinearSystem | None = None,
        null: Float[np.ndarray, "lanes extended"] | None = None,
    ) -> Tangent:
        """Directions along the set made orthonormal, and the step after them.

        Planes keep the step in them; else it is the shortest, orthogonal to the directions.
        """
        problem, width = self.problem, self.problem.width
        many = width + isinstance(problem.frame, Tangents)
        weights = weights_of(problem.structure, x.shape[2])
        along = orthonormal_rows(x[:, :many], width, weights)
        onto = np.ascontiguousarray(along[:, width] if many > width else x[:, width])
        return Tangent(onto, along[:, :width], index, sure, system, null)

    def bordered(self) -> Bordered:
        """Directions and step by the bordered system, which is regular at folds."""
        problem, structure = self.problem, self.problem.structure
        (lanes, size), width = self.z.shape, self.problem.width
        system = structure.linear_system(self.z, self.p, problem.directions)
        columns, k = system.columns, system.columns.shape[1]
        seeks = problem.critical and not problem.unfolded  # (v, g) needs one solution more
        rhs = np.zeros((lanes, width + 1 + seeks, size + width))
        rhs[:, :width, size:] = np.eye(width)
        np.negative(system.residual, out=rhs[:, width, :size])
        if seeks:
            rhs[:, -1, :size] = self.b
        if problem.unfolded:
            columns = np.concatenate([columns, self.b[:, None]], axis=1)
            rhs[:, width, :size] -= self.beta[:, None] * self.b
        solution = system.solve(rhs, (columns, self.rows[:, :, :size], self.rows[:, :, size:]))
        x, null = solution.x, None
        if problem.critical:
            null = np.empty((lanes, size + 1))
            null_lanes(x, size, k, self.b, null)
        index = solution.negative - structure.constraints
        sure = ~solution.pivoted & (solution.pivot_ratio >= DOUBTFUL)
        return x, index, sure, system, null

    def _over_parameters(self) -> Tangent:
        """The same where parameters are the coordinates: the structure's fused steps."""
        (lanes, size), k, structure = self.z.shape, self.problem.width, self.problem.structure
        along, onto = np.zeros((lanes, k, size + k)), np.zeros((lanes, size + k))
        if k:
            out = structure.respond(self.z, self.p, self.problem.directions)
            onto[:, :size], index = out.dz, out.index
            along[:, :, :size], along[:, :, size:] = out.tangents, np.eye(k)
        else:
            still, one, none = np.zeros_like(self.z), np.ones(lanes), np.zeros(lanes)
            move = structure.advance(self.z, self.p, np.zeros_like(self.p), still, one, none)
            onto[:, :size], index = move.dz, move.index
        return Tangent(onto, along, index, np.ones(lanes, bool))


def start_at(problem: Problem, z: Lanes, p: Parameters) -> Points:
    """Guesses, with a border and rows if these are needed."""
    structure, (lanes, size), k = problem.structure, z.shape, problem.width
    border, rows, frame = np.zeros((lanes, 0)), np.zeros((lanes, 0, 0)), problem.frame
    if not isinstance(frame, Held) and frame.border is not None:
        border = np.ascontiguousarray(frame.border)
    elif problem.critical:
        border = null_border(structure, z, p)
    if isinstance(frame, Planes):
        by_a = frame.by_p @ problem.directions.transpose(0, 2, 1)
        by_beta = [] if frame.by_beta is None else [frame.by_beta[:, :, None]]
        rows = np.concatenate([frame.by_z, by_a, *by_beta], axis=2)
    elif isinstance(frame, Tangents) and k:  # any rows that see the tangent space will do
        waves = np.cos(np.outer(np.arange(1, k + 1), 1.7 * np.arange(size + k)) + 0.4)
        rows = np.tile(waves, (lanes, 1, 1))
    z, p = np.ascontiguousarray(z), np.ascontiguousarray(p)
    return Points(problem, z, p, np.zeros(lanes), border, rows)


def weights_of(
    structure: Equations, bordered: int, multipliers: float = 0.0
) -> Float[np.ndarray, " bordered"]:
    """Weights of squared changes of (z, other unknowns): the metric, and that of multipliers."""
    weights = np.ones(bordered)
    weights[: structure.unknowns] = structure.mass
    weights[structure.unknowns : structure.size] = multipliers
    return weights


def _amount(
    slopes: Float[np.ndarray, "lanes m k"], value: Float[np.ndarray, "lanes m"]
) -> Float[np.ndarray, "lanes k"]:
    """Steps along the set that take scalars to zero: the shortest, or those of least squares."""
    count, m, k = slopes.shape
    amount, regular = np.full((count, k), np.nan), np.zeros(count, bool)
    if m <= k:
        # the shortest step is a combination of the gradients
        matrix = slopes if m == k else slopes @ slopes.transpose(0, 2, 1)
        share = np.empty((count, m))
        amount_lanes(*map(np.ascontiguousarray, (matrix, value)), share, regular)
        amount = share if m == k else (share[:, None] @ slopes)[:, 0]
        if regular.all():
            return amount
    rest = ~regular & np.isfinite(slopes).all(axis=(1, 2)) & np.isfinite(value).all(axis=1)
    if rest.any():
        inverse = np.linalg.pinv(slopes[rest], rcond=RANK)
        amount[rest] = -(inverse @ value[rest, :, None])[:, :, 0]
    return amount


def free_directions(structure: Structure, free: Int[np.ndarray, "*_ k"], lanes: int) -> Directions:
    """Directions in which parameters change by their scales: the same for all lanes, or of each."""
    k = free.shape[-1]
    out = np.zeros((lanes, k, len(structure.parameters)))
    lane = slice(None) if free.ndim == 1 else np.arange(lanes)[:, None]
    out[lane, np.arange(k), free] = structure.scales[free]
    return out
