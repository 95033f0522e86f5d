"""Curves on a set that Newton's method makes shorter, away from walls.

See `equimorph.tasks.planning.shortening` for what is least. Steps are those of a primal-dual method
[NocedalWright2006]_, section 19.3: the forces y_j of the walls are unknowns, too, with
``y_j g_j = ν w``, so that walls may become weaker by large factors. Several curves are made shorter
at once, each by its own steps.

See docs/decisions.md, "Shortest routes are geodesics beside walls".
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg.lapack import dpbsv

from equimorph.arrays import Bool, Flags, Float, Frames, Int, Lanes, Parameters, Rows, Some, Values
from equimorph.columns import Columns
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.geometry.tangents import frames_in_embedding
from equimorph.manifold.queries.nearest import SetPoints
from equimorph.structures import States, join_states
from equimorph.structures.margin import Pairs, first_pairs, softest_modes
from equimorph.tasks.optimising.tangent_steps import (
    bend_onto_set,
    step_along,
    tangent_planes,
    tangents_at,
    unconstrained_setting,
)
from equimorph.tasks.planning.network import Demands

NUDGE = 1e-4
"""Step along the tangents of the differences of constraints, in the metric."""
OFF = 1e-10
"""Distance of nodes from the set, in the metric: lifts begin where Newton's method ends."""
MODE_ERROR = 1e-4
"""Error of margins, relative to their distance from the wall."""
HELD = 0.1
"""Share of its distance to a wall that a node keeps in one step, by the slope of the wall."""
REACH = 0.3
"""Longest step of a node, in the metric."""
BELOW, PUSHES, NEARER = 0.05, 3, 0.5
"""Margin below its floor down to which a node is moved inside, how often, and the part of the
distance from a wall that it may lack."""
INWARD, SMALL = 1e-3, 1e-6
"""Distance from walls to which nodes on them are moved, as a share of the largest margin, of bounds
and of the box; and the least margin that counts for it."""
BALANCE = 10.0
"""Factor by which forces of walls may differ from those of the barrier."""

Walls = Float[np.ndarray, "nodes walls"]
Steps = Float[np.ndarray, "nodes d"]
Routes = Int[np.ndarray, " nodes"]
Each = Float[np.ndarray, " routes"]
"""A number for each curve."""


@dataclass(frozen=True)
class Curves(Columns):
    """Nodes of curves on a set, curve after curve."""

    route: Routes
    """Number of the curve of each node."""
    z: Lanes
    p: Parameters
    """The nodes."""
    frames: Frames
    """Orthonormal tangents."""
    walls: Walls
    """Distances from the walls, between the ends of the curves."""
    forces: Walls
    """Of the walls."""
    pairs: Pairs
    """Softest modes."""
    floor: Values
    """Least margin of each node."""
    share: Values
    """Of the leg that leads to a node in the length of its curve; one at the first node."""

    @property
    def legs(self) -> Some:
        """Nodes at the ends of legs: all but the first of each curve."""
        return 1 + np.flatnonzero(self.route[1:] == self.route[:-1])

    @property
    def inner(self) -> Some:
        """Nodes between the ends of curves."""
        same = self.route[1:] == self.route[:-1]
        return 1 + np.flatnonzero(same[1:] & same[:-1])

    @property
    def weights(self) -> Values:
        """Shares of the length around each inner node."""
        inner = self.inner
        return np.asarray(0.5 * (self.share[inner] + self.share[inner + 1]))

    def sums(self, values: Float[np.ndarray, " some"], nodes: Some, routes: int) -> Each:
        """Sums over the nodes of each curve."""
        return np.bincount(self.route[nodes], values, routes)


