"""The frame in which outlines of states are drawn: aspect, limits, labels, surroundings."""

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes

from equimorph.plotting import style
from equimorph.plotting.surroundings import Surroundings, frame_shapes, limits
from equimorph.plotting.symbols import with_unit
from equimorph.structures import States

_MARGINS = (0.54, 0.36, 0.14, 0.06)  # inches around the frame: left, bottom, right, top

Outlines = Float[np.ndarray, "states points 2"]


def framed(states: States, ax: Axes | None, *, room: float, below: float = 0.0) -> Axes:
    """Axes with the surroundings of states and limits around all their outlines.

    Parameters
    ----------
    states
        At least one.
    ax
        Where to draw; None makes a figure one column wide.
    room
        Empty border, as a share of the width of the outlines.
    below
        Inches of a new figure that stay free for what comes below the axes.
    """
    around = Surroundings(states)
    if ax is None:
        height = _height(around, room) + below
        ax = style.new_axes(style.SINGLE_COLUMN, height, _MARGINS)
    frame_shapes(ax, around, room)
    unit = states.structure.length_unit
    ax.set_xlabel(with_unit("$x$", unit))
    ax.set_ylabel(with_unit("$y$", unit))
    ax.xaxis.set_major_locator(style.few_ticks())
    ax.yaxis.set_major_locator(style.few_ticks())
    around.draw_still(ax)
    return ax


def _height(around: Surroundings, room: float) -> float:
    """Height of a figure one column wide whose drawing keeps its aspect without empty bands."""
    low, high = limits(around, room)
    width, height = high - low
    left, bottom, right, top = _MARGINS
    drawing = (style.SINGLE_COLUMN - left - right) * float(height / width)
    return bottom + top + min(drawing, 1.4 * style.SINGLE_COLUMN)


def farthest_apart(outlines: Outlines) -> list[int]:
    """Where each outline is farthest from its nearest neighbour at the same share of its way."""
    if len(outlines) == 1:
        return [outlines.shape[1] // 2]
    gaps = np.linalg.norm(outlines[:, None] - outlines[None], axis=3)
    gaps[np.arange(len(outlines)), np.arange(len(outlines))] = np.inf
    return [int(at) for at in gaps.min(axis=1).argmax(axis=1)]
