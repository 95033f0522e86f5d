"""Optima: the best state over two parameters, the strongest settings, an optimum that moves."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from mpl_toolkits.axes_grid1 import make_axes_locatable

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.manifold.geometry.topology import chains
from equimorph.model import Descriptor
from equimorph.plotting import style
from equimorph.plotting.labels import descriptor_label, number_points, parameter_label
from equimorph.plotting.maps import GROUND, load_map, new_map_axes, value_colours
from equimorph.structures import Structure
from equimorph.tasks.maps.limit_load import LimitLoadMap
from equimorph.tasks.optimising.landscapes import Landscape
from equimorph.tasks.optimising.optimum_path import FollowedOptimum
from equimorph.tasks.optimising.strength import Strongest, StrongestSettings

_BARRIERS: dict[str, dict[str, Any]] = {
    "stability": {"linewidths": 1.5, "linestyles": "-"},
    "preference": {"linewidths": 1.0, "linestyles": (0, (2.4, 1.0))},
}
_LABELS = {"stability": "barrier: stability", "preference": "barrier: preference"}


@check_arguments
def landscape(
    structure: Structure, found: Landscape, objective: Descriptor, ax: Axes | None = None
) -> Axes:
    """Values of an objective over two parameters, setting by setting; nothing is interpolated.

    Barriers run between the settings whose best states are not connected; settings without an
    allowed stable state are hatched.

    Parameters
    ----------
    structure
        Structure whose parameters span the grid.
    found
        The landscape.
    objective
        Descriptor that was minimised or maximised.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.
    """
    with style.house_style({"hatch.linewidth": 0.5}):
        own = ax is None
        ax = ax or new_map_axes(wider=0.12)
        box = found.grid.box
        ax.set_xlim(box.lower[0], box.upper[0])
        ax.set_ylim(box.lower[1], box.upper[1])
        ax.set_xlabel(parameter_label(structure, box.names[0]))
        ax.set_ylabel(parameter_label(structure, box.names[1]))
        ax.add_patch(Rectangle(tuple(box.lower), *(box.upper - box.lower), **GROUND))
        known = found.value[~found.gaps]
        if len(known):
            _fill(ax, found, Normalize(known.min(), known.max()), descriptor_label(objective))
        entries: list[Line2D | Patch] = list(_draw_barriers(ax, found))
        if found.gaps.any():
            entries.append(Patch(label="no stable state", **GROUND))
        style.legend_below(ax, entries, room=own)
    return ax


def _fill(ax: Axes, found: Landscape, norm: Normalize, label: str) -> None:
    """One cell around each setting, and the scale."""
    x, y = found.grid.axes()
    values = np.ma.masked_array(found.value, mask=found.gaps).T
    look: dict[str, Any] = {"cmap": value_colours(), "norm": norm}
    half = [0.5 * (line[1] - line[0]) for line in (x, y)]
    ends = [(line[0] - room, line[-1] + room) for line, room in zip((x, y), half, strict=True)]
    limits = ax.get_xlim(), ax.get_ylim()
    ax.imshow(
        values, extent=(*ends[0], *ends[1]), origin="lower", aspect="auto",
        interpolation="nearest", zorder=1.5, **look,
    )  # fmt: skip
    ax.set(xlim=limits[0], ylim=limits[1])
    style.colour_bar(ax, ScalarMappable(norm, look["cmap"]), label)


def _draw_barriers(ax: Axes, found: Landscape) -> list[Line2D]:
    """Draw barriers along the rims of the cells; return one labelled line of each kind."""
    lines = _rims(found)
    kinds = np.array(found.barriers.kind, dtype=object)
    entries = []
    for kind, look in _BARRIERS.items():
        mine = _join_lines(lines[kinds == kind])
        if mine:
            ax.add_collection(LineCollection(mine, colors=style.INK, zorder=4, **look))
            shown = {"linewidth": look["linewidths"], "linestyle": look["linestyles"]}
            entries.append(Line2D([], [], color=style.INK, label=_LABELS[kind], **shown))
    return entries


def _join_lines(
    lines: Float[np.ndarray, "edges 2 2"],
) -> list[Float[np.ndarray, "points 2"]]:
    """Short lines joined at their ends, so that dashes run through."""
    size = np.ptp(lines.reshape(-1, 2), axis=0).max(initial=0.0) if len(lines) else 0.0
    if not size > 0.0:
        return list(lines)
    rounded = np.round(lines.reshape(-1, 2) / size, 9)
    places, number = np.unique(rounded, axis=0, return_inverse=True)
    return [places[chain] * size for chain in chains(number.reshape(-1, 2))]


def _rims(found: Landscape) -> Float[np.ndarray, "edges 2 2"]:
    """Side between the cells of the two settings of each edge that crosses a barrier."""
    ends = found.barriers.ends
    box = found.grid.box
    step = (box.upper - box.lower) / np.array(found.grid.intervals)
    middle = ends.mean(axis=1)
    across = np.where(np.abs(ends[:, 1] - ends[:, 0]) > 0.5 * step, 0.0, 0.5 * step)
    return np.stack([middle - across, middle + across], axis=1)


_SURE: dict[str, Any] = {"marker": "o", "ms": 5, "mfc": style.ROUTE_COLOUR, "mec": "white"}
_ROBUST: dict[str, Any] = {"marker": "s", "ms": 5.5, "mfc": "white", "mec": style.ROUTE_COLOUR}
_ERRORS: dict[str, Any] = {"fill": False, "ec": style.ROUTE_COLOUR, "lw": 1.1, "zorder": 7}
_ROOM = (0.62, 0.38, 0.1, 0.34)
"""Inches around the axes: left, bottom, right, top."""
_SIDES = (("o", "-", True), ("s", "--", False))


@check_arguments
def strongest_settings(
    lmap: LimitLoadMap,
    sure: StrongestSettings,
    robust: StrongestSettings | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Map of limit loads with its largest values numbered, and a robust one with its errors.

    Parameters
    ----------
    lmap
        The map.
    sure
        Settings that are met exactly.
    robust
        The setting for errors, drawn as a square in the box of these.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.
    """
    ax = load_map(lmap, ax)
    names = lmap.grid.names
    places = np.array([[each.setting[name] for name in names] for each in sure.all])
    with style.house_style():
        ax.plot(*places.T, linestyle="none", zorder=8, mew=0.8, clip_on=False, **_SURE)
        if robust is not None and robust.status != "refused":
            middle = np.array([robust.best.setting[name] for name in names])
            half = np.array([robust.offsets.get(name, 0.0) for name in names])
            low, size = middle - half, 2.0 * half
            ax.add_patch(Rectangle((low[0], low[1]), size[0], size[1], **_ERRORS))
            ax.plot(*middle, linestyle="none", zorder=8.5, mew=1.2, clip_on=False, **_ROBUST)
        number_points(ax, places)
    return ax


