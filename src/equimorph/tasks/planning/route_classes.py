"""`alternatives`: the best routes that pass the holes of the stable set in different ways.

Integer cocycles of the surface, one for each independent hole, sum up along a path to its class.
Paths of different classes cannot be drawn into each other. (The converse need not hold: sums do not
know the order in which holes are passed.)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, Edges, Float, Int
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.kept_tables import from_cache
from equimorph.manifold.geometry.topology import places_among
from equimorph.model import Constraint, Descriptor
from equimorph.structures import State, States, join_states
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
    route_over_corners,
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
        paths, rough = classes.paths(count + SPARE)
        most = np.sort(rough)[:count].max(initial=0.0)
        paths = [each for each, cost in zip(paths, rough, strict=True) if cost <= UNSURE * most]
        corners = straight_corners(eset, paths, tightened, same_class=True)
        corners = sorted(corners, key=lambda each: chain_cost(each, tightened))[:count]
        routes = [
            route_over_corners(eset, follow_direction(each, ends), demands, monitor)
            for each in corners
        ]
        least = min((route.cost for route in routes if route.arrived), default=np.inf)
        if classes.direct < (1.0 - SHORTER) * least:
            chord = join_states(eset.structure, ends)
            routes.append(route_over_corners(eset, chord, demands, monitor))
        best = max(best, [route for route in routes if route.arrived], key=len)
        failed += routes
        if routes and len(best) == len(routes):
            break
    if not failed:
        return (refusal(explain_no_route(eset, ends, demands)),)
    return tuple(sorted(best, key=lambda route: route.cost)[:count]) or (failed[0],)


Triangles = Int[np.ndarray, "triangles 3"]
Values = Int[np.ndarray, "edges holes"]


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
        first, second, third = _sides(count, edges, triangles).T
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
        allowed = network.admissible(eset, demands)
        self.network, (self.broken, _) = network, network.verdicts(demands)
        self.inner = np.flatnonzero(allowed[network.pairs].all(axis=1))
        pairs = np.sort(network.pairs[self.inner], axis=1)

        triangles = np.sort(network.cells[allowed[network.cells].all(axis=1)], axis=1)

        def values_of() -> Values:
            return cocycles(len(eset.points), pairs, triangles)

        key = "cocycles", demands.constraints, demands.margin
        values = from_cache(eset, key, values_of)
        own, own_costs = end_links(eset, ends, demands)
        own_values, known = _own_values(own, pairs, values, len(eset.points))
        self.direct = float(own_costs[~known].min(initial=np.inf))
        own, own_costs, own_values = own[known], own_costs[known], own_values[known]
        self.across = across = _Diagonals.of(len(eset.points), pairs, triangles, values)
        costs = network.costs(eset, demands.objective)[self.inner]
        first, second = across.pairs.T
        far = demands.objective.costs(eset.points, first, second, ROUGH)
        self.graph = _Graph(
            np.concatenate([pairs, across.pairs, own]),
            np.concatenate([costs, far, own_costs]),
            np.concatenate([values, across.values, own_values]),
        )

    def paths(self, count: int) -> tuple[list[States], Float[np.ndarray, " paths"]]:
        """States along the best paths of up to `count` classes, and costs with cut corners.

        All links can be lifted; diagonals are left over two edges.
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
        graph, nodes = self.graph, len(self.states)
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
            np.array([count, LABELS * count, MOST_TURNS]),
        )
        return [_trace_back(labels, last) for last in found.tolist()]


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


@dataclass(frozen=True)
class _Surface:
    """Sorted edges and triangles, and the edges of each triangle: ab, bc, ac of a < b < c."""

    edges: Edges
    triangles: Triangles
    sides: Int[np.ndarray, "triangles 3"]


