"""Slices: equilibrium sets over two of many actuators, and straight lifts from one to another.

Stability ends at folds, which part the box of all actuators; folds end in cusps, of one dimension
less. A set over two parameters is the smallest that generically shows how a route leads around the
end of a fold, however narrow the way is. Slices lead through states that the task names: start and
goal, then those that are reached nearest to the other end.

See docs/decisions.md, "Many actuators are planned in slices".
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import combinations, pairwise

import numpy as np

from equimorph.arrays import Pairs
from equimorph.errors import EndlessError
from equimorph.linalg.graphs import components, shortest_path
from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.manifold.queries.locate import pieces_of
from equimorph.model import Box, Constraint
from equimorph.structures import State, States, join_states
from equimorph.structures.metric import distances
from equimorph.tasks.planning.mesh_paths import cheapest_path
from equimorph.tasks.planning.network import (
    MATCH,
    Demands,
    Ends,
    lift_straight,
)
from equimorph.tolerances import SAME_NUMBER

INTERVALS = (16, 16)
"""Grid of a slice: cells are cut along exact folds, so that coarse ones lose no way."""
LIFTED = 48
"""States of a stable region of a slice that are lifted to a parallel slice."""
LIFT = -1
"""In place of the number of a slice: two stations are joined by a straight lift."""


class Slices:
    """Stable states that are known (stations), and the slices and lifts that may join them.

    Stations on the same stratum of a slice may be joined; whether they are, within the demands, is
    decided when a path leads there.
    """

    def __init__(
        self, ends: Ends, box: Box, demands: Demands, within: Sequence[Constraint]
    ) -> None:
        """Begin with start and goal, the stations 0 and 1."""
        self.structure, self.demands, self.within = ends[0].structure, demands, within
        self.sides = dict(zip(box.names, zip(box.lower, box.upper, strict=True), strict=True))
        self.stations: list[State] = list(ends)
        self.sets: list[EquilibriumSet] = []
        self.regions: dict[tuple[int, int], list[int]] = {}
        self.joints: dict[tuple[int, int], list[int]] = {}

    def path(self, most: int) -> States | None:
        """States from start to goal; None if slices, at most so many, do not join them."""
        bases, path = [0, 1], None
        while bases and path is None:
            for names, base in ((names, base) for names in self._pairs() for base in bases):
                if path is None and len(self.sets) < most and self._add(names, base):
                    path = self._join_pieces()
            bases = list(self._nearest()) if path is None and len(self.sets) < most else []
        return path

    def _pairs(self) -> Iterator[tuple[str, ...]]:
        """Pairs of actuators: each as soon as possible, first those that have to move most."""
        start, goal = self.stations[:2]
        moved = {
            name: abs(goal[name] - start[name]) / (high - low)
            for name, (low, high) in self.sides.items()
        }
        left, uses = list(combinations(self.sides, 2)), Counter[str]()
        while left:
            pair = min(left, key=lambda names: sum(uses[each] - moved[each] for each in names))
            left.remove(pair)
            uses.update(pair)
            yield pair

    def _add(self, names: tuple[str, ...], base: int) -> bool:
        """Compute the slice through a station, join it to the others; whether it is a new one.

        Nor is there one where constraints do not bound it: lifts alone may still lead there.
        """
        state, number = self.stations[base], len(self.sets)
        like = [k for k, each in enumerate(self.sets) if each.names == names]
        if any(self._holds(self.sets[k], state) for k in like):
            return False
        fixed = {name: value for name, value in state.parameters.items() if name not in names}
        box = Box(**{name: self.sides[name] for name in names})
        try:
            eset = equilibrium_set(
                self.structure, box, fixed=fixed, within=self.within, intervals=INTERVALS
            )
        except EndlessError:
            return False
        self.sets.append(eset)
        for station in range(len(self.stations)):
            self._enter(number, station)
        here = self.sets[number].at(**{name: state[name] for name in names}).stable
        for other in here[self.demands.admissible(here)]:
            self._station(other)
        for k in like:
            self._lift_across(k, number)
            self._lift_across(number, k)
        return True

    def _holds(self, eset: EquilibriumSet, state: State) -> bool:
        """Whether a slice leads through the parameters of a state."""
        gap = np.abs(state.p - eset.points.p[0]) / self.structure.scales
        gap[eset.setting.free] = 0.0
        return bool(gap.max() <= SAME_NUMBER)

    def _station(self, state: State) -> int:
        """Number of a state among the stations, of which it becomes one if it is none."""
        known = join_states(self.structure, self.stations)
        gap = distances(self.structure, known.z, known.p, state.z[None], state.p[None])
        if gap.min() < MATCH:
            return int(gap.argmin())
        self.stations.append(state)
        for number in range(len(self.sets)):
            self._enter(number, len(known))
        return len(known)

    def _enter(self, number: int, station: int) -> None:
        """Join a station to the others on its stratum of a slice, if it lies there."""
        eset, state = self.sets[number], self.stations[station]
        stratum = pieces_of(eset, state)[0] if self._holds(eset, state) else -1
        if stratum >= 0:
            region = self.regions.setdefault((number, stratum), [])
            for other in region:
                self.joints.setdefault((other, station), []).append(number)
            region.append(station)

    def _lift_across(self, source: int, target: int) -> None:
        """Lift regions straight to a parallel slice; the first states of each region there join."""
        there, free = self.sets[target], self.sets[target].setting.free
        for region in [each for each in self.regions if each[0] == source]:
            states = self._states_of(region)
            states = states[np.unique(np.linspace(0, len(states) - 1, LIFTED).round().astype(int))]
            p = np.repeat(there.points.p[:1], len(states), axis=0)
            p[:, free] = states.p[:, free]
            z, arrived, _ = lift_straight(states, p, self.demands)
            seen = {-1}
            for k in np.flatnonzero(arrived).tolist():
                state = State(self.structure, z[k], p[k])
                stratum = pieces_of(there, state)[0]
                if stratum not in seen:
                    seen.add(stratum)
                    first, last = sorted((self._station(states[k]), self._station(state)))
                    self.joints.setdefault((first, last), []).append(LIFT)

    def _states_of(self, region: tuple[int, int]) -> States:
        """Admissible vertices of a stratum of a slice, one of its stations at least."""
        eset = self.sets[region[0]]
        some = np.unique(eset.cells[eset.stratum == region[1]])
        inner = eset.points[some[eset.index[some] == 0]]
        stations = [self.stations[k] for k in self.regions[region][:1]]
        return join_states(self.structure, [inner[self.demands.admissible(inner)], *stations])

    def _join_pieces(self) -> States | None:
        """Path from start to goal over stations, whose pieces are found one by one."""
        while True:
            pairs = self._links()
            way = shortest_path(len(self.stations), pairs, np.ones(len(pairs)), (0, 1))
            if way is None:
                return None
            pieces = [self._piece(one, other) for one, other in pairwise(way.tolist())]
            if None not in pieces:
                return join_states(self.structure, [each for each in pieces if each is not None])

    def _links(self) -> Pairs:
        """Pairs of stations that may be joined."""
        return np.array([pair for pair, ways in self.joints.items() if ways], int).reshape(-1, 2)

    def _piece(self, one: int, other: int) -> States | None:
        """Path between stations; slices in which there is none join them no more."""
        ends = (self.stations[one], self.stations[other])
        ways = self.joints[min(one, other), max(one, other)]
        while ways:
            if ways[-1] == LIFT:
                return join_states(self.structure, ends)
            path = cheapest_path(self.sets[ways[-1]], ends, self.demands)
            if path is not None:
                return path
            ways.pop()
        return None

    def _nearest(self) -> Iterator[int]:
        """New stations: the states reached from either end that are nearest to the other one."""
        pairs, count = self._links(), len(self.stations)
        label = components(count, pairs)
        sides = [
            [self._states_of(each) for each, some in self.regions.items() if label[some[0]] == own]
            for own in label[:2]
        ]
        for states, goal in zip(sides, self.stations[1::-1], strict=True):
            near = join_states(self.structure, states)
            gap = distances(self.structure, near.z, near.p, goal.z[None], goal.p[None])
            station = self._station(near[int(gap.argmin())]) if len(near) else 0
            if station >= count:
                yield station
