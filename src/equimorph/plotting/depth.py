"""Views and depth buffers: which triangle is nearest behind every pixel, which points it hides.

Triangles may cross each other; every pixel decides for itself, so no order of drawing is needed.
Solids are seen from a `Viewpoint`, which turns what lies in space into a plane.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from mpl_toolkits.mplot3d import proj3d

from equimorph.arrays import Bool, Float, Int
from equimorph.model import Actuator, Drawing, Forces, Support
from equimorph.plotting import style
from equimorph.plotting.raster_kernels import nearest
from equimorph.structures import Structure


@dataclass(frozen=True)
class View:
    """How coordinates become places on the screen; a parallel projection."""

    linear: Float[np.ndarray, "3 3"]
    shift: Float[np.ndarray, " 3"]
    """Columns, rows and depths of points are ``points @ linear + shift``, all in pixels."""
    point: float
    """Pixels per typographic point."""

    def place(self, points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Columns, rows and depths of points."""
        return np.asarray(points @ self.linear + self.shift)

    def translate(self, origin: Float[np.ndarray, " 2"], scale: float) -> "View":
        """View whose pixels are `scale` times as fine and counted from `origin`."""
        return View(self.linear * scale, (self.shift - [*origin, 0.0]) * scale, self.point * scale)


def view_of(axes: Any) -> View:
    """Present view of three-dimensional axes, in the pixels of their figure."""
    corners = np.concatenate([np.zeros((1, 3)), np.eye(3)])
    x, y, depth = (np.asarray(each) for each in proj3d.proj_transform(*corners.T, axes.M))
    flat = axes.transData.transform(np.column_stack([x, y]))
    # Right, up and depth share one unit, since the axes' box is drawn square.
    unit = axes.transData.transform([[0.0, 0.0], [1.0, 0.0]])
    places = np.column_stack([flat, depth * (unit[1, 0] - unit[0, 0])])
    return View(places[1:] - places[0], places[0], axes.figure.dpi / 72)


Corners = Float[np.ndarray, "cells 3 3"]

_LEVELS = 2.0**31 - 1
"""Number of different depths in the buffer: positive 32-bit integers."""
_AROUND = 2
"""Half width, in pixels, of the square around a point in which one pixel that does not hide it
makes it visible: a curve runs along edges of the surface, and one visible side is enough."""


@dataclass(frozen=True)
class DepthBuffer:
    """What is nearest to the viewer at every pixel."""

    owner: Int[np.ndarray, "rows columns"]
    """Number of the triangle visible at the middle of each pixel, −1 for the background."""
    depth: Float[np.ndarray, "rows columns"]
    """Distance of that place from the viewer, infinite for the background."""

    def shows(self, places: Float[np.ndarray, "points 3"], slack: float) -> Bool[np.ndarray, " _"]:
        """Whether points can be seen; those on the surface may lie `slack` behind it.

        Points have column, row and depth, as the corners of the triangles do.
        """
        rows, columns = self.depth.shape
        column, row = np.floor(places[:, :2]).astype(int).T
        farthest = np.full(len(places), -np.inf)
        for up in (-_AROUND, 0, _AROUND):
            for right in (-_AROUND, 0, _AROUND):
                i = np.clip(row + up, 0, rows - 1)
                j = np.clip(column + right, 0, columns - 1)
                farthest = np.maximum(farthest, self.depth[i, j])
        return np.asarray(places[:, 2] <= farthest + slack)


def depth_buffer(corners: Corners, rows: int, columns: int) -> DepthBuffer:
    """Depth buffer of triangles seen along the third axis.

    Corners are columns and rows in pixels and distances from the viewer; what lies outside the
    picture is clipped. A triangle covers the pixels whose middles it contains; of two that share an
    edge exactly one covers each pixel there. Depth is linear on each triangle, as it is in a
    parallel projection, and compared in steps of 2⁻³¹ of its range.
    """
    low, high = (f(corners[..., 2], initial=0.0) for f in (np.min, np.max))
    step = max(high - low, np.finfo(float).tiny) / _LEVELS
    downward = np.argsort(corners[..., 1], axis=1, kind="stable")
    ordered = np.take_along_axis(np.asarray(corners, float), downward[..., None], axis=1)
    owner = np.full((rows, columns), -1)
    level = np.full((rows, columns), np.iinfo(np.int64).max)
    steep = np.ascontiguousarray(slopes(ordered, ordered[..., 2]))
    nearest(ordered, steep, float(low), float(step), owner, level)
    return DepthBuffer(owner, np.where(owner >= 0, low + step * level, np.inf))


