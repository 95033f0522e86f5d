"""An optimisation problem on an equilibrium set: what is minimised, under which constraints."""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from equimorph.arrays import Flags, Float, Frames, Lanes, Parameters, Some, Values
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.queries.nearest import SetPoints
from equimorph.model import Constraint, Descriptor
from equimorph.structures import Structure, margin_of, value_of
from equimorph.structures.margin import generic_vectors, inverse_step
from equimorph.structures.metric import metric_length
from equimorph.tasks.optimising.quadratic import QuadraticStep
from equimorph.tasks.optimising.tangent_steps import (
    project_onto_set,
    step_along,
    unconstrained_setting,
)

Branches = tuple[Float[np.ndarray, "lanes m"], Float[np.ndarray, "lanes m"]]

SWEEPS = 5
"""Inverse iterations towards the eigenvalue nearest to zero."""
SHIFT = -1e-7
"""Of the inverse iteration: at folds the matrix is regular with it."""
STABLE = "stable"
"""Name of the descriptor whose sign is stability."""

DIFFERENCE = 1e-5
"""Step of first derivatives along the tangent space, in the metric."""
CURVING = 1e-3
"""Step of second derivatives along the set."""


@dataclass(frozen=True)
class Objective:
    """The function to be minimised: a descriptor, or its negative.

    A maximum of smooth functions, like max |κ|, is minimised through its `branches`.
    """

    descriptor: Descriptor
    sign: float

    @property
    def kinked(self) -> bool:
        """Whether it may have kinks at its minima."""
        return self.sign > 0.0 and self.descriptor.branches is not None

    def values(self, z: Lanes, p: Parameters) -> Values:
        """Values to be minimised."""
        return np.asarray(self.sign * self.descriptor.function(z, p))

    def branches(self, z: Lanes, p: Parameters) -> Branches:
        """Smooth functions whose largest it is, −∞ where there are fewer, and their places."""
        if self.kinked and self.descriptor.branches is not None:
            return self.descriptor.branches(z, p)
        value = self.values(z, p)[:, None]
        return value, np.zeros_like(value)


def match_branches(base: Branches, other: Branches) -> Float[np.ndarray, "lanes m"]:
    """Values of the other branches in the order of the first ones, by nearest places."""
    values, places = other
    there = np.where(np.isfinite(values), places, np.inf)
    gap = np.abs(np.where(np.isfinite(base[0]), base[1], 0.0)[:, :, None] - there[:, None])
    nearest = gap.argmin(axis=2)
    found = np.take_along_axis(values, nearest, axis=1)
    return np.where(np.isfinite(base[0]), found, -np.inf)


def stability(structure: Structure, margin: float) -> Constraint:
    """Constraint that the stability margin stays above `margin`."""
    if margin > 0.0:
        return margin_of(structure) >= margin

    def value(z: Lanes, p: Parameters) -> Values:
        return nearest_eigenvalue(structure, z, p)

    return Descriptor(STABLE, "1", value, STABLE, structure.signature) >= 0.0


def is_stability(constraint: Constraint) -> bool:
    """Whether a constraint is one of stability."""
    return constraint.descriptor.name in (STABLE, "stability_margin")


def nearest_eigenvalue(structure: Structure, z: Lanes, p: Parameters) -> Values:
    """Eigenvalue of the constrained Hessian nearest to zero, in the metric, by inverse iteration.

    Near the stability boundary it is the margin to round-off; far from it, about as large.
    """
    n, mass = structure.unknowns, structure.mass
    v = generic_vectors(structure, len(z))
    shift, value = np.full(len(z), SHIFT), np.zeros(len(z))
    for _ in range(SWEEPS):
        x = inverse_step(structure, z, p, v, shift)[:, :n]
        size = metric_length(structure, x)
        value = SHIFT + np.einsum("li,i,li->l", x, mass, v) / size**2
        v = x / size[:, None]
    return value


@dataclass(frozen=True)
class Expansion:
    """Values and derivatives along the set of functions f (whose largest counts) and g ≤ 0.

    `known`: where second derivatives could be measured; else they are zero.
    """

    f: Float[np.ndarray, "lanes m"]
    f_slope: Float[np.ndarray, "lanes m d"]
    f_bend: Float[np.ndarray, "lanes m d d"]
    g: Float[np.ndarray, "lanes k"]
    g_slope: Float[np.ndarray, "lanes k d"]
    g_bend: Float[np.ndarray, "lanes k d d"]
    known: Flags

    def with_bounds(self, some: Some) -> "Expansion":
        """The same with some of the bounds g."""
        g, slope, bend = (each[:, some] for each in (self.g, self.g_slope, self.g_bend))
        return replace(self, g=g, g_slope=slope, g_bend=bend)

    def bend(self, k: int, answer: QuadraticStep) -> Float[np.ndarray, "d d"]:
        """Second derivatives, at one of the points, of the Lagrangian with given multipliers."""
        out = np.einsum("m,mij->ij", answer.weights, self.f_bend[k])
        return np.asarray(out + np.einsum("k,kij->ij", answer.multipliers, self.g_bend[k]))


