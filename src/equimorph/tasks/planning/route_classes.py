"""`alternatives`: the best routes that pass the holes of the stable set in different ways.

Integer cocycles of the surface, one for each independent hole, sum up along a path to its class.
Paths of different classes cannot be drawn into each other. (The converse need not hold: sums do not
know the order in which holes are passed.)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, Edges, Float, Int
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.kept_tables import from_cache
from equimorph.manifold.geometry.topology import places_among
from equimorph.model import Constraint, Descriptor
from equimorph.structures import State, States, join_states
from equimorph.tasks.planning.homology import Triangles, Values, cocycles, sides_of
from equimorph.tasks.planning.kernels import search_classes
from equimorph.tasks.planning.network import (
    Demands,
    Ends,
    end_links,
    explain_no_route,
    network_of,
    nodes_with_ends,
)
from equimorph.tasks.planning.objectives import ROUGH, Wish
from equimorph.tasks.planning.straightening import (
    chain_cost,
    check_ends,
    follow_direction,
    order_ends,
    routes_over_corners,
    straight_corners,
    violation,
)
from equimorph.tasks.route import Route, refusal
from equimorph.tasks.start import check_two_parameters

MOST_TURNS = 2
"""How often a path may pass around one hole."""
SPARE, UNSURE = 6, 1.15
"""Further classes whose best paths over the mesh are straightened, too, and up to which ratio of
costs: ways over edges and diagonals of a grid of squares are too long by up to 8 %, and may come in
another order."""
SLACK = 1.08
"""The same ratio of costs along chords in the search, and along chains with states between."""
LABELS = 8
"""Classes that are kept at a vertex, for each requested route."""

SHORTER = 1e-2
"""Gain of the straight way from start to goal over all routes, relative to these, from which on it
is of a class of its own: else one of them would have become as short."""


@check_arguments
def alternatives(
    eset: EquilibriumSet,
    start: State,
    goal: State,
    count: int = 3,
    *,
    within: Sequence[Constraint] = (),
    margin: float = 0.0,
    objective: Wish = "length",
    monitor: Sequence[Descriptor] = (),
) -> tuple[Route, ...]:
    """Plan several routes that cannot be deformed into each other on the stable, feasible set.

    Dijkstra's algorithm on pairs of a vertex and a class [Bhattacharya2012]_ finds the best path of
    each class over the mesh; it is straightened within its class and verified.

    Parameters
    ----------
    eset
        Equilibrium set over two parameters.
    start
        Stable equilibrium with the set's fixed parameters.
    goal
        Another one.
    count
        Largest number of routes.
    within
        Constraints to obey on the way, in addition to those of the set.
    margin
        Smallest stability margin allowed, in the structure's metric.
    objective
        What each route minimises; see `plan`.
    monitor
        Descriptors to record in the schedules, in addition to those of the constraints.

    Returns
    -------
    Routes of distinct classes, the best first; fewer if there are no more, or one refusal.

    Raises
    ------
    InputError
        As `plan`, or for sets over one or three parameters, or a count below one.
    """
    check_two_parameters(eset)
    demands = Demands.of(eset.structure, objective, (*eset.constraints, *within), margin)
    ends = (start, goal)
    check_ends(eset, ends)
    why = violation(ends, demands)
    if why:
        return (refusal(why),)
    best, failed = list[Route](), list[Route]()
    for tightened in demands.with_reserves(min(end.margin for end in ends)):
        classes = _Classes(eset, order_ends(ends), tightened)
        paths, rough = classes.paths(count)
        most = np.sort(rough)[:count].max(initial=0.0)
        paths = [each for each, cost in zip(paths, rough, strict=True) if cost <= UNSURE * most]
        corners = straight_corners(eset, paths, tightened, best=count)
        chains = [follow_direction(each, ends) for each in corners]
        routes = routes_over_corners(eset, chains, demands, monitor)
        least = min((route.cost for route in routes if route.arrived), default=np.inf)
        if classes.direct < (1.0 - SHORTER) * least:
            chord = join_states(eset.structure, ends)
            routes += routes_over_corners(eset, [chord], demands, monitor)
        best = max(best, [route for route in routes if route.arrived], key=len)
        failed += routes
        if routes and len(best) == len(routes):
            break
    if not failed:
        return (refusal(explain_no_route(eset, ends, demands)),)
    return tuple(sorted(best, key=lambda route: route.cost)[:count]) or (failed[0],)


@dataclass(frozen=True)
class _Graph:
    """Links with costs and the cocycles along them, from the first node to the second."""

    pairs: Edges
    costs: Float[np.ndarray, " links"]
    values: Int[np.ndarray, "links holes"]


@dataclass(frozen=True)
class _Diagonals:
    """Links across edges between two triangles: from the third vertex of one to that of the other.

    They lead over the two edges `over`, which meet at a vertex `via`.
    """

    pairs: Edges
    via: Int[np.ndarray, " diagonals"]
    over: Int[np.ndarray, "diagonals 2"]
    values: Int[np.ndarray, "diagonals holes"]

    @classmethod
    def of(cls, count: int, edges: Edges, triangles: Triangles, values: Values) -> "_Diagonals":
        """Those of a surface; vertices of edges and triangles are in growing order."""
        a, b, c = triangles.T
        first, second, third = sides_of(count, edges, triangles).T
        # from the lower end of each side to the vertex opposite: over which side, and its sign
        side, over = np.concatenate([first, second, third]), np.concatenate([third, first, first])
        low, far = np.concatenate([a, b, a]), np.concatenate([c, a, b])
        sign = np.repeat([1, -1, 1], len(triangles))
        order = np.argsort(side, kind="stable")
        pair = order[:-1][side[order[:-1]] == side[order[1:]]]
        other = order[1:][side[order[:-1]] == side[order[1:]]]
        change = sign[other, None] * values[over[other]] - sign[pair, None] * values[over[pair]]
        back = far[pair] > far[other]
        pairs = np.sort(np.stack([far[pair], far[other]], axis=1), axis=1)
        change[back] *= -1
        return cls(pairs, low[pair], np.stack([over[pair], over[other]], axis=1), change)

    def over_edges(self, path: Int[np.ndarray, " n"], nodes: int) -> Int[np.ndarray, " m"]:
        """A path with the vertices by which its diagonals lead."""
        steps = np.sort(np.stack([path[:-1], path[1:]], axis=1), axis=1)
        at = places_among(steps, self.pairs, nodes)
        some = np.flatnonzero(at >= 0)
        return np.insert(path, some + 1, self.via[at[some]])


class _Classes:
    """Search for the best path of each class.

    `direct` is the cost of the straight way from start to goal where it is no link of the search:
    its class is not known unless both have a common neighbour.
    """

    def __init__(self, eset: EquilibriumSet, ends: Ends, demands: Demands) -> None:
        self.eset, self.ends, self.demands = eset, ends, demands
        self.states = nodes_with_ends(eset, ends)
        network = network_of(eset)
        self.network, (self.broken, _) = network, network.verdicts(demands)
        key = demands.constraints, demands.margin
        self.inner, pairs, values, self.across = from_cache(
            eset, ("cocycles", *key), lambda: _surface_of(eset, demands)
        )

        def costs_of() -> Float[np.ndarray, " links"]:
            costs = network.costs(eset, demands.objective)[self.inner]
            first, second = self.across.pairs.T
            far = demands.objective.costs(eset.points, first, second, ROUGH)
            return np.concatenate([costs, far])

        costs = from_cache(eset, ("costs over cells", *key, demands.objective.key), costs_of)
        own, own_costs = end_links(eset, ends, demands)
        own_values, known = _own_values(own, pairs, values, len(eset.points))
        self.direct = float(own_costs[~known].min(initial=np.inf))
        self.graph = _Graph(
            np.concatenate([pairs, self.across.pairs, own[known]]),
            np.concatenate([costs, own_costs[known]]),
            np.concatenate([values, self.across.values, own_values[known]]),
        )

    def paths(self, count: int) -> tuple[list[States], Float[np.ndarray, " paths"]]:
        """States along the best paths of `count` classes and a few more, if there are so many.

        And costs with cut corners. All links can be lifted; diagonals are left over two edges.
        """
        while True:
            short = self._search(count)
            paths = [self.across.over_edges(path, len(self.states)) for path in short]
            used = self.network.links_of(paths)
            if self.network.lift_links(used, self.states, self.demands):
                costs = [chain_cost(self.states[path], self.demands) for path in short]
                return [self.states[path] for path in paths], np.array(costs)

    def _search(self, count: int) -> list[Int[np.ndarray, " n"]]:
        """Paths of the best classes, by Dijkstra's algorithm on (vertex, class)."""
        graph, nodes, most = self.graph, len(self.states), count + SPARE
        good, broken = np.ones(len(graph.pairs), bool), self.broken[self.inner]
        good[: len(broken)] = ~broken
        good[len(broken) :][: len(self.across.via)] = ~broken[self.across.over].any(axis=1)
        pairs, costs, values = graph.pairs[good], graph.costs[good], graph.values[good]
        both = np.concatenate([pairs, pairs[:, ::-1]])
        order = np.argsort(both[:, 0], kind="stable")
        starts = np.searchsorted(both[order, 0], np.arange(nodes + 1))
        found, labels, _ = search_classes(
            starts,
            np.ascontiguousarray(both[order, 1]),
            np.tile(costs, 2)[order],
            np.concatenate([values, -values])[order],
            np.array([nodes - 2, nodes - 1]),
            np.array([most, LABELS * most, MOST_TURNS, count]),
            SLACK * UNSURE,
        )
        return [_trace_back(labels, last) for last in found.tolist()]


