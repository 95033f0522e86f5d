"""Classes of paths on a surface with holes: integer cocycles, summed up along edges."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from equimorph.arrays import Bool, Edges, Float, Int
from equimorph.manifold.geometry.topology import places_among

Triangles = Int[np.ndarray, "triangles 3"]
Values = Int[np.ndarray, "edges holes"]


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
    surface = _Surface(edges, triangles, sides_of(count, edges, triangles))
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


def sides_of(count: int, edges: Edges, triangles: Triangles) -> Int[np.ndarray, "triangles 3"]:
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
