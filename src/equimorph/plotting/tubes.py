"""Pictures of structures in space: shaded solids, nearer ones before others."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.image import AxesImage

from equimorph.array_types import UInt8
from equimorph.plotting import style
from equimorph.plotting.depth import View, Viewpoint, depth_buffer
from equimorph.plotting.scene import SAMPLES, downsample
from equimorph.plotting.shading import Paint, paint
from equimorph.structures import States
from equimorph.structures.solids import Mesh, joined, solids

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
        whole = joined(meshes)
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