def _surface_of(
    eset: EquilibriumSet, demands: Demands
) -> tuple[Int[np.ndarray, " links"], Edges, Values, _Diagonals]:
    """Links over admissible edges, their ends, cocycles along them, and links across edges."""
    network, count = network_of(eset), len(eset.points)
    allowed = network.admissible(eset, demands)
    inner = np.flatnonzero(allowed[network.pairs].all(axis=1))
    pairs = np.sort(network.pairs[inner], axis=1)
    triangles = np.sort(network.cells[allowed[network.cells].all(axis=1)], axis=1)
    values = cocycles(count, pairs, triangles)
    return inner, pairs, values, _Diagonals.of(count, pairs, triangles, values)


def _trace_back(labels: Int[np.ndarray, "labels 3"], last: int) -> Int[np.ndarray, " n"]:
    """Nodes of the path to a label, given node, class and parent of each."""
    way = []
    while last >= 0:
        node, _, last = labels[last].tolist()
        way.append(node)
    return np.array(way[::-1])


def _own_values(
    own: Int[np.ndarray, "own 2"],
    pairs: Edges,
    values: Int[np.ndarray, "edges holes"],
    count: int,
) -> tuple[Int[np.ndarray, "own holes"], Bool[np.ndarray, " own"]]:
    """Cocycles on the links of start and goal: zero to one neighbour, elsewhere along the mesh.

    That of the link from start to goal is known by way of a common neighbour.
    """
    out = np.zeros((len(own), values.shape[1]), dtype=int)
    for end in (count, count + 1):
        mine = np.flatnonzero((own[:, 0] == end) & (own[:, 1] < count))
        if len(mine) == 0:
            continue
        near = {int(own[k, 1]): int(k) for k in mine}
        inside = np.flatnonzero(np.isin(pairs, list(near)).all(axis=1))
        known, queue = {int(own[mine[0], 1])}, [int(own[mine[0], 1])]
        while queue:
            here = queue.pop()
            for k in inside[(pairs[inside] == here).any(axis=1)]:
                a, b = pairs[k].tolist()
                other, sign = (b, 1) if a == here else (a, -1)
                if other not in known:
                    out[near[other]] = out[near[here]] + sign * values[k]
                    known.add(other)
                    queue.append(other)
    fixed = np.ones(len(own), bool)
    direct = own[:, 1] == count + 1
    first, second = (np.flatnonzero((own[:, 0] == count + end) & ~direct) for end in (0, 1))
    _, a, b = np.intersect1d(own[first, 1], own[second, 1], return_indices=True)
    if len(a):
        out[direct] = out[first[a[0]]] - out[second[b[0]]]
    elif out.shape[1]:
        fixed[direct] = False
    return out, fixed
