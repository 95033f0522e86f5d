"""Bifurcation diagrams: sets over one parameter, drawn as curves of a descriptor."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D

from equimorph.argument_checks import check_arguments
from equimorph.array_types import Float, Int
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.geometry.topology import pieces
from equimorph.model import Descriptor
from equimorph.plotting import style
from equimorph.plotting.labels import constraint_label, descriptor_label, parameter_label

# Stable pieces stand out by width and a full line, so that no colour is needed.
_STABLE: dict[str, Any] = {"linewidths": 1.8, "linestyles": "solid", "zorder": 3}
_UNSTABLE: dict[str, Any] = {"linewidths": 0.9, "linestyles": [(0, (3, 1.5))], "zorder": 2}
_FOLD: dict[str, Any] = {"marker": "o", "ms": 4, "mfc": "white", "mec": style.INK, "mew": 0.9}
_CAP: dict[str, Any] = {"marker": "|", "ms": 7, "mec": style.INK, "mew": 0.9}
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
        marks = [_marks(ax, points, eset.folds, "fold", _FOLD)]
        caps = [each.vertices for each in eset.boundaries if each.kind == "cap"]
        marks.append(_marks(ax, points, caps, constraint_label(eset.constraints), _CAP))
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
    look = _STABLE if index == 0 else _UNSTABLE
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
