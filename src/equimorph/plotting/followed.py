"""An optimum that moves: its objective and its actuators along the legs."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from mpl_toolkits.axes_grid1 import make_axes_locatable

from equimorph.argument_checks import check_arguments
from equimorph.array_types import Float
from equimorph.model import Descriptor
from equimorph.plotting import style
from equimorph.plotting.labels import descriptor_label, parameter_label
from equimorph.tasks.optimising.optimum_path import FollowedOptimum

_ROOM = (0.6, 0.38, 0.1, 0.1)
"""Inches around the panels: left, bottom, right, top."""
_PANEL, _GAP = 1.05, 0.1
"""Inches: height of a panel, and gap between two."""
_ROUNDING = 1e-9
"""Range of an actuator, relative to its size, below which its axis is that of a constant."""
_COLOURS = {"objective": style.ROUTE_COLOUR, "actuator": style.INDEX_COLOURS[0]}


@check_arguments
def followed(
    found: FollowedOptimum,
    objective: Descriptor,
    actuators: Sequence[str],
    ax: Axes | None = None,
) -> Axes:
    """Objective of a moving optimum, and below it each actuator; broken where the optimum jumps.

    Parameters
    ----------
    found
        The optimum, with at least one state.
    objective
        What it is the optimum of.
    actuators
        Names of the parameters that were chosen.
    ax
        Where to draw the objective; the actuators go into axes below. None makes a figure one
        column wide.

    Returns
    -------
    The axes of the objective.
    """
    panels = 1 + len(actuators)
    with style.house_style():
        if ax is None:
            height = _ROOM[1] + _ROOM[3] + panels * _PANEL + (panels - 1) * _GAP
            ax = style.new_axes(style.SINGLE_COLUMN, height, _ROOM)
        divider = make_axes_locatable(ax)
        _draw(ax, found, found.values, _COLOURS["objective"])
        ax.set_ylabel(descriptor_label(objective))
        structure, last = found.states.structure, ax
        for name in actuators:
            last.tick_params(labelbottom=False)
            last = divider.append_axes("bottom", size="100%", pad=_GAP, sharex=ax)
            _draw(last, found, found.states[name], _COLOURS["actuator"])
            last.set_ylabel(parameter_label(structure, name))
        last.set_xlabel("legs done")
        ends = [float(found.at.min()), float(found.at.max())]
        ax.set_xlim(ends[0], max(ends[1], ends[0] + 1e-9))
    return ax


def _draw(
    ax: Axes, found: FollowedOptimum, values: Float[np.ndarray, " points"], colour: str
) -> None:
    """One quantity, with a gap and both sides at each jump, and lines at the ends of legs."""
    at = found.at
    for leg in range(1, int(np.ceil(at.max()))):
        ax.axvline(leg, color="#c4c4c4", linewidth=0.5, zorder=1)
    places = [jump.at for jump in found.jumps if jump.after is not None]
    cuts = np.array([int(np.flatnonzero(at == place)[0]) + 1 for place in places], dtype=int)
    x, y = (np.insert(each, cuts, np.nan) for each in (at, values))
    ax.plot(x, y, color=colour, linewidth=1.4, zorder=3)
    for cut in cuts[cuts < len(values)].tolist():
        sides = at[[cut - 1, cut]], values[[cut - 1, cut]]
        ax.plot(*sides, color=colour, linewidth=0.9, linestyle=":", zorder=2)
        ax.plot(*sides, "o", color=colour, ms=3.5, mec="white", mew=0.6, zorder=4)
    ax.yaxis.set_major_locator(style.few_ticks())
    ax.margins(y=0.12)
    middle, size = float(values.mean()), max(1.0, float(np.abs(values).max()))
    if np.ptp(values) < _ROUNDING * size:
        ax.set_ylim(middle - 0.1 * size, middle + 0.1 * size)
