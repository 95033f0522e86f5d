"""Closed pieces of a set that belong to others: states on straight ways from one to the other.

An island that is longer than wide may pass a side of cells without meeting its edges. On both sides
of it the polygons close, and its parts look like closed pieces.

See docs/decisions.md, "Determinants lead to islands inside cells".
"""

from collections.abc import Iterator

import numpy as np

from equimorph.arrays import Float, ItemFlags, Items
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.geometry.points import are_singular
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.lookup.exact_states import lift_to
from equimorph.structures import States
from equimorph.structures.metric import metric_length

SAME = 1e-6
"""Distance in the metric below which states are one."""


def between_pieces(eset: EquilibriumSet) -> States:
    """States half-way from small closed pieces to others, where straight ways lead to these.

    Pieces are small that are no longer than a grid cell along any parameter.
    """
    size = (eset.box.upper - eset.box.lower) / np.array(eset.intervals)
    pairs = np.array(list(_nearest(eset, size)), int).reshape(-1, 2)
    (start, end), structure, points = pairs.T, eset.structure, eset.points
    z, which = lift_to(points[start], points.p[end], eset.constraints)
    joined = which[metric_length(structure, z - points.z[end[which]]) < SAME]
    middle = 0.5 * (points.p[start[joined]] + points.p[end[joined]])
    z, which = lift_to(points[start[joined]], middle, eset.constraints)
    return States(structure, z, middle[which])


def _nearest(eset: EquilibriumSet, size: Float[np.ndarray, " d"]) -> Iterator[tuple[int, int]]:
    """Nearest regular vertices with one index of small closed pieces and others around them."""
    closed = np.flatnonzero([piece.loops == 0 for piece in eset.components])
    if len(closed) == 0 or len(eset.names) == 1:
        return
    piece = _pieces(eset)
    place = embed(eset.setting, eset.points.z, eset.points.p)
    regular = ~are_singular(eset.kinds)
    for number in closed.tolist():
        own = piece == number
        low, high = (bound(eset.coordinates[own], axis=0) for bound in (np.min, np.max))
        if (high - low > size).any():
            continue
        near = ((eset.coordinates > low - size) & (eset.coordinates < high + size)).all(axis=1)
        for other in np.unique(piece[near & regular & ~own]).tolist():
            yield from _pairs(eset.index, place, own & regular, near & regular & (piece == other))


def _pieces(eset: EquilibriumSet) -> Items:
    """Number of the piece that each vertex belongs to."""
    of_cell = np.array([stratum.component for stratum in eset.strata])[eset.stratum]
    piece = np.full(len(eset.kinds), -1)
    piece[eset.cells] = of_cell[:, None]
    return piece


def _pairs(
    index: Items, place: Float[np.ndarray, "n coordinates"], one: ItemFlags, other: ItemFlags
) -> Iterator[tuple[int, int]]:
    """Nearest two of one and other points, for each index of both."""
    for each in np.intersect1d(index[one], index[other]).tolist():
        first, second = (np.flatnonzero(own & (index == each)) for own in (one, other))
        gap = np.linalg.norm(place[first][:, None] - place[second], axis=2)
        a, b = np.unravel_index(gap.argmin(), gap.shape)
        yield int(first[a]), int(second[b])
