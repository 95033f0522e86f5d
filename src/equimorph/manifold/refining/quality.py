"""Quality of triangles and tetrahedra: their smallest angle, and whether they are upright.

Angles are measured in the embedding: at the corners of triangles, between the faces of tetrahedra.
An upright cell projects onto the parameters as the parity of its index demands, and looks the same
way as the cells around it in the tangent spaces at its corners. Tetrahedra that are steep against
these count less. See docs/decisions.md, "One rule for refills".

No triangle between two curves (folds, constraints, crossings, sides of the box) is better than the
corner at which these meet. And where two eigenvalues nearly vanish together, a fold and a crossing
run side by side over a long way. Such triangles are called squeezed.
"""

from itertools import combinations

import numpy as np

from equimorph.arrays import Bool, CellFlags, Cells, Float, Int, Items, VertexFlags
from equimorph.manifold.complex.marked_complex import (
    CURVES,
    TRIANGLES,
    Fabric,
    FacetMark,
    edges_of,
)
from equimorph.manifold.complex.vertices import Vertices
from equimorph.manifold.geometry.simplices import squared_sides
from equimorph.manifold.geometry.topology import count_corners, labels
from equimorph.manifold.refining.kernels import see_volumes

SHARP = np.radians(10.0)
"""Smallest angle that every cell should have at least."""
POOR = {2: np.radians(20.0), 3: np.radians(18.0)}
"""Cells with a smaller angle are made better if possible, by the dimension of the cells."""
OVERTURNED = {2: 0.0, 3: 0.1}
"""Factor on the angle of cells that project against their index; tetrahedra at folds may do so."""

Angles = Float[np.ndarray, " cells"]
Indices = Int[np.ndarray, " cells"]
Sides = Float[np.ndarray, "cells sides"]
"""Squared lengths of the sides 01, 02, 12 and so on."""


def smallest_angles(squared: Sides) -> Angles:
    """Smallest angle of triangles (three sides), or dihedral angle of tetrahedra (six)."""
    if squared.shape[1] > 3:
        return _smallest_dihedrals(squared)
    # column by column: reductions over rows of a few numbers cost several times as much
    a, b, c = squared.T
    total = a + b + c
    area = total**2 - 2.0 * (a**2 + b**2 + c**2)
    four_areas = np.sqrt(np.maximum(area, 1e-28 * total**2))
    cotangent = (total - 2.0 * np.minimum(np.minimum(a, b), c)) / four_areas
    return np.asarray(np.arctan2(1.0, cotangent))


def _smallest_dihedrals(squared: Float[np.ndarray, "cells 6"]) -> Angles:
    """Smallest dihedral angles, from the products of the gradients of barycentric coordinates.

    These are cofactors of the products of the sides from corner 0.
    """
    a, b, c, ab, ac, bc = squared.T
    x, y, z = 0.5 * (a + b - ab), 0.5 * (a + c - ac), 0.5 * (b + c - bc)
    # gradients 1, 2, 3; that of corner 0 is minus their sum
    products = {
        (1, 1): b * c - z * z, (2, 2): a * c - y * y, (3, 3): a * b - x * x,
        (1, 2): y * z - x * c, (1, 3): x * z - y * b, (2, 3): x * y - z * a,
    }  # fmt: skip
    for k in (1, 2, 3):
        own = (products[min(k, other), max(k, other)] for other in (1, 2, 3))
        products[0, k] = -np.asarray(sum(own))
    products[0, 0] = -(products[0, 1] + products[0, 2] + products[0, 3])
    size = [1.0 / np.sqrt(np.maximum(products[k, k], 1e-300)) for k in range(4)]
    largest = np.full(len(squared), -1.0)
    for i, j in combinations(range(4), 2):
        np.maximum(largest, -products[i, j] * size[i] * size[j], out=largest)
    return np.asarray(np.arccos(np.clip(largest, -1.0, 1.0)))


