"""Graphs of numbered nodes: their pieces, and the cheapest paths along links with costs."""

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from equimorph.arrays import Float, Int
from equimorph.linalg.graph_kernels import join_nodes

Pairs = Int[np.ndarray, "links 2"]
Costs = Float[np.ndarray, " links"]
Path = Int[np.ndarray, " stops"]


def components(count: int, pairs: Pairs) -> Int[np.ndarray, " nodes"]:
    """Number of the connected piece that each node belongs to."""
    return np.asarray(join_nodes(count, np.ascontiguousarray(pairs, np.int64)))


def graph_of(count: int, pairs: Pairs, costs: Costs) -> csr_array:
    """Sparse matrix of links with costs, from the first node of each pair to the second."""
    # a cost of zero would be no link in a sparse matrix
    return coo_array((np.maximum(costs, 1e-300), pairs.T), shape=(count, count)).tocsr()


def shortest_path(count: int, pairs: Pairs, costs: Costs, ends: tuple[int, int]) -> Path | None:
    """Cheapest path by Dijkstra from one node to another, over links either way; None if none."""
    start, goal = ends
    graph = graph_of(count, pairs, costs)
    _, before = dijkstra(graph, directed=False, indices=start, return_predecessors=True)
    return walk_back(before, start, goal)


def walk_back(before: Int[np.ndarray, " nodes"], start: int, goal: int) -> Path | None:
    """Path to a goal by the predecessors of all nodes; None if it was not reached."""
    path = [goal]
    while path[-1] != start:
        if before[path[-1]] < 0:
            return None
        path.append(int(before[path[-1]]))
    return np.array(path[::-1])
