"""Conditions on equilibria: what a point must satisfy in addition to F(z; p) = 0.

Newton's method only needs a condition and its slopes along the equilibrium set, so that a condition
is asked for its value after a step onto the set and for its derivatives along directions of the
set. There even a largest value over the structure is smooth, whose derivative with respect to a
single unknown has kinks.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from equimorph.arrays import Directions, Float, Lanes, Parameters, Scalars, Some
from equimorph.columns import Columns
from equimorph.equilibria.critical import Critical, Test
from equimorph.model.families import Evaluate, values_together
from equimorph.structures.equations import Direction
from equimorph.structures.metric import move_length

VALUE_DIFFERENCE, TEST_DIFFERENCE = 1e-5, 1e-5
"""Steps of differences, in the metric: they set the rate of convergence, not the error."""


@dataclass(frozen=True)
class Move:
    """A step onto the equilibrium set and directions along it, as changes of z and p."""

    onto_z: Lanes
    onto_p: Parameters
    along_z: Float[np.ndarray, "lanes k size"]
    along_p: Directions

    @property
    def along(self) -> list[Direction]:
        """Directions one by one."""
        return [(self.along_z[:, i], self.along_p[:, i]) for i in range(self.along_z.shape[1])]


@dataclass(frozen=True)
class Linear:
    """Values of m scalars after the step onto the set, and their slopes along its directions."""

    value: Float[np.ndarray, "lanes m"]
    slopes: Float[np.ndarray, "lanes m k"]


@runtime_checkable
class Condition(Protocol):
    """Scalars that vanish at the target points, linearised at a point of each lane."""

    @property
    def critical(self) -> bool:
        """Whether the scalars need the border of a nearly singular F_z."""

    def linear(self, at: Critical, move: Move) -> Linear:
        """Values after a step onto the set, and slopes along it."""

    def take(self, some: Some) -> "Condition":
        """Return the condition for some of the lanes."""


@dataclass(frozen=True)
class Fold(Columns):
    """det F_z = 0: the test function g of the bordered system vanishes."""

    critical = True

    def linear(self, at: Critical, move: Move) -> Linear:
        """By the exact second derivatives."""
        onto = (move.onto_z, move.onto_p)
        seconds = second_derivatives(at, [(at.v, np.zeros_like(at.p))], [*move.along, onto])
        return Linear(at.g[:, None] - seconds[:, :, -1], -seconds[:, :, :-1])


@dataclass(frozen=True)
class Crossing(Columns):
    """Gradient of the reduced equation r = 0 is zero: branch points, and crossings of sheets.

    Lyapunov–Schmidt reduction with a border b [Govaerts2000]_: where the residual is r b, the set
    is ``r(ξ, π) = 0`` in the amplitude ξ of the null vector and steps π along `directions`. The
    point must be sought with the border as one more unknown (`unfolded`). There is one scalar more
    than directions; all vanish together, so that least squares converge quadratically.
    """

    directions: Directions
    """Changes of the parameters along which the set branches."""
    critical = True

    def linear(self, at: Critical, move: Move) -> Linear:
        """By the exact second derivatives, which are the Hessian of r."""
        structure, (lanes, k) = at.structure, self.directions.shape[:2]
        moves = [np.ascontiguousarray(self.directions[:, i]) for i in range(k)]
        rhs = np.zeros((lanes, k, structure.size + 1))
        for i, dp in enumerate(moves):
            rhs[:, i, :-1] = -structure.parameter_derivative(at.z, at.p, dp)
        answers = at.solve(rhs)
        tangents = [(at.v, np.zeros_like(at.p))]
        tangents += [(answers[:, i, :-1], dp) for i, dp in enumerate(moves)]
        onto = (move.onto_z, move.onto_p)
        seconds = second_derivatives(at, tangents, [*move.along, onto])
        gradient = seconds[:, :, -1] - np.column_stack([at.g, answers[:, :, -1]])
        slopes = seconds[:, :, :-1]
        scale = np.maximum(np.abs(slopes).max(axis=(1, 2)), 1e-300)
        return Linear(gradient / scale[:, None], slopes / scale[:, None, None])


@dataclass(frozen=True)
class Plane(Columns):
    """Points in planes through given points: parameters held, arclength, normals of groups."""

    z: Lanes
    p: Parameters
    """A point of the plane of each lane."""
    by_z: Float[np.ndarray, "lanes m size"]
    by_p: Float[np.ndarray, "lanes m parameters"]
    """Normals: ``by_z·(z' − z) + by_p·(p' − p) = 0`` for each of m rows."""
    critical = False

    def linear(self, at: Critical, move: Move) -> Linear:
        """Exact."""
        value = np.einsum("lmi,li->lm", self.by_z, at.z + move.onto_z - self.z)
        value += np.einsum("lmi,li->lm", self.by_p, at.p + move.onto_p - self.p)
        slopes = self.by_z @ np.swapaxes(move.along_z, 1, 2)
        slopes += self.by_p @ np.swapaxes(move.along_p, 1, 2)
        return Linear(value, slopes)


@dataclass(frozen=True)
class Values(Columns):
    """Scalars of states take given values: descriptors, targets, active constraints."""

    functions: tuple[Evaluate, ...]
    """The m scalars."""
    targets: Float[np.ndarray, "lanes m"]
    """Their values for each lane."""
    difference: float = VALUE_DIFFERENCE
    """Step of differences, in the metric."""
    one_sided: bool = False
    """Whether differences are taken towards one side only: cheaper, and less exact."""
    reach: float = np.inf
    """Steps onto the set longer than this, in the metric, are not looked ahead: far from the set
    the scalars may have no meaning."""
    critical = False

    def linear(self, at: Critical, move: Move) -> Linear:
        """By differences along the directions."""
        if self.reach < np.inf:
            structure = at.structure
            near = (move_length(structure, move.onto_z, move.onto_p) < self.reach)[:, None]
            onto = np.where(near, move.onto_z, 0.0), np.where(near, move.onto_p, 0.0)
            move = Move(*onto, move.along_z, move.along_p)

        def excess(z: Lanes, p: Parameters) -> Scalars:
            shape = len(z) // len(self.targets), *self.targets.shape
            found = values_together(self.functions, z, p).reshape(shape) - self.targets
            return np.asarray(found.reshape(len(z), -1))

        return _differences(excess, at, move, self.difference, one_sided=self.one_sided)


@dataclass(frozen=True)
class Vanishing(Columns):
    """Tests of nearly singular states vanish: cusps, swallowtails, grazing of bounds.

    Parameters
    ----------
    tests
        The scalars for some of the lanes, by their numbers: they may differ from lane to lane. They
        are asked for whole rounds of these lanes at once.
    lanes
        Numbers of the lanes.
    difference, one_sided
        As for `Values`.
    at_null
        Whether the border is the null vector at the point itself. Otherwise it is the one that the
        corrector holds, which lags one step behind: next to pitchforks that costs convergence.
    """

    tests: Callable[[Some], Sequence[Test]]
    lanes: Some
    difference: float = TEST_DIFFERENCE
    one_sided: bool = False
    at_null: bool = False
    critical = True

    def linear(self, at: Critical, move: Move) -> Linear:
        """By differences along the directions, the border kept."""
        own, border = self.tests(self.lanes), at.b
        if self.at_null:
            border = at.v / np.linalg.norm(at.v, axis=1, keepdims=True)

        def scalars(z: Lanes, p: Parameters) -> Scalars:
            b = np.concatenate([border] * (len(z) // len(border)))
            there, found = Critical(at.structure, z, p, b), np.empty((len(z), len(own)))
            for i, test in enumerate(own):
                found[:, i] = test(there)
            return found

        return _differences(scalars, at, move, self.difference, one_sided=self.one_sided)


@dataclass(frozen=True)
class EqualEigenvalues(Columns):
    """Two eigenvalues of F_z are equal: its reduction to a plane is a multiple of the identity.

    With a border B that spans the plane, ``[F_z Bᵀ; B 0] [X; Λ] = [0; I]`` has minus the reduced
    matrix in Λ. Both are equal at single points of two-dimensional pieces of the set.
    """

    rows: Float[np.ndarray, "lanes 2 size"]
    """What changes of z are multiplied by to give their coordinates in the plane."""
    critical = False

    def linear(self, at: Critical, move: Move) -> Linear:
        """By differences along the directions, the border kept."""
        _, plane, size = self.rows.shape

        def scalars(z: Lanes, p: Parameters) -> Scalars:
            rows = np.concatenate([self.rows] * (len(z) // len(self.rows)))
            rhs = np.zeros((len(z), plane, size + plane))
            rhs[:, :, size:] = np.eye(plane)
            border = rows, rows, np.zeros((len(z), plane, plane))
            reduced = at.structure.solve(z, p, rhs, border).x[:, :, size:]
            with np.errstate(invalid="ignore"):  # infinite where the rows span no plane
                apart = reduced[:, 0, 0] - reduced[:, 1, 1]
            return np.stack([apart, reduced[:, 0, 1]], axis=1)

        return _differences(scalars, at, move, TEST_DIFFERENCE, one_sided=False)


def second_derivatives(
    at: Critical, tangents: Sequence[Direction], directions: Sequence[Direction]
) -> Float[np.ndarray, "lanes tangents directions"]:
    """vᵀD²F[tangent, direction] for all pairs, by one call for all: calls cost more than lanes."""
    m, k = len(tangents), len(directions)
    pairs = [(*one, *other) for one in tangents for other in directions]
    dz, dp, other_z, other_p = (np.concatenate(column) for column in zip(*pairs, strict=True))
    z, p = np.tile(at.z, (m * k, 1)), np.tile(at.p, (m * k, 1))
    twice = at.structure.second_derivative(z, p, (dz, dp), (other_z, other_p))
    twice = twice.reshape(m, k, *at.z.shape)
    return np.asarray(np.einsum("li,mkli->lmk", at.v, twice))


def _differences(
    scalars: Callable[[Lanes, Parameters], Scalars],
    at: Critical,
    move: Move,
    step: float,
    *,
    one_sided: bool,
) -> Linear:
    """Values after the step onto the set and differences around it, all in one call."""
    lanes, k = move.along_z.shape[:2]
    structure = at.structure
    length = move_length(structure, move.along_z, move.along_p)
    h = step / np.maximum(length, 1e-150)  # directions may be long where F_z is soft
    z = _rounds(at.z + move.onto_z, move.along_z, h, one_sided=one_sided)
    p = _rounds(at.p + move.onto_p, move.along_p, h, one_sided=one_sided)
    flat = scalars(z, p)
    found = flat.reshape(-1, lanes, flat.shape[1])
    ahead = found[1 : 1 + k]
    with np.errstate(invalid="ignore"):  # infinite where a reduction prefers no state: not found
        change = ahead - found[0] if one_sided else 0.5 * (ahead - found[1 + k :])
    return Linear(found[0], change.transpose(1, 2, 0) / h[:, None])


def _rounds(
    base: Float[np.ndarray, "lanes width"],
    along: Float[np.ndarray, "lanes k width"],
    h: Float[np.ndarray, "lanes k"],
    *,
    one_sided: bool,
) -> Float[np.ndarray, "many width"]:
    """All lanes at a base, then h ahead along each of the directions, then behind it."""
    k = h.shape[1]
    out = np.empty((1 + (1 if one_sided else 2) * k, *base.shape))
    out[0] = base
    for i in range(k):  # without arrays in between: these cost more than the products
        there = np.multiply(h[:, i, None], along[:, i], out=out[1 + i])
        if not one_sided:
            np.subtract(base, there, out=out[1 + k + i])
        there += base
    return out.reshape(-1, base.shape[1])