def _volumes(squared: Float[np.ndarray, "cells 6"]) -> Float[np.ndarray, " cells"]:
    """Volumes, times 3!, of tetrahedra: from the products of the sides from corner 0."""
    a, b, c, ab, ac, bc = squared.T
    x, y, z = 0.5 * (a + b - ab), 0.5 * (a + c - ac), 0.5 * (b + c - bc)
    gram = a * (b * c - z * z) - x * (x * c - z * y) + y * (x * z - b * y)
    return np.asarray(np.sqrt(np.maximum(gram, 1e-300)))


def qualities(vertices: Vertices, cells: Cells, index: Indices) -> Angles:
    """Smallest angle of each cell; less if it is not upright.

    Of tetrahedra it is multiplied by the cosine of the largest angle between the cell and the
    tangent space at a corner. Little or nothing is left of it if the cell is overturned. Each
    corner at which it is turned takes π: there its volume in the tangent space is not positive.
    """
    d, squared = cells.shape[1] - 1, squared_sides(vertices.place, cells)
    seen = volumes_at_corners(vertices, cells)
    factor = np.where(project_against_index(vertices, cells, index), OVERTURNED[d], 1.0)
    if d > TRIANGLES:
        cosine = seen.min(axis=1) / _volumes(squared)
        factor *= np.where(cosine > 0.0, np.minimum(cosine, 1.0), 1.0)
    turned = (seen <= 0.0).sum(axis=1)
    return np.asarray(factor * smallest_angles(squared) - np.pi * turned)


def qualities_near(fabric: Fabric, near: VertexFlags) -> Angles:
    """Qualities of the cells around those with a corner near; infinite for the others.

    Triangles are turned here where they are so on average over their corners.
    """
    beside = np.zeros_like(near)
    beside[fabric.cells[count_corners(near, fabric.cells) > 0]] = True
    own = count_corners(beside, fabric.cells) > 0
    cells, index, out = fabric.cells[own], fabric.cell_index[own], np.full(len(own), np.inf)
    if fabric.dimension > TRIANGLES:
        out[own] = qualities(fabric.vertices, cells, index)
        return out
    angle = smallest_angles(fabric.squared[own])
    over = np.where(project_against_index(fabric.vertices, cells, index), OVERTURNED[2], 1.0)
    out[own] = over * angle - np.pi * fabric.looks_back(cells)
    return out


def project_against_index(
    vertices: Vertices, cells: Cells, index: Indices
) -> Bool[np.ndarray, " cells"]:
    """Whether cells project against the parity of their index."""
    flat = vertices.place[:, 1 - cells.shape[1] :]
    if len(cells) > len(flat):
        flat = np.ascontiguousarray(flat)
    sides = flat[cells[:, 1:]] - flat[cells[:, :1]]
    return np.asarray(determinants(sides) * np.where(index % 2 == 0, 1.0, -1.0) < 0.0)


def volumes_at_corners(vertices: Vertices, cells: Cells) -> Float[np.ndarray, "cells corners"]:
    """Volumes, times d!, of cells as projected onto the tangent spaces at their corners."""
    out = np.empty(cells.shape)
    see_volumes(vertices.place, vertices.rows, np.ascontiguousarray(cells), out)
    return out


def determinants(sides: Float[np.ndarray, "cells d d"]) -> Angles:
    """Determinants of two or three vectors each."""
    if sides.shape[1] == 2:
        return np.asarray(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    a, b, c = sides[:, 0], sides[:, 1], sides[:, 2]
    return np.asarray(
        a[:, 0] * (b[:, 1] * c[:, 2] - b[:, 2] * c[:, 1])
        + a[:, 1] * (b[:, 2] * c[:, 0] - b[:, 0] * c[:, 2])
        + a[:, 2] * (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])
    )


def worst(quality: Angles, row: Indices, count: int) -> Float[np.ndarray, " rows"]:
    """Worth of groups of cells: the worst quality of each, at most π/2; row: group of each cell.

    Where some are turned, the qualities of these add up.
    """
    least = np.full(count, 0.5 * np.pi)
    np.minimum.at(least, row, quality)
    total = np.bincount(row, weights=np.minimum(quality, 0.0), minlength=count)
    return np.where(least < 0.0, total, least)


