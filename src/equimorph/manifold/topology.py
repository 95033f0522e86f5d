"""Topology of a triangulated surface: edges, components, strata, loops, orientation."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from equimorph.manifold.kernels import orient

Pairs = Int[np.ndarray, "n 2"]


@dataclass(frozen=True)
class Surface:
    """Edges of a triangulation and how cells hang together across them.

    edges (E, 2) with their cell counts; cell_edges (C, 3); neighbours: pairs of cells that share
    an edge of exactly two cells, with that edge.
    """

    edges: Int[np.ndarray, "E 2"]
    counts: Int[np.ndarray, " E"]
    cell_edges: Int[np.ndarray, "C 3"]
    neighbours: Int[np.ndarray, "N 2"]
    shared: Int[np.ndarray, " N"]


def surface(cells: Int[np.ndarray, "C 3"]) -> Surface:
    """Edges and adjacency of triangles."""
    pairs = np.stack([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]], 1).reshape(-1, 2)
    base = int(cells.max(initial=0)) + 1
    keys, inverse, counts = np.unique(
        pairs.min(axis=1) * base + pairs.max(axis=1), return_inverse=True, return_counts=True
    )
    edges = np.stack(np.divmod(keys, base), axis=1)
    order = np.argsort(inverse, kind="stable")
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    twice = np.flatnonzero(counts == 2)
    neighbours = np.stack([order[first[twice]] // 3, order[first[twice] + 1] // 3], axis=1)
    return Surface(edges, counts, inverse.reshape(-1, 3), neighbours, twice)


def flags_of(edges: Int[np.ndarray, "E 2"], chosen: set[tuple[int, int]]) -> Bool[np.ndarray, " E"]:
    """Which of the edges are among the chosen pairs (low, high)."""
    if not chosen:
        return np.zeros(len(edges), bool)
    base = int(edges.max()) + 1
    keys = np.array([a * base + b for a, b in chosen if a < base and b < base], dtype=np.int64)
    return np.isin(edges[:, 0].astype(np.int64) * base + edges[:, 1], keys)


def labels(
    cells: int, neighbours: Pairs, across: Bool[np.ndarray, " N"] | None = None
) -> Int[np.ndarray, " C"]:
    """Connected pieces of cells, over shared edges (those in `across` only), largest first."""
    links = neighbours if across is None else neighbours[across]
    graph = coo_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(cells, cells))
    _, label = connected_components(graph, directed=False)
    sizes = np.bincount(label)
    rank = np.empty(len(sizes), int)
    rank[np.argsort(-sizes, kind="stable")] = np.arange(len(sizes))
    return np.asarray(rank[label])


def euler_characteristic(cells: Int[np.ndarray, "C 3"]) -> int:
    """Vertices − edges + cells."""
    whole = surface(cells)
    return len(np.unique(cells)) - len(whole.edges) + len(cells)


def chains(pairs: Pairs) -> list[Int[np.ndarray, " vertices"]]:
    """Polylines along edges, split where other than two meet; closed ones repeat the start."""
    if len(pairs) == 0:
        return []
    around: dict[int, list[int]] = {}
    for number, (a, b) in enumerate(pairs.tolist()):
        around.setdefault(a, []).append(number)
        around.setdefault(b, []).append(number)
    used = np.zeros(len(pairs), bool)
    out = []
    starts = [v for v, edges in around.items() if len(edges) != 2]
    for start in [*starts, *around]:
        for number in around[start]:
            if used[number] or (start not in starts and used[around[start][0]]):
                continue
            line, at, edge = [start], start, number
            while True:
                used[edge] = True
                a, b = pairs[edge]
                at = int(b if at == a else a)
                line.append(at)
                onward = [e for e in around[at] if not used[e]]
                if len(around[at]) != 2 or not onward:
                    break
                edge = onward[0]
            out.append(np.array(line))
    return out


def orientation(cells: Int[np.ndarray, "C 3"], whole: Surface) -> tuple[Int[np.ndarray, " C"], int]:
    """Signs that orient all cells coherently, and the number of contradictions."""
    count = len(cells)
    a, b = whole.neighbours.T
    coherent = _runs_forward(cells, whole, a) != _runs_forward(cells, whole, b)
    sign = np.where(coherent, 1, -1)
    both = np.concatenate([np.stack([a, b, sign], 1), np.stack([b, a, sign], 1)])
    both = both[np.argsort(both[:, 0], kind="stable")]
    starts = np.concatenate([[0], np.cumsum(np.bincount(both[:, 0], minlength=count))])
    signs = np.zeros(count, np.int64)
    columns = [np.ascontiguousarray(both[:, k]) for k in (1, 2)]
    return signs, int(orient(count, starts, columns[0], columns[1], signs)) // 2


def _runs_forward(
    cells: Int[np.ndarray, "C 3"], whole: Surface, cell: Int[np.ndarray, " N"]
) -> Bool[np.ndarray, " N"]:
    """Whether the shared edge runs from its lower to its higher vertex in the cell's order."""
    low, high = whole.edges[whole.shared].T
    corners = cells[cell]
    at_low = (corners == low[:, None]).argmax(axis=1)
    return np.asarray(corners[np.arange(len(cell)), (at_low + 1) % 3] == high)


def projected_area(
    coordinates: Float[np.ndarray, "V 2"], cells: Int[np.ndarray, "C 3"]
) -> Float[np.ndarray, " C"]:
    """Signed areas of the cells over the plane of the free parameters."""
    a, b, c = (coordinates[cells[:, k]] for k in range(3))
    return np.asarray(0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]))
