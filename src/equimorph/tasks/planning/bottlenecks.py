"""The lowest peak: how low the largest value of a descriptor can be kept between two states.

The stable cells, joined through their facets in the order of their levels, show where the lowest
way is highest; Newton's method finds the exact pass there, and its value takes the place of those
of the facets around it, until the highest facet of the lowest way has an exact value.

See docs/decisions.md, "Passes are found on the mesh and made exact".
"""

from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Float, ItemFlags, Items, Some
from equimorph.equilibria import settle
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.kept_tables import places_of
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.queries.nearest import SetPoints, cells_around, points_at_vertices
from equimorph.model import Constraint
from equimorph.structures import State, States, join_states
from equimorph.tasks.optimising.certificates import certificate
from equimorph.tasks.optimising.passes import AROUND, passes_near, states_over
from equimorph.tasks.optimising.programme import Objective, Programme, stability
from equimorph.tasks.optimising.sqp import CriticalPoint
from equimorph.tasks.optimising.tangent_steps import project_onto_set
from equimorph.tasks.planning.filtration import Filtration
from equimorph.tasks.planning.network import Ends
from equimorph.tasks.planning.objectives import Extreme
from equimorph.tasks.route import Bottleneck, BottleneckKind
from equimorph.tasks.stable_part import cell_near, stable_values
from equimorph.tolerances import FEASIBLE, SAME_NUMBER

ROUNDS = 40
"""Places in which a pass is sought, at most."""
BELOW_ENDS = 6
"""Of these, places not above the ends, where a pass may hide between vertices."""
JUMP = 0.02
"""Difference of the places of extrema along the structure beyond which they are different ones."""
BESIDE = 3
"""Facets of a way before and after one at which exact states tell whether it is right."""
SAME_VALUE = 1e-7
"""Difference from the ends, relative to the range of the objective on the way, that is none."""


@dataclass(frozen=True, eq=False)
class Passing:
    """A bottleneck, and how a route passes it."""

    bottleneck: Bottleneck
    """The exact one."""
    bound: Constraint
    """What routes obey that come as near to it as the slack allows."""
    over: States | None
    """States over the pass that is highest on the way, which obey it; None if none is known."""
    way: States
    """States from start to goal along the lowest way over the mesh, which obey it."""
    point: CriticalPoint | None = None
    """The pass with the conditions that hold there, if the bottleneck is one."""
    reach: float = 0.0
    """Size of the cells around it."""


def find_bottleneck(
    eset: EquilibriumSet,
    ends: Ends,
    extreme: Extreme,
    within: tuple[Constraint, ...] = (),
    margin: float = 0.0,
) -> Passing | None:
    """Lowest peak between two stable states of a set; None if no stable way within bounds is known.

    Constraints come in addition to those of the set; `margin` is the smallest stability margin.
    """
    keeps = stability(eset.structure, margin)
    goal = Objective(extreme.descriptor, extreme.sign)
    programme = Programme.over(eset, goal, (*eset.constraints, *within, keeps))
    bounds = within if margin == 0.0 else (*within, keeps)
    return _Search(eset, ends, extreme, bounds, programme).run()


@dataclass(frozen=True)
class _Spot:
    """Where a facet opens, the size of the cells around it, and the facets among these."""

    facet: int
    start: SetPoints
    reach: float
    facets: Items


