"""Shapes of single states, side by side in one frame."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from equimorph.errors import InputError
from equimorph.plotting import style
from equimorph.plotting.outlines import farthest_apart, framed
from equimorph.structures import States

_ROOM = 0.1
_DASHES = ("solid", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1.5, 1, 1.5)))


def portraits(states: States, labels: Sequence[str] = (), ax: Axes | None = None) -> Axes:
    """Shapes of states, each with its label where it is farthest from the others.

    Parameters
    ----------
    states
        At least one.
    labels
        One for each; numbers from 1 if there are none.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        Without states, or for another number of labels.
    """
    names = list(labels) or [str(k) for k in range(1, len(states) + 1)]
    if not len(states) or len(names) != len(states):
        raise InputError(
            f"`labels` must be one for each of one or more states; got {len(names)} for "
            f"{len(states)}."
        )
    outlines = states.shape()
    with style.house_style():
        ax = framed(states, ax, room=_ROOM)
        colours = style.progress_map()(np.linspace(0.0, 0.8, len(states)))
        for k, (outline, at) in enumerate(zip(outlines, farthest_apart(outlines), strict=True)):
            look = {"color": colours[k], "linestyle": _DASHES[k % len(_DASHES)]}
            ax.plot(*outline.T, linewidth=1.6, zorder=3, **look)
            above = outline[at, 1] >= np.median(outlines[:, at, 1])
            ax.annotate(
                names[k], tuple(outline[at].tolist()), (0, 3 if above else -3), ha="center",
                va="bottom" if above else "top", textcoords="offset points", zorder=8,
                path_effects=style.RIM,
            )  # fmt: skip
    return ax
