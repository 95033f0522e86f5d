"""Vertices around which cells are no ball, nor half of one, and folds that touch sides, which may.

See docs/decisions.md, "Vertices have discs or spheres around them".
"""

import numpy as np

from equimorph.arrays import Cells, VertexFlags, VertexNumbers
from equimorph.manifold.geometry.points import VertexKind, on_fold
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.geometry.tangents import fold_forms
from equimorph.manifold.geometry.topology import PAIR, Adjacency, faces_of
from equimorph.model import Box
from equimorph.structures import States

ON_SIDE = 1e-9
"""Distance from a side, in widths of the box, of vertices that lie on it."""
TOUCHING = 1e-4
"""Part of the slope of a fold along a side where it touches it: points of it nearby are as far from
there as the root of their distance from the side."""


def count_pinched(
    setting: Setting,
    box: Box,
    points: States,
    kinds: VertexNumbers,
    cells: Cells,
    whole: Adjacency,
) -> int:
    """Pinched vertices where neither sheets cross nor a fold touches the box; see `touch_sides`."""
    pinched = pinched_vertices(cells, whole, len(points))
    pinched = pinched[kinds[pinched] != VertexKind.CROSSING]
    own = pinched[on_fold(kinds[pinched])]
    return len(pinched) - int(touch_sides(setting, box, points[own]).sum())


def pinched_vertices(cells: Cells, whole: Adjacency, vertices: int) -> VertexNumbers:
    """Vertices around which cells are no ball, nor half of one; over curves facets tell.

    The link of such a vertex, what is opposite to it in its cells, is no sphere, or no disc: its
    Euler characteristic, (−1)^k faces of k corners at the vertex added up, tells. So do voids that
    no cell fills, which touch the boundary in their corners.
    """
    corners = cells.shape[1]
    if corners == PAIR:
        return np.zeros(0, int)
    link, rim = np.zeros(vertices, int), np.zeros(vertices, bool)
    for k in range(2, corners + 1):
        faces = cells if k == corners else whole.facets if k == corners - 1 else faces_of(cells, k)
        link += (-1) ** k * np.bincount(faces.ravel(), None, vertices)
    rim[whole.facets[whole.counts == 1]] = True
    used = np.bincount(cells.ravel(), None, vertices) > 0
    return np.flatnonzero(used & (link != np.where(rim, 1, 1 + (-1) ** corners)))


def touch_sides(setting: Setting, box: Box, points: States) -> VertexFlags:
    """At which points on sides folds touch the box: in a side, an edge or a corner.

    From outside, two sheets have but such a point in common, and from inside, two parts of one may.
    There the slope of φᵀF_p vanishes along the side, and has one sign along all ways inwards.
    """
    place, slack = points.p[:, setting.free], ON_SIDE * (box.upper - box.lower)
    inwards = (place <= box.lower + slack).astype(float) - (place >= box.upper - slack)
    slope = fold_forms(setting, points.z, points.p).slope if len(points) else inwards
    size = TOUCHING * np.linalg.norm(slope, axis=1, keepdims=True)
    along = (np.abs(slope) > size) & (inwards == 0.0)
    rises, falls = slope * inwards > size, slope * inwards < -size
    one_way = ~(rises.any(axis=1) & falls.any(axis=1))
    return np.asarray(one_way & ~along.any(axis=1) & (inwards != 0.0).any(axis=1))
