"""Structures in space as solids: tubes and ribbons around their shapes that show their twist.

The stripe of a tube runs along the normal of the cross-sections; the back of a ribbon is pale.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from equimorph.arrays import Float
from equimorph.structures.states import States

RADIUS = 0.012
"""Radius of a round tube, as a share of the size of the structure."""
_BAR = 0.6
"""Radius of straight bars, by that of a rod."""
_FLATTEST = 9.0
"""Ribbons are drawn with this ratio of width to thickness at most."""
_ROUND = 1.2
"""Below this ratio of width to thickness a rod is drawn as a tube."""
_SQUARE = 1.3
"""Half the side of a square of the area of a ribbon, by the radius of a tube."""
_SIDES = 20
_STRIPE = 3
"""Sides of a tube, and how many of them are the stripe along its normal that shows the twist."""
_STRIPE_COLOUR, _BACK = 0.85, 0.6
"""Share of white in the stripe of a tube, and on the back of a ribbon."""
_STRAIGHT = 1e-9
"""Length of a bar, in the structure's unit, below which it is a point."""

Frames = Float[np.ndarray, "points 3 3"]
Places = Float[np.ndarray, "points 3"]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with a normal at each corner, and a share of white for each."""

    corners: Float[np.ndarray, "cells 3 3"]
    normals: Float[np.ndarray, "cells 3 3"]
    white: Float[np.ndarray, " cells"]


@dataclass(frozen=True, eq=False)
class Profile:
    """Outline of a cross-section: closed, in (normal, binormal), by straight sides.

    starts, stops: ends of the sides; first, last: unit normals there; white: share of white.
    """

    starts: Float[np.ndarray, "sides 2"]
    stops: Float[np.ndarray, "sides 2"]
    first: Float[np.ndarray, "sides 2"]
    last: Float[np.ndarray, "sides 2"]
    white: Float[np.ndarray, " sides"]


def profile(radius: float, flatness: float) -> Profile:
    """A circle of a radius with a stripe, or a rectangle with a pale back.

    `flatness` is the width along the binormal over the thickness along the normal.
    """
    if 1.0 / _ROUND < flatness < _ROUND:
        angles = 2.0 * np.pi * (np.arange(_SIDES + 1) - 0.5 * _STRIPE) / _SIDES
        unit = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        white = np.where(np.arange(_SIDES) < _STRIPE, _STRIPE_COLOUR, 0.0)
        return Profile(radius * unit[:-1], radius * unit[1:], unit[:-1], unit[1:], white)
    ratio = float(np.clip(flatness, 1.0 / _FLATTEST, _FLATTEST))
    size = _SQUARE * radius
    a, b = size / np.sqrt(ratio), size * np.sqrt(ratio)
    corners = np.array([[a, -b], [a, b], [-a, b], [-a, -b]])
    normals = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    back = np.array([0.0, 0.0, _BACK, 0.0] if ratio > 1.0 else [0.0, 0.0, 0.0, _BACK])
    return Profile(corners, np.roll(corners, -1, axis=0), normals, normals, back)


def tube(places: Places, frames: Frames, section: Profile) -> Mesh:
    """Surface swept by a cross-section along points, closed at both ends.

    frames: columns tangent, normal, binormal at the points.
    """
    normal, binormal = frames[:, :, 1], frames[:, :, 2]

    def swept(outline: Float[np.ndarray, "sides 2"]) -> Float[np.ndarray, "points sides 3"]:
        parts = outline[None, :, :1] * normal[:, None], outline[None, :, 1:] * binormal[:, None]
        return np.asarray(parts[0] + parts[1])

    start, stop = (places[:, None] + swept(each) for each in (section.starts, section.stops))
    first, last = swept(section.first), swept(section.last)
    corners = _quads(start[:-1], stop[:-1], stop[1:], start[1:])
    normals = _quads(first[:-1], last[:-1], last[1:], first[1:])
    white = np.tile(np.tile(section.white, len(places) - 1), 2)
    caps, outward = [], []
    for at, sign in ((0, -1.0), (-1, 1.0)):
        middle = np.broadcast_to(places[at], start[at].shape)
        rim = (stop[at], start[at]) if at == 0 else (start[at], stop[at])
        caps.append(np.stack([middle, *rim], axis=1))
        outward.append(np.broadcast_to(sign * frames[at, :, 0], caps[-1].shape))
    return Mesh(
        np.concatenate([corners, *caps]),
        np.concatenate([normals, *outward]),
        np.concatenate([white, np.zeros(2 * len(section.starts))]),
    )


def _quads(*corners: Float[np.ndarray, "points sides 3"]) -> Float[np.ndarray, "cells 3 3"]:
    """Two triangles for each quadrilateral: all of the first halves, then all of the second."""
    a, b, c, d = (each.reshape(-1, 3) for each in corners)
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def bars(corners: Places, section: Profile) -> list[Mesh]:
    """Straight tubes between successive corners."""
    found = []
    for ends in pairwise(corners):
        along = ends[1] - ends[0]
        if np.linalg.norm(along) > _STRAIGHT:
            frame = _frame_along(along / np.linalg.norm(along))
            found.append(tube(np.array(ends), np.stack([frame, frame]), section))
    return found


def _frame_along(tangent: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """Any frame with a given tangent."""
    across = np.cross(tangent, np.eye(3)[np.argmin(np.abs(tangent))])
    normal = across / np.linalg.norm(across)
    return np.stack([tangent, normal, np.cross(tangent, normal)], axis=1)


def solids(states: States, size: float) -> list[Mesh]:
    """One mesh for each state in space; their thickness follows the size of the structure."""
    structure, shapes = states.structure, states.shape()
    frames = structure.frames(states.z, states.p)
    if frames is None:
        section = profile(_BAR * RADIUS * size, 1.0)
        return [join_meshes(bars(corners, section)) for corners in shapes]
    section = profile(RADIUS * size, structure.flatness)
    return [tube(*each, section) for each in zip(shapes, frames, strict=True)]


def join_meshes(meshes: Sequence[Mesh]) -> Mesh:
    """All triangles in one mesh."""
    parts = [(each.corners, each.normals, each.white) for each in meshes]
    return Mesh(*(np.concatenate(column) for column in zip(*parts, strict=True)))
