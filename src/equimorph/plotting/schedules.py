"""A route over its length: margin and limited quantities; strips of every parameter that moves."""

import re
from collections.abc import Sequence
from itertools import groupby
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.axes_grid1 import make_axes_locatable

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Int
from equimorph.errors import InputError
from equimorph.model import Constraint, Descriptor, Schedule
from equimorph.plotting import style
from equimorph.plotting.curves import corner_steps, path_of, snap_steps
from equimorph.plotting.labels import descriptor_label, symbol, with_unit
from equimorph.tasks.route import Route

_CURVATURE = "max_curvature"
_MARGIN_COLOUR = style.INDEX_COLOURS[0]
_CURVATURE_COLOUR = "#a1561a"
_GAP = 0.1
"""Inches between panels."""
_ROOM = (0.58, 0.38, 0.1, 0.2)
"""Inches around the panels: left, bottom, right, top."""
_UNIT = re.compile(r"\([^()]*\)$")
_MOST_NUMBERS = 12
"""Largest number of way points that are numbered one by one."""
_NUMBER = 0.2
"""Height that a number needs beside its mark, as a fraction of the panel."""


@check_arguments
def margins(route: Route, ax: Axes | None = None, *, within: Sequence[Constraint] = ()) -> Axes:
    """Stability margin along a route, and below it what is limited, with its limits.

    Parameters
    ----------
    route
        A route with a schedule.
    ax
        Where to draw the margin; further panels go below it. None makes a figure one column wide.
    within
        Bounds to draw, of descriptors that the schedule has; without any max |κ| is drawn alone, if
        the schedule has it.

    Returns
    -------
    The axes of the margin.

    Raises
    ------
    InputError
        If the route has no schedule.
    """
    schedule = route.schedule
    if schedule is None:
        raise InputError(f"`route` must have a schedule; got a refused route: {route.why}")
    bounds = _bounds(route, schedule, within)
    with style.house_style():
        if ax is None:
            height = (0.5 + 0.3 * len(bounds)) * style.SINGLE_COLUMN
            ax = style.new_axes(style.SINGLE_COLUMN, height, _ROOM)
        lowest = ax
        snaps = snap_steps(route)
        _draw(ax, schedule, schedule.margins, _MARGIN_COLOUR, snaps)
        ax.set_ylabel("stability margin")
        panels = [ax]
        ax.set_ylim(0.0, 1.15 * schedule.margins.max())
        if not len(snaps):  # else it is zero at the snap, as the dotted line says
            _mark(ax, schedule, int(np.argmin(schedule.margins)), schedule.margins)
        # All share the room that the axes had, whatever laid it out.
        divider = make_axes_locatable(ax)
        for descriptor, limits in bounds.items():
            lowest.tick_params(labelbottom=False)
            lowest = divider.append_axes("bottom", size="100%", pad=_GAP, sharex=ax)
            values = schedule.descriptors[descriptor.name]
            _draw(lowest, schedule, values, _CURVATURE_COLOUR, snaps)
            lowest.set_ylabel(descriptor_label(descriptor))
            _draw_limits(lowest, values, limits)
            _mark(lowest, schedule, int(np.argmax(np.abs(values))), values, limits)
            panels.append(lowest)
        _wrap(panels)
        lowest.set_xlabel("fraction of the route length")
        _number_way_points(ax, schedule, corner_steps(route))
    return ax


def _wrap(panels: Sequence[Axes]) -> None:
    """Break labels that are longer than their panels into lines of no greater length."""
    figure = panels[0].get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()
    for panel in panels:
        label, room = panel.yaxis.label, panel.get_window_extent().height
        length, text = label.get_window_extent().height, label.get_text()
        if length > room:
            width = max(int(0.95 * len(text) * room / length), 1)
            whole = _UNIT.sub(lambda unit: unit[0].replace(" ", "\N{NO-BREAK SPACE}"), text)
            label.set_text(fill(whole, width))


