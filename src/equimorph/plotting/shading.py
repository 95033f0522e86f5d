"""Colour and light of a surface seen through a depth buffer, pixel by pixel."""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Bool, Float, Int
from equimorph.plotting.depth import DepthBuffer, View, slopes
from equimorph.plotting.raster_kernels import edges_of_depth, paint_pixels

Corners = Float[np.ndarray, "cells 3 3"]

# Direction to the light in the frame of the viewer: right, up, towards the viewer.
_LIGHT = np.array([-0.50, 0.55, 0.67])
# Halfway between light and viewer: what faces it is glossy.
_HALFWAY = np.array([-0.27, 0.30, 0.915])
_LINE, _OUTLINE = 0.35, 0.4
"""Widths of grid lines and outlines, in typographic points."""
_EDGE = 0.03
"""Step in depth, as a share of the scene, that is an edge of what is in front."""
_STEEPER = 3.0
"""Multiple of the slope next to a pixel by which the depth may change without an outline."""


@dataclass(frozen=True)
class Paint:
    """How a surface is painted."""

    normals: Corners
    """Unit normals at the corners of the triangles, in the proportions that are drawn."""
    proportions: Float[np.ndarray, " 3"]
    """Factors from the coordinates of the axes to the proportions that are drawn."""
    colours: Float[np.ndarray, "cells 3"]
    """Red, green and blue of each triangle in full light."""
    spacing: tuple[float, ...]
    """Thin lines run over the surface where its first coordinates are multiples of these."""
    ink: Float[np.ndarray, " 3"]
    """Red, green and blue of the thin lines and of the outlines."""


def corner_normals(
    corners: Corners,
    cells: Int[np.ndarray, "cells 3"],
    index: Int[np.ndarray, " cells"],
    sharp: Int[np.ndarray, " some"] | None = None,
) -> Corners:
    """Unit normals at the corners of the cells, averaged over all cells around a vertex.

    Crossing a fold changes the index by one and turns the projection over, so the normal whose
    vertical component has the sign (−1)^index is continuous across folds: no search for a coherent
    orientation is needed. Weighted by the angles of the cells, in the proportions that are drawn,
    as their shapes should not matter. At sharp vertices, where several sheets meet, every cell
    keeps its own normal.
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
    smooth = _unit(total)[cells]
    if sharp is None or len(sharp) == 0:
        return np.asarray(smooth)
    return np.where(np.isin(cells, sharp)[:, :, None], normals[:, None], smooth)


def paint(
    buffer: DepthBuffer, view: View, corners: Corners, surface: Paint
) -> Float[np.ndarray, "rows columns 4"]:
    """Red, green, blue and cover of every pixel.

    Normals and coordinates are interpolated on each triangle, so shading is smooth, and lines on
    the surface are as fine on large triangles as on small ones. The corners are in the coordinates
    of the axes, the buffer is that of the view.
    """
    places = view.place(corners)
    normals = _unit(surface.normals @ (view.linear / surface.proportions[:, None])) * [1, 1, -1]
    ruled = corners[..., : len(surface.spacing)] / np.array(surface.spacing)
    fields = np.concatenate([normals, ruled], axis=2)
    slope = slopes(places, fields)
    flat = np.ascontiguousarray(np.concatenate([fields[:, :1], slope], axis=1))
    width = _LINE * view.point * np.linalg.norm(slope[..., 3:], axis=1)
    picture = np.zeros((*buffer.owner.shape, 4), np.float32)
    colours, ink = (np.ascontiguousarray(each, float) for each in (surface.colours, surface.ink))
    paint_pixels(
        buffer.owner, places[:, 0, :2].copy(), flat, width, colours, _LIGHT, _HALFWAY, ink, picture
    )
    picture[outlines(buffer.depth, max(1, round(_OUTLINE * view.point))), :3] = surface.ink
    return picture


def outlines(
    depth: Float[np.ndarray, "rows columns"], width: int
) -> Bool[np.ndarray, "rows columns"]:
    """Pixels of the surface within `width` of where it ends or hides what is far behind it."""
    known = depth[np.isfinite(depth)]
    step = _EDGE * float(np.ptp(known)) if len(known) else 0.0
    return np.asarray(edges_of_depth(depth, width, step, _STEEPER))


def _unit(vectors: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    """Vectors of length 1; zero stays zero."""
    return np.asarray(
        vectors / np.maximum(np.sqrt((vectors**2).sum(axis=-1, keepdims=True)), 1e-30)
    )
