"""Deviation of a replay from the equilibria, over time."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.dynamics import Replay
from equimorph.plotting import style
from equimorph.plotting.depth import viewpoint_of
from equimorph.plotting.film import film_file, write_film
from equimorph.tasks.timing.speed import SpeedLimit

_SMALLEST = 1e-4
"""Least deviation that is drawn, relative to the largest."""

_WIDTH, _HEIGHT, _DOTS = 6.4, 2.8, 120
"""Inches of a frame, and pixels per inch."""
_STATICS = "#cfcfcf"
_ROOM = 0.08
"""Empty room around shapes, relative to their size."""
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
            figure = style.Picture(style.SINGLE_COLUMN, 2.2)
            ax = figure.add_axes((0.17, 0.19, 0.79, 0.69))
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
        ax.legend(
            frameon=False, fontsize=6.5, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4,
            columnspacing=1.2, handlelength=1.5, borderaxespad=0.2,
        )  # fmt: skip
    return ax


@check_arguments
def replay_film(played: Replay, path: str | Path, *, frames: int = 60, fps: int = 20) -> Path:
    """Write a film: the structure in the simulator over its equilibria, and the deviation.

    Parameters
    ----------
    played
        The replay.
    path
        File to write, a GIF, or an MP4 if the program ffmpeg is there; its folder must exist.
    frames
        Number of pictures, at least 2.
    fps
        Pictures per second.

    Returns
    -------
    The file.

    Raises
    ------
    InputError
        If the file cannot be of the kind that its name says.
    """
    file = film_file(path)
    shown = np.unique(np.linspace(0, len(played.times) - 1, frames).round().astype(int))
    figure = Figure(figsize=(_WIDTH, _HEIGHT), dpi=_DOTS)
    canvas: Any = FigureCanvasAgg(figure)  # matplotlib's canvas has no types
    left = figure.add_axes((0.01, 0.02, 0.5, 0.96))
    deviation_over_time(played, ax=figure.add_axes((0.62, 0.17, 0.35, 0.7)))
    (now,) = figure.axes[1].plot([], [], "o", color=style.INK, ms=5, zorder=9)
    moving, still = (_lines(played, each) for each in (played.points, played.statics))
    lines = [
        left.plot([], [], color=colour, linewidth=width)[0]
        for colour, width in ((_STATICS, 4.0), (style.INDEX_COLOURS[0], 1.6))
    ]
    ends = [getattr(np, f"nan{end}")(moving, axis=(0, 1)) for end in ("min", "max")]
    room = _ROOM * float((ends[1] - ends[0]).max())
    left.set(xlim=(ends[0][0] - room, ends[1][0] + room), aspect="equal")
    left.set_ylim(ends[0][1] - room, ends[1][1] + room)
    left.axis("off")
    pictures = []
    for k in shown:
        for line, places in zip(lines, (still, moving), strict=True):
            line.set_data(*places[k].T)
        now.set_data([played.times[k]], [max(played.deviation[k], 0.0)])
        canvas.draw()
        pictures.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB"))
    write_film(pictures, file, fps)
    return file


def _lines(
    played: Replay, points: Float[np.ndarray, "times points space"]
) -> Float[np.ndarray, "times drawn 2"]:
    """Points as they are seen, with a gap after each line."""
    times, _, space = points.shape
    chains = points.reshape(times, -1, played.chain, space)
    gap = np.full((times, chains.shape[1], 1, space), np.nan)
    drawn = np.concatenate([chains, gap], axis=2).reshape(times, -1, space)
    return drawn if space == 2 else viewpoint_of(played.structure).flat(drawn)


def _draw_bound(ax: Axes, played: Replay, limit: SpeedLimit) -> None:
    """The bound of a speed limit at the replay's speed: it grows with the rate."""
    moving = float(played.times[-2])
    assert limit.schedule.times is not None
    faster = limit.duration / moving
    ax.plot(
        limit.schedule.times / faster, limit.bound * faster, color=style.INK, linewidth=0.9,
        linestyle="--", label="bound before",
    )  # fmt: skip
