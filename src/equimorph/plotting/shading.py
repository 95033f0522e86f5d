"""Colour and light of a surface seen through a depth buffer, pixel by pixel."""

from dataclasses import dataclass

import numpy as np

from equimorph.array_types import Bool, Float, Int
from equimorph.plotting.depth import DepthBuffer, View, slopes

Corners = Float[np.ndarray, "cells 3 3"]

# Direction to the light in the frame of the viewer: right, up, towards the viewer.
_LIGHT = np.array([-0.50, 0.55, 0.67])
# Halfway between light and viewer: what faces it is glossy.
_HALFWAY = np.array([-0.27, 0.30, 0.915])
_AMBIENT, _GLOSS, _SHININESS = 0.42, 0.18, 10
"""Brightness away from the light, strength of highlights, and their exponent (Phong)."""
_LINE, _OUTLINE = 0.35, 0.4
"""Widths of grid lines and outlines, in typographic points."""
_LINE_OPACITY = 0.25
"""Opacity of grid lines where they are not crowded."""
_CROWDED = 8.0
"""Lines on the surface fade where fewer than this many of their widths lie between them."""
_EDGE = 0.03
"""Step in depth, as a share of the scene, that is an edge of what is in front."""
_STEEPER = 3.0
"""Multiple of the slope next to a pixel by which the depth may change without an outline."""
_BATCH = 400_000
"""Pixels that are painted at a time: this bounds the memory."""


@dataclass(frozen=True)
class Paint:
    """How a surface is painted.

    Attributes
    ----------
    normals
        Unit normals at the corners of the triangles, in the proportions that are drawn.
    proportions
        Factors from the coordinates of the axes to the proportions that are drawn.
    colours
        Red, green and blue of each triangle in full light.
    spacing
        Thin lines run over the surface where its first coordinates are multiples of these.
    ink
        Red, green and blue of the thin lines and of the outlines.
    """

    normals: Corners
    proportions: Float[np.ndarray, " 3"]
    colours: Float[np.ndarray, "cells 3"]
    spacing: tuple[float, ...]
    ink: Float[np.ndarray, " 3"]