@dataclass(frozen=True)
class CurveSteps:
    """Newton's method for curves on a set within demands."""

    eset: EquilibriumSet
    """The set."""
    demands: Demands
    """Constraints that every node obeys; floors of margins belong to the curves."""

    @cached_property
    def setting(self) -> Setting:
        """The set without its constraints: steps may cross these."""
        return unconstrained_setting(self.eset)

    def curves(self, chains: Sequence[States]) -> list[Curves | None]:
        """Curves through given stable states, legs of equal shares; None if one meets a wall.

        Nodes on walls are moved inside.
        """
        structure, counts = self.eset.structure, np.array([len(each) for each in chains])
        nodes, route = join_states(structure, chains), np.repeat(np.arange(len(chains)), counts)
        share, floor = 1.0 / (counts - 1.0)[route], np.full(len(route), self.demands.margin)
        share[np.cumsum(counts) - counts] = 1.0
        at = SetPoints(nodes.z, nodes.p, tangent_planes(self.setting, nodes))
        frames, _ = tangents_at(self.setting, at)
        walls, pairs, _ = self._walls(nodes.z, nodes.p, floor, first_pairs(structure, len(route)))
        every = Curves(route, nodes.z, nodes.p, frames, walls, walls, pairs, floor, share)
        margin = np.full(len(chains), SMALL)
        np.maximum.at(margin, route, walls[:, 0])
        sides = np.tile((self.eset.box.upper - self.eset.box.lower) / self.setting.scales, 2)
        sizes = np.array([0.0, *(each.size for each in self.demands.constraints), *sides])
        inner = every.inner
        distance = np.tile(INWARD * sizes, (len(inner), 1))
        distance[:, 0] = INWARD * margin[route[inner]]
        moved, good = self.inside(every.take(inner), distance)
        every, bad = every.with_rows(inner, moved), np.unique(route[inner[~good]])
        return [None if k in bad else every.take(route == k) for k in range(len(chains))]

    def states(self, curves: Curves) -> States:
        """States at the nodes."""
        return States(self.eset.structure, curves.z, curves.p)

    def squared_lengths(self, curves: Curves, routes: int) -> Each:
        """Squares of the lengths."""
        place, ends = embed(self.setting, curves.z, curves.p), curves.legs
        legs = ((place[ends] - place[ends - 1]) ** 2).sum(axis=1) / curves.share[ends]
        return curves.sums(legs, ends, routes)

    def values(self, curves: Curves, strengths: Each) -> Each:
        """Squared lengths with barriers."""
        inner, routes = curves.inner, len(strengths)
        logs = curves.weights * np.log(curves.walls[inner]).sum(axis=1)
        barriers = strengths * curves.sums(logs, inner, routes)
        return np.asarray(self.squared_lengths(curves, routes) - barriers)

    def with_forces(self, curves: Curves, strengths: Each) -> Curves:
        """Curves with the forces of barriers."""
        inner, forces = curves.inner, np.ones_like(curves.walls)
        strength = strengths[curves.route[inner]] * curves.weights
        forces[inner] = strength[:, None] / curves.walls[inner]
        return replace(curves, forces=forces)

    def step(
        self, curves: Curves, strengths: Each, values: Each, halvings: int
    ) -> tuple[Curves, Each]:
        """Curves after one step of each, and their values; as they were where no step lowers it."""
        rows = frames_in_embedding(self.setting, curves.frames)
        step, push, share = self._newton_step(curves, rows, strengths)
        out, lowest, todo = (
            curves,
            values.copy(),
            np.bincount(curves.route, minlength=len(values)) > 0,
        )
        for _ in range(halvings):
            some = np.flatnonzero(todo[curves.route])
            part = share[curves.route[some], None]
            moved, good = self._moved(
                _some(curves, todo), part * step[some], part * push[some], strengths
            )
            lower = np.full(len(values), np.inf)
            lower[good] = self.values(_some(moved, good), strengths)[good]
            better = lower < values
            if better[curves.route].all():
                return moved, np.where(better, lower, lowest)
            rows = np.flatnonzero(better[moved.route])
            out = out.with_rows(some[rows], moved.take(rows))
            lowest = np.where(better, lower, lowest)
            todo &= ~better
            if not todo.any():
                break
            share[todo] *= 0.5
        return out, lowest

    def _moved(
        self, curves: Curves, step: Steps, push: Walls, strengths: Each
    ) -> tuple[Curves, Bool[np.ndarray, " routes"]]:
        """Curves with their inner nodes moved, and which of them stay on the set and inside."""
        inner, good = curves.inner, np.zeros(len(strengths), bool)
        own = curves.take(inner)
        moved, found, inside = self._placed(own, step[inner])
        beyond = np.flatnonzero(found & ~inside)
        if len(beyond):  # where a wall bends, they move along it
            again, inside[beyond] = self.inside(moved.take(beyond), own.walls[beyond])
            moved = moved.with_rows(beyond, again)
        good[curves.route] = True
        good[own.route[~(found & inside)]] = False
        balance = (strengths[own.route] * curves.weights)[:, None] / np.abs(moved.walls)
        forces = np.clip(own.forces + push[inner], balance / BALANCE, BALANCE * balance)
        return curves.with_rows(inner, replace(moved, forces=forces)), good

    def between(self, first: Curves, second: Curves) -> tuple[Curves, Flags]:
        """Nodes between pairs of nodes, and which of them are inside."""
        z, p = 0.5 * (first.z + second.z), 0.5 * (first.p + second.p)
        middle = replace(second, z=z, p=p, frames=first.frames)
        return self.inside(middle, 0.5 * (first.walls + second.walls))

    def inside(self, nodes: Curves, distance: Walls) -> tuple[Curves, Flags]:
        """Nodes on the set, and which of them are inside.

        Those with less than half of a given distance from a wall are moved there.
        """
        far = ~np.isfinite(distance)  # as from a barrier where there is nothing to cross
        distance, scale = np.where(far, 0.0, distance), np.where(far, 1.0, distance)
        floor, still = nodes.floor, np.zeros((len(nodes.z), nodes.frames.shape[1]))
        nodes, found, _ = self._placed(replace(nodes, floor=floor - BELOW), still)
        todo, below = np.arange(len(found)), nodes
        for _ in range(PUSHES):
            lack = distance[todo] - below.walls
            lack[:, 0] += BELOW
            near = (lack > NEARER * distance[todo]).any(axis=1) & np.isfinite(lack.max(axis=1))
            some = np.flatnonzero(near & found[todo])
            if len(some) == 0:
                break
            todo, below, lack = todo[some], below.take(some), lack[some]
            worst = (np.arange(len(todo)), (lack / scale[todo]).argmax(axis=1))
            slopes = self._slopes(below)[worst]
            push = lack[worst] / np.maximum((slopes**2).sum(axis=1), 1e-300)
            below, found[todo], _ = self._placed(below, push[:, None] * slopes)
            nodes = nodes.with_rows(todo, below)
        nodes, inside = self._measured(replace(nodes, floor=floor))
        return nodes, found & inside

    def _placed(self, nodes: Curves, step: Steps) -> tuple[Curves, Flags, Flags]:
        """Nodes after steps along their tangents, which are found, and which no wall parts."""
        at = SetPoints(nodes.z, nodes.p, nodes.frames)
        guess = step_along(self.setting, at, nodes.frames, step)
        z, p, frames, found = bend_onto_set(self.setting, *guess, nodes.frames, OFF)
        frames[~found] = nodes.frames[~found]
        moved, inside = self._measured(replace(nodes, z=z, p=p, frames=frames))
        return moved, found, inside

    def _measured(self, nodes: Curves) -> tuple[Curves, Flags]:
        """Nodes with their distances from walls, and which of them no wall parts from others."""
        walls, pairs, inside = self._walls(nodes.z, nodes.p, nodes.floor, nodes.pairs)
        return replace(nodes, walls=walls, pairs=pairs), inside

    def _newton_step(
        self, curves: Curves, rows: Rows, strengths: Each
    ) -> tuple[Steps, Walls, Each]:
        """Steps of all nodes, changes of the forces, and the share that keeps away from walls."""
        inner = curves.inner
        place, d = embed(self.setting, curves.z, curves.p), rows.shape[1]
        pull = np.zeros_like(place)
        pull[1:] = np.diff(place, axis=0) / curves.share[1:, None]
        gradient = np.zeros((len(place), d))
        gradient[inner] = 2.0 * np.einsum("kde,ke->kd", rows[inner], pull[inner] - pull[inner + 1])
        own = curves.take(inner)
        slopes = self._slopes(own)
        barrier = (strengths[own.route] * curves.weights)[:, None] / own.walls
        gradient[inner] -= np.einsum("kw,kwd->kd", barrier, slopes)
        stiffness = own.forces / own.walls
        blocks = np.tile(np.eye(d), (len(place), 1, 1))
        blocks[inner] *= 2.0 * (1.0 / own.share + 1.0 / curves.share[inner + 1])[:, None, None]
        blocks[inner] += np.einsum("kw,kwd,kwe->kde", stiffness, slopes, slopes)
        both = inner[np.append(np.diff(inner) == 1, False)]  # and the next one
        beside = np.zeros((len(place) - 1, d, d))
        turns = np.einsum("kde,kfe->kdf", rows[both], rows[both + 1])
        beside[both] = -2.0 * turns / curves.share[both + 1, None, None]
        step = solve_block_tridiagonal(blocks, beside, -gradient)
        along = np.einsum("kwd,kd->kw", slopes, step[inner])
        push = np.zeros_like(curves.walls)
        push[inner] = barrier - own.forces - stiffness * along
        with np.errstate(divide="ignore"):
            room = np.where(along < 0.0, (HELD - 1.0) * own.walls / along, np.inf).min(axis=1)
        length = np.linalg.norm(step[inner], axis=1)
        share = np.ones(len(strengths))
        np.minimum.at(share, own.route, np.minimum(room, REACH / np.maximum(length, 1e-300)))
        return step, push, share

    def _walls(
        self, z: Lanes, p: Parameters, floor: Values, pairs: Pairs
    ) -> tuple[Walls, Pairs, Flags]:
        """Distances of points from the walls, softest modes, and which points are inside."""
        structure, free = self.eset.structure, self.setting.free
        found = softest_modes(structure, z, p, floor, pairs, MODE_ERROR)
        excess = [-each.excess(z, p) for each in self.demands.constraints]
        box, scales = self.eset.box, self.setting.scales
        place = p[:, free]
        sides = [(place - box.lower) / scales, (box.upper - place) / scales]
        walls = np.column_stack([found.first - floor, *excess, *sides])
        return walls, found.pairs, found.above & (walls > 0.0).all(axis=1)

    def _slopes(self, nodes: Curves) -> Float[np.ndarray, "nodes walls d"]:
        """Slopes of the walls along the tangents.

        Those of a margin with mode w are ``wᵀ D²F[w, t]``, of constraints differences; walls that
        are infinite have none.
        """
        structure, frames, d = self.eset.structure, nodes.frames, nodes.frames.shape[1]
        count, constraints = len(nodes.z), self.demands.constraints
        out = np.zeros((count, nodes.walls.shape[1], d))
        at, still = SetPoints(nodes.z, nodes.p, frames), np.zeros_like(nodes.p)
        mode = np.ascontiguousarray(nodes.pairs[:, 0])
        units = np.repeat(np.eye(d)[:, None], count, axis=1)
        for k in range(d):
            z, p = step_along(self.setting, at, frames, NUDGE * units[k])
            dz, dp = (z - nodes.z) / NUDGE, (p - nodes.p) / NUDGE
            bent = structure.second_derivative(nodes.z, nodes.p, (mode, still), (dz, dp))
            out[:, 0, k] = np.einsum("ki,ki->k", bent, mode)
            for number, each in enumerate(constraints, 1):
                moved, wall = -each.excess(z, p), nodes.walls[:, number]
                # a barrier is infinite where there is nothing to cross
                finite = np.isfinite(moved) & np.isfinite(wall)
                out[finite, number, k] = (moved[finite] - wall[finite]) / NUDGE
        steps = np.swapaxes(frames[:, :, structure.size :], 1, 2)
        first = 1 + len(constraints)
        out[:, first:] = np.concatenate([steps, -steps], axis=1)
        return out


