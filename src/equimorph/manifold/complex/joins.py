"""Vertices of a complex that are joined to one, and what becomes of its cells and facets."""

from dataclasses import replace

import numpy as np

from equimorph.arrays import Facets, Int, ItemFlags, Pairs, VertexNumbers
from equimorph.linalg.graphs import components
from equimorph.manifold.complex.description import Complex
from equimorph.manifold.geometry.topology import adjacency, flags_of


def groups_of(pairs: Pairs, count: int) -> list[Int[np.ndarray, "_ 2"]]:
    """Pairs of vertices that hang together."""
    label = components(count, pairs)
    own = label[pairs[:, 0]]
    return [pairs[own == each] for each in np.unique(own)]


def _one_of_same(same: Pairs, rank: VertexNumbers) -> VertexNumbers:
    """For each vertex the one that stands for it, of the highest rank."""
    label = components(len(rank), same)
    order = np.argsort(-rank, kind="stable")
    _, first = np.unique(label[order], return_index=True)
    return np.asarray(order[first][label])


def joined(whole: Complex, same: Pairs, rank: VertexNumbers) -> Complex:
    """Cells in which vertices that are the same point are one, that of the highest rank.

    Two cells with the same vertices then lie on one another and vanish; what they leave between
    cells of different index is a fold.
    """
    if len(same) == 0:
        return whole
    one = _one_of_same(same, rank)
    cells, index = one[whole.cells], whole.cell_index
    kept = _distinct(cells)
    _, label, counts = np.unique(
        np.sort(cells, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    double = kept & (counts == 2)[label]
    gone, cells, index = cells[double], cells[kept & ~double], index[kept & ~double]
    known = adjacency(cells)
    between = known.across[index[known.links[:, 0]] != index[known.links[:, 1]]]
    left = known.facets[between]
    left = left[
        flags_of(left, np.concatenate([np.delete(gone, k, axis=1) for k in range(gone.shape[1])]))
    ]
    used, numbered = np.unique(cells, return_inverse=True)
    number = np.full(len(one), -1)
    number[used] = np.arange(len(used))
    marked = {name: one[getattr(whole, name)] for name in ("folds", "caps", "crossings")}
    marked["folds"] = np.concatenate([marked["folds"], left])
    marked = {name: number[facets[_distinct(facets)]] for name, facets in marked.items()}
    marked = {name: facets[(facets >= 0).all(axis=1)] for name, facets in marked.items()}
    columns = {name: getattr(whole, name)[used] for name in ("kinds", "index", "grid_vertex")}
    return replace(
        whole, points=whole.points[used], **columns, cells=numbered.reshape(cells.shape),
        cell_index=index, **marked,
    )  # fmt: skip


def _distinct(rows: Facets) -> ItemFlags:
    """Which rows have no vertex twice."""
    ordered = np.sort(rows, axis=1)
    return np.asarray((ordered[:, 1:] != ordered[:, :-1]).all(axis=1))
