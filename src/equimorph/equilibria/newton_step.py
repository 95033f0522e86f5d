"""One Newton step onto the equilibrium set and along it to the conditions of points."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Flags, Lanes, Parameters, Values
from equimorph.equilibria.critical import Critical, null_border
from equimorph.equilibria.point_conditions import Condition, Directions, Move, Some
from equimorph.structures import Equations, Structure

DOUBTFUL = 1e-4
"""Pivot ratio below which the index is counted anew."""
SINGULAR, RANK = 1e-14, 1e-12
"""Determinant of the slopes of conditions and their smallest singular value, relative to their
size, that count as zero."""

Numbers = Int[np.ndarray, " lanes"]


@dataclass(frozen=True)
class Tangents:
    """Coordinates along the set: its tangent spaces, found on the way. Regular at folds, too.

    Parameters
    ----------
    unfolded
        Solve F + βb = 0 with one more unknown β, b near the null vector: regular at branch points
        and where sheets cross, too. There β is zero.
    border
        b, if it is given: then it is kept.
    """

    unfolded: bool = False
    border: Lanes | None = None

    def take(self, some: Some) -> "Tangents":
        """Return those of some of the lanes."""
        return self if self.border is None else Tangents(self.unfolded, self.border[some])


@dataclass(frozen=True)
class Planes:
    """Coordinates along the set: projections to given planes that are near its tangent spaces.

    Parameters
    ----------
    by_z, by_p
        k rows for each lane, whose products with (dz, dp) are the coordinates.
    by_beta
        Their products with β, if F + βb = 0 is solved with this unknown, too.
    border
        b, if it is given: then it is kept.
    """

    by_z: Float[np.ndarray, "lanes k size"]
    by_p: Float[np.ndarray, "lanes k parameters"]
    by_beta: Float[np.ndarray, "lanes k"] | None = None
    border: Lanes | None = None

    @property
    def unfolded(self) -> bool:
        """Whether β is one more unknown."""
        return self.by_beta is not None

    def take(self, some: Some) -> "Planes":
        """Return the planes of some of the lanes."""
        beta = None if self.by_beta is None else self.by_beta[some]
        border = None if self.border is None else self.border[some]
        return Planes(self.by_z[some], self.by_p[some], beta, border)


@dataclass(frozen=True)
class Held:
    """Coordinates along the set: the parameters along the directions. Singular at folds."""

    def take(self, some: Some) -> "Held":
        """Return the same."""
        return self


Frame = Tangents | Planes | Held


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
        """Unknowns besides z: steps along the directions, and β."""
        return int(self.directions.shape[1]) + self.unfolded

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

    def change(
        self, a: Float[np.ndarray, "lanes steps k"]
    ) -> Float[np.ndarray, "lanes steps parameters"]:
        """Changes of the parameters by steps along the directions."""
        return np.asarray(a[:, :, : self.directions.shape[1]] @ self.directions)


@dataclass(frozen=True)
class Tangent:
    """The set near points: a step onto it, directions along it, and what the factorisation told.

    dz, da: the step, of z and of the other unknowns; along_z, along_a: the directions.
    """

    dz: Lanes
    da: Float[np.ndarray, "lanes k"]
    along_z: Float[np.ndarray, "lanes k size"]
    along_a: Float[np.ndarray, "lanes k k"]
    index: Numbers
    sure: Flags

    @property
    def frames(self) -> Float[np.ndarray, "lanes k bordered"]:
        """Directions of all unknowns."""
        return np.concatenate([self.along_z, self.along_a], axis=2)


@dataclass(frozen=True)
class Step:
    """A Newton step of z and the other unknowns, the set where it starts, and the null vector.

    slopes: those of the conditions along the directions.
    """

    dz: Lanes
    da: Float[np.ndarray, "lanes k"]
    tangent: Tangent
    slopes: Float[np.ndarray, "lanes m k"]
    null: Float[np.ndarray, "lanes border"]


@dataclass(frozen=True)
class Points:
    """Where the lanes are: points, β, the border b of F_z, rows that see the tangent space."""

    problem: Problem
    z: Lanes
    p: Parameters
    beta: Values
    b: Float[np.ndarray, "lanes border"]
    rows: Float[np.ndarray, "lanes rows bordered"]

    def take(self, some: Some) -> "Points":
        """Return some of the lanes."""
        columns = (self.z, self.p, self.beta, self.b, self.rows)
        return Points(self.problem.take(some), *(column[some] for column in columns))

    def moved(self, step: Step, share: Values) -> "Points":
        """Points after shares of a step, with the border and the rows renewed."""
        problem, wide, moving = self.problem, share[:, None], share != 0.0
        dz, da = wide * step.dz, wide * step.da
        if not moving.all():  # those that do not may have steps that are no numbers
            dz[~moving], da[~moving] = 0.0, 0.0
        p, beta, rows = self.p, self.beta, self.rows
        if problem.directions.shape[1]:
            p = p + problem.change(da[:, None])[:, 0]
        if problem.unfolded:
            beta = beta + da[:, -1]
        if isinstance(problem.frame, Tangents) and problem.width:
            rows = _dual(problem.structure, step.tangent.frames)
        return Points(problem, self.z + dz, p, beta, step.null, rows)

    def step(self) -> Step:
        """Newton step onto the set and along it to the conditions."""
        problem, tangent = self.problem, self.tangent()
        if not problem.conditions:
            none = np.zeros((len(self.z), 0, problem.width))
            return Step(tangent.dz, tangent.da, tangent, none, self.b)
        # conditions without use for the border get any vector in its place
        at = Critical(problem.structure, self.z, self.p, self.b if problem.critical else self.z)
        onto_p = problem.change(tangent.da[:, None])[:, 0]
        move = Move(tangent.dz, onto_p, tangent.along_z, problem.change(tangent.along_a))
        found = [condition.linear(at, move) for condition in problem.conditions]
        slopes, value = found[0].slopes, found[0].value
        if len(found) > 1:
            slopes = np.concatenate([each.slopes for each in found], axis=1)
            value = np.concatenate([each.value for each in found], axis=1)
        spare = slopes.shape[1] < slopes.shape[2] and not isinstance(problem.frame, Held)
        gram = _gram(problem.structure, tangent.frames) if spare else None
        amount = _amount(slopes, value, gram)[:, None]
        dz = tangent.dz + (amount @ tangent.along_z)[:, 0]
        da = tangent.da + (amount @ tangent.along_a)[:, 0]
        return Step(dz, da, tangent, slopes, _unit(at.v) if problem.renews_border else self.b)

    def tangent(self) -> Tangent:
        """Newton step onto the set where the rows vanish, and directions along the set."""
        problem, structure = self.problem, self.problem.structure
        (lanes, size), k = self.z.shape, self.problem.width
        if k == 0 or isinstance(problem.frame, Held):
            return self._over_parameters()
        columns = np.empty((lanes, k, size))
        rhs = np.zeros((lanes, k + 1, size + k))
        rhs[:, 0, :size], rhs[:, 1:, size:] = -structure.residual(self.z, self.p), np.eye(k)
        if problem.unfolded:
            columns[:, -1] = self.b
            rhs[:, 0, :size] -= self.beta[:, None] * self.b
        if many := problem.directions.shape[1]:
            z, p = self.z.repeat(many, axis=0), self.p.repeat(many, axis=0)
            dp = problem.directions.reshape(-1, p.shape[1])
            columns[:, :many] = structure.parameter_derivative(z, p, dp).reshape(lanes, many, size)
        border = (columns, self.rows[:, :, :size], self.rows[:, :, size:])
        solution = structure.solve(self.z, self.p, rhs, border)
        sure = ~solution.pivoted & (solution.pivot_ratio >= DOUBTFUL)
        dz, along_z = np.ascontiguousarray(solution.x[:, 0, :size]), solution.x[:, 1:, :size]
        da, along_a = solution.x[:, 0, size:], solution.x[:, 1:, size:]
        return Tangent(dz, da, along_z, along_a, solution.negative - structure.constraints, sure)

    def _over_parameters(self) -> Tangent:
        """The same where parameters are the coordinates: the structure's fused steps."""
        (lanes, size), k = self.z.shape, self.problem.width
        still, one, none = np.zeros((lanes, size)), np.ones(lanes), np.zeros(lanes)
        along_z, along_a = np.empty((lanes, k, size)), np.tile(np.eye(k), (lanes, 1, 1))
        for i in range(max(k, 1)):
            fixed = np.zeros_like(self.p)
            dp = np.ascontiguousarray(self.problem.directions[:, i]) if k else fixed
            move = self.problem.structure.advance(self.z, self.p, dp, still, one, none)
            along_z[:, i : i + 1] = move.tangent_z[:, None]
        sure = np.ones(lanes, bool)
        return Tangent(move.dz, np.zeros((lanes, k)), along_z, along_a, move.index, sure)


