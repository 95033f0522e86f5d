"""Triangles between curves that meet at small angles, or run close together.

Where folds, constraints, crossings and sides of the box meet, no triangle between them is better
than their corner. And where two eigenvalues nearly vanish together, a fold and a crossing run side
by side over a long way.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.manifold.complex.marked_complex import (
    CURVES,
    ON_CROSSING,
    RIM,
    TRIANGLES,
    Fabric,
    edges_of,
)
from equimorph.manifold.geometry.topology import labels
from equimorph.manifold.refining.smoothing import SHARP
from equimorph.manifold.refining.surgery import angles


def smallest_free_angle(fabric: Fabric) -> float:
    """Smallest angle of triangles that are not squeezed, in degrees; 0 where there are none."""
    if fabric.dimension != TRIANGLES:
        return 0.0
    free = angles(fabric)
    if (fabric.marks & ON_CROSSING).any():
        free = free[~squeezed(fabric, SHARP)]
    return float(np.degrees(free.min(initial=np.inf)))


def corner_angles(fabric: Fabric) -> Float[np.ndarray, "C 3"]:
    """Angle between the curves on both sides of each corner of each triangle; infinite where none.

    All triangles around a vertex up to the next curves on both sides have it in common.
    """
    ends, of_cells = edges_of(fabric.cells, len(fabric.vertices))
    curve = (fabric.edge_marks(ends) & ~RIM) > 0
    count = len(fabric.cells)
    side = of_cells.ravel()
    order = np.argsort(side, kind="stable")
    pair = np.flatnonzero(side[order[1:]] == side[order[:-1]])
    first, second = order[pair], order[pair + 1]
    inside = ~curve[side[first]]
    first, second = first[inside], second[inside]
    links = []
    for end in range(2):
        vertex = ends[side[first], end]
        links.append(
            np.stack([_corner_of(fabric, place, vertex) for place in (first, second)], axis=1)
        )
    sector = labels(3 * count, np.concatenate(links))
    total = np.bincount(sector, weights=_angles(fabric).ravel())
    lone = np.bincount(side, minlength=len(ends)) == 1
    frayed = np.flatnonzero(((~curve & lone)[of_cells]).ravel())
    for end in range(2):
        total[sector[_corner_of(fabric, frayed, ends[side[frayed], end])]] = np.inf
    # full turns around vertices without curves are no corners
    bounded = np.zeros(len(total), bool)
    marked = np.flatnonzero(curve[side])
    for end in range(2):
        bounded[sector[_corner_of(fabric, marked, ends[side[marked], end])]] = True
    return np.asarray(np.where(bounded, total, np.inf)[sector].reshape(count, 3))


def _corner_of(
    fabric: Fabric, sides: Int[np.ndarray, " n"], vertices: Int[np.ndarray, " n"]
) -> Int[np.ndarray, " n"]:
    """Number of the corner, three for each cell, of the cells of sides that a vertex is at."""
    cell = sides // 3
    return np.asarray(3 * cell + (fabric.cells[cell] == vertices[:, None]).argmax(axis=1))


def _angles(fabric: Fabric) -> Float[np.ndarray, "C 3"]:
    """Angles at the corners of triangles, from their squared sides 01, 02, 12."""
    squared = fabric.squared
    out = np.empty_like(squared)
    for corner in range(3):
        opposite = squared[:, 2 - corner]
        one, other = (squared[:, k] for k in range(3) if k != 2 - corner)
        cosine = (one + other - opposite) / np.maximum(2.0 * np.sqrt(one * other), 1e-300)
        out[:, corner] = np.arccos(np.clip(cosine, -1.0, 1.0))
    return out


def squeezed(fabric: Fabric, sharp: float) -> Bool[np.ndarray, " C"]:
    """Triangles that cannot be expected to have no angle smaller than `sharp`.

    Those between curves that meet at less than that, from the corner on as long as all vertices lie
    on curves; and those that lie between a crossing and a fold or a constraint.
    """
    if fabric.dimension != TRIANGLES or len(fabric.cells) == 0:
        return np.zeros(len(fabric.cells), bool)
    corners = fabric.vertex_marks[fabric.cells]
    met = (corners & ON_CROSSING) > 0
    between = ((corners & CURVES) > 0).all(axis=1) & met.any(axis=1) & ~met.all(axis=1)
    start = (corner_angles(fabric) < sharp).any(axis=1)
    if not start.any():
        return np.asarray(between)
    along = ((corners & ~RIM) > 0).all(axis=1) | start
    ends, of_cells = edges_of(fabric.cells, len(fabric.vertices))
    open_side = ((fabric.edge_marks(ends) & ~RIM) == 0)[of_cells] & along[:, None]
    side = np.where(open_side, of_cells, -1).ravel()
    order = np.argsort(side, kind="stable")
    pair = np.flatnonzero((side[order[1:]] == side[order[:-1]]) & (side[order[1:]] >= 0))
    links = np.stack([order[pair], order[pair + 1]], axis=1) // 3
    label = labels(len(fabric.cells), links)
    return np.asarray(between | along & np.isin(label, label[start]))
