"""Routes on their set: surface, parameter plane and shapes side by side, or several at once."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch

from equimorph.argument_checks import check_arguments
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Descriptor
from equimorph.plotting import style
from equimorph.plotting.curves import corner_steps, track
from equimorph.plotting.plane import parameter_plane
from equimorph.plotting.shapes import number_in_space, numbered_shapes
from equimorph.plotting.surface import ASPECT, surface
from equimorph.tasks.route import Route

_HEIGHT = 108 * style.MILLIMETRE
_ZOOM = 1.06
"""Magnification of the solid view within its axes."""
_SOLID = (-0.04, 0.12, 0.6, 0.88)
_PLANE = (0.68, 0.575, 0.235, 0.38)
_SHAPES = (0.68, 0.13, 0.3, 0.34)
"""Axes of the three panels as shares of the figure: left, bottom, width, height."""


@check_arguments
def route_panels(
    eset: EquilibriumSet,
    route: Route,
    height_descriptor: Descriptor,
    *,
    limit: Constraint | None = None,
) -> Figure:
    """Draw a route on the surface, over the parameters, and the shapes at its way-points.

    The way-points are numbered alike in all panels; the plane is shaded by the number of stable
    equilibria.

    Parameters
    ----------
    eset
        Equilibrium set over two free parameters.
    route
        A route that arrived.
    height_descriptor
        Third axis of the surface.
    limit
        The surface is paler where it is not obeyed; its bound is drawn in both panels.

    Returns
    -------
    The figure, two columns wide.

    Raises
    ------
    InputError
        If the route did not arrive.
    """
    if route.path is None or route.schedule is None:
        raise InputError(f"`route` must have arrived; got one that was refused: {route.why}")
    figure = style.Picture(style.DOUBLE_COLUMN, _HEIGHT)
    with style.house_style():
        solid: Any = figure.add_axes(_SOLID, projection="3d")
        plane, shapes = figure.add_axes(_PLANE), figure.add_axes(_SHAPES)
        surface(eset, height_descriptor, solid, route, limit=limit)
        solid.set_box_aspect(ASPECT, zoom=_ZOOM)
        entries = {each.get_label(): each for each in _take_legend(solid)}
        parameter_plane(eset, route, plane, count="stable", limit=limit)
        entries |= {e.get_label(): e for e in _take_legend(plane) if isinstance(e, PathPatch)}
        states = route.path.states[corner_steps(route)]
        corners = np.column_stack([track(eset, states), height_descriptor(states)])
        number_in_space(solid, corners)
        numbered_shapes(shapes, states)
        style.letter_panels("bc", (plane, shapes))
        figure.text(0.012, 0.962, "(a)", weight="bold", size=8)
        figure.legend(
            handles=list(entries.values()), loc="lower center", ncols=4, bbox_to_anchor=(0.5, 0.0)
        )
    return figure


def _take_legend(ax: Axes) -> list[Artist]:
    """Take the legend of a panel away, and return its entries."""
    legend = ax.get_legend()
    assert legend is not None
    entries = [entry for entry in legend.legend_handles if entry is not None]
    legend.remove()
    return entries


_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (6, 1.5, 1.2, 1.5)))
"""Line styles of successive routes."""
_ENDS: dict[str, Any] = {"ls": "none", "ms": 5, "mec": style.ROUTE_COLOUR, "mew": 1.0, "zorder": 8}


@check_arguments
def alternative_routes(
    eset: EquilibriumSet, routes: Sequence[Route], ax: Axes | None = None
) -> Axes:
    """Routes over the numbers of stable equilibria; the legend gives their lengths.

    Parameters
    ----------
    eset
        Equilibrium set over two free parameters.
    routes
        Routes that arrived, the best first.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        If there is no route, or a route has no path.
    """
    if not routes:
        raise InputError("`routes` must hold at least one route; got none.")
    for route in routes:
        if route.path is None:
            raise InputError(f"`routes` must have arrived; got one that was refused: {route.why}")
    own = ax is None
    ax = parameter_plane(eset, ax=ax, count="stable")
    lines: list[Line2D] = []
    with style.house_style():
        shades = style.progress_map()(np.linspace(0.1, 0.8, len(routes)))
        for number, (route, shade) in enumerate(zip(routes, shades, strict=True), start=1):
            assert route.path is not None
            places = track(eset, route.path.states)
            look = {"color": shade, "linestyle": _DASHES[(number - 1) % len(_DASHES)]}
            label = f"{number}: length {route.length:.3g}"
            (line,) = ax.plot(*places.T, **look, linewidth=1.7, zorder=6, label=label)
            line.set_path_effects(style.rim(3.0))
            lines.append(line)
        for at, face in ((0, "white"), (-1, style.ROUTE_COLOUR)):
            ax.plot(*places[at : at + 1 or None].T, "o", mfc=face, **_ENDS)
        style.legend_below(ax, lines, room=own)
    return ax