def smallest_angle(fabric: Fabric) -> float:
    """Smallest angle of all triangles, in degrees; 0 where there are none."""
    if fabric.dimension < TRIANGLES:
        return 0.0
    if fabric.dimension == TRIANGLES:
        return float(np.degrees(smallest_angles(fabric.squared).min(initial=np.inf)))
    chosen = combinations(range(fabric.cells.shape[1]), 3)
    sides = (squared_sides(fabric.vertices.place, fabric.cells[:, list(each)]) for each in chosen)
    return float(np.degrees(min(smallest_angles(own).min(initial=np.inf) for own in sides)))


def smallest_dihedral(fabric: Fabric) -> float:
    """Smallest dihedral angle of all tetrahedra, in degrees; 0 where there are none."""
    if fabric.dimension <= TRIANGLES:
        return 0.0
    return float(np.degrees(smallest_angles(fabric.squared).min(initial=np.pi)))


def smallest_free_angle(fabric: Fabric) -> float:
    """Smallest angle of triangles that are not squeezed, in degrees; 0 where there are none."""
    if fabric.dimension != TRIANGLES:
        return 0.0
    free = smallest_angles(fabric.squared)
    if (fabric.marks & FacetMark.CROSSING).any():
        free = free[~confined_angles(fabric, SHARP)]
    return float(np.degrees(free.min(initial=np.inf)))


def corner_angles(fabric: Fabric) -> Float[np.ndarray, "C 3"]:
    """Angle between the curves on both sides of each corner of each triangle; infinite where none.

    All triangles around a vertex up to the next curves on both sides have it in common.
    """
    ends, of_cells = edges_of(fabric.cells, len(fabric.vertices))
    curve = (fabric.edge_marks(ends) & ~FacetMark.RIM) > 0
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
    total = np.bincount(sector, weights=_corner_angles(fabric).ravel())
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


def _corner_of(fabric: Fabric, sides: Items, vertices: Items) -> Items:
    """Number of the corner, three for each cell, of the cells of sides that a vertex is at."""
    cell = sides // 3
    return np.asarray(3 * cell + (fabric.cells[cell] == vertices[:, None]).argmax(axis=1))


def _corner_angles(fabric: Fabric) -> Float[np.ndarray, "C 3"]:
    """Angles at the corners of triangles, from their squared sides 01, 02, 12."""
    squared = fabric.squared
    out = np.empty_like(squared)
    for corner in range(3):
        opposite = squared[:, 2 - corner]
        one, other = (squared[:, k] for k in range(3) if k != 2 - corner)
        cosine = (one + other - opposite) / np.maximum(2.0 * np.sqrt(one * other), 1e-300)
        out[:, corner] = np.arccos(np.clip(cosine, -1.0, 1.0))
    return out


def confined_angles(fabric: Fabric, sharp: float) -> CellFlags:
    """Triangles that cannot be expected to have no angle smaller than `sharp`.

    Those between curves that meet at less than that, from the corner on as long as all vertices lie
    on curves; and those that lie between a crossing and a fold or a constraint.
    """
    if fabric.dimension != TRIANGLES or len(fabric.cells) == 0:
        return np.zeros(len(fabric.cells), bool)
    corners = fabric.vertex_marks[fabric.cells]
    met = (corners & FacetMark.CROSSING) > 0
    between = ((corners & CURVES) > 0).all(axis=1) & met.any(axis=1) & ~met.all(axis=1)
    start = (corner_angles(fabric) < sharp).any(axis=1)
    if not start.any():
        return np.asarray(between)
    along = ((corners & ~FacetMark.RIM) > 0).all(axis=1) | start
    ends, of_cells = edges_of(fabric.cells, len(fabric.vertices))
    open_side = ((fabric.edge_marks(ends) & ~FacetMark.RIM) == 0)[of_cells] & along[:, None]
    side = np.where(open_side, of_cells, -1).ravel()
    order = np.argsort(side, kind="stable")
    pair = np.flatnonzero((side[order[1:]] == side[order[:-1]]) & (side[order[1:]] >= 0))
    links = np.stack([order[pair], order[pair + 1]], axis=1) // 3
    label = labels(len(fabric.cells), links)
    return np.asarray(between | along & np.isin(label, label[start]))