def slopes(
    corners: Corners, values: Float[np.ndarray, "cells 3 *n"]
) -> Float[np.ndarray, "cells 2 *n"]:
    """Change of a quantity, linear on each triangle, per pixel to the right and per row.

    Zero on triangles seen exactly edge-on.
    """
    u, v = (corners[:, k, :2] - corners[:, 0, :2] for k in (1, 2))
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    scale = np.divide(1.0, area, out=np.zeros_like(area), where=area != 0.0)
    inverse = np.array([[v[:, 1], -u[:, 1]], [-v[:, 0], u[:, 0]]]) * scale
    change = values[:, 1:] - values[:, :1]
    return np.asarray(np.einsum("dkc,ck...->cd...", inverse, change))


_AZIMUTH, _ELEVATION = np.deg2rad(28.0), np.deg2rad(22.0)
"""To the right of the front, and above the horizon."""
_UPRIGHT = {"y": np.eye(3), "z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])}
"""Rows: right, up and towards the front, for the axis that is upward."""
_TRIAD, _CORNER = 0.14, 0.04
"""Longest arms of the directions, and their distance from the corner, as shares of the axes."""
_END_ON = 0.05
"""Length of the picture of a unit vector below which its direction has no meaning."""


@dataclass(frozen=True)
class Viewpoint:
    """Parallel projection of space."""

    upward: str
    """Axis that is upward in the picture: y or z."""

    @cached_property
    def frame(self) -> Float[np.ndarray, "3 3"]:
        """Unit vectors to the right, upward and towards the viewer, as columns."""
        (sa, ca), (se, ce) = ((np.sin(a), np.cos(a)) for a in (_AZIMUTH, _ELEVATION))
        right, toward = np.array([ca, 0.0, -sa]), np.array([sa * ce, se, ca * ce])
        upright = np.stack([right, np.cross(toward, right), toward])
        return np.asarray((upright @ _UPRIGHT[self.upward]).T)

    def flat(self, vectors: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 2"]:
        """Places or vectors in the plane of the picture."""
        return np.asarray(vectors @ self.frame[:, :2])

    def directions(self, vectors: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 2"]:
        """Unit vectors in the plane of the picture; to the right where they are seen end-on."""
        flat = self.flat(vectors)
        size = np.linalg.norm(flat, axis=-1, keepdims=True)
        seen = flat / np.maximum(size, _END_ON)
        return np.where(size > _END_ON, seen, np.array([1.0, 0.0]))

    def drawing(self, drawing: Drawing) -> Drawing:
        """Supports, forces and actuators in the plane of the picture; couples are planar."""
        return Drawing(
            tuple(
                Support(each.kind, self.flat(each.places), self.directions(each.directions))
                for each in drawing.supports
            ),
            tuple(
                Forces(self.flat(each.places), self.flat(each.vectors), each.distributed)
                for each in drawing.forces
            ),
            actuators=tuple(
                Actuator(each.kind, self.flat(each.line)) for each in drawing.actuators
            ),
        )


def draw_triad(ax: Axes, viewpoint: Viewpoint, unit: str) -> None:
    """Directions x, y, z in the lower left corner, of the length that stands below them."""
    ax.set_xticks([])
    ax.set_yticks([])
    for side in ax.spines.values():
        side.set_visible(False)
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    size = _TRIAD * min(right - left, high - low)
    length = _round_length(size)
    arms = viewpoint.flat(length * np.eye(3))
    reach = np.minimum(arms.min(axis=0), 0.0)
    foot = np.array([left, low]) + _CORNER * (right - left + high - low) - reach
    for name, arm in zip("xyz", arms, strict=True):
        ax.annotate(
            "", tuple(foot + arm), tuple(foot), zorder=9,
            arrowprops={"arrowstyle": "-|>", "linewidth": 0.6, "color": style.INK,
                        "mutation_scale": 4.0, "shrinkA": 0.0, "shrinkB": 0.0},
        )  # fmt: skip
        ax.annotate(
            f"${name}$", tuple(foot + arm), tuple(5.0 * arm / np.linalg.norm(arm)), ha="center",
            va="center", textcoords="offset points", size=7, zorder=9,
        )  # fmt: skip
    words = f"{length:g}" if unit == "1" else f"{length:g} {unit}"
    ax.annotate(
        words, tuple(foot + 0.3 * arms[0]), (0, -7), textcoords="offset points", size=6, va="top",
        ha="left", color=style.FAINT, zorder=9,
    )  # fmt: skip


def _round_length(most: float) -> float:
    """1, 2 or 5 times a power of ten, not longer than `most`."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(power * max(each for each in (1.0, 2.0, 5.0) if each * power <= most))


def viewpoint_of(structure: Structure) -> Viewpoint:
    """From where a structure in space is seen."""
    return Viewpoint(structure.upward)


def flat_shapes(
    structure: Structure, shapes: Float[np.ndarray, "*n space"]
) -> Float[np.ndarray, "*n 2"]:
    """Shapes as they are seen: planar ones as they are."""
    return shapes if shapes.shape[-1] == 2 else viewpoint_of(structure).flat(shapes)
