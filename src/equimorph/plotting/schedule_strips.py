"""Every parameter that a schedule moves, in strips one above the other."""

from itertools import groupby

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from equimorph.argument_checks import check_arguments
from equimorph.array_types import Float
from equimorph.errors import InputError
from equimorph.model import Schedule
from equimorph.plotting import style
from equimorph.plotting.labels import symbol, with_unit

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
    figure = style.attach_canvas(Figure(figsize=(style.SINGLE_COLUMN, height)))
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
                _draw(ax, schedule, k, (low, high))
                top -= _BETWEEN
            _name_scale(figure, schedule, group, (low, high))
            top -= _GROUPS
        lowest = figure.axes[-1]
        lowest.tick_params(labelbottom=True, length=2.5)
        lowest.set_xlabel("share of the length of the route")
    return figure


def _strips(schedule: Schedule) -> list[int]:
    """Columns that move, actuators first, each family together."""
    size = np.ptp(schedule.values, axis=0)
    moving = np.flatnonzero(size > 0.0)
    most = np.sort(moving[np.argsort(-size[moving])[:MOST_STRIPS]])
    return sorted(most.tolist(), key=lambda k: _family(schedule, k))


def _family(schedule: Schedule, k: int) -> tuple[str, str]:
    return schedule.roles[k], schedule.units[k]


def _draw(ax: Axes, schedule: Schedule, k: int, ends: tuple[float, float]) -> None:
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
