"""Deviation of a replay from the equilibria, over time."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from equimorph.argument_checks import check_arguments
from equimorph.dynamics import Replay
from equimorph.plotting import style
from equimorph.tasks.timing.speed import SpeedLimit

_SMALLEST = 1e-7
"""Least deviation that is drawn, relative to the largest."""

_AFTER = 1.25
"""End of the time axis relative to when a motion that snaps leaves: no deviation is known then."""


@check_arguments
def deviation_over_time(
    played: Replay, limit: SpeedLimit | None = None, *, ax: Axes | None = None
) -> Axes:
    """Largest distance of a point from its equilibrium, and its two parts, on a logarithmic scale.

    Parameters
    ----------
    played
        The replay.
    limit
        A limit of speed whose bound is drawn, too; its times are scaled to the replay's.
    ax
        Axes to draw in; None: new ones, a column wide.

    Returns
    -------
    The axes.
    """
    with style.house_style():
        if ax is None:
            figure = style.attach_canvas(Figure(figsize=(style.SINGLE_COLUMN, 2.2)))
            ax = figure.add_axes((0.17, 0.19, 0.79, 0.76))
        floor = _SMALLEST * played.largest_deviation
        parts = (
            ("chain of links", played.discretisation, style.FAINT, 1.0),
            ("motion", played.dynamics, style.INDEX_COLOURS[1], 1.0),
            ("both", played.deviation, style.INDEX_COLOURS[0], 1.6),
        )
        for label, values, colour, width in parts:
            if np.nanmax(values, initial=0.0) > floor:
                shown = np.maximum(values, floor)
                ax.plot(played.times, shown, color=colour, linewidth=width, label=label)
        if limit is not None:
            _draw_bound(ax, played, limit)
        if played.fold is not None:
            ax.axvline(played.fold, color=style.FAINT, linewidth=0.8, linestyle=":")
            ax.annotate("fold", (played.fold, 1.0), (-2, -2), xycoords=("data", "axes fraction"),
                        textcoords="offset points", ha="right", va="top", size=6.5)  # fmt: skip
        if played.where is not None:
            ax.axvline(played.where, color=style.ROUTE_COLOUR, linewidth=0.9, linestyle=":")
            ax.annotate("leaves", (played.where, 1.0), (2, -2), xycoords=("data", "axes fraction"),
                        textcoords="offset points", ha="left", va="top", size=6.5,
                        color=style.ROUTE_COLOUR)  # fmt: skip
        ax.set_yscale("log")
        last = float(played.times[-1])
        ax.set_xlim(0.0, last if played.where is None else min(last, _AFTER * played.where))
        ax.set_xlabel("time")
        ax.set_ylabel("largest deviation")
        ax.legend(frameon=False, fontsize=6.5, loc="lower right")
    return ax


def _draw_bound(ax: Axes, played: Replay, limit: SpeedLimit) -> None:
    """The bound of a speed limit at the replay's speed: it grows with the rate."""
    moving = float(played.times[-2])
    assert limit.schedule.times is not None
    faster = limit.duration / moving
    ax.plot(
        limit.schedule.times / faster, limit.bound * faster, color=style.INK, linewidth=0.9,
        linestyle="--", label="bound before",
    )  # fmt: skip