def _bounds(
    route: Route, schedule: Schedule, within: Sequence[Constraint]
) -> dict[Descriptor, list[float]]:
    """Descriptors of the schedule to draw, with their limits."""
    bounds: dict[Descriptor, list[float]] = {}
    tightest = {(each.descriptor, each.sense): each.bound for each in sorted(within, key=_width)}
    for (descriptor, _), bound in tightest.items():
        if descriptor.name in schedule.descriptors:
            bounds.setdefault(descriptor, []).append(bound)
    if not bounds and _CURVATURE in schedule.descriptors:
        bounds[path_of(route).states.structure.descriptor(_CURVATURE)] = []
    return bounds


def _width(constraint: Constraint) -> float:
    """Greater for what a constraint leaves less room for."""
    return -constraint.bound if constraint.sense == "<=" else constraint.bound


def _draw_limits(ax: Axes, values: Float[np.ndarray, " steps"], limits: list[float]) -> None:
    low, high = min(0.0, values.min(), *limits), max(0.0, values.max(), *limits)
    ax.set_ylim(1.25 * low, 1.25 * high)
    for limit in limits:
        ax.axhline(limit, **style.LIMIT_LINE)


def _draw(
    ax: Axes,
    schedule: Schedule,
    values: Float[np.ndarray, " steps"],
    colour: str,
    snaps: Int[np.ndarray, " snaps"],
) -> None:
    """One quantity over the share of the route, with thin lines at the way-points and gaps."""
    for at in schedule.progress[schedule.way_points]:
        ax.axvline(at, color="#c4c4c4", linewidth=0.5, zorder=1)
    for at in schedule.progress[snaps]:
        ax.axvline(at, color=style.ROUTE_COLOUR, linewidth=0.9, linestyle=":", zorder=2)
    x, y = (np.insert(each, snaps + 1, np.nan) for each in (schedule.progress, values))
    ax.plot(x, y, color=colour, linewidth=1.4, zorder=3)
    ax.set_xlim(0.0, 1.0)


def _mark(
    ax: Axes,
    schedule: Schedule,
    step: int,
    values: Float[np.ndarray, " steps"],
    limits: Sequence[float] = (),
) -> None:
    """Mark the worst step with its value, on the side of the curve where there is room.

    Below a limit that the number would cross it stands beside the mark.
    """
    is_low = values[step] <= values.mean()
    room = _NUMBER * float(np.ptp(ax.get_ylim()))
    crossed = any(0.0 < limit - values[step] < room for limit in limits)
    above = not is_low or values[step] < 0.15 * ax.get_ylim()[1]
    place = (float(schedule.progress[step]), float(values[step]))
    ax.plot(*place, "o", markersize=3.5, color=style.INK, zorder=4, clip_on=False)
    # Text near the end of the route is set to the left of its mark, to stay inside the frame.
    side = "right" if place[0] > 0.8 else "left" if place[0] < 0.2 or crossed else "center"
    across = 0.0 if not crossed else -5.0 if side == "right" else 5.0
    ax.annotate(
        f"{place[1]:.3g}", place, (across, (4 if above else -4) if not crossed else 1),
        textcoords="offset points", ha=side,
        va="center" if crossed else "bottom" if above else "top", zorder=5,
    )  # fmt: skip


def _number_way_points(ax: Axes, schedule: Schedule, steps: Int[np.ndarray, " corners"]) -> None:
    """Numbers of the way-points above the frame."""
    if len(steps) > _MOST_NUMBERS:
        return
    for number, step in enumerate(steps, start=1):
        ax.annotate(
            str(number), (float(schedule.progress[step]), 1.0), (0, 2),
            xycoords=("data", "axes fraction"), textcoords="offset points",
            ha="center", va="bottom", size=6.5, color=style.ROUTE_COLOUR,
        )  # fmt: skip


_STRIP, _BETWEEN, _GROUPS = 0.26, 0.05, 0.1
"""Inches: height of a strip, gap between strips, additional gap between groups."""
_LEFT, _BOTTOM, _RIGHT, _TOP = 0.5, 0.38, 0.95, 0.1
"""Inches around the strips."""
MOST_STRIPS = 24
"""Largest number of strips; those that move most are drawn."""
_COLOURS = {"actuator": style.INDEX_COLOURS[0], "load": style.INK}


