"""Closed pieces of a set that are one: a state on a straight way from one to the other.

An island that is longer than wide may pass a side of cells without meeting its edges. On both sides
of it the polygons close, and its parts look like closed pieces.

See docs/decisions.md, "Determinants lead to islands inside cells".
"""

from itertools import combinations

import numpy as np

from equimorph.arrays import Int, Items
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.geometry.points import are_singular
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.lookup.exact_states import lift_to
from equimorph.structures import States
from equimorph.structures.metric import metric_length

SAME = 1e-6
"""Distance in the metric below which states are one."""


def between_pieces(eset: EquilibriumSet) -> States:
    """States half-way between small closed pieces, where straight ways lead between these.

    Pieces are small that are no longer than a grid cell along any parameter.
    """
    start, end = _nearest(eset, _small(eset)).T
    structure, points, constraints = eset.structure, eset.points, eset.constraints
    z, which = lift_to(points[start], points.p[end], constraints)
    joined = which[metric_length(structure, z - points.z[end[which]]) < SAME]
    middle = 0.5 * (points.p[start[joined]] + points.p[end[joined]])
    z, which = lift_to(points[start[joined]], middle, constraints)
    return States(structure, z, middle[which])


def _small(eset: EquilibriumSet) -> list[Items]:
    """Vertices of small closed pieces."""
    closed = np.flatnonzero([piece.loops == 0 for piece in eset.components])
    if len(closed) == 0 or len(eset.names) == 1:
        return []
    piece = np.array([stratum.component for stratum in eset.strata])[eset.stratum]
    size = (eset.box.upper - eset.box.lower) / np.array(eset.intervals)
    vertices = [np.unique(eset.cells[piece == number]) for number in closed]
    return [own for own in vertices if (np.ptp(eset.coordinates[own], axis=0) <= size).all()]


def _nearest(eset: EquilibriumSet, pieces: list[Items]) -> Int[np.ndarray, "pairs 2"]:
    """Nearest regular vertices with one index of every two pieces, for each index."""
    pairs = []
    place = embed(eset.setting, eset.points.z, eset.points.p)
    regular = ~are_singular(eset.kinds)
    for one, other in combinations([own[regular[own]] for own in pieces], 2):
        for index in np.intersect1d(eset.index[one], eset.index[other]):
            first, second = (own[eset.index[own] == index] for own in (one, other))
            gap = np.linalg.norm(place[first][:, None] - place[second], axis=2)
            a, b = np.unravel_index(gap.argmin(), gap.shape)
            pairs.append((first[a], second[b]))
    return np.array(pairs, int).reshape(-1, 2)
