"""Edges along which sheets cross are cut in all sheets at once."""

from dataclasses import replace

import numpy as np

from equimorph.arrays import Bool, Int
from equimorph.manifold.complex.marked_complex import Fabric, FacetMark, edges_of
from equimorph.manifold.complex.vertices import Vertices, vertices_of
from equimorph.manifold.geometry.topology import keys_of, runs

Ends = Int[np.ndarray, "_ 2"]
Rows = Int[np.ndarray, " _"]


def crossing_edges(fabric: Fabric) -> tuple[Ends, Rows]:
    """Edges on crossings, of all sheets, in the order of keys that copies of one edge share."""
    facets = fabric.facets[(fabric.marks & FacetMark.CROSSING) > 0]
    if len(facets) == 0 or facets.shape[1] == 1:
        return np.zeros((0, 2), int), np.zeros(0, int)
    ends, _ = edges_of(facets, len(fabric.vertices))
    keys = _keys(fabric, ends)
    order = np.argsort(keys, kind="stable")
    return ends[order], keys[order]


def first_copies(fabric: Fabric, ends: Ends, marks: Rows) -> Bool[np.ndarray, " _"]:
    """Which edges are no copies of earlier ones."""
    out = np.ones(len(ends), bool)
    own = np.flatnonzero((marks & FacetMark.CROSSING) > 0)
    if len(own):
        _, first = np.unique(_keys(fabric, ends[own]), return_index=True)
        out[np.delete(own, first)] = False
    return out


def copies(fabric: Fabric, ends: Ends) -> tuple[Rows, Ends]:
    """Rows of edges on crossings, and the edges of other sheets that are the same."""
    every, keys = crossing_edges(fabric)
    if len(every) == 0:
        return np.zeros(0, int), every
    wanted = _keys(fabric, ends)
    start, stop = (np.searchsorted(keys, wanted, side) for side in ("left", "right"))
    row, at = runs(start, stop - start)
    found = every[at]
    other = (np.sort(ends[row], axis=1) != found).any(axis=1)
    # the same points may be joined by an edge off the crossing
    base = len(fabric.vertices)
    on = np.isin(keys_of(ends, base), keys_of(every, base))[row]
    return row[other & on], found[other & on]


def with_copies(fabric: Fabric, ends: Ends, more: Vertices) -> tuple[Ends, Vertices]:
    """Edges to be cut at vertices, with the copies of those on crossings."""
    row, others = copies(fabric, ends)
    if len(row) == 0:
        return ends, more
    shared = np.full(len(ends), -1)
    met = np.unique(row)
    shared[met] = fabric.vertices.shared.max() + 1 + np.arange(len(met))
    first, second = (fabric.vertices.rows[others[:, side]] for side in range(2))
    plane = first + first @ np.swapaxes(second, 1, 2) @ second
    own = more.take(row)
    known = own.z, own.p, own.kinds, own.index, own.grid_vertex
    new = vertices_of(fabric.setting, *known, plane)
    whole = more.join(new)
    whole = replace(whole, shared=np.concatenate([shared, shared[row]]))
    return np.concatenate([ends, others]), whole


def duplicates(fabric: Fabric) -> Ends:
    """Edges off the crossings between points that other edges join, too."""
    ends, _ = edges_of(fabric.cells, len(fabric.vertices))
    both = (fabric.vertices.shared[ends] >= 0).all(axis=1)
    ends = ends[both]
    keys = _keys(fabric, ends)
    _, inverse, counts = np.unique(keys, return_inverse=True, return_counts=True)
    plain = (fabric.edge_marks(ends) & FacetMark.CROSSING) == 0
    return np.asarray(ends[plain & (counts[inverse] > 1)])


def _keys(fabric: Fabric, ends: Ends) -> Rows:
    """One number for all edges between the same points."""
    shared = fabric.vertices.shared
    return np.asarray(keys_of(shared[ends] + 1, int(shared.max(initial=0)) + 2))
