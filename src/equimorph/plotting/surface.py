"""The equilibrium surface over the plane of free parameters, coloured by index."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from mpl_toolkits.mplot3d import Axes3D, proj3d

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, Float, Int
from equimorph.equilibria import Path
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet, divided_by
from equimorph.model import Constraint, Descriptor
from equimorph.plotting import style
from equimorph.plotting.curves import (
    boundary_pieces,
    fold_pieces,
    limit_pieces,
    states_along,
    track,
)
from equimorph.plotting.labels import constraint_label, descriptor_label, parameter_label
from equimorph.plotting.scene import Curve, Scene
from equimorph.plotting.shading import Paint, corner_normals
from equimorph.tasks.motion.tracking import Tracking
from equimorph.tasks.route import Route

Points = Float[np.ndarray, "vertices 3"]

_ELEVATION, _AZIMUTH = 23.0, 125.0
"""Direction of view, in degrees."""
ASPECT = np.array([1.2, 1.3, 1.0])
"""Sides of the box that a surface fills."""
_ZOOM = 1.17
"""Magnification of the solid view within its axes."""
_LINES_PER_TICK = 2
"""Grid lines on the surface per tick of an axis."""
_BEYOND = 0.55
"""Share of white in the colours beyond a limit."""
_ROUTE_POINTS = 240
"""States at which a route is drawn."""
_ROUTE_SLACK = 0.015
"""Depth below the drawn triangles, as a share of the scene, at which a route is visible: it runs on
the exact surface, which is curved between their vertices."""

_KEY: dict[str, Any] = {"loc": "upper center", "ncols": 4, "bbox_to_anchor": (0.53, 1.0)}
_GAP = 4.0
"""Pixels below the legend."""
_BOX: dict[str, Any] = {"color": style.INK, "linewidth": 0.5}
_CAP: dict[str, Any] = {"color": "#4d4d4d", "linewidth": 0.9}
_FOLD: dict[str, Any] = {"color": style.INK, "linewidth": 1.5, "capstyle": "round"}
_CROSSING: dict[str, Any] = {
    "color": style.INK,
    "linewidth": 1.5,
    "linestyle": (0, (4, 1.2, 1, 1.2)),
}
_LIMIT = style.LIMIT_LINE
_HIDDEN_FOLD: dict[str, Any] = {
    "color": style.INK,
    "linewidth": 0.6,
    "linestyle": (0, (3, 2)),
    "alpha": 0.45,
}
_RIM = style.rim(3.0)
_ROUTE: dict[str, Any] = {
    "color": style.ROUTE_COLOUR,
    "linewidth": 1.6,
    "capstyle": "round",
    "path_effects": _RIM,
}
_HIDDEN_ROUTE: dict[str, Any] = {
    "color": style.ROUTE_COLOUR,
    "linewidth": 1.0,
    "linestyle": (0, (2, 1.5)),
    "alpha": 0.7,
}


@check_arguments
def surface(
    eset: EquilibriumSet,
    height_descriptor: Descriptor | None = None,
    ax: Axes | None = None,
    route: Route | Tracking | None = None,
    *,
    limit: Constraint | None = None,
) -> Axes:
    """Equilibrium surface in three dimensions: two free parameters and a descriptor.

    Parallel projection; pieces are sorted by depth, curves among them, so that what lies behind is
    hidden. The route alone lies on top of everything.

    Parameters
    ----------
    eset
        Equilibrium set over two free parameters.
    height_descriptor
        Third axis, which tells the sheets apart; None takes the structure's own.
    ax
        Three-dimensional axes to draw on; None makes a figure one and a half columns wide.
    route
        Route or motion, drawn with its start and goal; omitted if it has no path.
    limit
        The set is cut along its bound, and paler where it is not obeyed.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        If `ax` is not three-dimensional.
    """
    with style.house_style():
        if ax is None:
            ax = _new_axes()
        elif ax.name != "3d":
            raise InputError(f'`ax` must be three-dimensional (projection="3d"); got {ax.name!r}.')
        beyond = np.zeros(len(eset.cells), bool)
        bounds: list[Int[np.ndarray, " _"]] = []
        if limit is not None:
            division = divided_by(eset, limit)
            eset, beyond = division.eset, division.side > 0
            bounds = [line for line, _ in limit_pieces(division)]
        height = eset.structure.elevation if height_descriptor is None else height_descriptor
        points = np.column_stack([eset.coordinates, np.asarray(height(eset.points))])
        _frame(ax, eset, height, points)
        curves, legend = _curves(eset, points)
        if limit is not None:
            curves += [Curve(points[line], _LIMIT | {"path_effects": _RIM}) for line in bounds]
            legend.append(Line2D([], [], **_LIMIT, label=constraint_label([limit])))
        if route is not None and route.path is not None:
            states = states_along(route.path, _ROUTE_POINTS)
            places = np.column_stack([track(eset, states), height(states)])
            curves.append(Curve(places, _ROUTE, _HIDDEN_ROUTE, slack=_ROUTE_SLACK))
            legend.append(_route_entry(route.status, route.path))
            _draw_ends(ax, places)
        _lower(ax, points, ax.legend(handles=legend, **_KEY))
        ax.add_artist(Scene(points[eset.cells], _paint(ax, eset, points, beyond), curves))
    return ax


def _new_axes() -> Axes:
    """Axes that fill a figure; room for the labels is inside them."""
    figure = style.Picture(0.72 * style.DOUBLE_COLUMN, 0.58 * style.DOUBLE_COLUMN)
    return figure.add_axes((-0.045, 0.03, 1.0, 0.95), projection="3d")


def _frame(ax: Axes3D, eset: EquilibriumSet, height: Descriptor, points: Points) -> None:
    """View, limits, labels and a quiet background."""
    ax.set_proj_type("ortho")
    ax.view_init(elev=_ELEVATION, azim=_AZIMUTH)
    ax.set_box_aspect(ASPECT, zoom=_ZOOM)
    ax.computed_zorder = False
    low, high = points.min(axis=0), points.max(axis=0)
    room = 0.02 * (high - low)
    for axis, a, b in zip("xyz", low - room, high + room, strict=True):
        getattr(ax, f"set_{axis}lim")(a, b)
    labels = [parameter_label(eset.structure, name) for name in eset.names]
    labels.append(descriptor_label(height))
    for axis, label in zip((ax.xaxis, ax.yaxis, ax.zaxis), labels, strict=True):
        axis.set_label_text(label)
        axis.set_major_locator(style.few_ticks())
        axis.labelpad = -5
        axis.set_tick_params(pad=0 if axis is ax.zaxis else -3)
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))


def _lower(ax: Axes3D, points: Points, legend: Legend) -> None:
    """Make room above the set if it would be drawn over the legend."""
    box = legend.get_window_extent()
    ax.apply_aspect()
    low, high = ax.get_zlim()
    ends = [[*points[0, :2], low], [*points[0, :2], high]]  # the height of the frame
    across, up, _ = proj3d.proj_transform(*np.vstack([points, ends]).T, ax.get_proj())
    x, y = ax.transData.transform(np.column_stack([across, up])).T
    behind = (box.x0 - _GAP < x[:-2]) & (x[:-2] < box.x1 + _GAP)
    excess = float(np.max(y[:-2][behind], initial=-np.inf)) + _GAP - box.y0
    if excess > 0.0:
        ax.set_zlim(low, low + (high - low) / (1.0 - min(0.5, excess / (y[-1] - y[-2]))))


def _curves(eset: EquilibriumSet, points: Points) -> tuple[list[Curve], list[Patch | Line2D]]:
    """Folds and boundaries of the set, and the entries of a legend for them and for the cells."""
    folds = [line for line, _ in fold_pieces(eset)]
    caps, box = ([line for line, _ in boundary_pieces(eset, box=side)] for side in (False, True))
    looks = [
        (box, _BOX, None),
        (caps, _CAP, None),
        (folds, _FOLD, _HIDDEN_FOLD),
        (eset.crossings, _CROSSING, None),
    ]
    curves = [Curve(points[line], seen, hidden) for lines, seen, hidden in looks for line in lines]
    return curves, _legend(eset, bool(folds), bool(caps))


def _paint(
    ax: Axes3D, eset: EquilibriumSet, points: Points, beyond: Bool[np.ndarray, " cells"]
) -> Paint:
    """Cells in the colours of their indices, with thin lines at even steps of the parameters."""
    limits = np.array([ax.get_xlim(), ax.get_ylim(), ax.get_zlim()])
    proportions = ASPECT / np.ptp(limits, axis=1)
    palette = np.array([style.rgba(style.index_colour(k))[:3] for k in range(1 + eset.index.max())])
    colours = palette[eset.cell_index]
    colours[beyond] += _BEYOND * (1.0 - colours[beyond])
    steps = [np.diff(style.few_ticks().tick_values(*ends))[0] for ends in limits[:2]]
    return Paint(
        corner_normals(
            points[eset.cells] * proportions,
            eset.cells,
            eset.cell_index,
            np.unique(np.concatenate([np.zeros(0, int), *eset.crossings])),
        ),
        proportions,
        colours,
        tuple(float(step) / _LINES_PER_TICK for step in steps),
        style.rgba(style.INK)[:3],
    )


def _legend(eset: EquilibriumSet, folds: bool, caps: bool) -> list[Patch | Line2D]:
    """Entries for the indices that occur and for the curves."""
    labels = {style.index_label(int(i)): style.index_colour(int(i)) for i in set(eset.cell_index)}
    entries: list[Patch | Line2D] = [
        Patch(facecolor=colour, edgecolor=style.INK, linewidth=0.4, label=label)
        for label, colour in sorted(labels.items(), key=lambda pair: (pair[0] != "stable", pair[0]))
    ]
    if folds:
        entries.append(Line2D([], [], label="fold", color=style.INK, linewidth=1.5))
    if eset.crossings:
        look = {name: _CROSSING[name] for name in ("color", "linewidth", "linestyle")}
        entries.append(Line2D([], [], **look, label="branch points"))
    if caps:
        label = constraint_label(eset.constraints)
        entries.append(Line2D([], [], **_CAP, label=label))
    return entries


def _route_entry(status: str, path: Path) -> Line2D:
    """Entry for a route in a legend."""
    label = "route (○ start, ● goal)"
    if status != "arrived":
        label = f"route, refused (○ start, ● {path.end.kind})"
    return Line2D([], [], color=style.ROUTE_COLOUR, linewidth=1.6, label=label)


def _draw_ends(ax: Axes3D, places: Points) -> None:
    """Draw a ring at the start of a route and a dot at its end."""
    colour = style.ROUTE_COLOUR
    for end, fill in ((places[0], "white"), (places[-1], colour)):
        (mark,) = ax.plot(*end[:, None], "o", color=colour, ms=4.5, mfc=fill, zorder=6)
        mark.set_path_effects(style.rim(2.8))
