"""Parameter planes: how many equilibria where, folds, routes, states; diagrams of one parameter."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Int
from equimorph.charts.regions import count_equilibria
from equimorph.equilibria import Path
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet, divided_by
from equimorph.manifold.geometry.topology import pieces
from equimorph.model import Constraint, Descriptor
from equimorph.plotting import style
from equimorph.plotting.counts import (
    count_bar,
    hatch_cut,
    label_of_counts,
    least_count,
    shade_regions,
    write_counts,
)
from equimorph.plotting.curves import (
    boundary_pieces,
    crossing_pieces,
    fold_pieces,
    legs,
    limit_pieces,
    snap_steps,
    track,
    way_points,
    way_points_of,
)
from equimorph.plotting.labels import (
    constraint_label,
    descriptor_label,
    number_points,
    number_way_points,
    parameter_label,
)
from equimorph.structures import States
from equimorph.tasks.route import Route
from equimorph.tasks.start import check_two_parameters

_STABILITY_BOUNDARY: dict[str, Any] = {"color": style.INK, "linewidth": 1.4, "zorder": 4}
_OTHER_FOLD: dict[str, Any] = {"color": style.INK, "linewidth": 0.6, "zorder": 3}
_DASHES = {"linestyle": (0, (4, 1.2, 1, 1.2))}
"""Of branch points, as in `surface`."""
_CAP: dict[str, Any] = {
    "color": style.INK,
    "linewidth": 0.6,
    "linestyle": (0, (3, 2)),
    "zorder": 3,
}
_ROUTE: dict[str, Any] = {"color": style.ROUTE_COLOUR, "linewidth": 1.6, "zorder": 6}

_SNAP: dict[str, Any] = {
    "marker": "*",
    "linestyle": "none",
    "ms": 10,
    "mfc": "white",
    "mec": style.ROUTE_COLOUR,
    "mew": 1.0,
}

_FRAME_HEIGHT = 2.16
"""Inches of the frame."""
_LEFT, _BOTTOM, _RIGHT, _TOP = 0.58, 0.4, 0.4, 0.08
"""Inches around the frame."""
_LONG_LEG, _BETWEEN = 0.12, 0.6
"""Length, as a share of the picture, from which on a leg gets arrow heads, and length between two
of them."""


@check_arguments
def parameter_plane(
    eset: EquilibriumSet,
    route: Route | None = None,
    ax: Axes | None = None,
    *,
    count: str = "all",
    limit: Constraint | None = None,
) -> Axes:
    """Number of equilibria over the parameters, with fold curves and a route.

    Regions are exact for the cells of the set, see `equimorph.charts.regions`. A region without
    equilibria that a constraint of the set bounds is hatched and has no number: there may be states
    beyond the constraint, at which the set is cut.

    Parameters
    ----------
    eset
        Equilibrium set over two free parameters.
    route
        Drawn with its way-points numbered; a route without a path is omitted.
    ax
        Where to draw; None makes a figure one column wide.
    count
        Which equilibria to count: "all" or "stable".
    limit
        Its bound is drawn where it meets states that are counted.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        If `count` is neither "all" nor "stable".
    """
    if count not in ("all", "stable"):
        raise InputError(f'`count` must be "all" or "stable"; got {count!r}.')
    with style.house_style():
        own = ax is None
        if ax is None:
            height = _BOTTOM + _FRAME_HEIGHT + _TOP
            ax = style.new_axes(style.SINGLE_COLUMN, height, (_LEFT, _BOTTOM, _RIGHT, _TOP))
        regions = count_equilibria(eset, stable_only=count == "stable")
        frame_plane(ax, eset)
        largest = shade_regions(ax, eset, regions)
        lines = draw_folds(ax, eset, stable_only=count == "stable")
        hatched = hatch_cut(ax, eset, regions, stable_only=count == "stable")
        if limit is not None:
            lines += _draw_limit(ax, eset, limit, stable_only=count == "stable")
        covered = np.empty((0, 2))
        if route is not None and route.path is not None:
            lines += [draw_track(ax, eset, route, route.path), *_mark_snaps(ax, eset, route)]
            corners = way_points(eset, route)[: None if route.status == "arrived" else -1]
            _draw_directions(ax, legs(eset, route))
            covered = np.concatenate(
                [_places_along(eset, route.path), number_way_points(ax, corners)]
            )
        write_counts(ax, regions, largest, covered, hatched)
        what = "equilibria" if count == "all" else "stable equilibria"
        least = least_count(eset, regions, hatched)
        count_bar(ax, least, largest, label_of_counts(what, eset.constraints))
        entries = [*lines, *hatched[:1]]
        style.legend_below(ax, entries, room=own)
    return ax


def frame_plane(ax: Axes, eset: EquilibriumSet) -> None:
    """Limits and labels of the plane of the free parameters."""
    ax.set_xlim(eset.box.lower[0], eset.box.upper[0])
    ax.set_ylim(eset.box.lower[1], eset.box.upper[1])
    ax.set_xlabel(parameter_label(eset.structure, eset.names[0]))
    ax.set_ylabel(parameter_label(eset.structure, eset.names[1]))


def draw_folds(ax: Axes, eset: EquilibriumSet, *, stable_only: bool = False) -> list[Line2D]:
    """Draw the stability boundary, the other folds, branch points and the caps.

    Branch points are drawn boldly where stability ends there. Returns a labelled line of every kind
    drawn, for a legend.
    """
    cap = constraint_label(eset.constraints)
    branches = "branch points"
    looks = {"stability boundary": _STABILITY_BOUNDARY, "other folds": _OTHER_FOLD, cap: _CAP}
    looks |= {branches: {**_OTHER_FOLD, **_DASHES}}
    pieces = [
        ("stability boundary" if low == 0 else "other folds", line, low)
        for line, low in fold_pieces(eset)
    ]
    pieces += [(cap, line, index) for line, index in boundary_pieces(eset, box=False)]
    # those where stability ends come last, so that the legend shows them
    met = sorted(crossing_pieces(eset), key=lambda piece: -piece[1])
    pieces += [(branches, line, low) for line, low in met]
    kinds: dict[str, Line2D] = {}
    for label, vertices, low in pieces:
        if low == 0 or not stable_only:
            look = looks[label]
            if label == branches and low == 0:
                look = {**_STABILITY_BOUNDARY, **_DASHES}
            (kinds[label],) = ax.plot(*eset.coordinates[vertices].T, **look, label=label)
    return [kinds[label] for label in looks if label in kinds]


def _draw_limit(
    ax: Axes, eset: EquilibriumSet, limit: Constraint, *, stable_only: bool
) -> list[Line2D]:
    """Draw the bound of a constraint; return one labelled line, if it meets the set."""
    division = divided_by(eset, limit)
    places, label = division.eset.coordinates, constraint_label([limit])
    drawn = [
        ax.plot(*places[line].T, **style.LIMIT_LINE, zorder=4, label=label)[0]
        for line, low in limit_pieces(division)
        if low == 0 or not stable_only
    ]
    return drawn[:1]


def draw_track(ax: Axes, eset: EquilibriumSet, route: Route, path: Path) -> Line2D:
    """Draw the way of a route over the plane; one that did not arrive ends in a cross.

    Returns the labelled line, for a legend.
    """
    places = track(eset, path.states)
    (line,) = ax.plot(*places.T, **_ROUTE, label="route")
    line.set_path_effects(style.rim(3.0))
    if route.status != "arrived":
        line.set_label(f"route, refused (× {path.end.kind})")
        ax.plot(*way_points_of(eset, route).T, **_ROUTE | {"linewidth": 0.9, "linestyle": ":"})
        (cross,) = ax.plot(*places[-1:].T, "x", color=style.ROUTE_COLOUR, ms=6, mew=1.6, zorder=8)
        cross.set_path_effects(style.rim(3.0))
    return line


def _mark_snaps(ax: Axes, eset: EquilibriumSet, route: Route) -> list[Line2D]:
    """Mark where a route snaps; return one labelled line if it does."""
    if route.path is None or not route.snaps:
        return []
    places = track(eset, route.path.states)[snap_steps(route)]
    return ax.plot(*places.T, **_SNAP, zorder=8, label="snap")


def _draw_directions(ax: Axes, ways: Sequence[Float[np.ndarray, "_ 2"]]) -> None:
    """Arrow heads at even distances along the longer ones of some lines."""
    size = np.array([np.ptp(ax.get_xlim()), np.ptp(ax.get_ylim())])
    look = {"arrowstyle": "-|>,head_width=0.22,head_length=0.4", "color": style.ROUTE_COLOUR}
    for way in ways:
        steps = np.linalg.norm(np.diff(way, axis=0) / size, axis=1)
        done = np.concatenate([[0.0], np.cumsum(steps)])
        count = max(1, round(done[-1] / _BETWEEN)) if done[-1] > _LONG_LEG else 0
        for share in (np.arange(count) + 0.5) / max(count, 1):
            shares = np.array([share, share + 0.01]) * done[-1]
            middle, tip = np.stack([np.interp(shares, done, column) for column in way.T], axis=1)
            ax.annotate(
                "", tip, middle, zorder=6.5,
                arrowprops=look | {"lw": 0, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 12},
            )  # fmt: skip


def _places_along(eset: EquilibriumSet, path: Path) -> Float[np.ndarray, "places 2"]:
    """Places that a path covers, where no count should be written."""
    line = track(eset, path.states)
    between = [line[:-1] + t * np.diff(line, axis=0) for t in (0.0, 0.25, 0.5, 0.75)]
    return np.concatenate([*between, line[-1:]])


_STABLE: dict[str, Any] = {"marker": "o", "ms": 5, "mfc": style.ROUTE_COLOUR, "mec": "white"}
_UNSTABLE: dict[str, Any] = {"marker": "o", "ms": 5, "mfc": "white", "mec": style.ROUTE_COLOUR}


@check_arguments
def solutions(eset: EquilibriumSet, states: States, ax: Axes | None = None) -> Axes:
    """Mark states on the plane of the free parameters, filled where stable.

    Parameters
    ----------
    eset
        Equilibrium set over two free parameters.
    states
        Equilibria of the set; they are numbered from 1 in their order.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        If the set has not two free parameters.
    """
    check_two_parameters(eset)
    ax = parameter_plane(eset, ax=ax)
    if not len(states):
        return ax
    places = track(eset, states)
    with style.house_style():
        for stable, look in ((True, _STABLE), (False, _UNSTABLE)):
            mine = places[(states.index == 0) == stable]
            ax.plot(*mine.T, linestyle="none", zorder=7, mew=0.8, **look)
        number_points(ax, places)
    return ax


# Stable pieces stand out by width and a full line, so that no colour is needed.
_STABLE_LOOK: dict[str, Any] = {"linewidths": 1.8, "linestyles": "solid", "zorder": 3}
_UNSTABLE_LOOK: dict[str, Any] = {"linewidths": 0.9, "linestyles": [(0, (3, 1.5))], "zorder": 2}
_FOLD_LOOK: dict[str, Any] = {"marker": "o", "ms": 4, "mfc": "white", "mec": style.INK, "mew": 0.9}
_CAP_LOOK: dict[str, Any] = {"marker": "|", "ms": 7, "mec": style.INK, "mew": 0.9}
_HEIGHT = 2.5
"""Inches of the figure."""
_MARGINS = (0.52, 0.4, 0.14, 0.08)
"""Inches around the axes: left, bottom, right, top."""


@check_arguments
def diagram(eset: EquilibriumSet, height: Descriptor | None = None, ax: Axes | None = None) -> Axes:
    """Equilibria over one parameter: stable ones as full lines, unstable ones dashed.

    Parameters
    ----------
    eset
        Equilibrium set over one free parameter.
    height
        Descriptor on the vertical axis; None takes the one that distinguishes the states best.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        If the set has more than one free parameter.
    """
    if len(eset.names) != 1:
        raise InputError(f"`eset` must have one free parameter; got {', '.join(eset.names)}.")
    height = height or eset.structure.elevation
    points = np.stack([eset.coordinates[:, 0], height(eset.points)], axis=1)
    with style.house_style():
        if ax is None:
            ax = style.new_axes(style.SINGLE_COLUMN, _HEIGHT, _MARGINS)
        lines = [_pieces(ax, eset, points, int(index)) for index in np.unique(eset.cell_index)]
        marks = [_marks(ax, points, eset.folds, "fold", _FOLD_LOOK)]
        caps = [each.vertices for each in eset.boundaries if each.kind == "cap"]
        marks.append(_marks(ax, points, caps, constraint_label(eset.constraints), _CAP_LOOK))
        ax.set_xlim(eset.box.lower[0], eset.box.upper[0])
        ax.margins(y=0.06)
        ax.xaxis.set_major_locator(style.few_ticks())
        ax.autoscale(axis="y")
        ax.set_xlabel(parameter_label(eset.structure, eset.names[0]))
        ax.set_ylabel(descriptor_label(height))
        ax.legend(handles=[*lines, *(mark for mark in marks if mark)], loc="best")
    return ax


def _pieces(ax: Axes, eset: EquilibriumSet, points: Float[np.ndarray, "V 2"], index: int) -> Line2D:
    """Draw the cells of one index; return a line for the legend."""
    colour = style.INK if index == 0 else style.index_colour(min(index, 2))
    look = _STABLE_LOOK if index == 0 else _UNSTABLE_LOOK
    chains = pieces(eset.cells[eset.cell_index == index])
    ax.add_collection(LineCollection([points[chain] for chain in chains], colors=colour, **look))
    dashes = look["linestyles"] if index == 0 else look["linestyles"][0]
    label = style.index_label(index)
    return Line2D([], [], color=colour, lw=look["linewidths"], linestyle=dashes, label=label)


def _marks(
    ax: Axes,
    points: Float[np.ndarray, "V 2"],
    places: list[Int[np.ndarray, "..."]] | tuple[Int[np.ndarray, "..."], ...],
    label: str,
    look: dict[str, Any],
) -> Line2D | None:
    """Mark single points; return a line for the legend if there are any."""
    if not len(places):
        return None
    here = points[np.concatenate([np.ravel(each) for each in places])]
    (line,) = ax.plot(*here.T, linestyle="none", zorder=4, clip_on=False, label=label, **look)
    return line
