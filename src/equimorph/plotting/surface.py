"""The equilibrium surface over the plane of free parameters, coloured by index."""

import numpy as np
from jaxtyping import Float, Int
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import AbstractPathEffect, withStroke
from mpl_toolkits.mplot3d import Axes3D

from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor
from equimorph.plotting import style
from equimorph.plotting.curves import boundary_pieces, fold_pieces, states_along, track
from equimorph.plotting.painter import Coat, PaintedPieces
from equimorph.plotting.shading import brightness, corner_normals, split_long
from equimorph.plotting.symbols import constraint_label, descriptor_label, parameter_label
from equimorph.tasks import Route

Points = Float[np.ndarray, "vertices 3"]
Cells = Float[np.ndarray, "cells 3 3"]
Pieces = Float[np.ndarray, "pieces 3 3"]

_ELEVATION, _AZIMUTH = 18.0, -135.0
_ASPECT = np.array([1.2, 1.3, 1.0])
_ZOOM = 1.12
# Longest edge of a painted triangle, in the units of _ASPECT.
_LONGEST = 0.05
_ISOLINES = 11
_SEAM = 0.35  # width of edges in the colour of the face: they close the seams of antialiasing
_ROUTE_POINTS = 240
_CAP_COLOUR = "#4d4d4d"


