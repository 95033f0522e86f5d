"""Shortest curves on a set between two states, away from walls: geodesics by Newton's method.

The nodes X_k of a curve on the set move along its tangent spaces, so that folds are no obstacle.
Sought is the least of

    Σ |X_{k+1} − X_k|²/w_k − ν Σ w_k Σ_j log g_j(X_k) ,   Σ w_k = 1 ,

whose first sum is the squared length of a curve that runs through its share w_k of the length from
node to node. The walls g_j > 0 are the stability margin above what is demanded, the constraints,
and the sides of the box. Where a margin is demanded, nodes keep as much more of it as straight
lifts from node to node lose between them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from equimorph.arrays import Flags, Parameters, Some, Values
from equimorph.equilibria import settle
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.geometry.setting import embed
from equimorph.structures import States, join_states
from equimorph.structures.margin import softest_modes
from equimorph.tasks.planning.corner_moves import chords
from equimorph.tasks.planning.curves import (
    Curves,
    CurveSteps,
    join_curves,
)
from equimorph.tasks.planning.network import Demands, connect, lift_straight
from equimorph.tasks.planning.objectives import Objective

STEPS, HALVINGS = 12, 5
"""Newton steps for one strength of the walls, and halvings of each."""
ENOUGH, NEARLY = 1e-4, 1e-2
"""Share of the squared length that the last step gains: of all, and before walls are weaker."""

FEW, NODES, MOST_NODES = 24, 48, 192
"""Nodes of a rough curve, of a fine one, and most after legs that cannot be lifted were divided."""
STRENGTHS = (0.1, 0.03, 0.01)
"""Strengths of the walls, one after the other: curves bend along a wall at half of it times the
radius of their bend."""
DIVISIONS, LONGER = 5, 1e-4
"""How often legs are divided until straight lifts follow them, and the share of the length by which
these may be longer."""
LOSSES, TAKEN, ROUGHLY = 3.0, 0.8, 1e-2
"""Margins above what is demanded, in losses on legs, up to which these count; the largest share of
what is free that is kept for them; and the relative error of losses."""


@dataclass(frozen=True)
class Shortener:
    """Search for the shortest curves within demands."""

    eset: EquilibriumSet
    """The set."""
    demands: Demands
    """Margin and constraints that every node obeys."""

    @property
    def _closely(self) -> Demands:
        """Lengths of lifts as fine as the final ones."""
        return replace(self.demands, objective=Objective(((1.0, "length"),)), closely=True)

    @cached_property
    def _steps(self) -> CurveSteps:
        return CurveSteps(self.eset, self.demands)

    def curves_near(self, paths: Sequence[States]) -> list[States | None]:
        """Nodes of shortest curves near paths, by straight lifts from one to the next.

        Walls are as weak as lifts of all legs allow; None where they never do.
        """
        todo = self._curves_along(paths, NODES)
        found = dict[int, Curves]()
        todo = self._link(todo, STRENGTHS, found) if todo else todo
        for strength in STRENGTHS[-2::-1]:
            todo = self._link(todo, (strength,), found) if todo else todo
        return [self._steps.states(found[k]) if k in found else None for k in range(len(paths))]

    def shortest_near(self, paths: Sequence[States]) -> tuple[int, States | None]:
        """Which path has the shortest curve nearby, judged by rough ones, and that curve's nodes.

        The fine curve begins with the rough one, its legs halved, unless it keeps a margin.
        """
        some = self._curves_along(paths, FEW)
        best, found = 0, dict[int, Curves]()
        if some:
            rough = dict(zip(some, self._shorten(list(some.values()), STRENGTHS), strict=True))
            best = min(rough, key=lambda k: float(self._gaps(self._steps.states(rough[k])).sum()))
        if some and self.demands.margin == 0.0:  # else floors are those of longer legs
            fine = self._halved([rough[best]], [np.arange(len(rough[best].z) - 1)])[0]
            self._link({} if fine is None else {best: fine}, STRENGTHS[-1:], found)
        if found:
            return best, self._steps.states(found[best])
        return best, self.curves_near([paths[best]])[0]

    def shortest(self, curves: Sequence[States | None], count: int) -> list[int]:
        """Which curves are among the shortest, and those that were not found."""
        lengths = [np.inf if each is None else float(self._gaps(each).sum()) for each in curves]
        longest = max(sorted(lengths)[:count], default=np.inf)
        return [k for k, each in enumerate(curves) if each is None or lengths[k] <= longest]

    def _curves_along(self, paths: Sequence[States], count: int) -> dict[int, Curves]:
        """Curves along paths, of about so many nodes each.

        Without those of one node, that meet a wall, or whose legs cannot be lifted. Between states
        that are farther apart there are those of straight lifts.
        """
        ways = [self._way_points(path, count) for path in paths]
        lengths = [len(p) for _, p in ways]
        if sum(lengths) == 0:
            return {}
        starts = join_states(self.eset.structure, [start for start, _ in ways])
        p = np.concatenate([p for _, p in ways])
        z, there, _ = lift_straight(starts, p, Demands(self.demands.objective))
        chains, cuts = dict[int, States](), np.cumsum(lengths)[:-1]
        split = (np.split(each, cuts) for each in (z, p, there))
        for k, (own_z, own_p, arrived) in enumerate(zip(*split, strict=True)):
            if arrived.all() and len(own_p):
                path = join_states(
                    paths[k].structure, [paths[k][0], States(starts.structure, own_z, own_p)]
                )
                at = np.concatenate([[0.0], np.cumsum(self._gaps(path))])
                even = np.linspace(0.0, at[-1], count + 1)
                nodes = np.unique(np.abs(at[:, None] - even).argmin(axis=0))
                chains |= {k: path[nodes]} if len(nodes) > 1 else {}
        found = self._steps.curves(list(chains.values())) if chains else []
        return {k: curve for k, curve in zip(chains, found, strict=True) if curve is not None}

    def _way_points(self, path: States, count: int) -> tuple[States, Parameters]:
        """States from which to lift, and parameters, of about as many states as given on a path."""
        gap = self._gaps(path)
        parts = np.maximum(1, np.ceil(0.7 * count * gap / max(gap.sum(), 1e-300))).astype(int)
        leg = np.repeat(np.arange(len(parts)), parts)
        first = np.repeat(np.cumsum(parts) - parts, parts)
        share = (np.arange(len(leg)) - first + 1) / parts[leg]
        start, share = np.where(share == 1.0, leg + 1, leg), np.where(share == 1.0, 0.0, share)
        return path[start], path.p[start] + share[:, None] * (path.p[leg + 1] - path.p[start])

    def _gaps(self, states: States) -> Values:
        place = embed(self._steps.setting, states.z, states.p)
        return np.asarray(np.linalg.norm(np.diff(place, axis=0), axis=1))

    def _link(
        self, todo: dict[int, Curves], strengths: tuple[float, ...], found: dict[int, Curves]
    ) -> dict[int, Curves]:
        """Enter shortened curves all of whose legs can be lifted; return the others.

        Legs that cannot, or whose lifts are longer, are divided.
        """
        left = dict[int, Curves]()
        for _ in range(DIVISIONS if todo else 0):
            shorter = self._shorten(list(todo.values()), strengths)
            linked, good = zip(*self._lifts(shorter), strict=True)
            divided = zip(todo, shorter, linked, self._divided(shorter, good), strict=True)
            todo, strengths = {}, strengths[-1:]
            for k, curve, whole, finer in divided:
                if whole:
                    found[k] = curve
                if finer is not None:
                    todo[k] = finer
                else:
                    left[k] = curve
            if not todo:
                break
        return {k: curve for k, curve in (left | todo).items() if k not in found}

    def _lifts(self, curves: list[Curves]) -> list[tuple[bool, Flags]]:
        """Whether all legs of each curve can be lifted, and which of them are as long as lifts."""
        every, count = join_curves(curves), len(curves)
        states, ends = self._steps.states(every), every.legs
        linked, cost = chords(states, ends - 1, ends, self._closely)
        some = np.flatnonzero(linked)
        lifts = connect(states[ends[some] - 1], states[ends[some]], self._closely)
        linked[some], cost[some] = lifts
        place = embed(self._steps.setting, every.z, every.p)
        chord = np.linalg.norm(place[ends] - place[ends - 1], axis=1)
        length = every.sums(chord, ends, count)
        close = linked & (cost - chord <= LONGER * length[every.route[ends]])
        own = [every.route[ends] == route for route in range(count)]
        return [(bool(linked[some].all()), close[some]) for some in own]

    def _divided(self, curves: list[Curves], good: Sequence[Flags]) -> list[Curves | None]:
        """Curves with bad legs in four parts and those beside in two; None where that fails."""
        legs, again = list[Some](), list[Some]()
        for fine in good:
            bad, beside = ~fine, ~fine
            beside[1:] |= bad[:-1]
            beside[:-1] |= bad[1:]
            first = np.arange(len(bad)) + np.cumsum(beside) - beside
            legs.append(np.flatnonzero(beside))
            again.append(np.sort(np.concatenate([first[bad], first[bad] + 1])))
        return self._halved(self._halved(curves, legs), again)

    def _halved(self, curves: Sequence[Curves | None], legs: Sequence[Some]) -> list[Curves | None]:
        """Curves with nodes in the middle of some legs; None of none, or if one is outside."""
        out: list[Curves | None] = [None] * len(curves)
        some = dict[int, Curves]()
        for k, curve in enumerate(curves):
            if curve is not None and 0 < len(legs[k]) <= MOST_NODES - len(curve.z):
                share = curve.share.copy()
                share[legs[k] + 1] *= 0.5
                some[k] = replace(curve, share=share)
        if not some:
            return out
        first, second = (
            Curves.concatenate([curve.take(legs[k] + end) for k, curve in some.items()])
            for end in (0, 1)
        )
        middle, inside = self._steps.between(first, second)
        begin = 0
        for k, curve in some.items():
            own = np.arange(begin, begin + len(legs[k]))
            begin += len(own)
            if inside[own].all():
                at = np.concatenate([np.arange(len(curve.z)), legs[k] + 0.5])
                order = np.argsort(at, kind="stable")
                out[k] = Curves.concatenate([curve, middle.take(own)]).take(order)
        return out

    def _shorten(self, curves: list[Curves], strengths: tuple[float, ...]) -> list[Curves]:
        """Curves after Newton steps with weaker and weaker walls."""
        every, count = join_curves(curves), len(curves)
        for strength in strengths[:-1]:
            every = self._with_walls(every, count, strength, NEARLY)
            every = every if self.demands.margin == 0.0 else self._with_floors(every)
        every = self._with_walls(every, count, strengths[-1], ENOUGH)
        return [every.take(every.route == route) for route in range(count)]

    def _with_walls(self, curves: Curves, count: int, strength: float, enough: float) -> Curves:
        """Curves after steps with walls of a strength, relative to the squared lengths."""
        steps = self._steps
        strengths = strength * steps.squared_lengths(curves, count)
        rows, own = np.arange(len(curves.z)), steps.with_forces(curves, strengths)
        for _ in range(STEPS):
            value = steps.values(own, strengths)
            own, lower = steps.step(own, strengths, value, HALVINGS)
            more = (value - lower > enough * np.abs(value))[own.route]
            if not more.all():
                curves = curves.with_rows(rows, own)
                rows, own = rows[more], own.take(more)
            if len(rows) == 0:
                return curves
        return curves.with_rows(rows, own)

    def _with_floors(self, curves: Curves) -> Curves:
        """Curves whose nodes keep as much margin as straight lifts between them lose.

        Near folds the square of a margin, and what a lift loses of it, are regular.
        """
        structure, demanded, ends = self.eset.structure, self.demands.margin, curves.legs
        z, p = (0.5 * (each[ends - 1] + each[ends]) for each in (curves.z, curves.p))
        middle, margin = settle(structure, z, p), curves.walls[:, 0] + curves.floor
        none = np.zeros(len(ends))
        found = softest_modes(structure, middle.z, middle.p, none, curves.pairs[ends], ROUGHLY)
        first, second = margin[ends - 1] ** 2, margin[ends] ** 2
        mean, known = 0.5 * (first + second), middle.found & found.above
        sag = 4.0 * (mean - np.where(known, np.minimum(found.first**2, mean), 0.0))
        # of a parabola, below the lower one of its ends
        loss = np.maximum(sag - np.abs(second - first), 0.0) ** 2 / (4.0 * np.maximum(sag, 1e-300))
        loss[np.minimum(first, second) > demanded**2 + LOSSES * loss] = 0.0
        lost = np.zeros(len(margin))
        np.maximum.at(lost, ends, loss)
        np.maximum.at(lost, ends - 1, loss)
        floor = np.sqrt(demanded**2 + lost)
        floor = np.minimum(floor, demanded + TAKEN * np.maximum(margin - demanded, 0.0))
        walls = curves.walls.copy()
        walls[:, 0] = margin - floor
        return replace(curves, walls=walls, floor=floor)
