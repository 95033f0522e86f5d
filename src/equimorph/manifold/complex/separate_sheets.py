"""Complexes parted where sheets cross: each part of a sheet gets vertices of its own there.

So every part is a manifold with boundary, and what is the same point of several parts is told by a
number that they share.
"""

import numpy as np
from jaxtyping import Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from equimorph.arrays import Cells
from equimorph.manifold.geometry.topology import adjacency, flags_of


def parted(
    cells: Cells, crossings: Int[np.ndarray, "x d"], count: int
) -> tuple[Cells, Int[np.ndarray, " V"]]:
    """Cells parted at facets on crossings, and for each vertex then the one that it was.

    Cells keep a vertex of a crossing in common as long as facets lead from one to the other around
    it without crossing. The first `count` vertices are those that there were.
    """
    if len(crossings) == 0:
        return cells, np.arange(count)
    corners = cells.shape[1]
    whole = adjacency(cells)
    joined = ~flags_of(whole.facets, crossings)[whole.across]
    links, facets = whole.links[joined], whole.facets[whole.across[joined]]
    same = [cells[own][:, None] == facets[:, :, None] for own in links.T]
    first, second = (
        (own[:, None] * corners + at.argmax(axis=2)).ravel()
        for own, at in zip(links.T, same, strict=True)
    )
    graph = coo_array((np.ones(len(first)), (first, second)), shape=(cells.size, cells.size))
    _, around = connected_components(graph, directed=False)
    met = np.isin(cells.ravel(), crossings)
    # vertices off the crossings stay one, whatever their cells are like
    key = np.where(met, around, -1 - cells.ravel())
    _, first, label = np.unique(key, return_index=True, return_inverse=True)
    origin = cells.ravel()[first]
    order = np.argsort(origin, kind="stable")
    number = np.empty(len(order), int)
    again = np.diff(origin[order], prepend=-1) == 0
    number[order] = np.where(again, count + np.cumsum(again) - 1, origin[order])
    more = origin[order][again]
    return number[label].reshape(cells.shape), np.concatenate([np.arange(count), more])