@dataclass(frozen=True)
class Programme:
    """Least largest branch of an objective on a set, within its box and constraints."""

    setting: Setting
    """Structure and free parameters."""
    bounds: tuple[Constraint, ...]
    """Limits of the free parameters."""
    objective: Objective
    """What is made small."""
    constraints: tuple[Constraint, ...]
    """Those that count, stability among them."""

    @classmethod
    def over(
        cls, eset: EquilibriumSet, objective: Objective, constraints: tuple[Constraint, ...]
    ) -> "Programme":
        """Return the problem within the box of a set."""
        bounds: list[Constraint] = []
        sides = zip(eset.names, eset.box.lower.tolist(), eset.box.upper.tolist(), strict=True)
        for name, low, high in sides:
            itself = value_of(eset.structure, name)
            bounds += [itself >= low, itself <= high]
        return cls(unconstrained_setting(eset), tuple(bounds), objective, constraints)

    @cached_property
    def all(self) -> tuple[Constraint, ...]:
        """Constraints and sides of the box."""
        return (*self.constraints, *self.bounds)

    def with_bounds(self, some: Some) -> "Programme":
        """The same with some of all bounds."""
        return replace(self, bounds=(), constraints=tuple(self.all[k] for k in some.tolist()))

    def excess(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes k"]:
        """Excess over all bounds, relative to these."""
        each = [c.excess(z, p) / c.size for c in self.all]
        return np.stack(each, axis=1) if each else np.zeros((len(z), 0))

    def expand(self, at: SetPoints, frames: Frames) -> Expansion:
        """Values, first and second derivatives along orthonormal tangents.

        Slopes are central differences along the tangent space: what lies off the set cancels. Bends
        are second differences between points on the set.
        """
        lanes, d = len(at), frames.shape[1]
        near, far = np.concatenate([np.eye(d), -np.eye(d)]), _directions(d)
        flat = self._tangent_points(at, frames, DIFFERENCE * near)
        curved, found = project_onto_set(
            self.setting,
            *self._tangent_points(at, frames, CURVING * far),
            np.repeat(at.rows, len(far), 0),
        )
        z = np.concatenate([at.z, flat[0], curved.z])
        p = np.concatenate([at.p, flat[1], curved.p])
        values, places = self.objective.branches(z, p)
        excess = self.excess(z, p)
        parts = np.split(np.arange(len(z)), [lanes, lanes + len(flat[0])])
        base = values[parts[0]], places[parts[0]]
        f = [base[0]]
        for part, count in zip(parts[1:], (len(near), len(far)), strict=True):
            own = (np.repeat(each, count, axis=0) for each in base)
            other = match_branches((next(own), next(own)), (values[part], places[part]))
            f.append(other.reshape(lanes, count, -1))
        g = [excess[parts[0]]]
        g += [
            excess[part].reshape(lanes, count, -1)
            for part, count in zip(parts[1:], (len(near), len(far)), strict=True)
        ]
        known = np.asarray(found.reshape(lanes, -1).all(axis=1))
        return Expansion(
            f[0], _slopes(f[1]), _bends(f[0], f[2], known), g[0],
            _slopes(g[1]), _bends(g[0], g[2], known), known,
        )  # fmt: skip

    def linearise(
        self, at: SetPoints, frames: Frames
    ) -> tuple[Float[np.ndarray, "lanes k"], Float[np.ndarray, "lanes k d"]]:
        """Excess over all bounds, and its slopes along orthonormal tangents."""
        d = frames.shape[1]
        flat = self._tangent_points(
            at, frames, DIFFERENCE * np.concatenate([np.eye(d), -np.eye(d)])
        )
        excess = self.excess(np.concatenate([at.z, flat[0]]), np.concatenate([at.p, flat[1]]))
        around = excess[len(at) :].reshape(len(at), 2 * d, -1)
        return excess[: len(at)], _slopes(around)

    def _tangent_points(
        self, at: SetPoints, frames: Frames, steps: Float[np.ndarray, "n d"]
    ) -> tuple[Float[np.ndarray, "many size"], Float[np.ndarray, "many parameters"]]:
        """Points of the tangent spaces, lane by lane."""
        many = at.take(np.repeat(np.arange(len(at)), len(steps)))
        own = np.repeat(frames, len(steps), axis=0)
        return step_along(self.setting, many, own, np.tile(steps, (len(at), 1)))


def _directions(d: int) -> Float[np.ndarray, "n d"]:
    """Along each axis and each diagonal of two axes, both ways."""
    one = np.eye(d)
    both = [one[i] + one[j] for i, j in _pairs(d)]
    ways = np.array([*one, *both])
    return np.concatenate([ways, -ways])


def _pairs(d: int) -> list[tuple[int, int]]:
    return list(combinations(range(d), 2))


def _finite(values: np.ndarray) -> np.ndarray:
    """Differences of branches that do not exist are zero."""
    return np.where(np.isfinite(values), values, 0.0)


def _slopes(values: Float[np.ndarray, "lanes n m"]) -> Float[np.ndarray, "lanes m d"]:
    d = values.shape[1] // 2
    values = _finite(values)
    return np.asarray(np.swapaxes(values[:, :d] - values[:, d:], 1, 2) / (2.0 * DIFFERENCE))


def _bends(
    middle: Float[np.ndarray, "lanes m"],
    values: Float[np.ndarray, "lanes n m"],
    known: Flags,
) -> Float[np.ndarray, "lanes m d d"]:
    half = values.shape[1] // 2
    d = int((np.sqrt(8 * half + 1) - 1) / 2)
    twice = _finite(values[:, :half]) + _finite(values[:, half:]) - 2.0 * _finite(middle)[:, None]
    twice[~known] = 0.0
    along = np.moveaxis(twice, 1, 2) / CURVING**2
    out = np.zeros((*along.shape[:2], d, d))
    for i in range(d):
        out[:, :, i, i] = along[:, :, i]
    for number, (i, j) in enumerate(_pairs(d)):
        mixed = 0.5 * (along[:, :, d + number] - along[:, :, i] - along[:, :, j])
        out[:, :, i, j] = out[:, :, j, i] = mixed
    return out
