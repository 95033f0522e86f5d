"""Shapes of a structure: along a path, single, numbered, or fitted to measured points."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from mpl_toolkits.axes_grid1 import make_axes_locatable
from mpl_toolkits.mplot3d import proj3d

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.equilibria import Path
from equimorph.errors import InputError
from equimorph.model import Obstacle
from equimorph.plotting import style
from equimorph.plotting.curves import path_of, states_along
from equimorph.plotting.depth import flat_shapes
from equimorph.plotting.labels import BOX, with_unit
from equimorph.plotting.surroundings import Surroundings, frame_shapes, limits
from equimorph.structures import States
from equimorph.tasks.calibration.calibrate import Calibration
from equimorph.tasks.calibration.measurements import MeasuredShape
from equimorph.tasks.route import Route

_MARGINS = (0.54, 0.36, 0.14, 0.06)
"""Inches around the frame: left, bottom, right, top."""

Outlines = Float[np.ndarray, "states points 2"]


def prepare_axes(
    states: States,
    ax: Axes | None,
    *,
    room: float,
    below: float = 0.0,
    obstacles: Sequence[Obstacle] = (),
) -> tuple[Axes, Surroundings]:
    """Axes with the surroundings of states and limits around all their outlines.

    `room` is the empty border, as a share of the width of the outlines; `below` the inches of a new
    figure that stay free for what comes below the axes.
    """
    around = Surroundings(states, tuple(obstacles))
    if ax is None:
        height = _height(around, room) + below
        ax = style.new_axes(style.SINGLE_COLUMN, height, _MARGINS)
    frame_shapes(ax, around, room)
    around.label_axes(ax)
    around.draw_still(ax)
    return ax, around


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


_ROOM = 0.085
"""Empty border, as a share of the width of the outlines."""
_BAR = 0.5
"""Inches for the colour bar and the labels above it."""


@check_arguments
def shapes(
    path_or_route: Path | Route,
    count: int = 13,
    ax: Axes | None = None,
    obstacles: Sequence[Obstacle] = (),
) -> Axes:
    """Shapes at even distances along a path, from dark (start) to light (goal).

    Parameters
    ----------
    path_or_route
        A lifted path, or a route that has one.
    count
        How many shapes, the first and the last included; at least 2.
    ax
        Where to draw; None makes a figure one column wide.
    obstacles
        Half-planes and discs that the shapes stay clear of, to draw.

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
    with style.house_style():
        ax, around = prepare_axes(states, ax, room=_ROOM, below=_BAR, obstacles=obstacles)
        outlines = around.outlines
        progress = np.linspace(0.0, 1.0, count)
        colours = style.progress_map()(progress)
        widths = np.full(count, 0.9)
        widths[[0, -1]] = 2.2
        around.draw_shapes(ax, colours, 2, linewidths=widths)
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


_PORTRAIT_ROOM = 0.1
"""Empty border of single states, as a share of the width of the outlines."""
_DASHES = ("solid", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1.5, 1, 1.5)))
"""Line styles of successive shapes."""


@check_arguments
def portraits(states: States, labels: Sequence[str] = (), ax: Axes | None = None) -> Axes:
    """Shapes of states, each with its label where it is farthest from the other shapes.

    Parameters
    ----------
    states
        At least one.
    labels
        One for each state; by default numbers from 1.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        If there are no states, or not as many labels as states.
    """
    names = list(labels) or [str(k) for k in range(1, len(states) + 1)]
    if not len(states) or len(names) != len(states):
        raise InputError(
            f"`labels` must be one for each of one or more states; got {len(names)} for "
            f"{len(states)}."
        )
    with style.house_style():
        ax, around = prepare_axes(states, ax, room=_PORTRAIT_ROOM)
        outlines = around.outlines
        colours = style.progress_map()(np.linspace(0.0, 0.8, len(states)))
        if around.viewpoint is not None:
            around.draw_shapes(ax, colours, 3)
        for k, (outline, at) in enumerate(zip(outlines, farthest_apart(outlines), strict=True)):
            if around.viewpoint is None:
                look = {"color": colours[k], "linestyle": _DASHES[k % len(_DASHES)]}
                ax.plot(*outline.T, linewidth=1.6, zorder=3, **look)
            above = outline[at, 1] >= np.median(outlines[:, at, 1])
            ax.annotate(
                names[k], tuple(outline[at].tolist()), (0, 3 if above else -3), ha="center",
                va="bottom" if above else "top", textcoords="offset points", zorder=8,
                path_effects=style.RIM,
            )  # fmt: skip
    return ax


_INDISTINCT = 1e-6
"""Largest distance between corresponding points of two outlines that are drawn once."""
_NUMBERED_ROOM = 0.09
"""Empty border of numbered shapes, as a share of the width of the outlines."""
_AWAY = 11.0
"""Typographic points from a shape to its number."""