def start_at(problem: Problem, z: Lanes, p: Parameters) -> Points:
    """Guesses, with a border and rows if these are needed."""
    structure, (lanes, size), k = problem.structure, z.shape, problem.width
    border, rows, frame = np.zeros((lanes, 0)), np.zeros((lanes, 0, 0)), problem.frame
    if not isinstance(frame, Held) and frame.border is not None:
        border = frame.border
    elif problem.critical:
        border = null_border(structure, z, p)
    if isinstance(frame, Planes):
        by_a = frame.by_p @ problem.directions.transpose(0, 2, 1)
        by_beta = [] if frame.by_beta is None else [frame.by_beta[:, :, None]]
        rows = np.concatenate([frame.by_z, by_a, *by_beta], axis=2)
    here = Points(problem, z, p, np.zeros(lanes), border, rows)
    if isinstance(frame, Tangents) and k:
        # any rows that see the tangent space will do, then its own
        waves = np.cos(np.outer(np.arange(1, k + 1), 1.7 * np.arange(size + k)) + 0.4)
        along = replace(here, rows=np.tile(waves, (lanes, 1, 1))).tangent().frames
        return replace(here, rows=_dual(structure, along))
    return here


def _dual(
    structure: Equations, along: Float[np.ndarray, "lanes k bordered"]
) -> Float[np.ndarray, "lanes k bordered"]:
    """Rows whose products with steps are coordinates in orthonormal directions of the same space.

    Not a number where the directions are dependent.
    """
    gram = _gram(structure, along)
    whole = np.isfinite(gram).all(axis=(1, 2))
    whole[whole] = np.linalg.det(gram[whole]) > 0.0
    gram[~whole] = np.eye(along.shape[1])
    rows = np.linalg.solve(np.linalg.cholesky(gram), along) * _weights(structure, along)
    rows[~whole] = np.nan
    return np.ascontiguousarray(rows)


