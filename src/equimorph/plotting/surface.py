"""The equilibrium surface over the plane of free parameters, coloured by index."""

import numpy as np
from jaxtyping import Float, Int
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from mpl_toolkits.mplot3d import Axes3D

from equimorph.equilibria import Path
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor
from equimorph.plotting import style
from equimorph.plotting.curves import boundary_pieces, fold_pieces, states_along, track
from equimorph.plotting.painter import Coat, PaintedPieces
from equimorph.plotting.symbols import constraint_label, descriptor_label, parameter_label
from equimorph.tasks import Route

Points = Float[np.ndarray, "vertices 3"]
Pieces = Float[np.ndarray, "pieces 3 3"]

_ELEVATION, _AZIMUTH = 24.0, -128.0
_ASPECT = np.array([1.15, 1.3, 0.85])
# Direction to the light in the frame of the viewer: right, towards the viewer, up.
_LIGHT = np.array([-0.45, 0.55, 0.70])
_AMBIENT = 0.62
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
            legend.append(_draw_route(ax, eset, route.path, height_descriptor))
        ax.legend(handles=legend, loc="upper left", bbox_to_anchor=(0.02, 0.98))
    return ax


def _new_axes() -> Axes:
    """Axes that fill a figure; room for the labels is inside them."""
    figure = Figure(figsize=(0.72 * style.DOUBLE_COLUMN, 0.56 * style.DOUBLE_COLUMN))
    style.attach_canvas(figure)
    return figure.add_axes((0.0, 0.0, 0.97, 1.0), projection="3d")


def _frame(ax: Axes3D, eset: EquilibriumSet, height: Descriptor, points: Points) -> None:
    """View, limits, labels and a quiet background."""
    ax.set_proj_type("ortho")
    ax.view_init(elev=_ELEVATION, azim=_AZIMUTH)
    ax.set_box_aspect(_ASPECT, zoom=1.0)
    ax.computed_zorder = False
    low, high = points[:, 2].min(), points[:, 2].max()
    room = 0.03 * (high - low)
    ax.set_xlim(eset.box.lower[0], eset.box.upper[0])
    ax.set_ylim(eset.box.lower[1], eset.box.upper[1])
    ax.set_zlim(low - room, high + room)
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
    caps = boundary_pieces(eset, box=False)
    ink = style.rgba(style.INK)
    coats = [
        Coat(cells, _shaded(eset, cells * _ASPECT / np.ptp(limits, axis=1)), _SEAM),
        Coat(_isolines(cells, limits[:2]), style.rgba(style.INK, 0.25), 0.3, lift=0.5),
        Coat(_segments(points, boundary_pieces(eset, box=True)), ink, 0.4, lift=1.0),
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


def _draw_route(ax: Axes3D, eset: EquilibriumSet, path: Path, height: Descriptor) -> Line2D:
    """Draw a path over everything, a ring at its start and a dot at its goal."""
    states = states_along(path, _ROUTE_POINTS)
    line = np.column_stack([track(eset, states), np.asarray(height(states))])
    drawn: Line2D
    (drawn,) = ax.plot(
        *line.T, color=style.ROUTE_COLOUR, linewidth=1.6, zorder=5, label="route (○ start, ● goal)"
    )
    drawn.set_path_effects([withStroke(linewidth=2.8, foreground="white")])
    for end, fill in ((line[0], style.START_COLOUR), (line[-1], style.ROUTE_COLOUR)):
        ax.plot(
            *end[:, None],
            "o",
            markersize=4.5,
            zorder=6,
            markerfacecolor=fill,
            markeredgecolor=style.ROUTE_COLOUR,
        )
    return drawn


def _segments(points: Points, lines: list[Int[np.ndarray, " _"]]) -> Pieces:
    """Segments of polylines as triangles with two equal corners."""
    pairs = [np.stack([line[:-1], line[1:], line[1:]], axis=1) for line in lines]
    return np.asarray(points[np.concatenate([np.empty((0, 3), int), *pairs])])


def _isolines(cells: Pieces, limits: Float[np.ndarray, "axes 2"]) -> Pieces:
    """Segments where the surface meets evenly spaced planes across the first axes."""
    levels = [
        (k, x)
        for k, (low, high) in enumerate(limits)
        for x in np.linspace(low, high, _ISOLINES)[1:-1]
    ]
    return np.concatenate([_slice(cells, axis, level) for axis, level in levels])


def _slice(cells: Pieces, axis: int, level: float) -> Pieces:
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


def _shaded(eset: EquilibriumSet, cells: Pieces) -> Float[np.ndarray, "cells 4"]:
    """Colours of the cells by index, darker where they turn away from the light."""
    normals = np.cross(cells[:, 1] - cells[:, 0], cells[:, 2] - cells[:, 0])
    viewer = _towards_viewer()
    # Both faces are lit alike: what counts is the side that the viewer sees.
    normals *= np.where(normals @ viewer < 0, -1.0, 1.0)[:, None]
    smooth = _smoothed(eset, normals)
    right = np.array([-np.sin(np.radians(_AZIMUTH)), np.cos(np.radians(_AZIMUTH)), 0.0])
    up = np.cross(viewer, right)
    light = _LIGHT @ np.stack([right, viewer, up])
    bright = _AMBIENT + (1 - _AMBIENT) * np.clip(smooth @ light / np.linalg.norm(light), 0, 1)
    base = np.array([to_rgb(style.index_colour(int(i))) for i in eset.cell_index])
    return np.column_stack([np.clip(1.12 * base * bright[:, None], 0, 1), np.ones(len(cells))])


def _smoothed(
    eset: EquilibriumSet, normals: Float[np.ndarray, "cells 3"]
) -> Float[np.ndarray, "cells 3"]:
    """Unit normals averaged over neighbours, so that shading does not show the mesh."""
    total = np.zeros((len(eset.coordinates), 3))
    for corner in range(3):
        np.add.at(total, eset.cells[:, corner], normals)
    # On a fold the two sides face the viewer with opposite normals: keep each cell near its own.
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    mean = total[eset.cells].sum(axis=1)
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)
    mixed = mean + normals / np.maximum(size, 1e-300)
    return np.asarray(mixed / np.maximum(np.linalg.norm(mixed, axis=1, keepdims=True), 1e-300))


def _towards_viewer() -> Float[np.ndarray, "3"]:
    """Unit vector from the surface to the viewer, in the coordinates of the drawn box."""
    up, around = np.radians([_ELEVATION, _AZIMUTH])
    return np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
