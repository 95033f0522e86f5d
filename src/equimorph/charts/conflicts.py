"""Cells that overlap in the parameters, and groups of them that must not share a chart."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, dijkstra, maximum_flow

from equimorph.arrays import Bool, Float, Int, Pairs, VertexNumbers
from equimorph.charts.kernels import overlap_flags
from equimorph.charts.location import Cells
from equimorph.linalg.graphs import graph_of
from equimorph.manifold.geometry.topology import labels
from equimorph.manifold.lookup.cell_index import CellIndex, meeting_boxes

TOUCHING = 1e-7
"""Depth of an overlap, in sizes of cells, up to which cells only touch."""
SHARP = 10_000
"""Capacity of the longest facet: the resolution of lengths in the integer flow problem."""
ENDLESS = 2**30
"""Largest capacity: more would not fit the integer flow problem."""


@dataclass(frozen=True)
class Conflicts:
    """Groups of cells: no two states of different colours may share a chart.

    colour: of each cell, −1 for those that lie alone.
    """

    colour: Int[np.ndarray, " own"]

    @property
    def any(self) -> bool:
        """Whether there are different colours."""
        return bool((self.colour >= 0).any())


def conflicts_of(cells: Cells, cusps: VertexNumbers) -> Conflicts:
    """Colours of cells that lie over other cells, as few as a greedy choice finds."""
    count = len(cells.numbers)
    pairs = overlapping(cells, cusps)
    colour = np.full(count, -1)
    if len(pairs) == 0:
        return Conflicts(colour)
    inside = np.zeros(count, bool)
    inside[pairs] = True
    links = cells.whole.links[inside[cells.whole.links].all(axis=1)]
    group = labels(count, links)
    group = _split(cells, group, pairs, links)
    return Conflicts(np.where(inside, _colour_groups(group, pairs)[group], -1))


def overlapping(cells: Cells, cusps: VertexNumbers) -> Pairs:
    """Pairs of cells without a common vertex, but perhaps a cusp, that lie over each other.

    Over two parameters by separating axes, over three where one holds the middle of the other. A
    sheet goes all the way round its cusp, and its cells on both folds there overlap. Cells turned
    over by chords of curved folds cover nothing.
    """
    plain = np.flatnonzero(cells.turn * np.sign(cells.turn.sum()) > 0.0)
    vertices = cells.corners[plain]
    corners = (cells.values / cells.extent)[vertices]
    if corners.shape[2] == 2:
        pairs, inward = meeting_boxes(corners), _inward(corners)
    else:
        hits = CellIndex.of(corners, np.zeros(len(corners))).near(corners.mean(axis=1))
        pairs = np.stack([hits.point[hits.inside], hits.cell[hits.inside]], axis=1)
        inward = np.zeros((0, 0, 2))
    # cells that have a cusp in common have no other vertex, or they are neighbours
    at_cusp = np.isin(vertices, cusps)
    own = -1 - np.arange(len(vertices))[:, None]
    overlap = overlap_flags(pairs, np.where(at_cusp, own, vertices), corners, inward, TOUCHING)
    return np.asarray(plain[pairs[overlap]])


def _inward(corners: Float[np.ndarray, "C 3 2"]) -> Float[np.ndarray, "C 3 2"]:
    """Normals of the sides of triangles, each from a corner to the next, that point inwards."""
    along = np.roll(corners, -1, axis=1) - corners
    third = np.roll(corners, -2, axis=1) - corners
    normal = np.stack([-along[..., 1], along[..., 0]], axis=2)
    normal /= np.maximum(np.hypot(normal[..., 0], normal[..., 1])[..., None], 1e-300)
    return np.asarray(normal * np.sign((normal * third).sum(axis=2))[..., None])


def _split(
    cells: Cells, group: Int[np.ndarray, " own"], pairs: Pairs, links: Int[np.ndarray, "m 2"]
) -> Int[np.ndarray, " own"]:
    """Groups that lie over themselves are parted between the ends of their longest overlap."""
    middle = cells.values[cells.corners].mean(axis=1)
    while True:
        own = np.flatnonzero(group[pairs[:, 0]] == group[pairs[:, 1]])
        if len(own) == 0:
            return group
        which = group[pairs[own[0], 0]]
        mine = pairs[own[group[pairs[own, 0]] == which]]
        inner = links[(group[links] == which).all(axis=1)]
        length = np.linalg.norm(middle[inner[:, 0]] - middle[inner[:, 1]], axis=1)
        graph = graph_of(len(group), inner, length)
        some = mine[np.linspace(0, len(mine) - 1, min(len(mine), 16)).astype(int)]
        far = dijkstra(graph, directed=False, indices=some[:, 0])
        apart = far[np.arange(len(some)), some[:, 1]]
        best = int(np.argmax(np.where(np.isfinite(apart), apart, -1.0)))
        ends = dijkstra(graph, directed=False, indices=some[best])
        group = np.where((group == which) & (ends[1] < ends[0]), group.max() + 1, group)


def _colour_groups(group: Int[np.ndarray, " own"], pairs: Pairs) -> np.ndarray:
    """Colour of each group: the least that no group over or under it has, the largest first."""
    edges = np.unique(np.sort(group[pairs], axis=1), axis=0)
    size = np.bincount(group)
    colour = np.full(len(size), -1)
    for own in sorted(np.unique(edges).tolist(), key=lambda k: -size[k]):
        others = np.concatenate([edges[edges[:, 0] == own, 1], edges[edges[:, 1] == own, 0]])
        taken = set(colour[others].tolist())
        colour[own] = next(k for k in range(len(taken) + 1) if k not in taken)
    return colour


def least_cut(
    cells: Cells, first: Bool[np.ndarray, " own"], second: Bool[np.ndarray, " own"]
) -> Bool[np.ndarray, " own"]:
    """Cells on the first one's side of the shortest cut between two groups of cells.

    The least cut of the dual graph, with the sizes of facets in scaled parameters as capacities.
    Each group is one of its nodes.
    """
    whole, middle = cells.whole, ~(first | second)
    size = facet_sizes(cells)[whole.across]
    capacity = np.maximum(1, np.round(SHARP * size / max(size.max(), 1e-300)))
    source, sink, count = 0, 1, 2 + int(middle.sum())
    node = np.where(second, sink, source)
    node[middle] = np.arange(2, count)
    ends = node[whole.links]
    apart = ends[:, 0] != ends[:, 1]
    a, b = ends[apart].T
    rows, columns = np.concatenate([a, b]), np.concatenate([b, a])
    graph = coo_array((np.tile(capacity[apart], 2), (rows, columns)), shape=(count, count)).tocsr()
    graph.data = np.minimum(graph.data, ENDLESS)
    graph = graph.astype(np.int32)
    left = graph - maximum_flow(graph, source, sink).flow
    left.data = np.maximum(left.data, 0)
    left.eliminate_zeros()
    side = np.zeros(count, bool)
    side[breadth_first_order(left, source, return_predecessors=False)] = True
    return side[node]


def facet_sizes(cells: Cells) -> Float[np.ndarray, " F"]:
    """Lengths or areas of facets in scaled coordinates; one for points."""
    scales = cells.coordinates.setting.scales
    at = cells.values[cells.whole.facets] / scales
    sides = at[:, 1:] - at[:, :1]
    if sides.shape[1] == 0:
        return np.ones(len(at))
    gram = sides @ np.swapaxes(sides, 1, 2)
    share = 1.0 if sides.shape[1] == 1 else 0.5
    return np.asarray(share * np.sqrt(np.maximum(np.linalg.det(gram), 0.0)))