def corner_normals(
    corners: Corners,
    cells: Int[np.ndarray, "cells 3"],
    index: Int[np.ndarray, " cells"],
    sharp: Int[np.ndarray, " some"] | None = None,
) -> Corners:
    """Unit normals at the corners of the cells, averaged over all cells around a vertex.

    Crossing a fold changes the index by one and turns the projection over, so the normal whose
    vertical component has the sign (−1)^index is continuous across folds: no search for a coherent
    orientation is needed. Weighted by the angles of the cells, as their shapes should not matter.

    Parameters
    ----------
    corners
        Corners of the cells, in the proportions that are drawn.
    cells
        Vertex numbers of the corners.
    index
        Index of the cells.
    sharp
        Vertices at which every cell keeps its own normal, because several sheets meet there.
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


def lit(
    colours: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 3"]:
    """Colours of pieces of surface in the light: matt, with a soft gloss; both sides alike.

    Parameters
    ----------
    colours
        Red, green and blue in full light.
    normals
        Unit normals in the frame of the viewer: right, up, towards the viewer.
    """
    facing = np.where(normals[:, 2:] < 0, -normals, normals)
    matt = 0.5 + 0.5 * (facing @ _LIGHT.astype(facing.dtype))[:, None]
    gloss = np.maximum(facing @ _HALFWAY.astype(facing.dtype), 0.0)[:, None] ** _SHININESS
    shaded = colours * (_AMBIENT + (1 - _AMBIENT) * matt)
    return np.asarray(shaded + _GLOSS * gloss * (1.0 - shaded))


def paint(
    buffer: DepthBuffer, view: View, corners: Corners, surface: Paint
) -> Float[np.ndarray, "rows columns 4"]:
    """Red, green, blue and cover of every pixel.

    Normals and coordinates are interpolated on each triangle, so shading is smooth, and lines on
    the surface are as fine on large triangles as on small ones.

    Parameters
    ----------
    buffer
        What is seen where.
    view
        The view that the buffer was made for.
    corners
        Corners of the triangles in the coordinates of the axes.
    surface
        How they are painted.
    """
    places = view.place(corners)
    normals = _unit(surface.normals @ (view.linear / surface.proportions[:, None])) * [1, 1, -1]
    ruled = corners[..., : len(surface.spacing)] / np.array(surface.spacing)
    fields = np.concatenate([normals, ruled], axis=2)
    slope = slopes(places, fields)
    # Numbers of half the length are exact to a thousandth of a colour, and twice as fast.
    flat = np.concatenate([fields[:, 0], slope[:, 0], slope[:, 1]], axis=1).astype(np.float32)
    width = (_LINE * view.point * np.linalg.norm(slope[..., 3:], axis=1)).astype(np.float32)
    colours, ink = surface.colours.astype(np.float32), surface.ink.astype(np.float32)
    owner = buffer.owner.ravel()
    picture = np.zeros((len(owner), 4), np.float32)
    seen = np.flatnonzero(owner >= 0)
    for start in range(0, len(seen), _BATCH):
        pixel = seen[start : start + _BATCH]
        cell, (row, column) = owner[pixel], np.divmod(pixel, buffer.owner.shape[1])
        offset = np.stack([column, row], axis=1) + 0.5 - places[cell, 0, :2]
        here = _linear(flat[cell], offset.astype(np.float32))
        colour = lit(colours[cell], _unit(here[:, :3]))
        opacity = _line_opacity(here[:, 3:], width[cell])[:, None]
        picture[pixel, :3] = colour + opacity * (ink - colour)
        picture[pixel, 3] = 1.0
    picture = picture.reshape(*buffer.owner.shape, 4)
    picture[outlines(buffer.depth, max(1, round(_OUTLINE * view.point))), :3] = surface.ink
    return picture


def _linear(
    flat: Float[np.ndarray, "pixels coefficients"], offset: Float[np.ndarray, "pixels 2"]
) -> Float[np.ndarray, "pixels fields"]:
    """Fields at offsets from the first corners, given their values there and their two slopes."""
    value, right, up = np.split(flat, 3, axis=1)
    return np.asarray(value + right * offset[:, :1] + up * offset[:, 1:])


def outlines(
    depth: Float[np.ndarray, "rows columns"], width: int
) -> Bool[np.ndarray, "rows columns"]:
    """Pixels of the surface within `width` of where it ends or hides what is far behind it."""
    known = depth[np.isfinite(depth)]
    step = _EDGE * float(np.ptp(known)) if len(known) else 0.0
    edge = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        for turn in (slice(None), slice(None, None, -1)):
            along, marked = (np.moveaxis(each, axis, 0)[turn] for each in (depth, edge))
            before, here, after = along[: -2 * width], along[width:-width], along[2 * width :]
            with np.errstate(invalid="ignore"):  # differences within the background
                # A steep surface goes on as steeply; an edge is a step beyond that.
                slope = np.where(np.isfinite(before), np.maximum(here - before, 0.0), 0.0)
                marked[width:-width] |= after - here > step + _STEEPER * slope
    return edge


def _line_opacity(
    ruled: Float[np.ndarray, "pixels rulings"], width: Float[np.ndarray, "pixels rulings"]
) -> Float[np.ndarray, " pixels"]:
    """Opacity of the thin lines, which run where a ruling is a whole number; widths in rulings."""
    on = np.abs(ruled - np.round(ruled)) <= 0.5 * width
    crowd = np.clip(1.0 / np.maximum(_CROWDED * width, 1e-6), 0.0, 1.0)
    return np.asarray(_LINE_OPACITY * np.where(on, crowd, 0.0).max(axis=1, initial=0.0))


def _unit(vectors: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    """Vectors of length 1; zero stays zero."""
    return np.asarray(
        vectors / np.maximum(np.sqrt((vectors**2).sum(axis=-1, keepdims=True)), 1e-30)
    )
