"""States on the plane of free parameters, numbered as in a table."""

from typing import Any

from matplotlib.axes import Axes

from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.plotting import style
from equimorph.plotting.badges import number_points
from equimorph.plotting.curves import track
from equimorph.plotting.plane import parameter_plane
from equimorph.structures import States

_STABLE: dict[str, Any] = {"marker": "o", "ms": 5, "mfc": style.ROUTE_COLOUR, "mec": "white"}
_UNSTABLE: dict[str, Any] = {"marker": "o", "ms": 5, "mfc": "white", "mec": style.ROUTE_COLOUR}


def solutions(eset: EquilibriumSet, states: States, ax: Axes | None = None) -> Axes:
    """Mark states on the plane of the free parameters, filled where stable.

    Parameters
    ----------
    eset
        Equilibrium set over two free parameters.
    states
        Equilibria of the set; they are numbered from 1 in their order.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        If the set has not two free parameters.
    """
    if len(eset.names) != 2:
        raise InputError(f"`eset` must have two free parameters; got {', '.join(eset.names)}.")
    ax = parameter_plane(eset, ax=ax)
    if not len(states):
        return ax
    places = track(eset, states)
    with style.house_style():
        for stable, look in ((True, _STABLE), (False, _UNSTABLE)):
            mine = places[(states.index == 0) == stable]
            ax.plot(*mine.T, linestyle="none", zorder=7, mew=0.8, **look)
        number_points(ax, places)
    return ax
