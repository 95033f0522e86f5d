"""The stable cells of a set as a network of straight lifts, computed once for all routes."""

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Bool, Flags, Float, Int, Lanes, Parameters, Some, Values
from equimorph.equilibria import ParameterLine, TraceOptions
from equimorph.equilibria.trace import Traces, trace
from equimorph.equilibria.trace_options import EventCode
from equimorph.linalg.graphs import components
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.kept_tables import from_cache
from equimorph.manifold.geometry.topology import faces_of
from equimorph.model import Constraint, are_feasible, ease
from equimorph.structures import State, States, Structure, join_states
from equimorph.structures.margin import count_below
from equimorph.structures.metric import metric_length
from equimorph.tasks.planning.objectives import ROUGH, Objective, Wish, objective_of
from equimorph.tasks.start import critical
from equimorph.tasks.straight_lines import FINE

EXACT, RESERVES = (1.0, 0.0), ((1.01, 1e-3), (1.05, 1e-2), (1.15, 1e-2))
"""Factors on the demanded margin, and shares of the smaller margin of the ends added to it."""
CLOSE = 0.05
"""Largest step in the metric where the stability margin is watched along a lift."""
BROAD = 0.1
"""The same where the cost is summed up from step to step."""
MATCH = 1e-5
"""Distance in the metric within which a lift leads to the state that is meant."""

SEARCHED = replace(FINE, retries=0, locate_jumps=False)
"""Step control of lifts as fine as the final ones, where one that fails is one of many."""

CRITICAL = (1, 4, 7)
"""Kinds of vertices at which stability ends: on folds, and where sheets cross."""
Ends = tuple[State, State]
Pairs = Int[np.ndarray, "links 2"]


@dataclass(frozen=True)
class Demands:
    """What a route has to obey, and what it minimises.

    `closely`: whether every lift is as fine as the final one; else it may step over the corner of a
    keep-out region.
    """

    objective: Objective
    constraints: tuple[Constraint, ...] = ()
    margin: float = 0.0
    closely: bool = False

    @classmethod
    def of(
        cls, structure: Structure, objective: Wish, within: Sequence[Constraint], margin: float
    ) -> "Demands":
        """Check what a caller demands of a route."""
        constraints = tuple(ease(each) for each in dict.fromkeys(within))
        return cls(objective_of(objective, structure), constraints, margin)

    def with_reserves(self, least: float) -> Iterator["Demands"]:
        """Demands with growing reserves of margin, for dips between the points that are watched.

        What leaves no room for a reserve is searched without one, too; without a demanded margin,
        and where shortest curves keep what they need, that comes first. No reserve exceeds `least`,
        the smaller margin of start and goal.
        """
        dips = self.margin > 0.0 and not self.objective.is_length
        for factor, share in (*RESERVES, EXACT) if dips else (EXACT, *RESERVES):
            yield replace(self, margin=min(self.margin * factor + least * share, least))

    def beyond(self, eset: EquilibriumSet) -> tuple[Constraint, ...]:
        """Constraints that the cells of a set do not obey anyway."""
        exact = (replace(each, ease=0.0) for each in self.constraints)
        return tuple(each for each in exact if each not in eset.constraints)

    @property
    def options(self) -> TraceOptions:
        """Step control of the lifts."""
        if self.closely:
            return SEARCHED
        if self.margin > 0.0:
            return TraceOptions(largest_step=CLOSE, locate_jumps=False)
        step = 0.5 if self.objective.is_length else BROAD
        return TraceOptions(first_step=0.1, largest_step=step, locate_jumps=False)

    def admissible(self, states: States) -> Flags:
        """Whether states keep the margin (by one count of inertia) and the constraints."""
        good = np.asarray(count_below(states.structure, states.z, states.p, self.margin) == 0)
        good[good] = are_feasible(self.constraints, states.z[good], states.p[good])
        return good


def connect(source: States, target: States, demands: Demands) -> tuple[Flags, Values]:
    """Whether straight lifts lead from states to states, admissible all the way; their costs."""
    z, linked, cost = lift_straight(source, target.p, demands)
    linked &= metric_length(source.structure, z - target.z) < MATCH
    return linked, cost


