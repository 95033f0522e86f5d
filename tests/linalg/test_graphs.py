"""Least cuts of graphs, against the maximum flow of scipy."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from equimorph.linalg.graph_kernels import side_of_least_cut


@pytest.mark.parametrize("seed", range(12))
def test_the_side_of_a_least_cut_is_what_no_maximum_flow_fills(seed):
    """Scipy's maximum flow and what its residual graph reaches: the smallest side, if several.

    Random graphs with multiple links, isolated nodes and, for every third, small capacities, for
    which least cuts are seldom the only ones.
    """
    generator = np.random.default_rng(seed)
    count = 12 + 8 * seed
    links = generator.integers(0, count, (3 * count, 2))
    links = links[np.abs(links[:, 0] - links[:, 1]) % (count - 6) < 7]
    links = np.ascontiguousarray(links[links[:, 0] != links[:, 1]])
    capacity = generator.integers(1, 3 if seed % 3 == 0 else 10_000, len(links))
    first, second = np.zeros(count, bool), np.zeros(count, bool)
    first[: 1 + seed % 3], second[-1 - seed % 2 :] = True, True
    node = np.where(first, 0, np.where(second, 1, 2 + np.arange(count)))
    a, b = node[links].T
    both = np.concatenate([a, b]), np.concatenate([b, a])
    graph = coo_array((np.tile(capacity, 2), both), shape=(count + 2,) * 2).tocsr().astype(np.int32)
    graph.setdiag(0)
    left = graph - maximum_flow(graph, 0, 1).flow
    left.eliminate_zeros()
    side = np.zeros(count + 2, bool)
    side[breadth_first_order(left, 0, return_predecessors=False)] = True
    found = side_of_least_cut(links, capacity, first, second)
    np.testing.assert_array_equal(found, side[node])
    assert not found[second].any()
