"""Random trees of exact states, and samples moved to where constraints hold."""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float, Int, Lanes, Parameters, Values
from equimorph.equilibria.sensitivity import slopes_along, tangents
from equimorph.model import Box, Constraint
from equimorph.structures import State, States
from equimorph.structures.metric import metric_coordinates

Numbers = Int[np.ndarray, " lanes"]

FINAL = 0.2
"""Share of the samples that aim at the end of the course."""

Slopes = Float[np.ndarray, "lanes constraints directions"]

SWEEPS = 12
"""Rounds of projections onto all constraints in turn."""


@dataclass(frozen=True)
class LoadCourse:
    """Settings: actuators in a box, and the place s = 0 … legs along a polyline of loads."""

    box: Box
    free: Int[np.ndarray, " d"]
    """Limits of the actuators, and their places among the parameters."""
    corners: Float[np.ndarray, "corners parameters"]
    """All parameters at the corners of the polyline."""

    @property
    def legs(self) -> int:
        """Number of legs of the loads' way."""
        return len(self.corners) - 1

    def parameters(self, a: Float[np.ndarray, "lanes d"], s: Values) -> Parameters:
        """All parameters at settings."""
        leg = np.clip(s.astype(int), 0, max(self.legs - 1, 0))
        share = (s - leg)[:, None]
        following = np.minimum(leg + 1, self.legs)
        p = (1.0 - share) * self.corners[leg] + share * self.corners[following]
        # at the corners themselves without round-off
        whole = s == np.round(s)
        p[whole] = self.corners[s[whole].astype(int)]
        p[:, self.free] = a
        return np.asarray(p)

    def sample(
        self, count: int, generator: np.random.Generator
    ) -> tuple[Float[np.ndarray, "lanes d"], Values]:
        """Random settings."""
        a = generator.uniform(self.box.lower, self.box.upper, (count, len(self.free)))
        s = generator.uniform(0.0, 1.0, count) * self.legs
        s[generator.random(count) < FINAL] = self.legs
        return a, s

    def gaps(self, a: Float[np.ndarray, "lanes d"], p: Parameters) -> Float[np.ndarray, "lanes n"]:
        """Squared distances between actuators, each in units of half its range."""
        half = 0.5 * (self.box.upper - self.box.lower)
        one, other = a / half, p[:, self.free] / half
        square = (one**2).sum(1)[:, None] + (other**2).sum(1) - 2.0 * one @ other.T
        return np.asarray(np.maximum(square, 0.0))

    def towards(
        self,
        tree: "Tree",
        near: Numbers,
        a: Float[np.ndarray, "lanes d"],
        s: Values,
        reach: float,
    ) -> tuple[Float[np.ndarray, "lanes d"], Values]:
        """Settings towards given ones, at most `reach` from nodes and before the next corner."""
        here, own = tree.p[near][:, self.free], tree.s[near]
        half = 0.5 * (self.box.upper - self.box.lower)
        far = np.sqrt((((a - here) / half) ** 2).sum(axis=1) + (s - own) ** 2)
        share = np.minimum(1.0, reach / np.maximum(far, 1e-300))
        new = own + share * (s - own)
        if tree.sense > 0.0:
            new = np.minimum(new, np.floor(own) + 1.0)
        else:
            new = np.maximum(new, np.ceil(own) - 1.0)
        return here + share[:, None] * (a - here), new


