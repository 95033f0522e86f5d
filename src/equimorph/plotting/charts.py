"""Internal parameterisations: the set above, the domains of its charts below."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.charts import Atlas, Chart, Domain, Edge, Reduction
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor
from equimorph.plotting import style
from equimorph.plotting.labels import descriptor_label, parameter_label
from equimorph.plotting.surface import surface

_FILL = "#bdd3e8"
_TWICE: dict[str, Any] = {"facecolor": "#ececec", "edgecolor": "#8c8c8c", "hatch": "xxxx"}
_GAP: dict[str, Any] = {"facecolor": "white", "edgecolor": "#8c8c8c", "hatch": "////"}
_EDGES: dict[str, dict[str, Any]] = {
    "fold": {"color": style.INK, "linewidth": 1.2},
    "cut": {"color": style.ROUTE_COLOUR, "linewidth": 1.2, "linestyle": (0, (4, 1.5))},
    "singular": {"color": style.INK, "linewidth": 0.9, "linestyle": (0, (1, 1))},
    "crossing": {"color": style.INK, "linewidth": 1.2, "linestyle": (0, (5, 1.5, 1, 1.5))},
    "cap": {"color": style.INK, "linewidth": 0.7, "linestyle": (0, (3, 2))},
    "box": {"color": style.INK, "linewidth": style.HAIRLINE},
}
_BARRIER: dict[str, Any] = {"color": style.ROUTE_COLOUR, "linewidth": 2.6, "zorder": 5}
_LABELS = {
    "fold": "fold", "cut": "cut", "singular": "coordinates fold", "cap": "constraint",
    "crossing": "branch points",
    "barrier": "barrier", "gap": "gap", "twice": "not single-valued", "inside": "one state",
}  # fmt: skip
_ROOM = 0.04
"""Empty room around the coordinates, as a share of their range."""
_ZOOM = 0.82
"""Of the pictures above: their labels stay inside."""
_PAD = 1
"""Points between the label and tick labels of up to five digits."""
_WIDTH, _ABOVE, _BELOW, _LEGEND = 2.0, 1.8, 1.6, 0.3
"""Inches: width of a column, heights of the solid and the plane in it, and of the legend."""
_COLUMNS, _ENTRIES = 4, 2
"""Columns in a row of panels, and entries of the legend for each of them."""


@check_arguments
def chart_domain(chart: Chart, ax: Axes | None = None) -> Axes:
    """Domain of a chart over two coordinates: barriers thick, gaps hatched.

    Parameters
    ----------
    chart
        A projection, descriptor chart, reduction, or chart of an atlas.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        If a chart does not have two coordinates.
    """
    if len(chart.names) != 2:
        raise InputError(f"`chart` must have two coordinates; got {len(chart.names)}.")
    with style.house_style({"hatch.linewidth": 0.4}):
        if ax is None:
            ax = style.new_axes(style.SINGLE_COLUMN, 2.6, (0.55, 0.4, 0.15, 0.1))
        _fill(ax, chart.domain, {"facecolor": _FILL, "edgecolor": "none"})
        for overlap in chart.overlaps if not isinstance(chart, Reduction) else ():
            _fill(ax, overlap.domain, _TWICE)
        if isinstance(chart, Reduction):
            _fill(ax, chart.gaps, _GAP)
        for edge in _edges_to_draw(chart):
            if edge.kind in _EDGES:
                ax.plot(*edge.points.T, zorder=4, **_EDGES[edge.kind])
        for barrier in chart.barriers if isinstance(chart, Reduction) else ():
            ax.plot(*barrier.points.T, **_BARRIER)
        _frame(ax, chart)
    return ax


@check_arguments
def parameterisation(
    charts: Sequence[Chart | Atlas | Sequence[Chart]], height: Descriptor
) -> Figure:
    """Panels with the set above and its internal parameterisation below, one for each of `charts`.

    Above, the part of the set that the charts cover, over the free parameters, with a descriptor as
    height. Charts of an atlas, and several charts of one set, stand next to each other.

    Parameters
    ----------
    charts
        Charts over two coordinates, several of one set, or atlases of such.
    height
        Third axis of the pictures above.
    """
    leaves = [_leaves(each) for each in charts]
    rows = rows_of([len(own) for own in leaves])
    columns = max(column + len(own) for (_, column), own in zip(rows, leaves, strict=True))
    size = (_WIDTH * columns + 0.2, (_ABOVE + _BELOW) * (1 + rows[-1][0]) + _LEGEND + 0.2)
    figure = style.Picture(*size)
    with style.house_style({"hatch.linewidth": 0.4}):
        for number, ((row, column), own) in enumerate(zip(rows, leaves, strict=True)):
            left = _WIDTH * column
            bottom = _LEGEND + (_ABOVE + _BELOW) * (rows[-1][0] - row)
            middle = left + 0.5 * _WIDTH * (len(own) - 1)
            above = _place(size, (middle, bottom + _BELOW, _WIDTH, _ABOVE))
            _draw_above(figure.add_axes(above, projection="3d"), own[0].eset, height)
            top = (bottom + _BELOW + _ABOVE + 0.04) / size[1]
            if len(charts) > 1:
                figure.text((left + 0.08) / size[0], top, f"({chr(97 + number)})", size=8)
            for k, chart in enumerate(own):
                inches = (left + k * _WIDTH + 0.55, bottom + 0.42, _WIDTH - 0.65, 1.1)
                chart_domain(chart, figure.add_axes(_place(size, inches)))
        entries = _legend([chart for own in leaves for chart in own])
        columns = min(len(entries), _ENTRIES * columns)
        figure.legend(handles=entries, loc="lower center", ncols=columns, frameon=False)
    return figure


def rows_of(widths: Sequence[int]) -> list[tuple[int, int]]:
    """Row and first column of each panel, given the numbers of columns that they span."""
    places, row, column = [], 0, 0
    for width in widths:
        if column and column + width > _COLUMNS:
            row, column = row + 1, 0
        places.append((row, column))
        column += width
    return places


def _draw_above(ax: Any, eset: EquilibriumSet, height: Descriptor) -> None:
    """The set, small and without a legend."""
    surface(eset, height, ax=ax)
    ax.set_box_aspect((1.2, 1.3, 1.0), zoom=_ZOOM)
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_major_locator(MaxNLocator(3))
    ax.zaxis.labelpad = _PAD
    ax.patch.set_visible(False)  # else it covers labels of the panel beside it
    if ax.get_legend() is not None:
        ax.get_legend().remove()


def _leaves(panel: Chart | Atlas | Sequence[Chart]) -> tuple[Chart, ...]:
    """Charts of a panel."""
    if isinstance(panel, Atlas):
        return panel.charts
    return (panel,) if isinstance(panel, Chart) else tuple(panel)


def _place(
    size: tuple[float, float], inches: tuple[float, float, float, float]
) -> tuple[float, float, float, float]:
    left, bottom, width, height = inches
    return (left / size[0], bottom / size[1], width / size[0], height / size[1])


def _fill(ax: Axes, domain: Domain, look: dict[str, Any]) -> None:
    if domain.loops:
        ax.add_patch(style.area(domain.loops, linewidth=0.0, zorder=1, **look))


def _edges_to_draw(chart: Chart) -> list[Edge]:
    """Edges of the domain; chords of folds that parameters cross are not worth a line."""
    skipped = "singular" if chart.coordinates.projecting else ""
    return [edge for edge in chart.domain.edges if edge.kind != skipped]


def _frame(ax: Axes, chart: Chart) -> None:
    """Limits around the cells of the chart, and labels of the coordinates."""
    places: Float[np.ndarray, "n 2"] = chart.cells.values[chart.cells.corners].reshape(-1, 2)
    low, high = places.min(axis=0), places.max(axis=0)
    if chart.coordinates.projecting:
        low, high = chart.eset.box.lower, chart.eset.box.upper
    room = _ROOM * (high - low)
    ax.set_xlim(low[0] - room[0], high[0] + room[0])
    ax.set_ylim(low[1] - room[1], high[1] + room[1])
    labels = [
        parameter_label(chart.eset.structure, scalar.name)
        if place >= 0
        else descriptor_label(scalar)
        for scalar, place in zip(
            chart.coordinates.scalars, chart.coordinates.places.tolist(), strict=True
        )
    ]
    ax.set_xlabel(labels[0])
    ax.set_ylabel(labels[1])
    ax.xaxis.set_major_locator(MaxNLocator(4))
    ax.yaxis.set_major_locator(style.few_ticks())


def _legend(charts: Sequence[Chart]) -> list[Patch | Line2D]:
    """Entries for what occurs."""
    kinds = {edge.kind for chart in charts for edge in _edges_to_draw(chart)}
    reduced = [chart for chart in charts if isinstance(chart, Reduction)]
    entries: list[Patch | Line2D] = [Patch(facecolor=_FILL, label=_LABELS["inside"])]
    if any(chart.overlaps for chart in charts if not isinstance(chart, Reduction)):
        entries.append(Patch(label=_LABELS["twice"], linewidth=0.0, **_TWICE))
    if any(chart.gaps.loops for chart in reduced):
        entries.append(Patch(label=_LABELS["gap"], linewidth=0.3, **_GAP))
    entries += [
        Line2D([], [], label=_LABELS[kind], **look)
        for kind, look in _EDGES.items()
        if kind in kinds and kind in _LABELS
    ]
    if any(chart.barriers for chart in reduced):
        look = {name: value for name, value in _BARRIER.items() if name != "zorder"}
        entries.append(Line2D([], [], label=_LABELS["barrier"], **look))
    return entries
