"""Routes that may snap, at a price: over the edges of the stability boundary to where they land."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.sparse.csgraph import dijkstra

from equimorph.arrays import Float, Int
from equimorph.equilibria import Landing, Path, lift, snap_landing
from equimorph.linalg.graphs import graph_of, walk_back
from equimorph.manifold import EquilibriumSet, Snap, snap_graph
from equimorph.manifold.complex.kept_tables import from_cache
from equimorph.model import Descriptor
from equimorph.structures import State, States, join_states
from equimorph.tasks.distances import distance
from equimorph.tasks.planning.network import (
    Demands,
    Ends,
    connect,
    end_links,
    neighbours,
    network_of,
    nodes_with_ends,
)
from equimorph.tasks.planning.objectives import ROUGH
from equimorph.tasks.planning.snap_places import SnapPlace, cheapest_place
from equimorph.tasks.planning.straightening import (
    straight_corners,
    way_points_of,
)
from equimorph.tasks.route import Corners, Route, refusal, schedule_of
from equimorph.tasks.straight_lines import FINE
from equimorph.tolerances import SAME_STATE

SAMPLES = 9
"""Points of each fold whose snaps are followed to where they land."""
MOST_RUNS = 8
"""Runs of the stability boundary, or sequences of them, that are compared."""
DETOUR = 0.5
"""Part by which paths over the mesh may be longer than what is made of them: they lead over sampled
places of a fold only."""
ROUNDS = 3
"""How often the parts before and after a snap are straightened, and its place is sought anew."""
SHARES, ENOUGH = (0.0, 0.5, 0.75, 0.9, 0.97), 1e-4
"""Shares of the part before a snap from which straight moves lead to its fold, and least gain."""
NOWHERE = "not even by snaps does the goal lie on a piece that can be reached"


@dataclass(frozen=True)
class Gate:
    """A place where stability can be lost on purpose."""

    sources: Int[np.ndarray, " sources"]
    """Stable vertices next to the fold."""
    costs: Float[np.ndarray, " sources"]
    """Of the chords from these to the fold."""
    snap: Snap
    """The run of the stability boundary that it belongs to."""
    landing: Landing
    """Where the snap leads."""


@dataclass(frozen=True)
class SnapPath:
    """States of each stable part of a path, and the numbers of the gates between them."""

    stable: list[States]
    gates: list[int]
    cost: float


def gates_of(eset: EquilibriumSet, demands: Demands) -> list[Gate]:
    """Snaps that land on stable strata of the set, each with an admissible vertex before it."""
    network = network_of(eset)
    allowed = network.admissible(eset, demands)
    graph = from_cache(eset, "snap graph", lambda: snap_graph(eset, samples=SAMPLES))
    gates = []
    for snap in graph.snaps:
        for vertex, landing in zip(snap.vertices.tolist(), snap.landings, strict=True):
            if not landing.landed or snap.target < 0:
                continue
            if not demands.admissible(landing.state.batch)[0]:
                continue
            cells = network.cells[(network.cells == vertex).any(axis=1)]
            beside = np.unique(cells)
            beside = beside[allowed[beside]]
            if len(beside):
                costs = _chords(eset, beside, vertex, demands)
                gates.append(Gate(beside, costs, snap, landing))
    return gates


def _chords(
    eset: EquilibriumSet, beside: Int[np.ndarray, " n"], fold: int, demands: Demands
) -> Float[np.ndarray, " n"]:
    """Costs of the chords from vertices to a fold."""
    number = np.arange(len(beside))
    states = eset.points[np.append(beside, fold)]
    return demands.objective.costs(states, number, np.full(len(beside), len(beside)), ROUGH)


def route_with_snaps(
    eset: EquilibriumSet,
    ends: Ends,
    demands: Demands,
    price: float,
    monitor: Sequence[Descriptor],
    known: float = np.inf,
) -> Route:
    """Cheapest route with snaps, of which each costs `price`, verified piece by piece.

    known: cost of a route without a snap, than which it is to be cheaper.
    """
    search, best, least = _Search(eset, ends, demands, price), refusal(NOWHERE), known
    for _ in range(MOST_RUNS):
        path = search.path()
        if path is None or path.cost > (1.0 + DETOUR) * least:
            break
        route = _verify(eset, ends, path, demands, monitor)
        if route.arrived:
            route = replace(route, cost=route.cost + price * len(route.snaps))
        if not best.arrived or route.cost < best.cost:
            best = route
            least = min(least, route.cost) if route.arrived else least
        search.close(path.gates)
    return best


class _Search:
    """The network twice, before any snap and after one, with one-way links through the gates.

    So every path from the start before to the goal after snaps at least once.
    """

    def __init__(self, eset: EquilibriumSet, ends: Ends, demands: Demands, price: float) -> None:
        self.eset, self.demands, self.price = eset, demands, price
        self.network = network_of(eset)
        self.gates = gates_of(eset, demands)
        states = nodes_with_ends(eset, ends)
        landed = [gate.landing.state for gate in self.gates]
        self.states = join_states(eset.structure, (states, *landed))
        self.first = len(states)
        allowed = self.network.admissible(eset, demands)
        own, costs = end_links(eset, ends, demands)
        pairs, weights = [own], [costs]
        for number, state in enumerate(landed):
            near, cost = neighbours(eset, allowed, state, demands)
            node = np.full(len(near), self.first + number)
            pairs.append(np.stack([node, near], axis=1))
            weights.append(cost)
        self.own, self.own_costs = np.concatenate(pairs), np.concatenate(weights)
        self.closed: set[int] = set()

    def close(self, gates: list[int]) -> None:
        """Do not use the runs of these gates again."""
        runs = {id(self.gates[k].snap) for k in gates}
        self.closed.update(k for k, gate in enumerate(self.gates) if id(gate.snap) in runs)

    def path(self) -> SnapPath | None:
        """The cheapest path all of whose links can be lifted; None if no such path exists."""
        network = self.network
        allowed = network.admissible(self.eset, self.demands)[network.pairs].all(axis=1)
        broken, _ = network.verdicts(self.demands)
        costs = network.costs(self.eset, self.demands.objective)
        while True:
            inner = np.flatnonzero(allowed & ~broken)
            both = np.concatenate([network.pairs[inner], self.own])
            path, cost = self._cheapest(both, np.concatenate([costs[inner], self.own_costs]))
            if path is None:
                return None
            used = network.links_of([path % len(self.states)])
            if network.lift_links(used, self.states, self.demands):
                return self._divide_at_snaps(path, cost)

    def _cheapest(
        self, both: Int[np.ndarray, "links 2"], weights: Float[np.ndarray, " links"]
    ) -> tuple[Int[np.ndarray, " n"] | None, float]:
        open_gates = [k for k in range(len(self.gates)) if k not in self.closed]
        none = np.zeros(0, int)
        sources = np.concatenate([none, *(self.gates[k].sources for k in open_gates)])
        to_folds = np.concatenate([np.zeros(0), *(self.gates[k].costs for k in open_gates)])
        many = [len(self.gates[k].sources) for k in open_gates]
        targets = self.first + np.repeat(np.array(open_gates, dtype=int), many)
        count = len(self.states)
        one, other = both.T
        rows = [one, other, one + count, other + count, sources, sources + count]
        columns = [other, one, other + count, one + count, targets + count, targets + count]
        costs = np.concatenate([*[weights] * 4, *[to_folds + self.price] * 2])
        pairs = np.stack([np.concatenate(rows), np.concatenate(columns)], axis=1)
        # of links given twice, like that from start to goal, sparse matrices would add the costs
        graph = graph_of(2 * count, pairs, costs)
        start, goal = self.first - 2, count + self.first - 1
        cost, before = dijkstra(graph, indices=start, return_predecessors=True)
        return walk_back(before, start, goal), float(cost[goal])

    def _divide_at_snaps(self, path: Int[np.ndarray, " n"], cost: float) -> SnapPath:
        """Parts of a path between its snaps."""
        nodes = path % len(self.states)
        cuts = [
            k + 1
            for k, (a, b) in enumerate(pairwise(nodes.tolist()))
            if b >= self.first and self._is_snap(a, b)
        ]
        parts = np.split(nodes, cuts)
        return SnapPath(
            [self.states[part] for part in parts],
            [int(p[0]) - self.first for p in parts[1:]],
            cost,
        )

    def _is_snap(self, a: int, b: int) -> bool:
        linked = ((self.own[:, 0] == b) & (self.own[:, 1] == a)).any()
        return bool(a in self.gates[b - self.first].sources and not linked)


def _verify(
    eset: EquilibriumSet,
    ends: Ends,
    path: SnapPath,
    demands: Demands,
    monitor: Sequence[Descriptor],
) -> Route:
    """Lift every part finely; snaps start from where the lifts meet the folds."""
    gates = gates_of(eset, demands)
    here, paths, snaps = ends[0], list[Path](), list[Landing]()
    part, begin, way_points = path.stable[0], Corners(), Corners()
    for number, onward in zip(path.gates, path.stable[1:], strict=True):
        gate = gates[number]
        crossing = _crossing(eset, gate.snap, part, onward, demands)
        if crossing is None:
            return refusal("no moves lead over a fold to where its snaps are known to land")
        legs = [*begin, *way_points_of(eset, crossing.part)[:-1], crossing.beyond(eset)]
        leg = lift(here, legs, within=demands.constraints, options=FINE)
        way_points += legs
        if leg.end.kind not in ("fold", "branch point"):
            return refusal(f"a part meant to end in a snap ends otherwise: {leg.end.kind}")
        landing = _landing(leg.end.state, gate)
        if landing is None:
            return refusal("a snap does not land where it does from the set")
        paths.append(leg)
        snaps.append(landing)
        here, part, begin = landing.state, crossing.onward, [crossing.beyond(eset)]
    last = [*begin, *way_points_of(eset, part)]
    leg = lift(here, last, within=demands.constraints, options=FINE)
    if not leg.arrived or distance(leg.end.state, ends[1]) > SAME_STATE:
        return refusal(f"the part after the last snap ends otherwise: {leg.end.kind}")
    return _join_paths([*paths, leg], tuple(snaps), [*way_points, *last], demands, monitor)


@dataclass(frozen=True)
class _Crossing:
    """Corners up to just before a fold, and from a little beyond it on."""

    part: States
    onward: States

    def beyond(self, eset: EquilibriumSet) -> dict[str, float]:
        """Parameters a little beyond the fold."""
        return {name: self.onward[0][name] for name in eset.names}


def _crossing(
    eset: EquilibriumSet, snap: Snap, part: States, onward: States, demands: Demands
) -> _Crossing | None:
    """Straighten the parts before and after a snap, which happens where that costs least.

    First with straight moves from the start or the end of the part before, to the end or the start
    of the part after; then between corners of the straightened parts.
    """
    last = len(onward) - 1
    for i, j in (
        (0, last),
        (0, min(1, last)),
        (len(part) - 1, last),
        (len(part) - 1, min(1, last)),
    ):
        place = cheapest_place(eset, snap, (part[i], onward[j]), demands)
        if place is not None:
            break
    else:
        return None
    parts = part[: i + 1], onward[j:]
    best, least = _join(eset, parts, place), np.inf
    for _ in range(ROUNDS):
        pairs = (parts[0], place.approach.batch), (place.beyond.batch, parts[1])
        ways = [join_states(eset.structure, pair) for pair in pairs]
        before, after = straight_corners(eset, ways, demands)
        spent, owed = _costs_along(before, demands), _costs_along(after, demands)
        m = max(int(np.searchsorted(owed, 0.5 * owed[-1])), 1)
        before_now = least
        for k in np.unique(np.searchsorted(spent[:-1], np.array(SHARES) * spent[-1], "right") - 1):
            ends = before[k], after[m]
            nearer = cheapest_place(eset, snap, ends, replace(demands, closely=True), place)
            if nearer is not None and spent[k] + nearer.cost + owed[-1] - owed[m] < least:
                least = spent[k] + nearer.cost + owed[-1] - owed[m]
                place, parts = nearer, (before[: k + 1], after[m:])
                best = _join(eset, parts, place)
        if least > (1.0 - ENOUGH) * before_now:
            break
    return best


def _join(eset: EquilibriumSet, parts: tuple[States, States], place: SnapPlace) -> _Crossing:
    """Crossing at a place, between the corners before and after it."""
    return _Crossing(
        join_states(eset.structure, (parts[0], place.approach.batch)),
        join_states(eset.structure, (place.beyond.batch, parts[1])),
    )


def _costs_along(way: States, demands: Demands) -> Float[np.ndarray, " corners"]:
    """Costs of straight lifts from the first corner to each."""
    legs = connect(way[:-1], way[1:], replace(demands, closely=True))[1]
    return np.concatenate([[0.0], np.cumsum(legs)])


def _landing(fold: State, gate: Gate) -> Landing | None:
    """Landing of a snap from a fold that lies near that of a gate."""
    landings = [each for each in snap_landing(fold) if each.landed]
    if not landings:
        return None
    return min(landings, key=lambda each: distance(each.state, gate.landing.state))


def _join_paths(
    paths: list[Path],
    snaps: tuple[Landing, ...],
    way_points: Corners,
    demands: Demands,
    monitor: Sequence[Descriptor],
) -> Route:
    """One route of all parts."""
    states = join_states(paths[0].states.structure, [path.states for path in paths])
    index = np.concatenate([path.index for path in paths])
    lengths, ats, before, legs = [], [], 0.0, 0.0
    for path in paths:
        lengths.append(before + path.length)
        ats.append(legs + path.at)
        before, legs = lengths[-1][-1], np.ceil(ats[-1][-1])
    events = tuple(event for path in paths for event in path.events)
    whole = Path(states, np.concatenate(ats), np.concatenate(lengths), index, events)
    margins = np.maximum(states.margin, 0.0)
    told = dict.fromkeys((*(c.descriptor for c in demands.constraints), *monitor))
    schedule = demands.objective.with_times(schedule_of(whole, margins, tuple(told)))
    cost = sum(demands.objective.along(path.states) for path in paths)
    return replace(
        Route("arrived", "", way_points, whole, 0.0, float(before), schedule),
        snaps=snaps,
        objective=str(demands.objective),
        cost=float(cost),
    )
