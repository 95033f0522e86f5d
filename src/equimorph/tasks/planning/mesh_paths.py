"""Cheap paths over the network of a set, whose every link can be lifted."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from equimorph.arrays import Float, Int, Values
from equimorph.linalg.graphs import graph_of, walk_back
from equimorph.manifold import EquilibriumSet
from equimorph.structures import States
from equimorph.structures.metric import metric_places
from equimorph.tasks.planning.network import (
    Demands,
    Ends,
    Pairs,
    end_links,
    network_of,
    nodes_with_ends,
)

DETOUR, APART = 0.1, 0.15
"""Part by which another path over the mesh may be longer, and its distance in such parts."""


def cheapest_path(eset: EquilibriumSet, ends: Ends, demands: Demands) -> States | None:
    """States of the cheapest path over the network whose every link can be lifted.

    Links are lifted only when a path uses them; what was found is remembered.
    """
    return next(cheap_paths(eset, ends, demands), None)


def cheap_paths(eset: EquilibriumSet, ends: Ends, demands: Demands) -> Iterator[States]:
    """Cheapest path over the network, then cheap ones that lie apart from all before, if any.

    The cheapest paths over single vertices are those of two trees, from start and goal. Of vertices
    farther than a share of the length from the paths before, that with the cheapest path is next.
    """
    network = network_of(eset)
    allowed = network.admissible(eset, demands)[network.pairs].all(axis=1)
    broken, _ = network.verdicts(demands)
    costs = network.costs(eset, demands.objective)
    states, (own, own_costs) = nodes_with_ends(eset, ends), end_links(eset, ends, demands)
    before, trees, best = list[States](), None, np.inf
    while True:
        if trees is None:
            inner = np.flatnonzero(allowed & ~broken)
            pairs = np.concatenate([network.pairs[inner], own])
            trees = _Trees.of(len(states), pairs, np.concatenate([costs[inner], own_costs]))
        middle = trees.cheapest(states, before, best)
        if middle is None:
            return
        path = trees.path(middle)
        if not network.lift_links(network.links_of([path]), states, demands):
            trees = None
            continue
        best = min(best, trees.over[middle])
        before.append(states[path])
        yield states[path]


@dataclass(frozen=True)
class _Trees:
    """Cheapest paths from start and goal, the last two nodes, to all others."""

    cost: Float[np.ndarray, "2 nodes"]
    before: Int[np.ndarray, "2 nodes"]

    @classmethod
    def of(cls, count: int, pairs: Pairs, costs: Values) -> "_Trees":
        graph, ends = graph_of(count, pairs, costs), [count - 2, count - 1]
        return cls(*dijkstra(graph, directed=False, indices=ends, return_predecessors=True))

    @cached_property
    def over(self) -> Values:
        """Costs of the cheapest paths over each node."""
        return np.asarray(self.cost.sum(axis=0))

    def cheapest(self, states: States, before: list[States], best: float) -> int | None:
        """Node with the cheapest path over it, of those that lie apart from given paths."""
        near = np.flatnonzero(self.over <= (1.0 + DETOUR) * best)
        near = near[np.isfinite(self.over[near])]
        structure = states.structure
        place = metric_places(structure, states.z[near], states.p[near])
        for path in before:
            apart = cKDTree(metric_places(structure, path.z, path.p)).query(place)[0] > APART * best
            near, place = near[apart], place[apart]
        return int(near[self.over[near].argmin()]) if len(near) else None

    def path(self, middle: int) -> Int[np.ndarray, " n"]:
        """Cheapest path over a node."""
        count = self.cost.shape[1]
        there, back = (
            walk_back(before, end, middle)
            for before, end in zip(self.before, (count - 2, count - 1), strict=True)
        )
        assert there is not None
        assert back is not None
        return np.concatenate([there, back[-2::-1]])
