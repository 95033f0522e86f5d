"""Compiled loops over pixels: the nearest triangle, its colour in the light, edges of depth."""

import numpy as np

from equimorph.linalg.compiled import njit

ACCURATE = {"nogil": True, "error_model": "numpy"}
"""Flags: a picture is the same bits on every machine."""
AMBIENT, GLOSS, SHININESS = 0.42, 0.18, 10
"""Brightness away from the light, strength of highlights, and their exponent (Phong)."""
LINE_OPACITY = 0.25
"""Opacity of grid lines where they are not crowded."""
CROWDED = 8.0
"""Lines on the surface fade where fewer than this many of their widths lie between them."""


@njit(**ACCURATE)
def nearest(corners, steep, low, step, owner, level):
    """Nearest triangle at the middle of each pixel; see `depth_buffer`.

    corners (cells, 3, 3), those of a cell sorted by row; steep (cells, 2): change of depth to the
    right and per row; owner (rows, columns), −1, and level, larger than all, are changed in place.
    """
    rows, columns = owner.shape
    for cell in range(len(corners)):
        a, b, c = corners[cell, 0], corners[cell, 1], corners[cell, 2]
        least, most = min(a[2], b[2], c[2]), max(a[2], b[2], c[2])
        for row in range(_bound(a[1], rows), _bound(c[1], rows)):
            y = row + 0.5
            one = _at_height(a, c, y)
            other = _at_height(a, b, y) if y < b[1] else _at_height(b, c, y)
            start = a[2] + steep[cell, 1] * (y - a[1])
            for column in range(_bound(min(one, other), columns), _bound(max(one, other), columns)):
                depth = start + steep[cell, 0] * (column + 0.5 - a[0])
                # never beyond the corners: triangles that are seen edge-on are steep
                here = np.int64((min(max(depth, least), most) - low) / step)
                if here < level[row, column]:
                    level[row, column], owner[row, column] = here, cell


@njit(**ACCURATE)
def _bound(place, count):
    """First pixel whose middle is not below a place, within the picture."""
    return int(min(max(np.ceil(place - 0.5), 0.0), count))


@njit(**ACCURATE)
def _at_height(start, end, y):
    """Where an edge crosses a row."""
    rise = end[1] - start[1]
    share = min(max((y - start[1]) / rise, 0.0), 1.0) if rise > 0.0 else 0.0
    return start[0] + share * (end[0] - start[0])


@njit(**ACCURATE)
def paint_pixels(owner, origins, fields, width, colours, light, halfway, ink, picture):
    """Colour and cover of every pixel that a triangle owns; see `paint`.

    origins (cells, 2): column and row of first corners; fields (cells, 3, 3 + rulings): normal and
    rulings there, and their changes to the right and per row; width (cells, rulings).
    """
    here = np.empty(fields.shape[2])
    for row in range(owner.shape[0]):
        for column in range(owner.shape[1]):
            cell = owner[row, column]
            if cell < 0:
                continue
            right, up = column + 0.5 - origins[cell, 0], row + 0.5 - origins[cell, 1]
            for k in range(len(here)):
                slope = right * fields[cell, 1, k] + up * fields[cell, 2, k]
                here[k] = fields[cell, 0, k] + slope
            opacity = _line_opacity(here[3:], width[cell])
            shade_pixel(colours[cell], here[:3], light, halfway, picture[row, column])
            for k in range(3):
                colour = picture[row, column, k]
                picture[row, column, k] = colour + opacity * (ink[k] - colour)
            picture[row, column, 3] = 1.0


@njit(**ACCURATE)
def shade_pixel(colour, normal, light, halfway, shaded):
    """Colour of a piece of surface in the light: matt, with a soft gloss; both sides alike."""
    size, toward, mirrored = 0.0, 0.0, 0.0
    for k in range(3):
        size += normal[k] ** 2
        toward += normal[k] * light[k]
        mirrored += normal[k] * halfway[k]
    size = max(np.sqrt(size), 1e-30) * (-1.0 if normal[2] < 0.0 else 1.0)
    bright = AMBIENT + (1.0 - AMBIENT) * (0.5 + 0.5 * toward / size)
    gloss = GLOSS * max(mirrored / size, 0.0) ** SHININESS
    for k in range(3):
        matt = colour[k] * bright
        shaded[k] = matt + gloss * (1.0 - matt)


@njit(**ACCURATE)
def _line_opacity(ruled, width):
    """Opacity of the thin lines, which run where a ruling is a whole number; widths in rulings."""
    opacity = 0.0
    for k in range(len(ruled)):
        if abs(ruled[k] - np.round(ruled[k])) <= 0.5 * width[k]:
            opacity = max(opacity, min(1.0 / max(CROWDED * width[k], 1e-6), 1.0))
    return LINE_OPACITY * opacity


@njit(**ACCURATE)
def edges_of_depth(depth, width, step, steeper):
    """Pixels that `width` pixels farther are a step in front of what is there; see `outlines`.

    A steep surface goes on as steeply; an edge is a step beyond that.
    """
    rows, columns = depth.shape
    edge = np.zeros(depth.shape, np.bool_)
    for row in range(rows):
        for column in range(columns):
            for i, j in ((width, 0), (-width, 0), (0, width), (0, -width)):
                if not (abs(i) <= row < rows - abs(i) and abs(j) <= column < columns - abs(j)):
                    continue
                before, here = depth[row - i, column - j], depth[row, column]
                slope = max(here - before, 0.0) if np.isfinite(before) else 0.0
                if depth[row + i, column + j] - here > step + steeper * slope:
                    edge[row, column] = True
    return edge
