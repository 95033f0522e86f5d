"""Routes that may snap, at a price: over the edges of the stability boundary to where they land."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from equimorph.equilibria import Landing, Path, lift, snap_landing
from equimorph.manifold import EquilibriumSet, snap_graph
from equimorph.model import Descriptor
from equimorph.structures import State, States
from equimorph.tasks.distances import distance
from equimorph.tasks.planning.network import (
    Demands,
    Ends,
    end_links,
    neighbours,
    network_of,
    nodes_with_ends,
    on_paths,
    walk_back,
)
from equimorph.tasks.planning.straightening import (
    route_over_corners,
    straight_corners,
    way_points_of,
)
from equimorph.tasks.route import FINE, Corners, Route, refusal, schedule_of
from equimorph.tasks.stable_part import from_cache
from equimorph.tolerances import SAME_STATE

SAMPLES = 9
"""Points of each fold whose snaps are followed to where they land."""
BEYOND = 0.02
"""How far beyond the fold the parameters go, in their scales, so that the structure does snap."""


@dataclass(frozen=True)
class Gate:
    """A place where stability can be lost on purpose.

    Parameters
    ----------
    source
        Stable vertex next to the fold.
    fold
        The fold, as it lies in the set.
    landing
        Where the snap leads.
    """

    source: int
    fold: State
    landing: Landing


@dataclass(frozen=True)
class SnapPath:
    """States of each stable part of a path, and the numbers of the gates between them."""

    stable: list[States]
    gates: list[int]


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
                gates.append(Gate(int(beside[0]), eset.points[vertex], landing))
    return gates


def route_with_snaps(
    eset: EquilibriumSet,
    ends: Ends,
    demands: Demands,
    price: float,
    monitor: Sequence[Descriptor],
) -> Route:
    """Cheapest route on which every snap costs `price`, verified piece by piece."""
    search = _Search(eset, ends, demands, price)
    tried = 0
    while True:
        path = search.path()
        if path is None:
            return refusal("not even by snaps does the goal lie on a piece that can be reached")
        route = _verify(eset, ends, path, demands, monitor)
        tried += 1
        if route.arrived:
            return replace(route, cost=route.cost + price * len(route.snaps))
        if not path.gates or tried > len(search.gates):
            return route
        search.close(path.gates)


class _Search:
    """The network with one-way links through the gates."""

    def __init__(self, eset: EquilibriumSet, ends: Ends, demands: Demands, price: float) -> None:
        self.eset, self.demands, self.price = eset, demands, price
        self.network = network_of(eset)
        self.gates = gates_of(eset, demands)
        states = nodes_with_ends(eset, ends)
        landed = [gate.landing.state for gate in self.gates]
        self.states = States(
            eset.structure,
            np.concatenate([states.z, *(state.z[None] for state in landed)]),
            np.concatenate([states.p, *(state.p[None] for state in landed)]),
        )
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
        """Do not use gates again."""
        self.closed.update(gates)

    def path(self) -> SnapPath | None:
        """The cheapest path all of whose links can be lifted; None if no such path exists."""
        network = self.network
        allowed = network.admissible(self.eset, self.demands)[network.pairs].all(axis=1)
        broken, _ = network.verdicts(self.demands)
        costs = network.costs(self.eset, self.demands.objective)
        while True:
            inner = np.flatnonzero(allowed & ~broken)
            both = np.concatenate([network.pairs[inner], self.own])
            path = self._cheapest(both, np.concatenate([costs[inner], self.own_costs]))
            if path is None:
                return None
            used = inner[on_paths(network.pairs[inner], [path])]
            if network.lift_links(used, self.states, self.demands):
                return self._divide_at_snaps(path)

    def _cheapest(
        self, both: Int[np.ndarray, "links 2"], weights: Float[np.ndarray, " links"]
    ) -> Int[np.ndarray, " n"] | None:
        open_gates = [k for k in range(len(self.gates)) if k not in self.closed]
        sources = np.array([self.gates[k].source for k in open_gates], dtype=int)
        targets = np.array([self.first + k for k in open_gates], dtype=int)
        rows = np.concatenate([both[:, 0], both[:, 1], sources])
        columns = np.concatenate([both[:, 1], both[:, 0], targets])
        costs = np.concatenate([weights, weights, np.full(len(sources), self.price)])
        shape = (len(self.states), len(self.states))
        # of links given twice, like that from start to goal, sparse matrices would add the costs
        graph = coo_array((np.maximum(costs, 1e-300), (rows, columns)), shape=shape).tocsr()
        start, goal = self.first - 2, self.first - 1
        _, before = dijkstra(graph, indices=start, return_predecessors=True)
        return walk_back(before, start, goal)

    def _divide_at_snaps(self, path: Int[np.ndarray, " n"]) -> SnapPath:
        """Parts of a path between its snaps."""
        sources = {gate.source for gate in self.gates}
        cuts = [
            k + 1
            for k, (a, b) in enumerate(pairwise(path.tolist()))
            if b >= self.first and a < self.first and a in sources and self._is_snap(a, b)
        ]
        parts = np.split(path, cuts)
        return SnapPath(
            [self.states[part] for part in parts], [int(p[0]) - self.first for p in parts[1:]]
        )

    def _is_snap(self, a: int, b: int) -> bool:
        gate = self.gates[b - self.first]
        linked = ((self.own[:, 0] == b) & (self.own[:, 1] == a)).any()
        return gate.source == a and not linked


def _verify(
    eset: EquilibriumSet,
    ends: Ends,
    path: SnapPath,
    demands: Demands,
    monitor: Sequence[Descriptor],
) -> Route:
    """Lift every part finely; snaps start from where the lifts meet the folds."""
    stable, numbers = path.stable, path.gates
    if not numbers:
        return route_over_corners(
            eset, straight_corners(eset, stable[0], demands), demands, monitor
        )
    gates = gates_of(eset, demands)
    here, paths, snaps = ends[0], list[Path](), list[Landing]()
    corners, way_points = Corners(), Corners()
    for part, number in zip(stable[:-1], numbers, strict=True):
        gate = gates[number]
        beyond = _beyond(eset, part[-1], gate.fold)
        if beyond is None:
            return refusal("the parameters beyond a fold lie outside the box")
        corners = [*corners, *_corners(eset, part, demands), beyond]
        leg = lift(here, corners, within=demands.constraints, options=FINE)
        way_points += corners
        if leg.end.kind not in ("fold", "branch point"):
            return refusal(f"a part meant to end in a snap ends otherwise: {leg.end.kind}")
        landing = _landing(leg.end.state, gate)
        if landing is None:
            return refusal("a snap does not land where it does from the set")
        paths.append(leg)
        snaps.append(landing)
        here, corners = landing.state, [beyond]
    last = [*corners, *_corners(eset, stable[-1], demands)]
    leg = lift(here, last, within=demands.constraints, options=FINE)
    if not leg.arrived or distance(leg.end.state, ends[1]) > SAME_STATE:
        return refusal(f"the part after the last snap ends otherwise: {leg.end.kind}")
    return _join_paths([*paths, leg], tuple(snaps), [*way_points, *last], demands, monitor)


def _corners(eset: EquilibriumSet, part: States, demands: Demands) -> Corners:
    return way_points_of(eset, straight_corners(eset, part, demands)) if len(part) > 1 else []


def _beyond(eset: EquilibriumSet, before: State, fold: State) -> dict[str, float] | None:
    """Parameters a little beyond a fold, seen from a state before it."""
    step = (fold.p - before.p) / eset.structure.scales
    size = float(np.linalg.norm(step))
    p = fold.p + BEYOND * step / max(size, 1e-300) * eset.structure.scales
    beyond = {name: float(p[k]) for k, name in enumerate(fold.parameters) if name in eset.names}
    inside = eset.box.holds(np.array([beyond[name] for name in eset.names]))
    return beyond if bool(inside) else None


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
    structure = paths[0].states.structure
    z = np.concatenate([path.states.z for path in paths])
    p = np.concatenate([path.states.p for path in paths])
    index = np.concatenate([path.index for path in paths])
    lengths, ats, before, legs = [], [], 0.0, 0.0
    for path in paths:
        lengths.append(before + path.length)
        ats.append(legs + path.at)
        before, legs = lengths[-1][-1], np.ceil(ats[-1][-1])
    events = tuple(event for path in paths for event in path.events)
    states = States(structure, z, p)
    whole = Path(states, np.concatenate(ats), np.concatenate(lengths), index, events)
    margins = np.maximum(states.margin, 0.0)
    told = dict.fromkeys((*(c.descriptor for c in demands.constraints), *monitor))
    schedule = schedule_of(whole, margins, tuple(told))
    cost = sum(demands.objective.along(path.states) for path in paths)
    return replace(
        Route("arrived", "", way_points, whole, 0.0, float(before), schedule),
        snaps=snaps,
        objective=str(demands.objective),
        cost=float(cost),
    )