def lift_straight(source: States, p: Parameters, demands: Demands) -> tuple[Lanes, Flags, Values]:
    """Where straight lifts to parameters end; whether they got there admissibly; their costs."""
    structure, z = source.structure, source.z.copy()
    velocity = p - source.p
    there, cost = np.ones(len(source), bool), np.zeros(len(source))
    moving = np.flatnonzero(np.abs(velocity).max(axis=1, initial=0.0) > 0.0)
    if len(moving):
        line = ParameterLine(structure, source.p[moving].copy(), velocity[moving])
        outcome = trace(line, z[moving], demands.constraints, demands.options)
        arrived = outcome.code == EventCode.ARRIVED
        if demands.margin > 0.0:
            arrived &= _keeps_margin(line, outcome, demands)
        z[moving], there[moving] = outcome.z, arrived
        cost[moving] = _costs(source[moving], line, outcome, demands.objective)
    return z, there, cost


def _keeps_margin(line: ParameterLine, outcome: Traces, demands: Demands) -> Flags:
    """Whether every recorded point of the lifts has at least the margin."""
    keeps = np.ones(len(outcome.code), bool)
    points = outcome.points
    p = line.take(points.lanes).parameters(points.t)
    margin_alone = Demands(demands.objective, (), demands.margin)
    good = margin_alone.admissible(States(line.structure, points.z, p))
    keeps[points.lanes[~good]] = False
    return keeps


def _costs(source: States, line: ParameterLine, outcome: Traces, objective: Objective) -> Values:
    """Cost of each lift, summed up over its recorded points."""
    if objective.is_length:
        return np.asarray(outcome.travelled * sum(weight for weight, _ in objective.terms))
    points, lanes = outcome.points, np.arange(len(source))
    lane = np.concatenate([lanes, points.lanes, lanes])
    t = np.concatenate([np.zeros(len(lanes)), points.t, outcome.t])
    order = np.lexsort((t, lane))
    z = np.concatenate([source.z, points.z, outcome.z])[order]
    lane, t = lane[order], t[order]
    states = States(line.structure, z, line.take(lane).parameters(t))
    pairs = np.flatnonzero(lane[1:] == lane[:-1])
    costs = objective.costs(states, pairs, pairs + 1)
    return np.bincount(lane[pairs], costs, len(lanes))


class Network:
    """States of a set that a route may visit, links between them, and what is known of these.

    Node numbers: the vertices of the set, then the start, then the goal.

    Parameters
    ----------
    eset
        The set.
    """

    def __init__(self, eset: EquilibriumSet) -> None:
        stable = np.zeros(len(eset.points), bool)
        cells = eset.cells[eset.cell_index == 0]
        stable[cells] = True
        stable &= ~np.isin(eset.kinds, CRITICAL)
        self.stable, self.cells = stable, cells
        pairs = faces_of(cells, 2)
        self.pairs = pairs[stable[pairs].all(axis=1)]
        code = np.array([len(eset.points), 1])
        keys = np.sort(self.pairs, axis=1) @ code
        self._order = np.argsort(keys)
        self._code, self._keys = code, keys[self._order]
        self._allowed: dict[tuple[tuple[Constraint, ...], float], Flags] = {}
        self._broken: dict[tuple[tuple[Constraint, ...], float, bool], Flags] = {}
        self._lifted: dict[tuple[tuple[Constraint, ...], float, bool], Flags] = {}
        self._costs: dict[Hashable, Values] = {}

    def admissible(self, eset: EquilibriumSet, demands: Demands) -> Bool[np.ndarray, " V"]:
        """Vertices of stable cells, off the folds, that obey the demands."""
        key = demands.constraints, demands.margin
        if key not in self._allowed:
            some = np.flatnonzero(self.stable)
            good = self.stable.copy()
            good[some] = demands.admissible(eset.points[some])
            self._allowed[key] = good
        return self._allowed[key]

    def costs(self, eset: EquilibriumSet, objective: Objective) -> Values:
        """Cost of each link, along its chord."""
        key = objective.key
        if key not in self._costs:
            # margins of unstable vertices would be for nothing
            used, pairs = np.unique(self.pairs, return_inverse=True)
            first, second = pairs.reshape(self.pairs.shape).T
            self._costs[key] = objective.costs(eset.points[used], first, second, ROUGH)
        return self._costs[key]

    def verdicts(self, demands: Demands) -> tuple[Flags, Flags]:
        """Which links were lifted in vain, and which with success, in earlier searches."""
        key = demands.constraints, demands.margin, demands.closely
        for known in (self._broken, self._lifted):
            known.setdefault(key, np.zeros(len(self.pairs), bool))
        return self._broken[key], self._lifted[key]

    def links_of(self, paths: Sequence[Int[np.ndarray, " n"]]) -> Some:
        """Links that paths lead over, but for those of start and goal."""
        steps = [np.sort(np.stack([path[:-1], path[1:]], axis=1), axis=1) for path in paths]
        joined = np.concatenate([np.zeros((0, 2), int), *steps])
        keys = np.unique(joined[joined[:, 1] < self._code[0]] @ self._code)
        at = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        return self._order[at[self._keys[at] == keys]] if len(self._keys) else at[:0]

    def lift_links(self, used: Some, states: States, demands: Demands) -> bool:
        """Lift those of the used links that were not lifted before; whether all lead on.

        What was found is remembered for later searches.
        """
        broken, lifted = self.verdicts(demands)
        fresh = used[~lifted[used] & ~broken[used]]
        if len(fresh):
            first, second = self.pairs[fresh].T
            good, _ = connect(states[first], states[second], demands)
            lifted[fresh[good]], broken[fresh[~good]] = True, True
        return not broken[used].any()


