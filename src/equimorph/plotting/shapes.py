"""Shapes of a structure along a path or a route."""

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from mpl_toolkits.axes_grid1 import make_axes_locatable

from equimorph.equilibria import Path
from equimorph.errors import InputError
from equimorph.plotting import style
from equimorph.plotting.curves import path_of, states_along
from equimorph.plotting.outlines import framed
from equimorph.tasks import Route

_ROOM = 0.085
_BAR = 0.5  # inches for the colour bar and the labels above it


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
        ax = framed(states, ax, room=_ROOM, below=_BAR)
        progress = np.linspace(0.0, 1.0, count)
        colours = style.progress_map()(progress)
        widths = np.full(count, 0.9)
        widths[[0, -1]] = 2.2
        ax.add_collection(
            LineCollection(list(outlines), colors=colours, linewidths=widths, zorder=2)
        )
        _name_ends(ax, outlines[0], outlines[-1])
        below = make_axes_locatable(ax).append_axes("bottom", size=0.08, pad=_BAR - 0.08)
        scale = ScalarMappable(Normalize(0, 1), style.progress_map())
        bar = ax.figure.colorbar(scale, cax=below, orientation="horizontal")
        bar.set_label("progress along the route")
    return ax


def _name_ends(
    ax: Axes, first: Float[np.ndarray, "points 2"], last: Float[np.ndarray, "points 2"]
) -> None:
    """Write "start" and "goal" on the outer sides of both shapes, where they are far apart."""
    apart = np.linalg.norm(last - first, axis=1)
    middle = len(apart) // 2
    if apart.max() < 1e-6:
        ax.annotate(
            "start = goal", first[middle], (0, -4), textcoords="offset points", ha="center",
            va="top", weight="bold", path_effects=style.RIM, zorder=8,
        )  # fmt: skip
        return
    at = middle if apart[middle] > 0.9 * apart.max() else int(apart.argmax())
    start, goal = first[at], last[at]
    above = 1 if start[1] >= goal[1] else -1
    for name, place, side in (("start", start, above), ("goal", goal, -above)):
        ax.annotate(
            name, place, (0, 4 * side), textcoords="offset points", ha="center",
            va="bottom" if side > 0 else "top", weight="bold", path_effects=style.RIM, zorder=8,
        )  # fmt: skip
