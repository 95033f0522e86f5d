"""Several routes between the same states, on the plane of the free parameters."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.plotting import style
from equimorph.plotting.curves import track
from equimorph.plotting.plane import legend_below, parameter_plane
from equimorph.tasks import Route

_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (6, 1.5, 1.2, 1.5)))
_ENDS: dict[str, Any] = {"ls": "none", "ms": 5, "mec": style.ROUTE_COLOUR, "mew": 1.0, "zorder": 8}


def alternative_routes(
    eset: EquilibriumSet, routes: Sequence[Route], ax: Axes | None = None
) -> Axes:
    """Routes over the numbers of stable equilibria; the legend tells their lengths.

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
        If there is none, or one has no path.
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
            line.set_path_effects([withStroke(linewidth=3.0, foreground="white")])
            lines.append(line)
        for at, face in ((0, "white"), (-1, style.ROUTE_COLOUR)):
            ax.plot(*places[at : at + 1 or None].T, "o", mfc=face, **_ENDS)
        legend_below(ax, lines, room=own)
    return ax
