"""Edges of cells between whose ends a page holds a state, so that its pictures follow the set."""

import numpy as np

from equimorph.arrays import Values
from equimorph.explorer.pictures import FIDELITY, size_of
from equimorph.manifold import EdgeMiddles, EquilibriumSet, edge_middles

_AT_ONCE = 8192
"""Edges whose shapes are computed together."""


def curved_edges(eset: EquilibriumSet) -> EdgeMiddles:
    """Edges whose middle is elsewhere than the mean of its ends, by more than `FIDELITY`.

    That is a share of the size of the structure, or of the box of parameters.
    """
    middles, size = edge_middles(eset), size_of(eset.points)
    starts = range(0, len(middles.ends), _AT_ONCE)
    bends = [_bends(eset, middles, slice(first, first + _AT_ONCE)) for first in starts]
    places = middles.states.p[:, eset.setting.free] - eset.coordinates[middles.ends].mean(axis=1)
    moved = np.abs(places / (eset.box.upper - eset.box.lower)).max(axis=1, initial=0.0)
    bent = np.maximum(np.concatenate([np.zeros(0), *bends]) / size, moved) > FIDELITY
    return EdgeMiddles(middles.ends[bent], middles.states[bent])


def _bends(eset: EquilibriumSet, middles: EdgeMiddles, some: slice) -> Values:
    """How far, at most, a point of a shape is from the mean of where it is at both ends."""
    first, second = (eset.points[end].shape() for end in middles.ends[some].T)
    gap = middles.states[some].shape() - 0.5 * (first + second)
    return np.asarray(np.linalg.norm(gap, axis=2).max(axis=1))