@check_arguments
def beside_strongest(
    lmap: LimitLoadMap, found: Sequence[Strongest], ax: Axes | None = None
) -> Axes:
    """Limit loads on both sides of one or two settings, over the distance from them.

    Parameters
    ----------
    lmap
        The map that they are of.
    found
        The best setting without errors, and a robust one.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.
    """
    with style.house_style():
        ax = ax or style.new_axes(style.SINGLE_COLUMN, 0.75 * style.SINGLE_COLUMN, _ROOM)
        shades = style.progress_map()(np.linspace(0.1, 0.6, len(found)))
        words = ("best", "robust")
        for each, shade, word in zip(found, shades, words, strict=False):
            for side, (marker, dash, filled) in zip(each.sides, _SIDES, strict=True):
                ax.plot(
                    each.distances, side, marker, ls=dash, color=shade, lw=1.1, ms=4,
                    mfc=shade if filled else "white", mec=shade,
                    label=f"{word}, {'one' if filled else 'other'} side",
                )  # fmt: skip
            ax.axhline(each.value, color=shade, linewidth=0.6, linestyle=":", zorder=1)
        ax.set_xscale("log")
        ax.set_xlabel("distance from the setting (scaled)")
        ax.set_ylabel(f"limit load {parameter_label(lmap.structure, lmap.load)}")
        ax.yaxis.set_major_locator(style.few_ticks())
        ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.2)
    return ax