def network_of(eset: EquilibriumSet) -> Network:
    """The network of a set, made on first use and kept as long as the set."""
    network: Network = from_cache(eset, "network", lambda: Network(eset))
    return network


def nodes_with_ends(eset: EquilibriumSet, ends: Ends) -> States:
    """Vertices of the set, start and goal."""
    return join_states(eset.structure, (eset.points, *ends))


def end_links(eset: EquilibriumSet, ends: Ends, demands: Demands) -> tuple[Pairs, Values]:
    """Links of start and goal to the vertices around them, and to each other."""
    count, allowed = len(eset.points), network_of(eset).admissible(eset, demands)
    near = [np.flatnonzero(allowed & vertices_around(eset, end)) for end in ends]
    own = np.repeat([0, 1, 0], [*map(len, near), 1])
    source = join_states(eset.structure, ends)[own]
    target = join_states(eset.structure, (eset.points[np.concatenate(near)], ends[1]))
    linked, cost = connect(source, target, demands)
    pairs = np.stack([count + own, np.concatenate([*near, [count + 1]])], axis=1)
    return pairs[linked], cost[linked]


def neighbours(
    eset: EquilibriumSet, allowed: Bool[np.ndarray, " V"], end: State, demands: Demands
) -> tuple[Int[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Allowed vertices over the grid cells around a state that a straight lift reaches."""
    near = np.flatnonzero(allowed & vertices_around(eset, end))
    source = States(eset.structure, np.tile(end.z, (len(near), 1)), np.tile(end.p, (len(near), 1)))
    linked, cost = connect(source, eset.points[near], demands)
    return near[linked], cost[linked]


def vertices_around(eset: EquilibriumSet, state: State) -> Flags:
    """Which vertices lie over the grid cell of a state and those around it."""
    cells, over = eset.mesh.cells, eset.grid_vertex
    count = 1 + max(int(cells.max()), int(over.max()))
    corners, around = np.zeros(count, bool), np.zeros(count, bool)
    corners[cells[eset.mesh.locate(np.array([state[name] for name in eset.names]))]] = True
    around[cells[corners[cells].any(axis=1)]] = True
    return np.asarray((over >= 0) & around[over])


def explain_no_route(eset: EquilibriumSet, ends: Ends, demands: Demands) -> str:
    """Say whether instability alone or the other demands separate start and goal."""
    network, free = network_of(eset), Demands(demands.objective)
    allowed = network.admissible(eset, free)
    own, _ = end_links(eset, ends, free)
    pairs = np.concatenate([network.pairs[allowed[network.pairs].all(axis=1)], own])
    label = components(len(eset.points) + 2, pairs)
    if label[-1] != label[-2]:
        why = critical("start", ends[0]) or critical("goal", ends[1])
        return why or "start and goal lie on different stable components of the set"
    words = [str(constraint) for constraint in demands.constraints]
    words += [f"margin >= {demands.margin:g}"] if demands.margin > 0 else []
    return f"start and goal are connected by stable states, but not within {' and '.join(words)}"
