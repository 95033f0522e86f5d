"""Solid surfaces, and curves on them, in three dimensions, hidden where something is nearer.

matplotlib draws three-dimensional things one over the other, sorted by depth, which cannot be right
for sheets that cross or wind around each other. Here the surface is one picture made with a depth
buffer, at the resolution of the file; curves stay vectors and are cut where they get hidden.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.image import AxesImage
from matplotlib.transforms import IdentityTransform
from scipy import ndimage

from equimorph.arrays import Bool, Float, UInt8
from equimorph.plotting import style
from equimorph.plotting.depth import DepthBuffer, View, Viewpoint, depth_buffer, view_of
from equimorph.plotting.shading import Paint, paint
from equimorph.structures import States
from equimorph.structures.solids import Mesh, join_meshes, solids

SAMPLES = 3
"""Pixels of the depth buffer per pixel of the picture, in each direction."""
_VOTES = 9
"""Neighbouring points along a curve, one a pixel, whose median decides whether it is visible:
single ones err."""


@dataclass(frozen=True)
class Curve:
    """A polyline on the surface."""

    points: Float[np.ndarray, "points 3"]
    """In the coordinates of the axes."""
    seen: Mapping[str, Any]
    hidden: Mapping[str, Any] | None = None
    """Settings of the line (color, linewidth, linestyle, …) where it is seen and where the surface
    hides it; None leaves that part out."""
    slack: float = 0.004
    """How far behind the surface it may lie and still belong to it, as a share of the depth of the
    scene."""


class Scene(Artist):
    """Artist that draws one solid surface and curves on it, in axes with parallel projection.

    Parameters
    ----------
    corners
        Corners of the triangles of the surface in the coordinates of the axes.
    surface
        How it is painted.
    curves
        Drawn in their order, all hidden parts before the seen ones.
    """

    def __init__(
        self, corners: Float[np.ndarray, "cells 3 3"], surface: Paint, curves: Sequence[Curve]
    ) -> None:
        super().__init__()
        self._corners, self._surface = corners, surface
        self.curves = tuple(curves)
        self._shots: dict[tuple[Any, ...], _Shot] = {}

    def draw(self, renderer: Any) -> None:
        """Draw picture and curves for the present view, at the resolution of the renderer."""
        if not self.get_visible():
            return
        axes: Any = self.axes  # three-dimensional, which the types do not know
        view, fineness = view_of(axes), float(renderer.get_image_magnification())
        shot = self._shot(view, fineness)
        context = renderer.new_gc()
        renderer.draw_image(context, *shot.corner, shot.picture)
        context.restore()
        for look, pieces in shot.lines:
            lines = LineCollection(pieces, transform=IdentityTransform(), **look)
            lines.set_figure(axes.figure)
            lines.draw(renderer)
        self.stale = False

    def _shot(self, view: View, fineness: float) -> "_Shot":
        """Picture and lines of a view; the last is kept for the next format of a figure."""
        finest = view.translate(np.zeros(2), fineness)
        name = (finest.linear.round(6).tobytes(), finest.shift.round(3).tobytes())
        if name not in self._shots:
            self._shots = {name: _take(finest, self._corners, self._surface, self.curves)}
        return self._shots[name].rescale(1 / fineness)


@dataclass(frozen=True)
class _Shot:
    """What a view shows: a picture, its lower left corner, and pieces of lines with their looks."""

    picture: UInt8[np.ndarray, "rows columns 4"]
    corner: Float[np.ndarray, " 2"]
    lines: list[tuple[Mapping[str, Any], list[Float[np.ndarray, "_ 2"]]]]

    def rescale(self, factor: float) -> "_Shot":
        """The same with places in another unit; pixels of the picture stay."""
        lines = [(look, [piece * factor for piece in pieces]) for look, pieces in self.lines]
        return _Shot(self.picture, self.corner * factor, lines)


def _take(
    view: View,
    corners: Float[np.ndarray, "cells 3 3"],
    surface: Paint,
    curves: Sequence[Curve],
) -> _Shot:
    """Render the surface and cut the curves."""
    reach = view.place(corners)[..., :2].reshape(-1, 2)
    low, high = np.floor(reach.min(axis=0)) - 1, np.ceil(reach.max(axis=0)) + 1
    columns, rows = (high - low).astype(int)
    fine = view.translate(low, SAMPLES)
    placed = fine.place(corners)
    buffer = depth_buffer(placed, int(rows * SAMPLES), int(columns * SAMPLES))
    picture = downsample(paint(buffer, fine, corners, surface))
    range_of_depth = float(np.ptp(placed[..., 2]))
    lines: list[tuple[Mapping[str, Any], list[Float[np.ndarray, "_ 2"]]]] = []
    cut = [_cut(fine.place(c.points), buffer, c.slack * range_of_depth) for c in curves]
    for curve, (_, hidden) in zip(curves, cut, strict=True):
        if curve.hidden is not None:
            lines.append((curve.hidden, hidden))
    lines += [(curve.seen, seen) for curve, (seen, _) in zip(curves, cut, strict=True)]
    return _Shot(picture, low, lines=[(k, [v / SAMPLES + low for v in vs]) for k, vs in lines])


def _cut(
    places: Float[np.ndarray, "points 3"], buffer: DepthBuffer, slack: float
) -> tuple[list[Float[np.ndarray, "_ 2"]], list[Float[np.ndarray, "_ 2"]]]:
    """Pieces of a polyline that are seen, and those that are hidden; neighbours share an end."""
    steps = np.hypot(*np.diff(places[:, :2], axis=0).T)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.linspace(0.0, length[-1], max(2, int(length[-1] / SAMPLES)))
    at = np.unique(np.concatenate([at, length]))  # corners stay sharp
    points = np.column_stack([np.interp(at, length, places[:, k]) for k in range(3)])
    seen = ndimage.median_filter(buffer.shows(points, slack), _VOTES, mode="nearest")
    return _runs(points[:, :2], seen), _runs(points[:, :2], ~seen)


def _runs(
    points: Float[np.ndarray, "points 2"], wanted: Bool[np.ndarray, " points"]
) -> list[Float[np.ndarray, "_ 2"]]:
    """Runs of selected points, each with the first point after it."""
    switch = np.diff(np.concatenate([[False], wanted, [False]]).astype(int))
    starts, ends = np.flatnonzero(switch > 0), np.flatnonzero(switch < 0)
    return [points[a : b + 1] for a, b in zip(starts, ends, strict=True)]


def downsample(picture: Float[np.ndarray, "rows columns 4"]) -> UInt8[np.ndarray, "_ _ 4"]:
    """Mean colour and share of cover of blocks of pixels; colours are weighted by their cover."""
    rows, columns, _ = picture.shape
    blocks = picture.reshape(rows // SAMPLES, SAMPLES, columns // SAMPLES, SAMPLES, 4)
    mean = blocks.mean(axis=(1, 3))
    mean[..., :3] /= np.maximum(mean[..., 3:], 1e-6)
    return np.asarray(np.round(255 * np.clip(mean, 0.0, 1.0)).astype(np.uint8))


_FINENESS = 300.0
"""Pixels per inch of a picture."""
Colour = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Picture:
    """Solids seen in axes, as an image that covers them.

    viewpoint: from where; ax: the axes, whose limits and aspect are final; fineness: pixels per
    inch.
    """

    viewpoint: Viewpoint
    ax: Axes
    fineness: float = _FINENESS

    def image(self, zorder: float) -> AxesImage:
        """An empty image over the axes."""
        extent = (*self.ax.get_xlim(), *self.ax.get_ylim())
        image = AxesImage(self.ax, extent=extent, origin="lower", interpolation="antialiased")
        image.set_zorder(zorder)
        image.set_data(np.zeros((1, 1, 4), np.uint8))
        self.ax.add_image(image)
        return image

    def render(self, meshes: Sequence[Mesh], colours: Sequence[Colour]) -> UInt8[Any, "_ _ 4"]:
        """Red, green, blue and cover of every pixel."""
        (left, right), low = self.ax.get_xlim(), self.ax.get_ylim()[0]
        columns, rows = self._pixels
        scale = columns / (right - left)
        linear = self.viewpoint.frame * np.array([scale, scale, -scale])
        view = View(linear, np.array([-left * scale, -low * scale, 0.0]), self.fineness / 72)
        fine = view.translate(np.zeros(2), SAMPLES)
        whole = join_meshes(meshes)
        tints = np.repeat(np.array(colours), [len(each.white) for each in meshes], axis=0)
        tints = tints + whole.white[:, None] * (1.0 - tints)
        surface = Paint(whole.normals, np.ones(3), tints, (), style.rgba(style.INK)[:3])
        placed = fine.place(whole.corners)
        buffer = depth_buffer(placed, rows * SAMPLES, columns * SAMPLES)
        return downsample(paint(buffer, fine, whole.corners, surface))

    @property
    def _pixels(self) -> tuple[int, int]:
        """Columns and rows that cover the axes."""
        (left, right), (low, high) = self.ax.get_xlim(), self.ax.get_ylim()
        window = self.ax.get_window_extent()
        width, height = (float(each) / self.ax.figure.dpi for each in (window.width, window.height))
        scale = min(width / (right - left), height / (high - low)) * self.fineness
        return max(2, round(scale * (right - left))), max(2, round(scale * (high - low)))


def draw_solids(
    picture: Picture, states: States, size: float, colours: Any, zorder: float
) -> AxesImage:
    """All states in one picture, each in its colour; nearer ones hide others."""
    image = picture.image(zorder)
    tints = [_tint(each) for each in colours]
    image.set_data(picture.render(solids(states, size), tints))
    return image


def place_solid(
    image: AxesImage, picture: Picture, meshes: Sequence[Mesh], colour: Colour, k: int
) -> None:
    """Show state number k."""
    image.set_data(picture.render([meshes[k]], [colour]))


def moving_solid(
    picture: Picture, states: States, size: float, colour: Any, zorder: float
) -> tuple[AxesImage, Any]:
    """An image, and a function that shows a state on it by its number."""
    image = picture.image(zorder)
    return image, partial(place_solid, image, picture, solids(states, size), _tint(colour))


def _tint(colour: Any) -> Colour:
    red, green, blue = to_rgb(colour)
    return float(red), float(green), float(blue)
