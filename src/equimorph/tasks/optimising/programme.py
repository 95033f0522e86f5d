"""An optimisation problem on an equilibrium set, and its derivatives along the set."""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Flags, Frames, Lanes, Parameters
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.geometry.setting import Setting
from equimorph.model import Constraint
from equimorph.structures import value_of
from equimorph.tasks.optimising.objectives import Objective, matched
from equimorph.tasks.optimising.plane import Spots, plane_of, settled, stepped

DIFFERENCE = 1e-5
"""Step of first derivatives along the tangent space, in the metric."""
CURVING = 1e-3
"""Step of second derivatives along the set."""


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


@dataclass(frozen=True)
class Programme:
    """Least largest branch of an objective on a set, within its box and constraints.

    Parameters
    ----------
    setting
        Structure and free parameters.
    bounds
        Limits of the free parameters.
    objective
        What is made small.
    constraints
        Those that count, stability among them.
    """

    setting: Setting
    bounds: tuple[Constraint, ...]
    objective: Objective
    constraints: tuple[Constraint, ...]

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
        return cls(plane_of(eset), tuple(bounds), objective, constraints)

    @cached_property
    def all(self) -> tuple[Constraint, ...]:
        """Constraints and sides of the box."""
        return (*self.constraints, *self.bounds)

    def excess(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes k"]:
        """Excess over all bounds, relative to these."""
        each = [c.excess(z, p) / max(1.0, abs(c.bound)) for c in self.all]
        return np.stack(each, axis=1)

    def expanded(self, at: Spots, frames: Frames) -> Expansion:
        """Values, first and second derivatives along orthonormal tangents.

        Slopes are central differences along the tangent space: what lies off the set cancels. Bends
        are second differences between points on the set.
        """
        lanes, d = len(at), frames.shape[1]
        near, far = np.concatenate([np.eye(d), -np.eye(d)]), _directions(d)
        flat = self._moved(at, frames, DIFFERENCE * near)
        curved, found = settled(
            self.setting, *self._moved(at, frames, CURVING * far), np.repeat(at.rows, len(far), 0)
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
            other = matched((next(own), next(own)), (values[part], places[part]))
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

    def linearised(
        self, at: Spots, frames: Frames
    ) -> tuple[Float[np.ndarray, "lanes k"], Float[np.ndarray, "lanes k d"]]:
        """Excess over all bounds, and its slopes along orthonormal tangents."""
        d = frames.shape[1]
        flat = self._moved(at, frames, DIFFERENCE * np.concatenate([np.eye(d), -np.eye(d)]))
        excess = self.excess(np.concatenate([at.z, flat[0]]), np.concatenate([at.p, flat[1]]))
        around = excess[len(at) :].reshape(len(at), 2 * d, -1)
        return excess[: len(at)], _slopes(around)

    def _moved(
        self, at: Spots, frames: Frames, steps: Float[np.ndarray, "n d"]
    ) -> tuple[Float[np.ndarray, "many size"], Float[np.ndarray, "many parameters"]]:
        """Points of the tangent spaces, lane by lane."""
        many = at.take(np.repeat(np.arange(len(at)), len(steps)))
        own = np.repeat(frames, len(steps), axis=0)
        return stepped(self.setting, many, own, np.tile(steps, (len(at), 1)))


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
