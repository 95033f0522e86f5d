"""Faces of a map over a grid: triangles where it is smooth, cells cut in two where it is not."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from equimorph.arrays import Bool, Float, Int

Axis = Float[np.ndarray, " _"]

_ON_LINE = 1e-9
"""Distance from a grid line, in grid intervals, of points that lie on it."""


@dataclass(frozen=True)
class Faces:
    """What to fill."""

    triangles: Int[np.ndarray, "triangles 3"]
    """Vertices (row by row) of the triangles of the cells that no curve enters."""
    pieces: list[Float[np.ndarray, "_ 2"]]
    values: Float[np.ndarray, " pieces"]
    """Polygons of the other cells, and the mean values of their corners."""


def faces(
    axes: tuple[Axis, Axis], value: Float[np.ndarray, "rows columns"], cuts: np.ndarray
) -> Faces:
    """Faces of a map over grid lines; values are not numbers where it is not defined.

    `cuts` are the places on grid lines where the map jumps or ends.
    """
    defined = np.isfinite(value)
    crossings = _crossings(axes, cuts)
    whole = defined[:-1, :-1] & defined[1:, :-1] & defined[:-1, 1:] & defined[1:, 1:]
    for i, j in crossings:
        whole[i, j] = False
    some = defined[:-1, :-1] | defined[1:, :-1] | defined[:-1, 1:] | defined[1:, 1:]
    pieces, values = [], []
    for i, j in np.argwhere(some & ~whole).tolist():
        for polygon, inside in _pieces(axes, (i, j), crossings.get((i, j), [])):
            known = value[tuple(np.transpose(inside))]
            known = known[np.isfinite(known)]
            if len(known) and len(polygon) > 2:
                pieces.append(polygon)
                values.append(known.mean())
    return Faces(_triangles(whole), pieces, np.array(values))


def corners(axes: tuple[Axis, Axis]) -> Float[np.ndarray, "vertices 2"]:
    """Places of all vertices, row by row."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


def _triangles(whole: Bool[np.ndarray, "_ _"]) -> Int[np.ndarray, "triangles 3"]:
    """Two triangles for each whole cell."""
    columns = whole.shape[1] + 1
    i, j = np.nonzero(whole)
    a = i * columns + j
    b, c, d = a + columns, a + columns + 1, a + 1
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


class _Crossing(NamedTuple):
    """A place on the rim of a cell; around: its distance from the first corner, 0 to 4."""

    around: float
    x: float
    y: float


def _crossings(
    axes: tuple[Axis, Axis], cuts: Float[np.ndarray, "points 2"]
) -> dict[tuple[int, int], list[_Crossing]]:
    """Places on the rims of cells, by the cells."""
    found: dict[tuple[int, int], list[_Crossing]] = {}
    shape = [len(axis) - 1 for axis in axes]
    steps = [axis[1] - axis[0] for axis in axes]
    for place in cuts:
        at = [(x - axis[0]) / step for x, axis, step in zip(place, axes, steps, strict=True)]
        for across in (0, 1):
            if abs(at[across] - round(at[across])) > _ON_LINE:
                continue
            line, along = round(at[across]), min(int(at[1 - across]), shape[1 - across] - 1)
            share = at[1 - across] - along
            for low in (True, False):  # the line is the low or the high side of the cell
                cell = (line if low else line - 1, along)
                if 0 <= cell[0] < shape[across]:
                    key = cell if across == 0 else cell[::-1]
                    where = _around(across, low, share)
                    found.setdefault(key, []).append(_Crossing(where, *place.tolist()))
            break
    return found


def _around(across: int, low: bool, share: float) -> float:
    """Way around a cell, through (0, 0), (1, 0), (1, 1), (0, 1), to a place on one side."""
    if across == 0:  # on a line of the first axis: the sides 1 (high) and 3 (low)
        return 4.0 - share if low else 1.0 + share
    return share if low else 3.0 - share


def _pieces(
    axes: tuple[Axis, Axis], cell: tuple[int, int], crossed: list[_Crossing]
) -> list[tuple[Float[np.ndarray, "_ 2"], list[tuple[int, int]]]]:
    """Polygons into which a cell is cut, with the corners (vertices of the grid) of each."""
    i, j = cell
    corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
    places = [np.array([axes[0][a], axes[1][b]]) for a, b in corners]
    cuts = sorted(crossed)
    if len(cuts) < 2:
        return [(np.array(places), corners)]
    found = []
    for (start, *first), (end, *last) in zip(cuts, [*cuts[1:], cuts[0]], strict=True):
        stop = end if end > start else end + 4
        inside = [k % 4 for k in range(int(np.ceil(start)), int(np.floor(stop)) + 1)]
        polygon = np.array([first, *(places[k] for k in inside), last])
        if inside:
            found.append((polygon, [corners[k] for k in inside]))
    return found
