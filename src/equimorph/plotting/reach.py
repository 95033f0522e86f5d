"""What a structure can reach: descriptor plane, set, parameter plane and shapes side by side."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.charts.regions import count_regions
from equimorph.errors import InputError
from equimorph.plotting import style
from equimorph.plotting.labels import descriptor_label, number_way_points, parameter_label
from equimorph.plotting.shapes import numbered_shapes
from equimorph.plotting.surface import surface
from equimorph.tasks.motion.tracking import Tracking
from equimorph.tasks.reach.reachable_sets import Reach

_HEIGHT = 148 * style.MILLIMETRE
# distinguishable in black and white, too
_LOOKS: dict[str, dict[str, Any]] = {
    "snap-through": {"color": style.INK, "linewidth": 1.7, "linestyle": "-"},
    "singular Jacobian": {"color": "#1f5f99", "linewidth": 1.5, "linestyle": (0, (5, 1.3))},
    "actuator limit": {"color": "#b36200", "linewidth": 1.3, "linestyle": (0, (1, 1))},
    "constraint": {"color": style.FAINT, "linewidth": 1.3, "linestyle": "-"},
    "open": {"color": style.FAINT, "linewidth": 0.8, "linestyle": (0, (1, 3))},
}
_MOTION: dict[str, Any] = {"color": style.ROUTE_COLOUR, "linewidth": 1.4, "zorder": 6}
_RIM = style.rim(2.6)
_VISIBLE = 2e-3
"""Area that is covered several times, as a share of the image, below which it is a trace of
chords."""

Line = Float[np.ndarray, "_ 2"]


@check_arguments
def reach_plane(
    reach: Reach,
    motion: Tracking | None = None,
    ax: Axes | None = None,
    *,
    targets: Sequence[Sequence[float]] = (),
) -> Axes:
    """Image of the start's region in the plane of two descriptors, with its boundary by kinds.

    Darker where the region covers the plane more than once.

    Parameters
    ----------
    reach
        Reachable or attainable set over two parameters, of two descriptors.
    motion
        Drawn by the values that it takes, with its corners numbered.
    ax
        Where to draw; None makes a figure one column wide.
    targets
        Requested values, numbered from 1.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        If there are not two parameters and two descriptors.
    """
    _check(reach)
    with style.house_style():
        own, ax = ax is None, _axes(ax)
        levels = count_regions(reach.home.values, reach.home.eset.cells)
        whole, areas = reach.home.image_size, levels.areas()
        last = max((k for k, area in areas.items() if area > _VISIBLE * whole), default=0)
        shades = style.count_shades(last + 2)
        for level, shade in zip(levels.levels[:last], shades[1:], strict=False):
            ax.add_patch(style.area(level, facecolor=shade, edgecolor="none", zorder=1))
        _boundary(ax, reach, [piece.values for piece in reach.boundary])
        start = np.array([each(reach.start) for each in reach.descriptors])
        _motion(ax, start, None if motion is None else _values(motion))
        first, second = reach.descriptors
        ax.set_xlabel(descriptor_label(first))
        ax.set_ylabel(descriptor_label(second))
        ax.set_aspect("equal" if first.unit == second.unit else "auto", adjustable="datalim")
        if motion is not None:
            number_way_points(ax, _corners(motion, _values(motion)))
        if len(targets):
            ax.autoscale_view()
            number_way_points(ax, np.array(targets, dtype=float))
        if own:
            style.legend_below(ax, _entries(reach), room=True)
    return ax


@check_arguments
def reach_parameters(reach: Reach, motion: Tracking | None = None, ax: Axes | None = None) -> Axes:
    """Region of the start in the plane of two parameters, with its boundary by kinds.

    Parameters
    ----------
    reach
        Reachable or attainable set over two parameters.
    motion
        Drawn with its corners numbered.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        If there are not two parameters and two descriptors.
    """
    _check(reach)
    with style.house_style():
        own, ax, eset = ax is None, _axes(ax), reach.home.eset
        shade = style.count_shades(3)[1]
        cells = PolyCollection(
            list(eset.coordinates[eset.cells]), facecolor=shade, edgecolor=shade,
            linewidth=0.3, zorder=1,
        )  # fmt: skip
        ax.add_collection(cells)
        names = eset.names
        lines = [_columns(piece.states, names) for piece in reach.boundary]
        _boundary(ax, reach, lines)
        start = np.array([reach.start[name] for name in names])
        track = None if motion is None else _columns(motion.states, names)
        _motion(ax, start, track)
        ax.set_xlabel(parameter_label(eset.structure, names[0]))
        ax.set_ylabel(parameter_label(eset.structure, names[1]))
        if motion is not None and track is not None:
            number_way_points(ax, _corners(motion, track))
        if own:
            style.legend_below(ax, _entries(reach), room=True)
    return ax


@check_arguments
def reach_panels(reach: Reach, motion: Tracking) -> Figure:
    """Reachable set and a motion in it: image, set, parameter plane and shapes.

    Parameters
    ----------
    reach
        Reachable or attainable set over two parameters, of two descriptors.
    motion
        A motion that was followed.

    Returns
    -------
    The figure, two columns wide.

    Raises
    ------
    InputError
        If there are not two parameters and two descriptors.
    """
    _check(reach)
    width = style.DOUBLE_COLUMN
    figure = style.Picture(width, _HEIGHT)
    with style.house_style():
        places = [(0.075, 0.58, 0.385, 0.385), (0.075, 0.115, 0.385, 0.385)]
        image, plane = (figure.add_axes(place) for place in places)
        shapes = figure.add_axes((0.575, 0.115, 0.405, 0.385))
        solid = figure.add_axes((0.475, 0.525, 0.47, 0.475), projection="3d")
        reach_plane(reach, motion, image)
        surface(reach.whole, reach.start.structure.elevation, solid, motion)
        legend = solid.get_legend()
        assert legend is not None
        legend.remove()  # below are all kinds of lines
        reach_parameters(reach, motion, plane)
        numbered_shapes(shapes, motion.states[np.array(_steps(motion))])
        shapes.set_anchor("C")
        style.letter_panels("acd", (image, plane, shapes))
        figure.text(0.515, 0.968, "(b)", weight="bold", size=8)
        entries = _entries(reach)
        entries.append(Line2D([], [], label="motion", **_MOTION))
        figure.legend(handles=entries, loc="lower center", ncols=5, bbox_to_anchor=(0.5, 0.0))
    return figure


def _check(reach: Reach) -> None:
    count, free = len(reach.descriptors), len(reach.whole.names)
    if (count, free) != (2, 2):
        raise InputError(
            f"`reach` must be over two parameters, of two descriptors; got {free} and {count}."
        )


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    room = (0.62, 0.4, 0.1, 0.1)
    return style.new_axes(style.SINGLE_COLUMN, 0.9 * style.SINGLE_COLUMN, room)


def _boundary(ax: Axes, reach: Reach, lines: list[Line]) -> None:
    for piece, line in zip(reach.boundary, lines, strict=True):
        ax.plot(*line.T, **_LOOKS[piece.kind], zorder=4)


def _entries(reach: Reach) -> list[Line2D]:
    """Lines for a legend of the kinds of the boundary."""
    kinds = {piece.kind for piece in reach.boundary}
    return [Line2D([], [], label=kind, **_LOOKS[kind]) for kind in _LOOKS if kind in kinds]


def _motion(ax: Axes, start: Float[np.ndarray, " 2"], line: Line | None) -> None:
    if line is not None:
        (drawn,) = ax.plot(*line.T, **_MOTION)
        drawn.set_path_effects(_RIM)
    (mark,) = ax.plot(*start[:, None], "o", color=style.ROUTE_COLOUR, ms=4, mfc="white", zorder=7)
    mark.set_path_effects(_RIM)


def _values(motion: Tracking) -> Line:
    return np.stack(list(motion.values.values()), axis=1)


def _columns(states: Any, names: tuple[str, ...]) -> Line:
    return np.stack([states[name] for name in names], axis=1)


def _steps(motion: Tracking) -> list[int]:
    """Corners of a motion but for its start."""
    at = motion.path.at
    corners = np.flatnonzero(np.isclose(at, np.round(at), rtol=0, atol=1e-12))
    return [int(k) for k in corners[1:]]


def _corners(motion: Tracking, line: Line) -> Float[np.ndarray, "corners 2"]:
    return line[_steps(motion)]
