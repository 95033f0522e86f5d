"""Settings with the largest limit load, and how it falls off around them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from equimorph.argument_checks import check_arguments
from equimorph.plotting import style
from equimorph.plotting.labels import number_points, parameter_label
from equimorph.plotting.maps import load_map
from equimorph.tasks.maps.limit_load import LimitLoadMap
from equimorph.tasks.optimising.strength import Strongest, StrongestSettings

_SURE: dict[str, Any] = {"marker": "o", "ms": 5, "mfc": style.ROUTE_COLOUR, "mec": "white"}
_ROBUST: dict[str, Any] = {"marker": "s", "ms": 5.5, "mfc": "white", "mec": style.ROUTE_COLOUR}
_ERRORS: dict[str, Any] = {"fill": False, "ec": style.ROUTE_COLOUR, "lw": 1.1, "zorder": 7}
_ROOM = (0.62, 0.38, 0.1, 0.34)
"""Inches around the axes: left, bottom, right, top."""
_LOOKS = (("o", "-", True), ("s", "--", False))


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
        if robust is not None and robust.status == "found":
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
            for side, (marker, dash, filled) in zip(each.sides, _LOOKS, strict=True):
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
