"""Parallel projection of three-dimensional axes onto the pixels of a figure."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from mpl_toolkits.mplot3d import proj3d


@dataclass(frozen=True)
class View:
    """How coordinates become places on the screen; a parallel projection.

    Attributes
    ----------
    linear, shift
        Columns, rows and depths of points are ``points @ linear + shift``, all in pixels.
    point
        Pixels per typographic point.
    """

    linear: Float[np.ndarray, "3 3"]
    shift: Float[np.ndarray, " 3"]
    point: float

    def place(self, points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Columns, rows and depths of points."""
        return np.asarray(points @ self.linear + self.shift)

    def moved(self, origin: Float[np.ndarray, " 2"], scale: float) -> "View":
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