def cocycles(count: int, edges: Edges, triangles: Triangles) -> Values:
    """Integer cocycles that span the first cohomology of a surface; of edges from low to high.

    Spanning trees of the vertices and of the triangles with the outside are set to zero and solved
    for [EricksonWhittlesey2005]_; the edges in neither tree generate. Vertices of edges and
    triangles are in growing order; at most two triangles are at an edge.
    """
    surface = _Surface(edges, triangles, _sides(count, edges, triangles))
    tree = _spanning(count, edges)
    parent, depth = _dual_tree(surface, tree)
    determined = np.zeros(len(edges), bool)
    determined[parent[parent >= 0]] = True
    generators = np.flatnonzero(~tree & ~determined)
    values = np.zeros((len(edges), len(generators)), dtype=int)
    values[generators, np.arange(len(generators))] = 1
    # the boundary of each triangle sums to zero, from the leaves of the tree to its roots
    hung = np.flatnonzero(parent >= 0)
    hung = hung[np.argsort(-depth[hung], kind="stable")]
    signs = np.where(surface.sides == parent[:, None], 0, [1, 1, -1])
    sense = np.array([1, 1, -1])[(signs == 0).argmax(axis=1)]
    for level in np.split(hung, np.flatnonzero(np.diff(depth[hung])) + 1):
        total = np.einsum("ts,tsh->th", signs[level], values[surface.sides[level]])
        values[parent[level]] = -sense[level, None] * total
    return values[:, np.abs(values).max(axis=0, initial=0) > 0]


def _sides(count: int, edges: Edges, triangles: Triangles) -> Int[np.ndarray, "triangles 3"]:
    """Edges ab, bc, ac of each triangle a < b < c."""
    sides = np.stack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [0, 2]]], axis=1)
    return places_among(sides.reshape(-1, 2), edges, count).reshape(-1, 3)


def _spanning(count: int, edges: Edges) -> Bool[np.ndarray, " edges"]:
    """Edges of a spanning forest."""
    weights = np.arange(1, len(edges) + 1, dtype=float)
    graph = coo_array((weights, edges.T), shape=(count, count))
    kept = minimum_spanning_tree(graph.tocsr()).data
    tree = np.zeros(len(edges), bool)
    tree[kept.astype(int) - 1] = True
    return tree


def _dual_tree(
    surface: _Surface, tree: Bool[np.ndarray, " edges"]
) -> tuple[Int[np.ndarray, " triangles"], Int[np.ndarray, " triangles"]]:
    """Edge by which each triangle hangs on its parent, or −1; and how deep it hangs."""
    outside = len(surface.triangles)
    owner = np.repeat(np.arange(outside), 3)
    side = surface.sides.ravel()
    order = np.argsort(side, kind="stable")
    side, owner = side[order], owner[order]
    first = np.flatnonzero(np.concatenate([[True], side[1:] != side[:-1]]))
    counts = np.diff(np.append(first, len(side)))
    one = owner[first]
    other = np.where(counts > 1, owner[np.minimum(first + 1, len(owner) - 1)], outside)
    edge = side[first]
    free = ~tree[edge]
    one, other, edge = one[free], other[free], edge[free]
    shape = (outside + 1, outside + 1)
    graph = coo_array((np.ones(len(one)), (one, other)), shape=shape).tocsr()
    keys = one * (outside + 1) + other
    last = np.argsort(keys, kind="stable")
    parent, depth = np.full(outside, -1), np.zeros(outside + 1, int)
    seen = np.zeros(outside + 1, bool)
    for root in (outside, *range(outside)):
        if seen[root]:
            continue
        found, before = breadth_first_order(graph, root, directed=False)
        seen[found] = True
        below = found[1:]
        for triangle, above in zip(below.tolist(), before[below].tolist(), strict=True):
            depth[triangle] = depth[above] + 1
        pair = np.sort(np.stack([below, before[below]]), axis=0)
        at = np.searchsorted(keys[last], pair[0] * (outside + 1) + pair[1], side="right") - 1
        parent[below] = edge[last[at]]
    return parent, depth[:outside]


def signature(
    count: int, edges: Edges, values: Values, path: Int[np.ndarray, " n"]
) -> tuple[int, ...]:
    """Class of a path over edges."""
    steps = np.stack([path[:-1], path[1:]], axis=1)
    places = places_among(steps, edges, count)
    signs: Float[np.ndarray, " n"] = np.where(steps[:, 0] < steps[:, 1], 1, -1)
    return tuple((signs[:, None] * values[places]).sum(axis=0).astype(int).tolist())
