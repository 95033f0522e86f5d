"""Shapes of a structure along a path or a route."""

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize

from equimorph.equilibria import Path
from equimorph.errors import InputError
from equimorph.plotting import style
from equimorph.plotting.curves import path_of, states_along
from equimorph.plotting.furniture import draw_supports, frame_shapes, length_unit
from equimorph.plotting.symbols import with_unit
from equimorph.tasks import Route

_ROOM = 0.085


def shapes(path_or_route: Path | Route, count: int = 13, ax: Axes | None = None) -> Axes:
    """Shapes at even distances along a path, from dark (start) to light (goal).

    Parameters
    ----------
    path_or_route
        A lifted path, or a route that has one.
    count
        How many shapes, the first and the last included; at least 2.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        If the route has no path, or `count` is below 2.
    """
    if count < 2:
        raise InputError(f"`count` must be at least 2; got {count!r}.")
    states = states_along(path_of(path_or_route), count)
    outlines = states.shape()
    with style.house_style():
        if ax is None:
            ax = style.new_axes(style.SINGLE_COLUMN, _height(outlines))
        frame_shapes(ax, outlines, room=_ROOM)
        unit = length_unit(states.structure)
        ax.set_xlabel(with_unit("$x$", unit))
        ax.set_ylabel(with_unit("$y$", unit))
        draw_supports(ax, states)
        progress = np.linspace(0.0, 1.0, count)
        colours = style.progress_map()(progress)
        widths = np.full(count, 0.9)
        widths[[0, -1]] = 2.2
        ax.add_collection(
            LineCollection(list(outlines), colors=colours, linewidths=widths, zorder=2)
        )
        _name_ends(ax, outlines[0], outlines[-1])
        bar = ax.figure.colorbar(
            ScalarMappable(Normalize(0, 1), style.progress_map()),
            ax=ax, orientation="horizontal", aspect=40, pad=0.03, shrink=0.8,
        )  # fmt: skip
        bar.set_label("progress along the route")
    return ax


def _height(outlines: Float[np.ndarray, "shapes points 2"]) -> float:
    """Height of a figure one column wide whose drawing keeps its aspect without empty bands."""
    width, height = np.ptp(outlines.reshape(-1, 2), axis=0) + _ROOM * 2 * np.ptp(outlines)
    around, beside = 0.85, 0.6  # inches for labels and colour bar
    drawing = (style.SINGLE_COLUMN - beside) * float(height / width)
    return around + float(np.clip(drawing, 0.25, 1.4 * style.SINGLE_COLUMN))


def _name_ends(
    ax: Axes, first: Float[np.ndarray, "points 2"], last: Float[np.ndarray, "points 2"]
) -> None:
    """Write "start" and "goal" on the outer sides of the first and the last shape."""
    start, goal = first[len(first) // 2], last[len(last) // 2]
    above = 1 if start[1] >= goal[1] else -1
    for name, place, side in (("start", start, above), ("goal", goal, -above)):
        ax.annotate(
            name, place, (0, 4 * side), textcoords="offset points", ha="center",
            va="bottom" if side > 0 else "top", weight="bold",
        )  # fmt: skip
