"""Shortest curves on a set between two states, away from walls: a geodesic by Newton's method.

The nodes X_k of a curve on the set move along its tangent spaces, so that folds are no obstacle.
Sought is the least of

    Σ |X_{k+1} − X_k|²/w_k − ν Σ w_k Σ_j log g_j(X_k) ,   Σ w_k = 1 ,

whose first sum is the squared length of a curve that runs through its share w_k of the length from
node to node. The walls g_j > 0 are the stability margin above what is demanded, the constraints,
and the sides of the box.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solveh_banded

from equimorph.arrays import Float, Frames, Some, Values
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.queries.nearest import SetPoints
from equimorph.structures import States, stability_margin
from equimorph.tasks.optimising.tangent_steps import (
    project_onto_set,
    step_along,
    tangent_planes,
    tangents_at,
    unconstrained_setting,
)
from equimorph.tasks.planning.network import Demands, connect, lift_straight

NUDGE = 1e-4
"""Step along the tangents of the differences of walls, in the metric."""
MARGIN_ERROR = 1e-6
"""Relative error of margins, whose differences are taken."""
HELD = 0.2
"""Share of its distance to a wall that a node keeps in one step, by the slope of the wall."""
REACH = 0.3
"""Longest step of a node, in the metric."""
STEPS, HALVINGS = 12, 5
"""Newton steps for one strength of the walls, and halvings of each."""
ENOUGH = 1e-4
"""Share of the squared length that the last step gains."""

FEW, NODES, MOST_NODES = 20, 48, 128
"""Nodes of a rough curve, of a fine one, and most after legs that cannot be lifted were divided."""
STRENGTHS = (0.2, 0.06, 0.02, 0.01)
"""Strengths of the walls, one after the other: curves bend along a wall at half of it times the
radius of their bend."""
DIVISIONS = 5
"""How often legs are divided until straight lifts follow them."""
INWARD = 1e-3
"""Share of the box by which nodes on its sides are moved inside."""

Walls = Float[np.ndarray, "nodes walls"]
Steps = Float[np.ndarray, "nodes d"]


@dataclass(frozen=True)
class Curve:
    """Nodes on a set, their distances from walls, and the shares of the legs between them."""

    at: SetPoints
    walls: Walls
    shares: Values


@dataclass(frozen=True)
class Shortener:
    """Search for the shortest curve within demands.

    Parameters
    ----------
    eset
        The set.
    demands
        Margin and constraints that every node obeys.
    """

    eset: EquilibriumSet
    demands: Demands

    @property
    def _setting(self) -> Setting:
        return unconstrained_setting(self.eset)

    def curve(self, nodes: States) -> Curve:
        """Curve through given stable states, with equal shares."""
        rows = tangent_planes(self._setting, nodes)
        at = SetPoints(nodes.z, nodes.p, rows)
        return Curve(at, self._walls(at), np.full(len(nodes) - 1, 1.0 / (len(nodes) - 1)))

    def curve_near(self, path: States) -> Curve | None:
        """Shortest curve near a path, by straight lifts from node to node; None if none is found.

        Walls become weaker as long as all legs can be lifted.
        """
        curve, found = self._curve_along(path, NODES), list[Curve]()
        if curve is None:
            return None
        for strength in STRENGTHS:
            # farther from walls there is more room for further nodes
            tried = (self._linked(each, strength) for each in [*found[:-3:-1], curve])
            linked = next((each for each in tried if each is not None), None)
            if linked is None:
                break
            found.append(linked)
        return found[-1] if found else None

    def rough_length(self, path: States) -> float:
        """Length of a shortened curve of few nodes near a path; infinite without one."""
        curve = self._curve_along(path, FEW)
        if curve is None:
            return np.inf
        for strength in STRENGTHS:
            curve = self.shorten(curve, strength)
        return float(np.linalg.norm(np.diff(self._place(curve), axis=0), axis=1).sum())

    def _curve_along(self, path: States, count: int) -> Curve | None:
        """Curve along a path, of about so many nodes; None if one of them meets a wall."""
        nodes = self._nodes(path, count)
        curve = None if nodes is None else self.curve(nodes)
        return curve if curve is not None and (curve.walls[1:-1] > 0.0).all() else None

    def _nodes(self, path: States, count: int) -> States | None:
        """States along a path, about as many as a curve has, inside the box."""
        some = np.unique(np.linspace(0, len(path) - 1, min(len(path), count)).round().astype(int))
        path = path[some]
        setting = self._setting
        place = embed(setting, path.z, path.p)
        gap = np.linalg.norm(np.diff(place, axis=0), axis=1)
        parts = np.maximum(1, (count * gap / max(gap.sum(), 1e-300)).round()).astype(int)
        leg = np.repeat(np.arange(len(parts)), parts)
        share = np.concatenate([np.arange(1, each + 1) / each for each in parts])[:, None]
        p = path.p[leg] + share * (path.p[leg + 1] - path.p[leg])
        box, inset = self.eset.box, INWARD * np.ptp([self.eset.box.lower, self.eset.box.upper], 0)
        inside = p.copy()
        inside[:-1, setting.free] = np.clip(
            p[:-1, setting.free], box.lower + inset, box.upper - inset
        )
        z, there, _ = lift_straight(path[leg], inside, Demands(self.demands.objective))
        z[-1] = path.z[-1]
        if not there.all():
            return None
        return States(
            path.structure,
            np.concatenate([path.z[:1], z]),
            np.concatenate([path.p[:1], inside]),
        )

    def _linked(self, curve: Curve, strength: float) -> Curve | None:
        """Shortened curve all of whose legs can be lifted; None if none was found.

        Legs that cannot are divided before, where the curve is farther from walls.
        """
        for _ in range(DIVISIONS):
            shorter = self.shorten(curve, strength)
            states = self.states(shorter)
            good, _ = connect(states[:-1], states[1:], self.demands)
            if good.all():
                return shorter
            bad = ~good
            bad[1:] |= ~good[:-1]
            bad[:-1] |= ~good[1:]
            if len(states) + bad.sum() > MOST_NODES:
                break
            divided = self._divided(curve, np.flatnonzero(bad))
            if divided is None:
                break
            curve = divided
        return None

    def _divided(self, curve: Curve, legs: Some) -> Curve | None:
        """Curve with a further node in the middle of some legs; None if one meets a wall."""
        at = curve.at
        z, p = (0.5 * (each[legs] + each[legs + 1]) for each in (at.z, at.p))
        there, found = project_onto_set(self._setting, z, p, at.rows[legs])
        walls = self._walls(there)
        if not found.all() or not (walls > 0.0).all():
            return None
        z, p, rows = (
            np.insert(old, legs + 1, new, axis=0)
            for old, new in zip(
                (at.z, at.p, at.rows), (there.z, there.p, at.rows[legs]), strict=True
            )
        )
        shares = curve.shares.copy()
        shares[legs] *= 0.5
        shares = np.insert(shares, legs + 1, shares[legs])
        every = np.insert(curve.walls, legs + 1, walls, axis=0)
        return Curve(SetPoints(z, p, rows), every, shares)

    def shorten(self, curve: Curve, strength: float) -> Curve:
        """Curve after Newton steps with walls of a strength, in squared lengths."""
        strength = strength * self._squared_length(curve)
        value = self._value(curve, strength)
        for _ in range(STEPS):
            nearer = self._step(curve, strength, value)
            if nearer is None:
                break
            before, (curve, value) = value, nearer
            if before - value < ENOUGH * abs(before):
                break
        return curve

    def states(self, curve: Curve) -> States:
        """States at the nodes."""
        return States(self.eset.structure, curve.at.z, curve.at.p)

    def _step(self, curve: Curve, strength: float, value: float) -> tuple[Curve, float] | None:
        """Curve after one step that lowers the value, and the new one; None if no step does."""
        frames, at = tangents_at(self._setting, curve.at)
        curve = replace(curve, at=at)
        step, share = self._newton_step(curve, frames, strength)
        for _ in range(HALVINGS):
            moved = self._moved(curve, frames, share * step)
            if moved is not None:
                lower = self._value(moved, strength)
                if lower < value:
                    return moved, lower
            share *= 0.5
        return None

    def _moved(self, curve: Curve, frames: Frames, step: Steps) -> Curve | None:
        """Curve with its inner nodes moved; None if one of them meets a wall or leaves the set."""
        inner = slice(1, len(step) - 1)
        at = curve.at
        own = SetPoints(at.z[inner], at.p[inner], at.rows[inner])
        z, p = step_along(self._setting, own, frames[inner], step[inner])
        there, found = project_onto_set(self._setting, z, p, own.rows)
        if not found.all():
            return None
        walls = self._walls(there)
        if not (walls > 0.0).all():
            return None
        z, p, all_walls = at.z.copy(), at.p.copy(), curve.walls.copy()
        z[inner], p[inner], all_walls[inner] = there.z, there.p, walls
        return Curve(SetPoints(z, p, at.rows), all_walls, curve.shares)

    def _newton_step(self, curve: Curve, frames: Frames, strength: float) -> tuple[Steps, float]:
        """Step of all nodes, and the share of it that keeps away from walls."""
        rows, shares = curve.at.rows, curve.shares
        legs = np.diff(self._place(curve), axis=0) / shares[:, None]
        inner, d = slice(1, len(rows) - 1), rows.shape[1]
        gradient = 2.0 * np.einsum("kde,ke->kd", rows[inner], legs[:-1] - legs[1:])
        slopes = self._slopes(curve, frames)[inner]
        walls, weight = curve.walls[inner], strength * 0.5 * (shares[:-1] + shares[1:])
        pull = slopes / walls[:, :, None]
        gradient -= weight[:, None] * pull.sum(axis=1)
        blocks = weight[:, None, None] * np.einsum("kwd,kwe->kde", pull, pull)
        blocks += 2.0 * (1.0 / shares[:-1] + 1.0 / shares[1:])[:, None, None] * np.eye(d)
        turns = np.einsum("kde,kfe->kdf", rows[1:-2], rows[2:-1])
        beside = -2.0 / shares[1:-1, None, None] * turns
        step = np.zeros((len(rows), d))
        step[inner] = solve_block_tridiagonal(blocks, beside, -gradient)
        toward = -np.einsum("kwd,kd->kw", slopes, step[inner])
        with np.errstate(divide="ignore"):
            room = np.where(toward > 0.0, (1.0 - HELD) * walls / toward, np.inf)
        longest = np.linalg.norm(step, axis=1).max()
        return step, float(min(1.0, room.min(), REACH / max(longest, 1e-300)))

    def _place(self, curve: Curve) -> Float[np.ndarray, "nodes coordinates"]:
        return embed(self._setting, curve.at.z, curve.at.p)

    def _squared_length(self, curve: Curve) -> float:
        legs = np.diff(self._place(curve), axis=0)
        return float(((legs**2).sum(axis=1) / curve.shares).sum())

    def _value(self, curve: Curve, strength: float) -> float:
        around = 0.5 * (curve.shares[:-1] + curve.shares[1:])
        logs = np.log(curve.walls[1:-1]).sum(axis=1)
        return self._squared_length(curve) - strength * float(around @ logs)

    def _walls(self, at: SetPoints) -> Walls:
        """Distances of points from the walls: positive inside."""
        structure, demands, free = self.eset.structure, self.demands, self._setting.free
        margin = stability_margin(structure, at.z, at.p, MARGIN_ERROR) - demands.margin
        excess = [each.excess(at.z, at.p) for each in demands.constraints]
        box, scales = self.eset.box, self._setting.scales
        place = at.p[:, free]
        sides = [(place - box.lower) / scales, (box.upper - place) / scales]
        return np.column_stack([margin, *(-each for each in excess), *sides])

    def _slopes(self, curve: Curve, frames: Frames) -> Float[np.ndarray, "nodes walls d"]:
        """Slopes of the walls along the tangents."""
        at, columns = curve.at, []
        for k in range(frames.shape[1]):
            step = np.zeros((len(at), frames.shape[1]))
            step[:, k] = NUDGE
            z, p = step_along(self._setting, at, frames, step)
            columns.append((self._walls(SetPoints(z, p, at.rows)) - curve.walls) / NUDGE)
        return np.stack(columns, axis=2)


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
    return np.asarray(solveh_banded(band, rhs.ravel()).reshape(count, d))