def _some(curves: Curves, flags: Bool[np.ndarray, " routes"]) -> Curves:
    """Some of the curves; those given if these are all."""
    rows = flags[curves.route]
    return curves if rows.all() else curves.take(rows)


def join_curves(curves: Sequence[Curves]) -> Curves:
    """Curves numbered in turn."""
    numbered = [replace(curve, route=np.full(len(curve.z), k)) for k, curve in enumerate(curves)]
    return Curves.concatenate(numbered)


def solve_block_tridiagonal(
    blocks: Float[np.ndarray, "nodes d d"],
    beside: Float[np.ndarray, "legs d d"],
    rhs: Steps,
) -> Steps:
    """Solve with a symmetric matrix of blocks on the diagonal and of those to the right of it."""
    count, d = rhs.shape
    rows = np.zeros((count, d, 2 * d))  # of the upper triangle, each from its block on
    rows[:, :, :d], rows[:-1, :, d:] = blocks, beside
    band = np.zeros((2 * d, count * d))
    for k in range(2 * d):  # the k-th diagonal above the main one
        for i in range(d):
            if i + k < 2 * d:
                columns = np.arange(i + k, count * d, d)
                band[2 * d - 1 - k, columns] = rows[: len(columns), i, i + k]
    _, found, info = dpbsv(band, rhs.ravel())
    assert info == 0  # squares of lengths and of forces add up: the matrix is positive
    return np.asarray(found.reshape(count, d))