@check_arguments
def schedule_strips(schedule: Schedule) -> Figure:
    """Parameters along a schedule; those of one role and unit share their scale.

    Parameters
    ----------
    schedule
        With at least one parameter that moves; of many, the 24 that move most are drawn.

    Returns
    -------
    A figure one column wide.

    Raises
    ------
    InputError
        If nothing moves.
    """
    strips = _strips(schedule)
    if not strips:
        raise InputError("`schedule` must move a parameter; got one that moves none.")
    groups = [list(each) for _, each in groupby(strips, key=lambda k: _family(schedule, k))]
    height = _BOTTOM + _TOP + len(strips) * (_STRIP + _BETWEEN) + (len(groups) - 1) * _GROUPS
    figure = style.Picture(style.SINGLE_COLUMN, height)
    width = 1.0 - (_LEFT + _RIGHT) / style.SINGLE_COLUMN
    top = height - _TOP
    with style.house_style():
        for group in groups:
            values = schedule.values[:, group]
            low, high = float(values.min()), float(values.max())
            for k in group:
                top -= _STRIP
                ax = figure.add_axes(
                    (_LEFT / style.SINGLE_COLUMN, top / height, width, _STRIP / height)
                )
                _draw_strip(ax, schedule, k, (low, high))
                top -= _BETWEEN
            _name_scale(figure, schedule, group, (low, high))
            top -= _GROUPS
        lowest = figure.axes[-1]
        lowest.tick_params(labelbottom=True, length=2.5)
        lowest.set_xlabel("fraction of the route length")
    return figure


def _strips(schedule: Schedule) -> list[int]:
    """Columns that move, actuators first, each family together."""
    size = np.ptp(schedule.values, axis=0)
    moving = np.flatnonzero(size > 0.0)
    most = np.sort(moving[np.argsort(-size[moving])[:MOST_STRIPS]])
    return sorted(most.tolist(), key=lambda k: _family(schedule, k))


def _family(schedule: Schedule, k: int) -> tuple[str, str]:
    return schedule.roles[k], schedule.units[k]


def _draw_strip(ax: Axes, schedule: Schedule, k: int, ends: tuple[float, float]) -> None:
    """One parameter, filled towards zero or the lowest value of its family."""
    low, high = ends
    values: Float[np.ndarray, " steps"] = schedule.values[:, k]
    colour = _COLOURS.get(schedule.roles[k], style.INK)
    ground = min(max(0.0, low), high)
    ax.fill_between(schedule.progress, ground, values, color=colour, alpha=0.25, linewidth=0.0)
    ax.plot(schedule.progress, values, color=colour, linewidth=1.1, clip_on=False)
    ax.axhline(ground, color=style.FAINT, linewidth=style.HAIRLINE)
    room = 0.06 * (high - low)
    ax.set_xlim(0.0, 1.0)
    ax.set_ylim(low - room, high + room)
    ax.set_yticks([])
    ax.tick_params(labelbottom=False, length=0)
    for side in ("top", "right", "left"):
        ax.spines[side].set_visible(False)
    ax.spines["bottom"].set_color("#d5d5d5")
    ax.annotate(
        symbol(schedule.names[k]), (0.0, 0.5), (-6, 0), xycoords="axes fraction",
        textcoords="offset points", ha="right", va="center", size=8,
    )  # fmt: skip


def _name_scale(
    figure: Figure, schedule: Schedule, group: list[int], ends: tuple[float, float]
) -> None:
    """Scale of a family, at the right of its last strip."""
    ax = figure.axes[-1]
    ax.yaxis.tick_right()
    low, high = (f"{end + 0.0:.2g}".replace("-", "−") for end in ends)
    ax.set_yticks(list(ends), [low, with_unit(high, schedule.units[group[0]])])
    ax.tick_params(axis="y", length=2.5, labelsize=6.5)
    ax.spines["right"].set_visible(True)