class Tree:
    """Exact states, each reached by a straight lift from its parent.

    `sense`: +1 if the tree grows with the course of the loads, −1 against it.
    """

    def __init__(self, root: State, s: float, sense: float) -> None:
        self.structure, self.sense = root.structure, sense
        self.z, self.p = root.z[None].copy(), root.p[None].copy()
        self.s, self.parent = np.array([s]), np.array([-1])

    def add(self, z: Lanes, p: Parameters, s: Values, parent: Numbers) -> Numbers:
        """Add nodes; their numbers."""
        count = len(self.s)
        self.z, self.p = np.concatenate([self.z, z]), np.concatenate([self.p, p])
        self.s, self.parent = np.concatenate([self.s, s]), np.concatenate([self.parent, parent])
        return np.arange(count, len(self.s))

    def nearest(self, course: LoadCourse, a: Float[np.ndarray, "lanes d"], s: Values) -> Numbers:
        """Nearest node from which settings lie ahead; −1 if no node does."""
        ahead = self.sense * (s[:, None] - self.s)
        square = np.where(ahead >= 0.0, course.gaps(a, self.p) + ahead**2, np.inf)
        best = square.argmin(axis=1)
        return np.where(np.isfinite(square[np.arange(len(s)), best]), best, -1)

    def candidates(
        self, course: LoadCourse, other: "Tree", new: Numbers, count: int
    ) -> tuple[Numbers, Numbers]:
        """Pairs of new nodes of another tree and the nearest nodes of this one on the same leg."""
        s = other.s[new]
        ahead = other.sense * (self.s - s[:, None])
        leg = np.floor(np.minimum(self.s, s[:, None])) + 1.0
        fits = (ahead >= 0.0) & (np.maximum(self.s, s[:, None]) <= leg)
        one, two = (metric_coordinates(self.structure, z) for z in (other.z[new], self.z))
        square = (one**2).sum(1)[:, None] + (two**2).sum(1) - 2.0 * one @ two.T
        square += course.gaps(other.p[new][:, course.free], self.p)
        square = np.where(fits, square, np.inf)
        order = np.argsort(square, axis=1)[:, :count]
        good = np.isfinite(np.take_along_axis(square, order, axis=1))
        return np.repeat(new, good.sum(axis=1)), order[good]

    def branch(self, node: int) -> list[int]:
        """Nodes from the root to a node."""
        way = [node]
        while self.parent[way[-1]] >= 0:
            way.append(int(self.parent[way[-1]]))
        return way[::-1]


@dataclass(frozen=True)
class TreePath:
    """States along a path through trees, and their places along the course of the loads."""

    states: States
    places: Float[np.ndarray, " nodes"]


def join_paths(first: Tree, here: int, second: Tree | None, there: int) -> TreePath:
    """Path from the root of a tree to that of another."""
    way = first.branch(here)
    z, p, s = first.z[way], first.p[way], first.s[way]
    if second is not None:
        back = second.branch(there)[::-1]
        z, p, s = (
            np.concatenate([one, other[back]])
            for one, other in ((z, second.z), (p, second.p), (s, second.s))
        )
    return TreePath(States(first.structure, z, p), s)


def constraint_slopes(
    states: States,
    directions: Float[np.ndarray, "lanes directions parameters"],
    within: tuple[Constraint, ...],
) -> tuple[Float[np.ndarray, "lanes constraints"], Slopes]:
    """Excesses of constraints at states, and their slopes on the set along changes of p."""
    structure, z, p = states.structure, states.z, states.p
    dz, excess = tangents(structure, z, p, directions), [each.excess for each in within]
    here = np.stack([each(z, p) for each in excess], axis=1)
    return here, slopes_along(structure, z, p, dz, directions, excess)


def project_onto_constraints(
    change: Float[np.ndarray, "lanes d"],
    excess: Float[np.ndarray, "lanes constraints"],
    slopes: Float[np.ndarray, "lanes constraints d"],
    low: Float[np.ndarray, "lanes d"],
    high: Float[np.ndarray, "lanes d"],
    inside: Float[np.ndarray, " constraints"],
) -> Float[np.ndarray, "lanes d"]:
    """Changes near the given ones after which no linearised constraint is violated.

    Projections onto one constraint after the other, with the changes kept between `low` and `high`.
    Where constraints contradict each other they stay violated, and a lift decides.
    """
    change = change.copy()
    norms = np.maximum((slopes**2).sum(axis=2), 1e-300)
    for _ in range(SWEEPS):
        for k in range(slopes.shape[1]):
            over = excess[:, k] + (slopes[:, k] * change).sum(axis=1) + inside[k]
            share = np.maximum(over, 0.0) / norms[:, k]
            change -= share[:, None] * slopes[:, k]
        change = np.clip(change, low, high)
    return change
