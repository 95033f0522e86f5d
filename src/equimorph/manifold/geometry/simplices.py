"""Geometry of simplices in the space of the free parameters, in one to three dimensions."""

from math import factorial

import numpy as np

from equimorph.arrays import Cells, Float, ItemValues, Place, Places
from equimorph.manifold.geometry.kernels import square_sides


def volumes(corners: Float[np.ndarray, "n corners d"]) -> ItemValues:
    """Signed lengths, areas or volumes of d-simplices in d dimensions, with d + 1 corners."""
    sides = corners[:, 1:] - corners[:, :1]
    d = sides.shape[1]
    if d == 1:
        return np.asarray(sides[:, 0, 0])
    if d == 2:
        return np.asarray(0.5 * (sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]))
    normal = np.cross(sides[:, 1], sides[:, 2])
    return np.asarray(np.einsum("ni,ni->n", sides[:, 0], normal) / 6.0)


def middles(
    places: Float[np.ndarray, "V embedding"], cells: Cells
) -> Float[np.ndarray, "C embedding"]:
    """Means of the corners of cells, corner by corner: no array of all corners is made."""
    first, *rest = cells.T
    total = places[first]
    for corner in rest:
        total = total + places[corner]
    return np.asarray(total / cells.shape[1])


def squared_sides(
    places: Float[np.ndarray, "V embedding"], cells: Cells
) -> Float[np.ndarray, "C sides"]:
    """Squared lengths of the sides 01, 02, 12 and so on of cells."""
    corners = cells.shape[1]
    out = np.empty((len(cells), corners * (corners - 1) // 2))
    square_sides(places, np.ascontiguousarray(cells, int), out)
    return out


def longest_sides(
    places: Float[np.ndarray, "V embedding"], cells: Cells
) -> Float[np.ndarray, " C"]:
    """Longest side of each cell from its first corner."""
    first, *rest = squared_sides(places, cells).T[: cells.shape[1] - 1]
    for side in rest:
        first = np.maximum(first, side)
    return np.asarray(np.sqrt(first))


def sizes_of(places: Float[np.ndarray, "V embedding"], cells: Cells) -> Float[np.ndarray, " C"]:
    """Lengths, areas or volumes of cells."""
    squared, d = squared_sides(places, cells), cells.shape[1] - 1
    gram, number = np.empty((len(cells), d, d)), d
    for i in range(d):
        gram[:, i, i] = squared[:, i]
        for j in range(i + 1, d):
            inner = 0.5 * (squared[:, i] + squared[:, j] - squared[:, number])
            gram[:, i, j], gram[:, j, i], number = inner, inner, number + 1
    return np.asarray(np.sqrt(np.maximum(np.linalg.det(gram), 0.0)) / factorial(d))


def barycentric(
    corners: Float[np.ndarray, "n corners d"], point: Place
) -> Float[np.ndarray, "n corners"]:
    """Barycentric coordinates of a point in simplices; −∞ in those without volume."""
    whole, count = volumes(corners), corners.shape[1]
    weights = np.full(corners.shape[:2], -np.inf)
    for k in range(count - 1):
        part = corners.copy()
        part[:, k] = point
        np.divide(volumes(part), whole, out=weights[:, k], where=whole != 0.0)
    weights[:, -1] = np.where(whole != 0.0, 1.0 - weights[:, :-1].sum(axis=1), -np.inf)
    return weights


def shares_in(
    corners: Float[np.ndarray, "n corners d"], places: Places
) -> Float[np.ndarray, "n corners"]:
    """Barycentric coordinates, each place in its own simplex or orthogonally above it."""
    sides = corners[:, 1:] - corners[:, :1]
    inner = np.einsum("nd,ndk->nk", places - corners[:, 0], np.linalg.pinv(sides))
    return np.concatenate([1.0 - inner.sum(axis=1, keepdims=True), inner], axis=1)


def plane_bases(corners: Float[np.ndarray, "n corners d"]) -> Float[np.ndarray, "n k d"]:
    """Orthonormal vectors along simplices in d dimensions: one fewer than these have corners."""
    sides = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    return np.ascontiguousarray(np.swapaxes(np.linalg.qr(sides)[0], 1, 2))