def numbered_shapes(ax: Axes, states: States) -> None:
    """Different shapes of states, each numbered where it is farthest from the other shapes."""
    around = Surroundings(states)
    outlines = around.outlines
    frame_shapes(ax, around, _NUMBERED_ROOM)
    around.draw_still(ax)
    different = [
        k
        for k, outline in enumerate(outlines)
        if not any(np.abs(outline - other).max() < _INDISTINCT for other in outlines[:k])
    ]
    colours = style.progress_map()(np.linspace(0.0, 1.0, len(states)))
    shown = outlines[different]
    Surroundings(states[different]).draw_shapes(ax, colours[different], 2, linewidths=1.3)
    for k, outline, at in zip(different, shown, farthest_apart(shown), strict=True):
        up = bool(outline[at, 1] >= np.median(shown[:, at, 1]))
        text = ax.annotate(
            str(k + 1), tuple(outline[at].tolist()), (0, 2.5 if up else -2.5),
            textcoords="offset points", ha="center", va="bottom" if up else "top",
            color=colours[k], weight="bold", zorder=4,
        )  # fmt: skip
        text.set_path_effects(style.RIM)
    around.label_axes(ax)


def number_in_space(ax: Any, places: Float[np.ndarray, "_ 3"]) -> None:
    """Number places in three-dimensional axes, away from their middle as it is seen."""
    x, y, _ = proj3d.proj_transform(*places.T, ax.get_proj())
    seen = np.stack([np.asarray(x), np.asarray(y)], axis=1)
    outward = seen - seen.mean(axis=0)
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-12)
    for number, (there, way) in enumerate(zip(seen, outward, strict=True), start=1):
        ax.annotate(
            str(number), tuple(there), tuple(_AWAY * way), textcoords="offset points", size=6.5,
            ha="center", va="center", zorder=8, bbox=BOX,
        )  # fmt: skip


_BORDER_OF_FIT = 0.06
"""Empty border, as a share of the width of the outlines."""
_BELOW = 1.15
"""Inches for the residuals and the labels above them."""
_GAP = 0.42
"""Inches between the shapes and the residuals."""
_AXIS_LOOKS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("$x$", "o", {}),
    ("$y$", "s", {"mfc": "white"}),
    ("$z$", "^", {"mfc": "white"}),
)


@check_arguments
def calibration(found: Calibration, measured: MeasuredShape, ax: Axes | None = None) -> Axes:
    """Shapes at the fitted unknowns under the measured points; below, the residuals.

    Parameters
    ----------
    found
        A calibration on one `MeasuredShape` alone.
    measured
        What it was fitted to.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes of the shapes.

    Raises
    ------
    InputError
        If the residuals are not those of the measured points.
    """
    points = np.asarray(measured.points, dtype=float)
    there = np.isfinite(points)
    if there.sum() != len(found.residuals):
        raise InputError(
            f"`measured` must be the shape that was fitted, with {len(found.residuals)} numbers; "
            f"got {there.sum()}."
        )
    left = np.full(points.shape, np.nan)
    left[there] = found.residuals
    colours = style.progress_map()(np.linspace(0.0, 0.85, len(points)))
    with style.house_style():
        ax, around = prepare_axes(found.states, ax, room=_BORDER_OF_FIT, below=_BELOW)
        around.draw_shapes(ax, colours, 2, linewidths=1.0)
        for dots, colour in zip(flat_shapes(found.states.structure, points), colours, strict=True):
            ax.plot(
                *dots.T, "o", ms=3, mfc="white", mec=colour, mew=0.8, linestyle="none", zorder=3
            )
        below = make_axes_locatable(ax).append_axes("bottom", size=_BELOW - _GAP, pad=_GAP)
        places = np.linspace(0.0, 1.0, points.shape[1]) if measured.s is None else measured.s
        _draw_residuals(below, np.asarray(places, dtype=float), left, colours)
        unit = found.states.structure.length_unit
        below.set_ylabel(
            "residual / σ" if measured.sigma is not None else with_unit("residual", unit)
        )
    return ax


def _draw_residuals(
    ax: Axes,
    places: Float[np.ndarray, " points"],
    left: Float[np.ndarray, "states points space"],
    colours: Float[np.ndarray, "states 4"],
) -> None:
    """Residuals, fitted minus measured coordinates, over the arclengths of the points."""
    ax.axhline(0.0, color=style.FAINT, linewidth=style.HAIRLINE, zorder=1)
    for own, colour in zip(left, colours, strict=True):
        for values, (_, marker, look) in zip(own.T, _AXIS_LOOKS, strict=False):
            ax.plot(
                places, values, marker, ms=2.8, color=colour, mew=0.7, zorder=3, **look
            )  # fmt: skip
    for name, marker, look in _AXIS_LOOKS[: left.shape[2]]:
        ax.plot([], [], marker, ms=2.8, color=style.INK, mew=0.7, label=name, **look)
    largest = np.nanmax(np.abs(left), initial=1e-300)
    ax.set_ylim(-1.2 * largest, 1.2 * largest)
    ax.set_xlabel("$s$")
    ax.yaxis.set_major_locator(style.few_ticks())
    ax.legend(
        loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=2, handletextpad=0.1, columnspacing=0.8
    )
