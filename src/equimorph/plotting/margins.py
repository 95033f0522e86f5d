"""Stability margin and largest curvature along a route."""

import numpy as np
from matplotlib.axes import Axes
from mpl_toolkits.axes_grid1 import make_axes_locatable

from equimorph.argument_checks import check_arguments
from equimorph.array_types import Float, Int
from equimorph.errors import InputError
from equimorph.model import Schedule
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
def margins(route: Route, ax: Axes | None = None) -> Axes:
    """Stability margin along a route, and below it max |κ| if the schedule has it.

    Parameters
    ----------
    route
        A route with a schedule.
    ax
        Where to draw the margin; the curvature goes into an axes below it. None makes a figure
        one column wide.

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
    curvature = schedule.descriptors.get(_CURVATURE)
    with style.house_style():
        if ax is None:
            height = (0.5 if curvature is None else 0.8) * style.SINGLE_COLUMN
            ax = style.new_axes(style.SINGLE_COLUMN, height, _ROOM)
        lowest = ax
        snaps = snap_steps(route)
        _draw(ax, schedule, schedule.margins, _MARGIN_COLOUR, snaps)
        ax.set_ylabel("stability margin")
        ax.set_ylim(0.0, 1.15 * schedule.margins.max())
        if not len(snaps):  # else it is zero at the snap, as the dotted line says
            _mark(ax, schedule, int(np.argmin(schedule.margins)), schedule.margins)
        if curvature is not None:
            # Both share the room that the axes had, whatever laid it out.
            divider = make_axes_locatable(ax)
            lowest = divider.append_axes("bottom", size="100%", pad=_GAP, sharex=ax)
            ax.tick_params(labelbottom=False)
            _draw(lowest, schedule, curvature, _CURVATURE_COLOUR, snaps)
            descriptor = path_of(route).states.structure.descriptor(_CURVATURE)
            lowest.set_ylabel(descriptor_label(descriptor))
            lowest.set_ylim(0.0, 1.25 * curvature.max())
            _mark(lowest, schedule, int(np.argmax(curvature)), curvature)
        lowest.set_xlabel("share of the length of the route")
        _number_way_points(ax, schedule, corner_steps(route))
    return ax


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