class _Search:
    """The lowest way over the facets, some of which have exact levels already."""

    def __init__(
        self,
        eset: EquilibriumSet,
        ends: Ends,
        extreme: Extreme,
        bounds: tuple[Constraint, ...],
        programme: Programme,
    ) -> None:
        """Begin with the levels of the mesh."""
        self.eset, self.ends, self.extreme, self.programme = eset, ends, extreme, programme
        self.filtration = Filtration.of(eset, programme.objective, bounds)
        links = self.filtration.passages.links
        values = programme.objective.sign * stable_values(eset, extreme.descriptor)
        cells = values[eset.cells[self.filtration.passages.cells]].max(axis=1)
        self.ceiling = cells[links].max(axis=1)
        self.examined, self.bent = np.zeros(len(links), bool), False
        self.passes: dict[int, tuple[CriticalPoint, float]] = {}
        self.sought: dict[int, tuple[_Spot, list[CriticalPoint]]] = {}
        self.at_ends = [
            float(programme.objective.values(each.z[None], each.p[None])[0]) for each in ends
        ]

    def run(self) -> Passing | None:
        """Seek passes on the lowest way until its highest facet is exact, or below the ends."""
        first, last = (cell_near(self.eset, each) for each in self.ends)
        way, below, top = None, 0, max(self.at_ends)
        for _ in range(ROUNDS):
            way = self.filtration.way(first, last)
            facet = None if way is None else self._doubtful(way, top, self.examined)
            if way is None or facet is None:
                break
            level = float(self.filtration.level[facet])
            below += int(level <= top)
            if below > BELOW_ENDS:
                break
            if level > top and self.programme.objective.kinked and not self.bent:
                self._bend(top, level)
            else:
                self._make_exact(facet, way, top)
        return None if way is None else self._answer(way, top)

    def _doubtful(self, way: Some, top: float, examined: ItemFlags) -> int | None:
        """Highest facet of a way that may be higher than the peak as it is known; else None."""
        level = self.filtration.level[way]
        highest = max(top, float(level.max(initial=-np.inf)))
        able = (level == highest) | (self.ceiling[way] > highest)
        some = way[able & ~examined[way]]
        return int(some[self.filtration.level[some].argmax()]) if len(some) else None

    def _bend(self, top: float, level: float) -> None:
        """Open facets on which branches of the objective cross, if that may lower the way."""
        self.bent = True
        own, facets = self.filtration.level, self.filtration.passages.facets
        able = (own > top) & (own < level + (self.ceiling - own))
        place = self.extreme.descriptor.place
        if place is not None:
            points = self.eset.points
            used, at = np.unique(facets[able], return_inverse=True)
            places = place(points.z[used], points.p[used])[at.reshape(facets[able].shape)]
            able[able] = np.ptp(places, axis=1) > JUMP
        self.filtration = self.filtration.with_kinks(np.flatnonzero(able))

    def _make_exact(self, facet: int, way: Items, top: float) -> None:
        """Seek the pass at a facet; its value replaces the levels around it that it disproves."""
        if facet not in self.sought:
            self._seek(self._next(facet, way, top))
        spot, passes = self.sought[facet]
        self.examined[spot.facets] = True
        for found in passes:
            if self._replace_levels(facet, found, spot.reach, way):
                return

    def _seek(self, spots: "list[_Spot]") -> None:
        """Passes near some facets, in one batch."""
        starts = SetPoints.concatenate([each.start for each in spots])
        passes = passes_near(self.programme, starts, np.array([each.reach for each in spots]))
        self.sought |= {each.facet: (each, own) for each, own in zip(spots, passes, strict=True)}

    def _next(self, facet: int, way: Items, top: float) -> "list[_Spot]":
        """A facet; not above the ends, also those that follow it if there is no pass."""
        spots, examined = [self._spot(facet)], self.examined.copy()
        while self.filtration.level[facet] <= top and len(spots) < BELOW_ENDS:
            examined[spots[-1].facets] = True
            further = self._doubtful(way, top, examined)
            if further is None:
                break
            spots.append(self._spot(further))
        return spots

    def _spot(self, facet: int) -> "_Spot":
        """Where a facet opens, and what lies around it."""
        eset, filtration = self.eset, self.filtration
        corners, shares = filtration.passages.facets[facet], filtration.shares[facet]
        around = np.unique(eset.cells[cells_around(eset, corners)])
        middle = shares @ self._places[corners]
        reach = float(np.linalg.norm(self._places[around] - middle, axis=1).max())
        rows = points_at_vertices(eset, corners[[shares.argmax()]]).rows
        z, p = ((shares @ each[corners])[None] for each in (eset.points.z, eset.points.p))
        facets = np.append(self._near(middle, reach), facet)
        return _Spot(facet, SetPoints(z, p, rows), reach, facets)

    def _replace_levels(self, facet: int, found: CriticalPoint, reach: float, way: Items) -> bool:
        """Give the value of a pass to levels around it, if their errors explain the difference."""
        here = embed(self.eset.setting, found.point.z, found.point.p)[0]
        value, level = float(found.expansion.f[0].max()), self.filtration.level
        if abs(value - level[facet]) > self._bend_around(found, reach):
            return False
        if value > level[facet] and self._passes_below(facet, way, found):
            return False
        near = self._near(here, AROUND * reach)
        low, high = sorted((value, level[facet]))
        chosen = np.append(near[(level[near] >= low) & (level[near] <= high)], facet)
        self.examined[near] = True
        self.passes |= dict.fromkeys(chosen.tolist(), (found, reach))
        new = level.copy()
        new[chosen] = value
        self.filtration = replace(self.filtration, level=new)
        return True

    def _passes_below(self, facet: int, way: Items, found: CriticalPoint) -> bool:
        """Whether exact states along the way show that it leads past a higher pass."""
        level, value = float(self.filtration.level[facet]), float(found.expansion.f[0].max())
        at = int(np.flatnonzero(way == facet)[0])
        own = way[max(at - BESIDE, 0) : at + BESIDE + 1]
        facets, shares = self.filtration.passages.facets[own], self.filtration.shares[own]
        z, p = (
            np.einsum("fd,fdi->fi", shares, each[facets])
            for each in (self.eset.points.z, self.eset.points.p)
        )
        at_facets, dense = np.arange(len(own)), np.linspace(0.0, len(own) - 1, 8 * len(own) - 7)
        z, p = (
            np.stack([np.interp(dense, at_facets, column) for column in each.T], axis=1)
            for each in (z, p)
        )
        rows = np.repeat(found.point.rows, len(z), axis=0)
        exact, good = project_onto_set(self.programme.setting, z, p, rows)
        if not good.all() or self.programme.excess(exact.z, exact.p).max() > FEASIBLE:
            return False
        stable = self.programme.setting.structure.index(exact.z, exact.p) == 0
        high = self.programme.objective.values(exact.z, exact.p)
        return bool(stable.all() and high.max() < 0.5 * (level + value))

    def _bend_around(self, found: CriticalPoint, reach: float) -> float:
        """Largest difference of the Lagrangian around a pass from the plane through its values.

        It knows the shapes of active bounds, too.
        """
        here = embed(self.eset.setting, found.point.z, found.point.p)[0]
        some = self._vertices_near(here, reach)
        some = some[np.isfinite(stable_values(self.eset, self.extreme.descriptor)[some])]
        near, gap = self.eset.points[some], self._places[some] - here
        values = self.programme.objective.values(near.z, near.p)
        values += self.programme.excess(near.z, near.p) @ found.answer.multipliers
        flat = np.column_stack([np.ones(len(some)), gap @ found.point.rows[0].T])
        plane, *_ = np.linalg.lstsq(flat, values, rcond=None)
        off = np.append(values - flat @ plane, float(found.expansion.f[0].max()) - plane[0])
        return float(np.abs(off).max())

    @property
    def _places(self) -> Float[np.ndarray, "V coordinates"]:
        """Vertices in the metric; kept with the set."""
        return places_of(self.eset)

    def _near(self, place: Float[np.ndarray, " coordinates"], reach: float) -> Items:
        """Facets with all vertices within a distance."""
        near = np.zeros(len(self.eset.points), bool)
        near[self._vertices_near(place, reach)] = True
        return np.flatnonzero(near[self.filtration.passages.facets].all(axis=1))

    def _vertices_near(self, place: Float[np.ndarray, " coordinates"], reach: float) -> Items:
        """Vertices within a distance, which their parameters are, too."""
        d = len(self.eset.names)
        able = (np.abs(self._places[:, -d:] - place[-d:]) <= reach).all(axis=1)
        some = np.flatnonzero(able)
        return np.asarray(some[np.linalg.norm(self._places[some] - place, axis=1) <= reach])

    def _answer(self, way: Items, top: float) -> Passing:
        """The pass that is highest on the way, or the end that is higher."""
        level = self.filtration.level[way]
        size = max(abs(top), float(np.ptp([*self.at_ends, *self.ceiling[way]])))
        highest = float(level.max(initial=-np.inf))
        facet = int(way[level.argmax()]) if len(way) else -1
        found = self.passes.get(facet)
        at_end = highest <= top + SAME_VALUE * size
        if at_end:
            bottleneck = self._end(top)
        else:
            bottleneck = self._vertex(facet) if found is None else self._pass(found[0])
        room = self._room(self.extreme.sign * bottleneck.value, size)
        over = None if found is None else states_over(self.programme, *found, room)
        bound = self.extreme.bound(bottleneck.value, room)
        point, reach = (None, 0.0) if found is None or at_end else found
        way_over = self._states_along(way, facet, over, bound)
        return Passing(bottleneck, bound, over, way_over, point, reach)

    def _states_along(
        self, way: Items, facet: int, over: States | None, bound: Constraint
    ) -> States:
        """Start, exact states at the facets of a way that obey a bound, and goal."""
        points, facets = self.eset.points, self.filtration.passages.facets[way]
        shares = self.filtration.shares[way]
        z, p = (np.einsum("fd,fdi->fi", shares, each[facets]) for each in (points.z, points.p))
        exact = settle(points.structure, z, p)
        states = States(points.structure, exact.z, p)
        good = exact.found
        high = np.flatnonzero(good & (self.ceiling[way] > self.extreme.sign * bound.bound))
        good[high] = bound.excess(exact.z[high], p[high]) <= 0.0
        good[good] = states[good].index == 0
        at = int(np.flatnonzero(way == facet)[0]) if len(way) else 0
        number = np.arange(len(way))
        before, after = states[good & (number < at)], states[good & (number > at)]
        parts = [self.ends[0].batch, before, after, self.ends[1].batch]
        if over is not None:
            place = embed(self.eset.setting, over.z, over.p)
            last = (parts[0] if len(before) == 0 else before)[-1:]
            gap = np.linalg.norm(place - embed(self.eset.setting, last.z, last.p), axis=1)
            parts.insert(2, over if gap[0] <= gap[-1] else over[::-1])
        return join_states(points.structure, parts)

    def _room(self, value: float, scale: float) -> float:
        """How far routes may exceed a value; by part of the scale if that and the ends are zero."""
        size = max(abs(value), *(abs(value - each) for each in self.at_ends))
        return self.extreme.slack * (size if size > SAME_NUMBER * scale else scale)

    def _end(self, top: float) -> Bottleneck:
        number = self.at_ends.index(top)
        kind: BottleneckKind = "start" if number == 0 else "goal"
        return Bottleneck(self.extreme.sign * top, self.ends[number], kind)

    def _vertex(self, facet: int) -> Bottleneck:
        filtration, points = self.filtration, self.eset.points
        vertex = int(filtration.passages.facets[facet, filtration.shares[facet].argmax()])
        value = self.extreme.sign * float(filtration.level[facet])
        return Bottleneck(value, points[vertex], "vertex", np.nan)

    def _pass(self, found: CriticalPoint) -> Bottleneck:
        known = certificate(self.programme, found)
        value = self.extreme.sign * float(found.expansion.f[0].max())
        state = State(self.eset.structure, found.point.z[0], found.point.p[0])
        kinds: dict[str, BottleneckKind] = {"interior": "saddle", "stability boundary": "fold"}
        kind: BottleneckKind = kinds.get(known.kind, known.kind)  # type: ignore[arg-type]
        return Bottleneck(value, state, kind, known.residual, tuple(known.active))
