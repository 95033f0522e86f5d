"""Maps over actuator settings, with the curves on which they jump or bend."""

from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.patheffects import AbstractPathEffect, withStroke
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation
from mpl_toolkits.axes_grid1 import make_axes_locatable

from equimorph.plotting import style
from equimorph.plotting.map_faces import Faces, faces
from equimorph.plotting.symbols import parameter_label
from equimorph.tasks import LimitLoadMap

_FRAME_HEIGHT = 2.3  # inches
_LEFT, _BOTTOM, _RIGHT, _TOP = 0.5, 0.4, 0.5, 0.08  # inches around the frame
_LEGEND_COLUMNS, _LEGEND_ROW, _LEGEND_GAP = 2, 0.15, 0.06

# From low (light) to high (dark), in even steps of lightness: it reads in grey.
_ANCHORS = ("#f6f1e1", "#d3dfe6", "#a5c3db", "#719fc6", "#417aac", "#1d527f")
_LEVELS = 10
_HATCH: dict[str, Any] = {
    "facecolor": "#f4f4f4",
    "edgecolor": "#c9c9c9",
    "hatch": "////",
    "linewidth": 0.0,
}
_RIM: list[AbstractPathEffect] = [withStroke(linewidth=2.2, foreground="white")]

# Kinds of curves: label, whether the map jumps or ends there, and look.
_LOOKS: dict[str, tuple[str, bool, dict[str, Any]]] = {
    "cusp": ("jump: two folds merge", True, {"linewidth": 1.5}),
    "grazing": ("jump: grazing", True, {"linewidth": 1.5, "linestyle": (0, (6, 1.5))}),
    "jump": ("jump", True, {"linewidth": 1.0}),
    "branch point": ("branch point", True, {"linewidth": 1.3, "linestyle": (0, (4, 1.5, 1, 1.5))}),
    "exchange": ("stability / constraint", False, {"linewidth": 0.8}),
    "place": ("place of the extremum", False, {"linewidth": 1.0, "linestyle": (0, (1, 1.2))}),
    "kink": ("kink", False, {"linewidth": 0.8, "linestyle": (0, (2, 1.5))}),
    "edge": ("", True, {"linewidth": 0.6}),
}


def load_map(lmap: LimitLoadMap, ax: Axes | None = None) -> Axes:
    """Limit loads over two actuators, with the curves on which they jump or bend.

    Cells that a jump crosses are cut along it; nothing is interpolated across. Contours are drawn
    where the map is smooth. Settings without a limit load are hatched.

    Parameters
    ----------
    lmap
        The map.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.
    """
    with style.house_style({"hatch.linewidth": 0.5}):
        own = ax is None
        if ax is None:
            height = _BOTTOM + _FRAME_HEIGHT + _TOP
            ax = style.new_axes(style.SINGLE_COLUMN, height, (_LEFT, _BOTTOM, _RIGHT, _TOP))
        _frame(ax, lmap)
        cuts = [curve.points for curve in lmap.curves if _LOOKS[curve.kind][1]]
        grid = lmap.grid.axes()
        found = faces((grid[0], grid[1]), lmap.value, np.concatenate([np.empty((0, 2)), *cuts]))
        _fill(ax, lmap, found)
        entries: list[Line2D | Patch] = list(_draw_curves(ax, lmap))
        if not np.isfinite(lmap.value).all():
            entries.append(Patch(label="undefined", **_HATCH))
        _write_legend(ax, entries, room=own)
    return ax


def _frame(ax: Axes, lmap: LimitLoadMap) -> None:
    """Limits, labels, and the hatched ground."""
    low, high = lmap.grid.box.lower, lmap.grid.box.upper
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1], high[1])
    ax.set_xlabel(parameter_label(lmap.structure, lmap.grid.names[0]))
    ax.set_ylabel(parameter_label(lmap.structure, lmap.grid.names[1]))
    ax.add_patch(Rectangle(tuple(low), *(high - low), zorder=0, **_HATCH))


def _colours() -> Colormap:
    return LinearSegmentedColormap.from_list("load", list(_ANCHORS))


def _fill(ax: Axes, lmap: LimitLoadMap, found: Faces) -> None:
    """Fill the faces, and draw contours over the smooth ones."""
    known = lmap.value[np.isfinite(lmap.value)]
    if not len(known):
        return
    norm, colours = Normalize(0.0, float(known.max())), _colours()
    x, y = (each.ravel() for each in np.meshgrid(*lmap.grid.axes(), indexing="ij"))
    pieces = PolyCollection(found.pieces, array=found.values, cmap=colours, norm=norm, zorder=1)
    pieces.set(edgecolor="face", linewidth=0.3, rasterized=True)
    ax.add_collection(pieces, autolim=False)
    if len(found.triangles):
        values = np.where(np.isfinite(lmap.value), lmap.value, 0.0).ravel()
        mesh = Triangulation(x, y, found.triangles)
        look: dict[str, Any] = {"cmap": colours, "norm": norm, "zorder": 1, "rasterized": True}
        ax.tripcolor(mesh, values, shading="gouraud", **look)
        lines = ax.tricontour(
            mesh, values, _levels(float(known.max())),
            colors=[style.INK], linewidths=0.3, alpha=0.6, zorder=2,
        )  # fmt: skip
        texts = ax.clabel(lines, fontsize=5.5, fmt="%g", inline_spacing=2)
        for text in texts:
            text.set_zorder(6)
    beside = make_axes_locatable(ax).append_axes("right", size=0.08, pad=0.06)
    bar = ax.figure.colorbar(ScalarMappable(norm, colours), cax=beside)
    bar.outline.set_linewidth(style.HAIRLINE)
    bar.set_label(f"limit load {parameter_label(lmap.structure, lmap.load)}")


def _levels(largest: float) -> Float[np.ndarray, " levels"]:
    """Round numbers for contours."""
    return np.asarray(MaxNLocator(_LEVELS, steps=[1, 2, 2.5, 5, 10]).tick_values(0.0, largest)[1:])


def _draw_curves(ax: Axes, lmap: LimitLoadMap) -> list[Line2D]:
    """Draw the curves; return one labelled line of every kind."""
    kinds: dict[str, Line2D] = {}
    for curve in lmap.curves:
        if len(curve.points) < 2:
            continue
        label, _, look = _LOOKS[curve.kind]
        line = Line2D(*curve.points.T, color=style.INK, zorder=5, label=label, **look)
        if look["linewidth"] > 1.0:
            line.set_path_effects(_RIM)
        ax.add_line(line)
        if label:
            kinds[curve.kind] = line
    return [kinds[kind] for kind in _LOOKS if kind in kinds]


def _write_legend(ax: Axes, entries: list[Line2D | Patch], *, room: bool) -> None:
    """Legend below the frame; with `room`, the figure grows by its height."""
    if not entries:
        return
    if room:
        style.grow_below(ax, _LEGEND_GAP + -(-len(entries) // _LEGEND_COLUMNS) * _LEGEND_ROW)
    below = -(_BOTTOM + 0.5 * _LEGEND_GAP) / _FRAME_HEIGHT
    ax.legend(
        handles=entries, loc="upper center", bbox_to_anchor=(0.5, below), ncols=_LEGEND_COLUMNS,
        borderaxespad=0.0, borderpad=0.0,
    )  # fmt: skip
