"""Level sets of a descriptor on the set, over the plane of two further descriptors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.manifold import EquilibriumSet, Level, level_set
from equimorph.model import Descriptor
from equimorph.plotting import style
from equimorph.plotting.curves import fold_pieces, path_of, states_along
from equimorph.plotting.labels import descriptor_label, roomiest
from equimorph.structures import State, States
from equimorph.tasks.route import Route
from equimorph.tasks.start import check_two_parameters

_TINT = 0.22
"""Strength of the colours of indices: lines and words on top stay readable."""
_STABLE: dict[str, Any] = {"color": style.INK, "linewidth": 0.8}
_UNSTABLE: dict[str, Any] = {"color": style.INK, "linewidth": 0.6, "linestyle": (0, (3, 2))}
_BOUNDARY: dict[str, Any] = {"color": style.INK, "linewidth": 1.8}
_ROUTE: dict[str, Any] = {"color": style.ROUTE_COLOUR, "linewidth": 1.6}
_RIM = style.rim(2.4)
_ROUTE_POINTS = 240
"""States at which a route is drawn."""
_HEIGHT, _MARGINS, _LEGEND = 2.6, (0.52, 0.4, 0.12, 0.08), 0.37
"""Inches: height of the axes, margins (left, bottom, right, top), height of the legend."""

Places = Float[np.ndarray, "_ 2"]


@dataclass(frozen=True)
class _Plane:
    """Two descriptors as coordinates."""

    across: Descriptor
    up: Descriptor

    def __call__(self, states: States) -> Float[np.ndarray, "states 2"]:
        return np.stack([self.across(states), self.up(states)], axis=1)

    def at(self, state: State) -> Float[np.ndarray, " 2"]:
        """Coordinates of one state."""
        return np.array([self.across(state), self.up(state)])


@check_arguments
def level_plane(
    eset: EquilibriumSet,
    plane: tuple[Descriptor, Descriptor],
    level: Descriptor,
    values: Sequence[float],
    *,
    route: Route | None = None,
    marks: Mapping[str, State] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Level sets of a descriptor over the plane of two descriptors that distinguish all states.

    The levels are exact states: full lines where they are stable, dashed elsewhere.

    Parameters
    ----------
    eset
        Equilibrium set over two free parameters.
    plane
        Descriptors on both axes.
    level, values
        A descriptor, and those of its values whose states are drawn and labelled.
    route
        Drawn in the plane.
    marks
        States to be marked, by their labels.
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
    check_two_parameters(eset)
    view = _Plane(*plane)
    with style.house_style():
        own = ax is None
        if ax is None:
            ax = style.new_axes(style.SINGLE_COLUMN, _HEIGHT, _MARGINS)
        points = view(eset.points)
        entries: list[Patch | Line2D] = list(_regions(ax, eset, points))
        (low, high) = points.min(axis=0), points.max(axis=0)
        ax.set_xlim(low[0], high[0])
        ax.set_ylim(low[1], high[1])
        boundary = _boundary(ax, eset, points)
        taken = [*boundary, *(view.at(state)[None] for state in (marks or {}).values())]
        if boundary:
            entries.append(Line2D([], [], **_BOUNDARY, label="stability boundary"))
        for value in values:
            number = f"{value:.3g}".replace("-", "−")
            _level(ax, view, level_set(eset, level, value), number, taken)
        entries.append(Line2D([], [], **_STABLE, label=f"levels of {descriptor_label(level)}"))
        if route is not None:
            way = view(states_along(path_of(route), _ROUTE_POINTS))
            ax.plot(*way.T, **_ROUTE, zorder=5, path_effects=_RIM)
            entries.append(Line2D([], [], **_ROUTE, label="route"))
        _mark(ax, view, marks or {})
        ax.set_xlabel(descriptor_label(view.across))
        ax.set_ylabel(descriptor_label(view.up))
        if own:
            style.grow_below(ax, _LEGEND)
            ax.figure.legend(handles=entries, loc="lower center", ncols=3)
    return ax


def _regions(ax: Axes, eset: EquilibriumSet, points: Float[np.ndarray, "V 2"]) -> list[Patch]:
    """Fill the cells, paler than on surfaces; return an entry for each index."""
    entries = []
    for index in sorted({int(i) for i in eset.cell_index}):
        colour = 1.0 - _TINT * (1.0 - style.rgba(style.index_colour(index))[:3])
        cells = points[eset.cells[eset.cell_index == index]]
        look: dict[str, Any] = {"facecolor": colour, "zorder": 1}
        ax.add_collection(PolyCollection(list(cells), edgecolor=colour, linewidth=0.3,
                                         rasterized=True, **look))  # fmt: skip
        entries.append(Patch(**look, edgecolor=style.INK, linewidth=0.4,
                             label=style.index_label(index)))  # fmt: skip
    return entries


def _boundary(ax: Axes, eset: EquilibriumSet, points: Places) -> list[Places]:
    """Draw the boundary of stability; return its pieces."""
    lines = [points[line] for line, index in fold_pieces(eset) if index == 0]
    for line in lines:
        ax.plot(*line.T, **_BOUNDARY, zorder=4)
    return lines


def _level(ax: Axes, view: _Plane, level: Level, number: str, taken: list[Places]) -> None:
    """Draw a level set, and write its number off the places that are taken, if there is room."""
    corner = np.array([ax.get_xlim()[0], ax.get_ylim()[0]])
    size = np.array([ax.get_xlim()[1], ax.get_ylim()[1]]) - corner
    points, margin = view(level.states), level.states.margin
    for piece in level.pieces:
        edges = np.stack([piece[:-1], piece[1:]], axis=1)
        stable = margin[edges].sum(axis=1) > 0.0
        for look, mine in ((_STABLE, stable), (_UNSTABLE, ~stable)):
            if mine.any():
                broken = np.where(mine[:, None, None], points[edges], np.nan)
                ax.plot(*broken.reshape(-1, 2).T, **look, zorder=3)
    full = (np.concatenate([np.empty((0, 2)), *taken]) - corner) / size
    found = roomiest((points - corner) / size, full)
    if found is not None:
        x, y = corner + found * size
        taken.append(np.array([[x, y]]))
        words = ax.text(x, y, number, size=6, ha="center", va="center", zorder=6)
        words.set_path_effects(_RIM)


def _mark(ax: Axes, view: _Plane, marks: Mapping[str, State]) -> None:
    for label, state in marks.items():
        there = view.at(state)
        ax.plot(*there, "o", color=style.INK, ms=3.5, mec="white", mew=0.6, zorder=7)
        text = ax.annotate(label, tuple(there), (4, 4), textcoords="offset points", zorder=7)
        text.set_path_effects(_RIM)
