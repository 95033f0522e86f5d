"""Sets whose sheets cross, as manifolds: cut along their crossings.

There each part of a sheet has vertices of its own.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Int

from equimorph.manifold import EquilibriumSet
from equimorph.manifold.complex.separate_sheets import parted
from equimorph.manifold.geometry.points import CROSSING
from equimorph.manifold.geometry.topology import Adjacency, adjacency, flags_of, pieces


def uncrossed(eset: EquilibriumSet) -> EquilibriumSet:
    """A set cut along its crossings, which are boundaries of its parts then; others as they are."""
    if not eset.crossings:
        return eset
    crossings, folds = (_facets(curves, len(eset.names)) for curves in (eset.crossings, eset.folds))
    cells, origin = parted(eset.cells, crossings, len(eset.points))
    whole = adjacency(cells)
    folded = whole.facets[flags_of(np.sort(origin[whole.facets], axis=1), folds)]
    return replace(
        eset,
        points=eset.points[origin],
        kinds=eset.kinds[origin],
        index=eset.index[origin],
        grid_vertex=eset.grid_vertex[origin],
        cells=cells,
        folds=tuple(pieces(folded)),
        crossings=(),
    )


def at_crossings(eset: EquilibriumSet, whole: Adjacency) -> Bool[np.ndarray, " F"]:
    """Facets at which a set that `uncrossed` cut ends where other sheets cross."""
    met = (eset.kinds == CROSSING)[whole.facets].all(axis=1)
    return np.asarray(met & (whole.counts == 1) & ~_on_box(eset, whole.facets))


def first_copies(eset: EquilibriumSet) -> Int[np.ndarray, " V"]:
    """For each vertex the first one that is the same state."""
    own = np.arange(len(eset.points))
    met = np.flatnonzero(eset.kinds == CROSSING)
    if len(met):
        rows = np.concatenate([eset.points.z[met], eset.points.p[met]], axis=1)
        _, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        own[met] = met[first[inverse.ravel()]]
    return own


def _on_box(eset: EquilibriumSet, facets: Int[np.ndarray, "n d"]) -> Bool[np.ndarray, " n"]:
    """Whether facets lie on a side of the box; points in one dimension never do."""
    size = eset.box.upper - eset.box.lower
    places, out = eset.coordinates[facets], np.zeros(len(facets), bool)
    for bound in (eset.box.lower, eset.box.upper):
        out |= (np.abs(places - bound) <= 1e-9 * size).all(axis=1).any(axis=1)
    return out


def _facets(curves: tuple[Int[np.ndarray, "..."], ...], d: int) -> Int[np.ndarray, "n d"]:
    parts = [np.stack([c[:-1], c[1:]], axis=1) if d == 2 else c.reshape(-1, d) for c in curves]
    return np.concatenate([np.zeros((0, d), int), *parts])
