"""Figures of transition networks: disconnectivity graphs, minimum-energy paths, barriers."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.equilibria import EnergyPath, TransitionNetwork
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet, NetworkChanges
from equimorph.plotting import style
from equimorph.plotting.labels import with_unit
from equimorph.plotting.maps import value_colours
from equimorph.plotting.plane import draw_folds, frame_plane
from equimorph.plotting.surroundings import Surroundings, frame_shapes
from equimorph.structures import States
from equimorph.tasks.start import check_two_parameters

_TREE_ROOM, _PATH_ROOM = (0.66, 0.66, 0.1, 0.1), (0.66, 0.98, 0.1, 0.1)
_PLANE_ROOM = (0.5, 0.42, 0.62, 0.1)
"""Inches around the axes: left, bottom, right, top; shapes stand below."""
_HEIGHT = 2.7
"""Height of a diagram in inches."""
_BAND, _BELOW_TREE, _BELOW_PATH = 0.3, -0.33, -0.45
"""Height and bottoms of the shapes, as shares of the height of the axes."""
_LABEL_PAD = 40.0
"""Points between the numbers on the axis and its label."""
_WIDEST = 0.9
"""Width of a shape, as a share of the distance of two leaves."""
_MOST_SHAPES = 8
"""Largest number of shapes below a diagram."""
_BORDER = 0.08
_HEADROOM = 0.12
"""Of the energies."""
Group = tuple[int, ...]
"""Numbers of the stable states of a group of basins."""
_STABLE, _SADDLE = style.index_colour(0), style.index_colour(1)


@check_arguments
def disconnectivity(network: TransitionNetwork, ax: Axes | None = None) -> Axes:
    """Disconnectivity graph of a network: stable states as leaves, joined where saddles join them.

    The height of a leaf is the energy of the state, that of a bar the energy of the saddle over
    which two groups of states reach each other. Lines that end at the top have no saddle to others.
    Shapes stand below the leaves, if there are at most eight.

    Parameters
    ----------
    network
        With at least one stable state.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        If the network has no stable state.
    """
    if len(network.minima) == 0:
        raise InputError("`network` must have a stable state; got one without.")
    energy = network.energy
    groups: dict[Group, float] = {(int(k),): float(energy[k]) for k in network.minima}
    order = _order(network)
    place: dict[Group, float] = {(number,): float(k) for k, number in enumerate(order)}
    levels = [merge.energy for merge in network.merges]
    top = max(levels, default=float(energy[network.minima].max()))
    span = max(top - float(energy[network.minima].min()), 1e-9 * max(1.0, abs(top)))
    with style.house_style():
        ax = ax or style.new_axes(style.SINGLE_COLUMN, _HEIGHT, _TREE_ROOM)
        for merge in network.merges:
            one, other = merge.one, merge.other
            for group in (one, other):
                ax.plot([place[group]] * 2, [groups.pop(group), merge.energy], **_LINE)
            ends = [place[one], place[other]]
            ax.plot(ends, [merge.energy] * 2, **_LINE)
            joined = tuple(sorted(one + other))
            groups[joined], place[joined] = merge.energy, sum(ends) / 2.0
            ax.plot(place[joined], merge.energy, "o", color=_SADDLE, mec=style.INK, **_DOT)
        for group, level in groups.items():
            ax.plot([place[group]] * 2, [level, top + _HEADROOM * span], **_LINE)
        for k, number in enumerate(order):
            ax.plot(k, energy[number], "o", color=_STABLE, mec=style.INK, **_DOT)
        ax.set_xlim(-0.5, len(order) - 0.5)
        ax.set_ylim(top - (1.0 + _HEADROOM) * span, top + _HEADROOM * span)
        ax.set_xticks([])
        ax.set_ylabel(_energy_label(network.states))
        leaves = np.arange(len(order), dtype=float)
        _draw_shapes(ax, network.states[np.array(order)], leaves, _BELOW_TREE)
    return ax


_LINE: dict[str, Any] = {
    "color": style.INK,
    "linewidth": 1.1,
    "zorder": 2,
    "solid_capstyle": "projecting",
}
_DOT: dict[str, Any] = {"ms": 4.0, "mew": 0.5, "zorder": 3}


def _order(network: TransitionNetwork) -> list[int]:
    """Leaves from left to right, so that bars do not cross lines; the lower group first."""
    rows: dict[Group, list[int]] = {(int(k),): [int(k)] for k in network.minima}
    for merge in network.merges:
        parts = sorted((rows.pop(merge.one), rows.pop(merge.other)), key=min)
        rows[tuple(sorted(merge.one + merge.other))] = parts[0] + parts[1]
    return [number for row in rows.values() for number in row]


@check_arguments
def energy_path(path: EnergyPath, ax: Axes | None = None, *, shapes: bool = True) -> Axes:
    """Energy along a minimum-energy path, with the shapes of its stable states and saddles.

    Parameters
    ----------
    path
        The path.
    ax
        Where to draw; None makes a figure one column wide.
    shapes
        Whether shapes stand below.

    Returns
    -------
    The axes.
    """
    minima, saddles = path.minima, path.saddles
    with style.house_style():
        ax = ax or style.new_axes(style.SINGLE_COLUMN, _HEIGHT, _PATH_ROOM)
        ax.plot(path.length, path.states.energy, color=style.INK, linewidth=1.2, zorder=2)
        marks = []
        for states, colour in ((minima, _STABLE), (saddles, _SADDLE)):
            near = [np.abs(path.states.z - z).max(axis=1).argmin() for z in states.z]
            at = path.length[np.array(near, int)]
            ax.plot(at, states.energy, "o", color=colour, mec=style.INK, **_DOT)
            marks.append(at)
        ax.margins(y=_HEADROOM)
        ax.set_ylabel(_energy_label(path.states))
        ax.set_xlabel("length of the path in the metric", labelpad=_LABEL_PAD if shapes else None)
        order = np.argsort(np.concatenate(marks))
        z = np.concatenate([minima.z, saddles.z])[order]
        p = np.concatenate([minima.p, saddles.p])[order]
        shown, at = States(path.states.structure, z, p), np.concatenate(marks)[order]
        step = float(np.diff(at).min(initial=np.inf)) if len(at) > 1 else 1.0
        ax.set_xlim(at[0] - 0.5 * step, at[-1] + 0.5 * step)
        if shapes:
            _draw_shapes(ax, shown, at, _BELOW_PATH)
    return ax


@check_arguments
def least_barriers(
    eset: EquilibriumSet, values: Float[np.ndarray, "rows columns"], ax: Axes | None = None
) -> Axes:
    """Least energy barrier among the stable states over each point of two parameters.

    What stays white has nothing to snap to, or no stable state.

    Parameters
    ----------
    eset
        Equilibrium set over two free parameters.
    values
        Barriers on a grid over its box, as `SetBarriers.least`; negative ones for infinite ones.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        If the set has another number of free parameters.
    """
    check_two_parameters(eset)
    axes = [
        np.linspace(low, high, count)
        for low, high, count in zip(eset.box.lower, eset.box.upper, values.T.shape, strict=True)
    ]
    with style.house_style():
        own = ax is None
        ax = ax or style.new_axes(style.SINGLE_COLUMN, _HEIGHT, _PLANE_ROOM)
        shown = np.ma.masked_less(values, 0.0)
        look: dict[str, Any] = {"cmap": value_colours(), "norm": Normalize(0.0)}
        paint = ax.pcolormesh(*axes, shown, shading="nearest", rasterized=True, **look)
        frame_plane(ax, eset)
        lines = draw_folds(ax, eset, stable_only=True)
        unit = eset.structure.descriptor("energy").unit
        style.colour_bar(ax, paint, with_unit("least barrier $\\Delta E$", unit))
        style.legend_below(ax, lines, room=own)
    return ax


@check_arguments
def network_changes(changes: NetworkChanges, ax: Axes | None = None) -> Axes:
    """Curves over two parameters on which the transition network changes.

    Parameters
    ----------
    changes
        Over two free parameters.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        If the set has another number of free parameters.
    """
    eset = changes.eset
    check_two_parameters(eset)
    with style.house_style():
        own = ax is None
        ax = ax or style.new_axes(style.SINGLE_COLUMN, _HEIGHT, _TREE_ROOM)
        frame_plane(ax, eset)
        lines = draw_folds(ax, eset, stable_only=True)
        for level, look in ((changes.swaps, _SWAP), (changes.passes, _PASS)):
            at = np.stack([level.states[name] for name in eset.names], axis=1)
            drawn = [ax.plot(*at[piece].T, **look)[0] for piece in level.pieces]
            lines += drawn[:1]
        style.legend_below(ax, lines, room=own)
    return ax


_SWAP: dict[str, Any] = {"color": _STABLE, "linewidth": 1.4, "label": "two minima swap order"}
_PASS: dict[str, Any] = {
    "color": _SADDLE,
    "linewidth": 1.4,
    "linestyle": (0, (4, 2)),
    "label": "two lowest passes swap",
}


def _energy_label(states: States) -> str:
    return with_unit("energy $E$", states.structure.descriptor("energy").unit)


def _draw_shapes(ax: Axes, states: States, places: Float[np.ndarray, " n"], below: float) -> None:
    """Draw shapes below the axes, all at one scale, each below its place."""
    if len(states) > _MOST_SHAPES:
        return
    low, high = ax.get_xlim()
    step = min(float(np.diff(np.sort(places)).min(initial=high - low)), 0.4 * (high - low))
    for k, place in enumerate(places):
        frame = (place - 0.5 * _WIDEST * step, below, _WIDEST * step, _BAND)
        inner = ax.inset_axes(frame, transform=ax.get_xaxis_transform())
        inner.axis("off")
        around = Surroundings(states, ())
        frame_shapes(inner, around, _BORDER)
        one = Surroundings(states[[k]], ())
        one.draw_shapes(inner, [style.INK], 2, linewidths=1.2)
