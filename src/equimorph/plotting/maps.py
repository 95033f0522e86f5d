"""Maps of limit loads and of curvature, and their parts: faces, contours, marks, legend."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, Float
from equimorph.model.descriptor import CONSTRAINT
from equimorph.plotting import style
from equimorph.plotting.labels import (
    constraint_label,
    descriptor_label,
    label_contours,
    parameter_label,
    symbol,
)
from equimorph.plotting.map_faces import Faces, corners, faces
from equimorph.tasks.maps.curvature import CurvatureMap
from equimorph.tasks.maps.limit_load import LimitLoadMap

ActuatorMap = LimitLoadMap | CurvatureMap
Points = Float[np.ndarray, "_ 2"]

_FRAME_HEIGHT = 2.3
"""Inches of the frame."""
_LEFT, _BOTTOM, _RIGHT, _TOP = 0.5, 0.4, 0.5, 0.08
"""Inches around the frame."""
_MARGIN = 0.06
"""Room beyond the settings that have a natural state, as a share of their range."""

# From low (light) to high (dark), in even steps of lightness: it reads in grey.
_ANCHORS = ("#f6f1e1", "#d3dfe6", "#a5c3db", "#719fc6", "#417aac", "#1d527f")
_LEVELS = 9
"""Largest number of contour levels."""
GROUND: dict[str, Any] = {
    "facecolor": "#f4f4f4",
    "edgecolor": "#c9c9c9",
    "hatch": "////",
    "linewidth": 0.0,
}
"""Where nothing is known."""
_DOTS, _STRIPES = "....", "\\\\"
_MARK: dict[str, Any] = {
    "facecolor": "none",
    "edgecolor": style.INK,
    "linewidth": 0.0,
    "alpha": 0.55,
}
_RIM = style.rim(2.2)


@dataclass(frozen=True)
class CurveLook:
    """How curves of one kind are drawn.

    `label`: entry of the legend, none if empty; `cuts`: whether values or statuses differ on both
    sides, so that nothing is interpolated across; `line`: looks.
    """

    label: str
    cuts: bool
    line: Mapping[str, Any]


@dataclass(frozen=True)
class Mark:
    """A pattern of some settings, and what it means; dots unless said otherwise."""

    where: Bool[np.ndarray, "rows columns"]
    label: str
    hatch: str = _DOTS


@dataclass(frozen=True)
class Panel:
    """What a figure of a map shows in addition to the values."""

    looks: Mapping[str, CurveLook]
    """Looks of the curves by kind; those of other kinds are left out."""
    bar: str
    """Label of the colour bar."""
    marks: tuple[Mark, ...]
    """Settings that have a pattern, and what it means."""
    ground_label: str
    """What is hatched."""
    from_zero: bool
    """Whether colours begin at zero."""
    highest: float | None = None
    """Value of the last colour; that of the map if there is none."""


def new_map_axes(wider: float = 0.0) -> Axes:
    """Empty axes for a map, one column wide; labels get that many inches more on both sides."""
    height = _BOTTOM + _FRAME_HEIGHT + _TOP
    room = (_LEFT + wider, _BOTTOM, _RIGHT + wider, _TOP)
    return style.new_axes(style.SINGLE_COLUMN, height, room)


def draw_map(amap: ActuatorMap, panel: Panel, ax: Axes | None) -> Axes:
    """Draw a map into axes, or into a new figure one column wide."""
    with style.house_style({"hatch.linewidth": 0.5}):
        own = ax is None
        ax = ax or new_map_axes()
        _frame(ax, amap)
        first, second = amap.grid.axes()
        axes, cuts = (first, second), _cuts(amap, panel)
        if np.isfinite(amap.value).any():
            _fill(ax, amap, panel, faces(axes, amap.value, cuts))
        entries: list[Line2D | Patch] = list(_draw_curves(ax, amap, panel))
        for mark in panel.marks:
            if mark.where.any():
                _mark(ax, faces(axes, mark.where.astype(float), cuts), axes, mark)
                entries.append(Patch(label=mark.label, **_MARK, hatch=mark.hatch))
        if not np.isfinite(amap.value).all():
            entries.append(Patch(label=panel.ground_label, **GROUND))
        style.legend_below(ax, entries, room=own)
    return ax


def _cuts(amap: ActuatorMap, panel: Panel) -> Points:
    """All places on grid lines where values or statuses differ on both sides."""
    cutting = [
        curve.points
        for curve in amap.curves
        if curve.kind in panel.looks and panel.looks[curve.kind].cuts
    ]
    return np.concatenate([np.empty((0, 2)), *cutting])


def _frame(ax: Axes, amap: ActuatorMap) -> None:
    """Limits around the settings that have a natural state, labels, and the hatched ground."""
    low, high = amap.grid.box.lower, amap.grid.box.upper
    known = np.isfinite(amap.value)
    limits = []
    for axis, across in zip(amap.grid.axes(), (1, 0), strict=True):
        some = axis[known.any(axis=across)] if known.any() else axis
        room = _MARGIN * (some[-1] - some[0])
        limits.append((max(axis[0], some[0] - room), min(axis[-1], some[-1] + room)))
    ax.set_xlim(*limits[0])
    ax.set_ylim(*limits[1])
    ax.set_xlabel(parameter_label(amap.structure, amap.grid.names[0]))
    ax.set_ylabel(parameter_label(amap.structure, amap.grid.names[1]))
    ax.add_patch(Rectangle((low[0], low[1]), high[0] - low[0], high[1] - low[1], **GROUND))


def value_colours() -> Colormap:
    """Colours from low to high values."""
    return LinearSegmentedColormap.from_list("load", list(_ANCHORS))


def _fill(ax: Axes, amap: ActuatorMap, panel: Panel, found: Faces) -> None:
    """Fill the faces, and draw contours over the smooth ones."""
    known = amap.value[np.isfinite(amap.value)]
    low = 0.0 if panel.from_zero else float(known.min())
    high = float(known.max()) if panel.highest is None else panel.highest
    norm = Normalize(low, high)
    look: dict[str, Any] = {
        "cmap": value_colours(),
        "norm": norm,
        "zorder": 1.5,
        "rasterized": True,
    }
    pieces = PolyCollection(found.pieces, array=found.values, **look)
    pieces.set(edgecolor="face", linewidth=0.3)
    ax.add_collection(pieces, autolim=False)
    if len(found.triangles):
        x, y = (each.ravel() for each in np.meshgrid(*amap.grid.axes(), indexing="ij"))
        values = np.where(np.isfinite(amap.value), amap.value, 0.0).ravel()
        mesh = Triangulation(x, y, found.triangles)
        ax.tripcolor(mesh, values, shading="gouraud", **look)
        ticks = MaxNLocator(_LEVELS, steps=[1, 2, 2.5, 5, 10])
        lines = ax.tricontour(
            mesh, values, ticks.tick_values(low, high)[1:],
            colors=[style.INK], linewidths=0.3, alpha=0.6, zorder=2,
        )  # fmt: skip
        drawn = [curve.points for curve in amap.curves if curve.kind in panel.looks]
        label_contours(ax, lines, np.concatenate([np.empty((0, 2)), *drawn]))
    style.colour_bar(ax, ScalarMappable(norm, look["cmap"]), panel.bar)


def _mark(
    ax: Axes,
    found: Faces,
    axes: tuple[Float[np.ndarray, " _"], Float[np.ndarray, " _"]],
    mark: Mark,
) -> None:
    """Pattern of the faces whose corners are marked."""
    inside = mark.where.ravel()[found.triangles].all(axis=1)
    whole = list(corners(axes)[found.triangles[inside]])
    cut = [piece for piece, value in zip(found.pieces, found.values, strict=True) if value > 0.5]
    look = {**_MARK, "hatch": mark.hatch}
    ax.add_collection(PolyCollection([*whole, *cut], zorder=3, rasterized=True, **look))


def _draw_curves(ax: Axes, amap: ActuatorMap, panel: Panel) -> list[Line2D]:
    """Draw the curves; return one labelled line of every kind."""
    kinds: dict[str, Line2D] = {}
    for curve in amap.curves:
        if len(curve.points) < 2 or curve.kind not in panel.looks:
            continue
        look = panel.looks[curve.kind]
        line = Line2D(*curve.points.T, color=style.INK, zorder=5, label=look.label, **look.line)
        if line.get_linewidth() > 1.0:
            line.set_path_effects(_RIM)
        ax.add_line(line)
        if look.label:
            kinds[curve.kind] = line
    return [kinds[kind] for kind in panel.looks if kind in kinds]


_DASHED, _CHAIN, _DOTTED = (0, (6, 1.5)), (0, (4, 1.5, 1, 1.5)), (0, (1, 1.2))
"""Line styles: offset, then lengths of dashes and gaps in line widths."""
_LOOKS = {
    "cusp": CurveLook("jump: two folds merge", True, {"linewidth": 1.5}),
    "grazing": CurveLook("jump: grazing", True, {"linewidth": 1.5, "linestyle": _DASHED}),
    "jump": CurveLook("jump", True, {"linewidth": 0.9, "linestyle": _DASHED}),
    "branch point": CurveLook("branch point", True, {"linewidth": 1.3, "linestyle": _CHAIN}),
    "exchange": CurveLook("stability / constraint", True, {"linewidth": 0.8}),
    "place": CurveLook("two extrema tie", False, {"linewidth": 1.0, "linestyle": _DOTTED}),
    "kink": CurveLook("kink", False, {"linewidth": 0.7, "linestyle": (0, (2, 1.5))}),
    "edge": CurveLook("", True, {"linewidth": 0.6}),
}


@check_arguments
def load_map(lmap: LimitLoadMap, ax: Axes | None = None, *, highest: float | None = None) -> Axes:
    """Limit loads over two actuators, with the curves on which they jump or bend.

    Cells that a jump crosses are cut along it; nothing is interpolated across. Contours are drawn
    where the map is smooth. Dots mark settings at which a constraint is met before stability is
    lost, stripes those at which the structure leaves its plane first; settings without a limit load
    are hatched. Between two curves that pass through one cell no setting lies: there the ground
    shows, too; a finer grid fills it.

    Parameters
    ----------
    lmap
        The map.
    ax
        Where to draw; None makes a figure one column wide.
    highest
        Limit load of the last colour, so that several maps share their colours; None takes the
        largest of the map.

    Returns
    -------
    The axes.
    """
    met = [each for each in lmap.within if each.event == CONSTRAINT]
    panel = Panel(
        looks=_LOOKS,
        bar=f"limit load {parameter_label(lmap.structure, lmap.load)}",
        marks=(
            Mark(lmap.where("constraint"), f"{constraint_label(met)} first"),
            Mark(lmap.where("lateral branch point"), "leaves its plane first", _STRIPES),
        ),
        ground_label="undefined",
        from_zero=True,
        highest=highest,
    )
    return draw_map(lmap, panel, ax)


_CURVATURE_LOOKS = {
    "fold": CurveLook("barrier: fold", True, {"linewidth": 1.5}),
    "jump": CurveLook("barrier", True, {"linewidth": 1.5, "linestyle": _DASHED}),
    "snap": CurveLook("edge of snapping", True, {"linewidth": 0.8, "linestyle": (0, (3, 1.5))}),
    "gap": CurveLook("edge of a gap", True, {"linewidth": 0.8}),
    "place": CurveLook("two extrema tie", False, {"linewidth": 1.0, "linestyle": _DOTTED}),
    "edge": CurveLook("", True, {"linewidth": 0.6}),
}


@check_arguments
def curvature_map(cmap: CurvatureMap, ax: Axes | None = None) -> Axes:
    """Largest curvature, or another descriptor, of the first stable state at a load.

    Cells that a barrier crosses are cut along it; nothing is interpolated across. Dots mark
    settings whose real loading would snap on the way; settings without a state are hatched.

    Parameters
    ----------
    cmap
        The map.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.
    """
    panel = Panel(
        looks=_CURVATURE_LOOKS,
        bar=f"{descriptor_label(cmap.descriptor)} at {symbol(cmap.load)} = {cmap.at:g}",
        marks=(Mark(cmap.snaps, "snaps on the way"),),
        ground_label="no stable state",
        from_zero=False,
    )
    return draw_map(cmap, panel, ax)