def _gram(
    structure: Equations, along: Float[np.ndarray, "lanes k bordered"]
) -> Float[np.ndarray, "lanes k k"]:
    """Products of directions in the metric."""
    return np.asarray((along * _weights(structure, along)) @ np.swapaxes(along, 1, 2))


def _weights(
    structure: Equations, along: Float[np.ndarray, "lanes k bordered"]
) -> Float[np.ndarray, " bordered"]:
    """Metric of (z, steps along the directions); multipliers do not count."""
    weights = np.ones(along.shape[2])
    weights[: structure.unknowns], weights[structure.unknowns : structure.size] = (
        structure.mass,
        0.0,
    )
    return weights


def length(structure: Equations, step: Step, multipliers: float) -> Values:
    """Length of steps in the metric and in the scaled parameters."""
    n = structure.unknowns
    squared = step.dz[:, :n] ** 2 @ structure.mass
    if step.da.shape[1]:
        squared += (step.da**2).sum(axis=1)
    if multipliers:
        squared += multipliers * (step.dz[:, n:] ** 2).sum(axis=1)
    return np.asarray(np.sqrt(squared))


def _amount(
    slopes: Float[np.ndarray, "lanes m k"],
    value: Float[np.ndarray, "lanes m"],
    gram: Float[np.ndarray, "lanes k k"] | None,
) -> Float[np.ndarray, "lanes k"]:
    """Steps along the set that take scalars to zero: the shortest, or those of least squares.

    Lengths are measured by the products of the directions, if these are given.
    """
    count, m, k = slopes.shape
    spread = slopes.transpose(0, 2, 1)
    if m < k and gram is not None:
        spread = np.linalg.solve(gram, spread)
    matrix = slopes if m == k else slopes @ spread
    if m > k or k == 0:
        regular = np.zeros(count, bool)
    else:
        with np.errstate(invalid="ignore", over="ignore"):
            size = np.abs(matrix).max(axis=(1, 2), initial=0.0)
            regular = np.abs(np.linalg.det(matrix)) > SINGULAR * size**m
    if regular.all():
        share = np.linalg.solve(matrix, -value[:, :, None])
        return np.asarray((share if m == k else spread @ share)[:, :, 0])
    amount = np.full((count, k), np.nan)
    if regular.any():
        some = None if gram is None else gram[regular]
        amount[regular] = _amount(slopes[regular], value[regular], some)
    rest = ~regular & np.isfinite(slopes).all(axis=(1, 2)) & np.isfinite(value).all(axis=1)
    if rest.any():
        inverse = np.linalg.pinv(slopes[rest], rcond=RANK)
        amount[rest] = -(inverse @ value[rest, :, None])[:, :, 0]
    return amount


def _unit(v: Lanes) -> Lanes:
    return np.ascontiguousarray(v / np.linalg.norm(v, axis=1, keepdims=True))


def free_directions(structure: Structure, free: Int[np.ndarray, "*_ k"], lanes: int) -> Directions:
    """Directions in which parameters change by their scales: the same for all lanes, or of each."""
    places = np.broadcast_to(free, (lanes, free.shape[-1]))
    out = np.zeros((*places.shape, len(structure.parameters)))
    np.put_along_axis(out, places[:, :, None], structure.scales[places][:, :, None], axis=2)
    return out


def distances(
    structure: Equations, here: tuple[Lanes, Parameters], there: tuple[Lanes, Parameters]
) -> Values:
    """Distances of points in the metric and in the scaled parameters."""
    (z, p), (other_z, other_p), n = here, there, structure.unknowns
    squared = (z[:, :n] - other_z[:, :n]) ** 2 @ structure.mass
    squared += (((p - other_p) / structure.scales) ** 2).sum(axis=1)
    return np.asarray(np.sqrt(squared))
