"""Stability margin and limited quantities along a route."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from mpl_toolkits.axes_grid1 import make_axes_locatable

from equimorph.argument_checks import check_arguments
from equimorph.array_types import Float, Int
from equimorph.errors import InputError
from equimorph.model import Constraint, Descriptor, Schedule
from equimorph.plotting import style
from equimorph.plotting.curves import corner_steps, path_of, snap_steps
from equimorph.plotting.labels import descriptor_label
from equimorph.tasks.route import Route

_CURVATURE = "max_curvature"
_MARGIN_COLOUR = style.INDEX_COLOURS[0]
_CURVATURE_COLOUR = "#a1561a"
_GAP = 0.1
"""Inches between panels."""
_ROOM = (0.58, 0.38, 0.1, 0.2)
"""Inches around the panels: left, bottom, right, top."""
_MOST_NUMBERS = 12
"""Largest number of way points that are numbered one by one."""


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
            _mark(lowest, schedule, int(np.argmax(np.abs(values))), values)
        lowest.set_xlabel("share of the length of the route")
        _number_way_points(ax, schedule, corner_steps(route))
    return ax


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
    for at in _corner_places(schedule):
        ax.axvline(at, color="#c4c4c4", linewidth=0.5, zorder=1)
    for at in schedule.progress[snaps]:
        ax.axvline(at, color=style.ROUTE_COLOUR, linewidth=0.9, linestyle=":", zorder=2)
    x, y = (np.insert(each, snaps + 1, np.nan) for each in (schedule.progress, values))
    ax.plot(x, y, color=colour, linewidth=1.4, zorder=3)
    ax.set_xlim(0.0, 1.0)


def _corner_places(schedule: Schedule) -> list[float]:
    """Shares of the route at which its corners lie."""
    return [float(schedule.progress[step]) for step in schedule.way_points]


def _mark(
    ax: Axes,
    schedule: Schedule,
    step: int,
    values: Float[np.ndarray, " steps"],
) -> None:
    """Mark the worst step with its value, on the side of the curve where there is room."""
    is_low = values[step] <= values.mean()
    above = not is_low or values[step] < 0.15 * ax.get_ylim()[1]
    place = (float(schedule.progress[step]), float(values[step]))
    ax.plot(*place, "o", markersize=3.5, color=style.INK, zorder=4, clip_on=False)
    # Text near the end of the route is set to the left of its mark, to stay inside the frame.
    side = "right" if place[0] > 0.8 else "left" if place[0] < 0.2 else "center"
    ax.annotate(
        f"{place[1]:.3g}", place, (0, 4 if above else -4), textcoords="offset points", ha=side,
        va="bottom" if above else "top", zorder=5,
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
