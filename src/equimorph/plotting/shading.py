"""Light on the triangles of an equilibrium surface."""

import numpy as np
from jaxtyping import Float, Int

Corners = Float[np.ndarray, "cells 3 3"]
# The four quarters of a triangle, from its corners 0, 1, 2 and the middles 3, 4, 5 opposite them.
_QUARTERS = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2], [3, 4, 5]])
_AMBIENT = 0.6
# Direction to the light in the frame of the viewer: right, towards the viewer, up.
_LIGHT = np.array([-0.45, 0.55, 0.70]) / np.linalg.norm([-0.45, 0.55, 0.70])


def corner_normals(
    corners: Corners, cells: Int[np.ndarray, "cells 3"], index: Int[np.ndarray, " cells"]
) -> Corners:
    """Unit normals at the corners of the cells, averaged over all cells around a vertex.

    Crossing a fold changes the index by one and turns the projection over, so the normal whose
    vertical component has the sign (−1)^index is continuous across folds: no search for a coherent
    orientation is needed. Weighted by the angles of the cells, as their shapes should not matter.

    Parameters
    ----------
    corners
        Corners of the cells, in the coordinates that are drawn.
    cells
        Vertex numbers of the corners.
    index
        Index of the cells.
    """
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    upward = np.where(index % 2 == 0, 1.0, -1.0)
    normals *= np.where(normals[:, 2] * upward < 0, -1.0, 1.0)[:, None]
    normals = _unit(normals)
    total = np.zeros((int(cells.max(initial=0)) + 1, 3))
    for k in range(3):
        one, two = (_unit(corners[:, (k + j) % 3] - corners[:, k]) for j in (1, 2))
        angle = np.arccos(np.clip((one * two).sum(axis=1), -1.0, 1.0))
        np.add.at(total, cells[:, k], angle[:, None] * normals)
    return np.asarray(_unit(total)[cells])


def brightness(
    normals: Float[np.ndarray, "cells 3 3"], elevation: float, azimuth: float
) -> Float[np.ndarray, " cells"]:
    """Brightness of cells, 1 where they face the light; both sides of the surface are lit alike.

    Parameters
    ----------
    normals
        Unit normals at the corners, see `corner_normals`.
    elevation, azimuth
        Direction to the viewer in degrees.
    """
    up, around = np.radians([elevation, azimuth])
    viewer = np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
    right = np.array([-np.sin(around), np.cos(around), 0.0])
    light = _LIGHT @ np.stack([right, viewer, np.cross(viewer, right)])
    mean = _unit(normals.sum(axis=1))
    facing = np.where(mean @ viewer < 0, -1.0, 1.0)
    return np.asarray(_AMBIENT + (1 - _AMBIENT) * np.clip(facing * (mean @ light), 0.0, 1.0))


def split_long(
    corners: Corners, normals: Corners, longest: float
) -> tuple[
    Float[np.ndarray, "pieces 3 3"], Float[np.ndarray, "pieces 3 3"], Int[np.ndarray, " pieces"]
]:
    """Quarter triangles until no edge is longer than `longest`; normals are interpolated.

    Short pieces shade smoothly and sort well by depth. They stay in the planes of their cells, so
    no gaps open between neighbours of different size.

    Returns
    -------
    Corners and normals of the pieces, and the cell of each.
    """
    owner = np.arange(len(corners))
    done: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    while len(owner):
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        long = edges.max(axis=1) > longest
        done.append((corners[~long], normals[~long], owner[~long]))
        corners, normals = _quarters(corners[long]), _quarters(normals[long])
        owner = np.repeat(owner[long], 4)
    pieces, piece_normals, owners = zip(*done, strict=True)
    return np.concatenate(pieces), np.concatenate(piece_normals), np.concatenate(owners)


def _quarters(values: Corners) -> Float[np.ndarray, "pieces 3 3"]:
    """Values at the corners of the four quarters of each triangle, linear in between."""
    middles = 0.5 * (values[:, [1, 2, 0]] + values[:, [2, 0, 1]])
    return np.concatenate([values, middles], axis=1)[:, _QUARTERS].reshape(-1, 3, 3)


def _unit(vectors: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Vectors of length 1; zero stays zero."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300))
