"""Painter's algorithm for triangles and lines in three dimensions."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.collections import PolyCollection
from mpl_toolkits.mplot3d import proj3d


@dataclass(frozen=True)
class Coat:
    """Pieces painted alike.

    Attributes
    ----------
    pieces
        Corners of triangles; a segment is a triangle with two equal corners.
    colours
        One colour for all pieces or one for each, for face and edge.
    width
        Line width in points.
    lift
        How far the pieces are moved towards the viewer before sorting, in depths of a typical
        triangle: lines on a surface belong in front of the triangles beside them.
    """

    pieces: Float[np.ndarray, "pieces 3 3"]
    colours: Float[np.ndarray, "4"] | Float[np.ndarray, "pieces 4"]
    width: float
    lift: float = 0.0


class PaintedPieces(PolyCollection):
    """Triangles and segments drawn from back to front, each with its colour and line width.

    matplotlib's own collection of polygons in three dimensions does not sort line widths.

    Parameters
    ----------
    coats
        What to paint, in any order.
    """

    def __init__(self, coats: Sequence[Coat], **settings: Any) -> None:
        super().__init__([], **settings)
        many = [len(coat.pieces) for coat in coats]
        self._pieces = np.concatenate([coat.pieces for coat in coats])
        self._colours = np.concatenate(
            [np.broadcast_to(coat.colours, (len(coat.pieces), 4)) for coat in coats]
        )
        self._widths = np.repeat([coat.width for coat in coats], many)
        self._lift = np.repeat([coat.lift for coat in coats], many)

    def do_3d_projection(self) -> float:
        """Project and sort for the present view, which the axes ask for before drawing."""
        axes: Any = self.axes  # three-dimensional, which the types do not know
        x, y, depth = proj3d.proj_transform(*self._pieces.reshape(-1, 3).T, axes.M)
        corners: Any = np.stack([np.asarray(x), np.asarray(y)], axis=-1).reshape(-1, 3, 2)
        depth = np.asarray(depth).reshape(-1, 3)
        faces = self._lift == 0
        typical = float(np.quantile(np.ptp(depth[faces], axis=1), 0.5)) if faces.any() else 0.0
        order = np.argsort(depth.mean(axis=1) - self._lift * typical, kind="stable")[::-1]
        self.set_verts(corners[order], closed=True)
        colours: Any = self._colours[order]
        widths: Any = self._widths[order]
        self.set_facecolor(colours)
        self.set_edgecolor(colours)
        self.set_linewidth(widths)
        return float(depth.min(initial=0.0))