def surface(
    eset: EquilibriumSet,
    height_descriptor: Descriptor,
    ax: Axes | None = None,
    route: Route | None = None,
) -> Axes:
    """Equilibrium surface in three dimensions: two free parameters and a descriptor.

    Parallel projection; pieces are sorted by depth, curves among them, so that what lies behind is
    hidden. The route alone lies on top of everything.

    Parameters
    ----------
    eset
        Equilibrium set over two free parameters.
    height_descriptor
        Third axis; a height or an angle that tells the sheets apart.
    ax
        Three-dimensional axes to draw on; None makes a figure one and a half columns wide.
    route
        Drawn with its start and goal; one without a path is left out.

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
        heights = np.asarray(height_descriptor(eset.points))
        points = np.column_stack([eset.coordinates, heights])
        _frame(ax, eset, height_descriptor, points)
        legend = _draw_set(ax, eset, points)
        if route is not None and route.path is not None:
            label = "route (○ start, ● goal)"
            if route.status != "arrived":
                label = f"route, refused (○ start, ● {route.path.end.kind})"
            states = states_along(route.path, _ROUTE_POINTS)
            places = np.column_stack([track(eset, states), height_descriptor(states)])
            legend.append(_draw_route(ax, places, label))
        ax.legend(handles=legend, loc="upper center", ncols=4, bbox_to_anchor=(0.5, 1.0))
    return ax


def _new_axes() -> Axes:
    """Axes that fill a figure; room for the labels is inside them."""
    figure = Figure(figsize=(0.72 * style.DOUBLE_COLUMN, 0.58 * style.DOUBLE_COLUMN))
    style.attach_canvas(figure)
    return figure.add_axes((0.02, -0.02, 0.96, 0.98), projection="3d")


def _frame(ax: Axes3D, eset: EquilibriumSet, height: Descriptor, points: Points) -> None:
    """View, limits, labels and a quiet background."""
    ax.set_proj_type("ortho")
    ax.view_init(elev=_ELEVATION, azim=_AZIMUTH)
    ax.set_box_aspect(_ASPECT, zoom=_ZOOM)
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


def _draw_set(ax: Axes3D, eset: EquilibriumSet, points: Points) -> list[Patch | Line2D]:
    """Draw cells and curves as one collection; return the entries of a legend."""
    cells = points[eset.cells]
    limits = np.array([ax.get_xlim(), ax.get_ylim(), ax.get_zlim()])
    folds = [line for line, _ in fold_pieces(eset)]
    caps, box = ([line for line, _ in boundary_pieces(eset, box=side)] for side in (False, True))
    ink = style.rgba(style.INK)
    coats = [
        _coat(eset, points, _ASPECT / np.ptp(limits, axis=1)),
        Coat(_isolines(cells, limits[:2]), style.rgba(style.INK, 0.25), 0.3, lift=0.5),
        Coat(_segments(points, box), ink, 0.4, lift=1.0),
        Coat(_segments(points, caps), style.rgba(_CAP_COLOUR), 0.8, lift=1.0),
        Coat(_segments(points, folds), ink, 1.5, lift=1.0),
    ]
    # Ten thousand triangles are too many for a vector file.
    ax.add_collection3d(PaintedPieces(coats, rasterized=True, zorder=1), autolim=False)
    return _legend(eset, bool(folds), bool(caps))


def _legend(eset: EquilibriumSet, folds: bool, caps: bool) -> list[Patch | Line2D]:
    """Entries for the indices that occur and for the curves."""
    labels = {style.index_label(int(i)): style.index_colour(int(i)) for i in set(eset.cell_index)}
    entries: list[Patch | Line2D] = [
        Patch(facecolor=colour, edgecolor=style.INK, linewidth=0.4, label=label)
        for label, colour in sorted(labels.items(), key=lambda pair: (pair[0] != "stable", pair[0]))
    ]
    if folds:
        entries.append(Line2D([], [], color=style.INK, linewidth=1.5, label="fold"))
    if caps:
        label = constraint_label(eset.constraints)
        entries.append(Line2D([], [], color=_CAP_COLOUR, linewidth=0.8, label=label))
    return entries


def _draw_route(ax: Axes3D, places: Points, label: str) -> Line2D:
    """Draw a route over everything, a ring at its start and a dot at its end."""
    rim: list[AbstractPathEffect] = [withStroke(linewidth=2.8, foreground="white")]
    colour = style.ROUTE_COLOUR
    drawn: Line2D
    (drawn,) = ax.plot(*places.T, color=colour, linewidth=1.6, zorder=5, label=label)
    drawn.set_path_effects(rim)
    for end, fill in ((places[0], "white"), (places[-1], colour)):
        (mark,) = ax.plot(*end[:, None], "o", color=colour, ms=4.5, mfc=fill, zorder=6)
        mark.set_path_effects(rim)
    return drawn


def _segments(points: Points, lines: list[Int[np.ndarray, " _"]]) -> Pieces:
    """Segments of polylines as triangles with two equal corners."""
    pairs = [np.stack([line[:-1], line[1:], line[1:]], axis=1) for line in lines]
    return np.asarray(points[np.concatenate([np.empty((0, 3), int), *pairs])])


def _isolines(cells: Cells, limits: Float[np.ndarray, "axes 2"]) -> Pieces:
    """Segments where the surface meets evenly spaced planes across the first axes."""
    levels = [
        (k, x)
        for k, (low, high) in enumerate(limits)
        for x in np.linspace(low, high, _ISOLINES)[1:-1]
    ]
    return np.concatenate([_slice(cells, axis, float(level)) for axis, level in levels])


def _slice(cells: Cells, axis: int, level: float) -> Pieces:
    """Segments where the surface meets one plane across an axis."""
    above = cells[..., axis] > level
    cut = cells[above.any(axis=1) & ~above.all(axis=1)]
    above = cut[..., axis] > level
    # The corner that is alone on its side of the plane; both cuts lie on its edges.
    alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
    lanes = np.arange(len(cut))
    tip = cut[lanes, alone]
    ends = []
    for step in (1, 2):
        other = cut[lanes, (alone + step) % 3]
        share = (level - tip[:, axis]) / (other[:, axis] - tip[:, axis])
        ends.append(tip + share[:, None] * (other - tip))
    return np.stack([ends[0], ends[1], ends[1]], axis=1)


def _coat(eset: EquilibriumSet, points: Points, scale: Float[np.ndarray, "3"]) -> Coat:
    """Cells in the colours of their indices, in the light; `scale` leads to what is drawn."""
    corners = points[eset.cells] * scale
    normals = corner_normals(corners, eset.cells, eset.cell_index)
    pieces, normals, owner = split_long(corners, normals, _LONGEST)
    bright = brightness(normals, _ELEVATION, _AZIMUTH)
    index = eset.cell_index[owner]
    palette = np.array([style.rgba(style.index_colour(k)) for k in range(int(index.max()) + 1)])
    colours = palette[index]
    colours[:, :3] *= bright[:, None]
    return Coat(pieces / scale, colours, _SEAM)