_PANEL_ROOM = (0.6, 0.38, 0.1, 0.1)
"""Inches around the panels: left, bottom, right, top."""
_PANEL, _GAP = 1.05, 0.1
"""Inches: height of a panel, and gap between two."""
_ROUNDING = 1e-9
"""Range of an actuator, relative to its size, below which its axis is that of a constant."""
_COLOURS = {"objective": style.ROUTE_COLOUR, "actuator": style.INDEX_COLOURS[0]}


@check_arguments
def followed(
    found: FollowedOptimum,
    objective: Descriptor,
    actuators: Sequence[str],
    ax: Axes | None = None,
) -> Axes:
    """Objective of a moving optimum, and below it each actuator; broken where the optimum jumps.

    Parameters
    ----------
    found
        The optimum, with at least one state.
    objective
        What it is the optimum of.
    actuators
        Names of the parameters that were chosen.
    ax
        Where to draw the objective; the actuators go into axes below. None makes a figure one
        column wide.

    Returns
    -------
    The axes of the objective.
    """
    panels = 1 + len(actuators)
    with style.house_style():
        if ax is None:
            height = _PANEL_ROOM[1] + _PANEL_ROOM[3] + panels * _PANEL + (panels - 1) * _GAP
            ax = style.new_axes(style.SINGLE_COLUMN, height, _PANEL_ROOM)
        divider = make_axes_locatable(ax)
        _draw(ax, found, found.values, _COLOURS["objective"])
        ax.set_ylabel(descriptor_label(objective))
        structure, last = found.states.structure, ax
        for name in actuators:
            last.tick_params(labelbottom=False)
            last = divider.append_axes("bottom", size="100%", pad=_GAP, sharex=ax)
            _draw(last, found, found.states[name], _COLOURS["actuator"])
            last.set_ylabel(parameter_label(structure, name))
        last.set_xlabel("legs done")
        ends = [float(found.at.min()), float(found.at.max())]
        ax.set_xlim(ends[0], max(ends[1], ends[0] + 1e-9))
    return ax


def _draw(
    ax: Axes, found: FollowedOptimum, values: Float[np.ndarray, " points"], colour: str
) -> None:
    """One quantity, with a gap and both sides at each jump, and lines at the ends of legs."""
    at = found.at
    for leg in range(1, int(np.ceil(at.max()))):
        ax.axvline(leg, color="#c4c4c4", linewidth=0.5, zorder=1)
    places = [jump.at for jump in found.jumps if jump.after is not None]
    cuts = np.array([int(np.flatnonzero(at == place)[0]) + 1 for place in places], dtype=int)
    x, y = (np.insert(each, cuts, np.nan) for each in (at, values))
    ax.plot(x, y, color=colour, linewidth=1.4, zorder=3)
    for cut in cuts[cuts < len(values)].tolist():
        sides = at[[cut - 1, cut]], values[[cut - 1, cut]]
        ax.plot(*sides, color=colour, linewidth=0.9, linestyle=":", zorder=2)
        ax.plot(*sides, "o", color=colour, ms=3.5, mec="white", mew=0.6, zorder=4)
    ax.yaxis.set_major_locator(style.few_ticks())
    ax.margins(y=0.12)
    middle, size = float(values.mean()), max(1.0, float(np.abs(values).max()))
    if np.ptp(values) < _ROUNDING * size:
        ax.set_ylim(middle - 0.1 * size, middle + 0.1 * size)
