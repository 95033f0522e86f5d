"""Robustness: sensitivities, laws of imperfections, room around a state, random trials."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse, Patch, Rectangle

from equimorph.argument_checks import check_arguments
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.plotting import style
from equimorph.plotting.labels import parameter_label, symbol
from equimorph.plotting.plane import parameter_plane
from equimorph.structures import State, Structure
from equimorph.tasks.robustness.derivatives import Sensitivity
from equimorph.tasks.robustness.imperfection import ImperfectionLaw
from equimorph.tasks.robustness.room import Room
from equimorph.tasks.robustness.trials import Trials

_ROOM_AROUND = (0.72, 0.42, 0.12, 0.3)
"""Inches around the axes: left, bottom, right, top."""
MOST_BARS = 40
"""Largest number of derivatives in one figure."""
_MARKERS = ("o", "s", "^", "D", "v", "P")
_ENDS = ("x", "+", "1", "2", "3", "4")
_BOX: dict[str, Any] = {"fill": False, "ec": style.ROUTE_COLOUR, "lw": 1.4, "zorder": 6}


@check_arguments
def sensitivities(structure: Structure, found: Sensitivity, ax: Axes | None = None) -> Axes:
    """Change of each descriptor with each parameter, for one scale of the parameter.

    Parameters
    ----------
    structure
        Whose parameters they are.
    found
        Derivatives.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        If there are more than 40 derivatives, or none.
    """
    names, descriptors = found.names, list(found.descriptors)
    count = len(names) * len(descriptors)
    if not 1 <= count <= MOST_BARS:
        raise InputError(f"`found` must hold 1 to {MOST_BARS} derivatives; got {count}.")
    scales = {each.name: each.scale for each in structure.parameters}
    with style.house_style():
        if ax is None:
            height = 0.95 + 0.13 * count + 0.1 * len(names)
            ax = style.new_axes(style.SINGLE_COLUMN, height, _ROOM_AROUND)
        width = 0.8 / len(descriptors)
        shades = style.progress_map()(np.linspace(0.1, 0.9, len(descriptors)))
        for k, (name, shade) in enumerate(zip(descriptors, shades, strict=True)):
            sizes = [found[name, each] * scales[each] for each in names]
            places = np.arange(len(names)) + (k - 0.5 * (len(descriptors) - 1)) * width
            unit = structure.descriptor(name).unit if _knows(structure, name) else ""
            label = symbol(name) if unit in ("", "1") else f"{symbol(name)} ({unit})"
            ax.barh(places, sizes, width, color=shade, label=label, zorder=2)
        ax.axvline(0.0, color=style.INK, linewidth=style.HAIRLINE, zorder=3)
        ax.set_yticks(np.arange(len(names)), [symbol(each) for each in names])
        ax.invert_yaxis()
        ax.xaxis.set_major_locator(style.few_ticks())
        ax.set_xlabel("change for one scale of the parameter")
        _legend_above(ax)
    return ax


def _knows(structure: Structure, name: str) -> bool:
    try:
        structure.descriptor(name)
    except InputError:
        return False
    return True


@check_arguments
def imperfection_laws(
    structure: Structure, laws: Mapping[str, ImperfectionLaw], load: str, ax: Axes | None = None
) -> Axes:
    """Changes of a limit load with imperfections, both signs, and the fitted powers.

    Parameters
    ----------
    structure
        Whose parameters they are.
    laws
        By the names of the imperfections.
    load
        Name of the load.
    ax
        Where to draw, on logarithmic axes; None makes a figure one column wide.

    Returns
    -------
    The axes.
    """
    with style.house_style():
        ax = ax or style.new_axes(style.SINGLE_COLUMN, 0.8 * style.SINGLE_COLUMN, _ROOM_AROUND)
        shades = style.progress_map()(np.linspace(0.0, 0.75, len(laws)))
        scales = {each.name: each.scale for each in structure.parameters}
        for (name, law), shade, marker in zip(
            laws.items(), shades, np.resize(_MARKERS, len(laws)).tolist(), strict=True
        ):
            changes, sizes = np.abs(law.loads - law.perfect), np.abs(law.sizes) * scales[name]
            for sign, face, size in ((-1.0, "white", 6.5), (1.0, shade, 3.5)):
                mine = (np.sign(law.sizes) == sign) & (changes > 0.0)
                ax.plot(
                    sizes[mine], changes[mine], marker, ms=size, mfc=face, mec=shade, zorder=3,
                    label=f"{symbol(name)} {'+' if sign > 0 else '−'} ε",
                )  # fmt: skip
            if law.status == "fitted":
                ends = np.array([sizes.min(), sizes.max()])
                fitted = np.abs(law.coefficient) * ends**law.power
                ax.plot(ends, fitted, color=shade, linewidth=0.9, zorder=2)
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_xlabel("size of the imperfection |ε|")
        ax.set_ylabel(f"change of the limit load {symbol(load)}")
        _legend_above(ax)
    return ax


@check_arguments
def room(
    state: State, found: Room, eset: EquilibriumSet | None = None, ax: Axes | None = None
) -> Axes:
    """Largest stable box or ellipse around a state, in the plane of two parameters.

    Parameters
    ----------
    state
        The middle.
    found
        Its room, with two tolerances.
    eset
        Drawn below where it is a set over the same two parameters.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        If there are not two tolerances.
    """
    box = found.boxes[0]
    if len(box.names) != 2:
        raise InputError(f"`found` must have two tolerances; got {', '.join(box.names)}.")
    below = eset is not None and set(eset.names) == set(box.names)
    names = eset.names if below and eset is not None else box.names
    at = [box.names.index(name) for name in names]
    low, size = box.lower[at], (box.upper - box.lower)[at]
    with style.house_style():
        if below and eset is not None:
            ax = parameter_plane(eset, ax=ax, count="stable")
        else:
            ax = ax or style.new_axes(style.SINGLE_COLUMN, 0.8 * style.SINGLE_COLUMN, _ROOM_AROUND)
            ax.set_xlabel(parameter_label(state.structure, names[0]))
            ax.set_ylabel(parameter_label(state.structure, names[1]))
        shape: Patch = (
            Rectangle((float(low[0]), float(low[1])), float(size[0]), float(size[1]), **_BOX)
            if found.shape == "box"
            else Ellipse(tuple(low + 0.5 * size), float(size[0]), float(size[1]), **_BOX)
        )
        limits = ax.get_xlim(), ax.get_ylim()
        ax.add_patch(shape)
        middle, met = (np.array([each[name] for name in names]) for each in (state, found.met[0]))
        ax.plot(*middle, "o", color=style.ROUTE_COLOUR, ms=4, mec="white", zorder=7)
        if found.kind[0] != "arrived":
            ax.plot(*met, "x", color=style.ROUTE_COLOUR, ms=6, mew=1.6, zorder=7, clip_on=False)
        if below:
            ax.set_xlim(limits[0])
            ax.set_ylim(limits[1])
        else:
            ax.margins(0.15)
            ax.autoscale_view()
    return ax


@check_arguments
def trials(structure: Structure, found: Trials, ax: Axes | None = None) -> Axes:
    """Random trials by their first two offsets, or by one offset and where they ended.

    Parameters
    ----------
    structure
        Whose parameters were off.
    found
        The trials.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.
    """
    with style.house_style():
        ax = ax or style.new_axes(style.SINGLE_COLUMN, 0.85 * style.SINGLE_COLUMN, _ROOM_AROUND)
        alone = len(found.names) == 1
        upright = found.at if alone else found.offsets[:, 1]
        kinds = ["arrived", *sorted(set(found.kind.tolist()) - {"arrived"})]
        shades = style.progress_map()(np.linspace(0.25, 0.75, max(len(kinds) - 1, 1)))
        for k, kind in enumerate(kinds):
            mine = found.kind == kind
            look: dict[str, Any] = {"marker": "o", "mfc": "white", "mec": style.INDEX_COLOURS[0]}
            if k:
                look = {"marker": _ENDS[(k - 1) % len(_ENDS)], "mec": shades[k - 1], "mew": 1.3}
            label = f"{kind}: {int(mine.sum())}"
            ax.plot(found.offsets[mine, 0], upright[mine], linestyle="", ms=4, label=label, **look)
        ax.set_xlabel(f"offset of {parameter_label(structure, found.names[0])}")
        ax.set_ylabel(
            "legs done" if alone else f"offset of {parameter_label(structure, found.names[1])}"
        )
        ax.xaxis.set_major_locator(style.few_ticks())
        ax.margins(0.08)
        _legend_above(ax)
    return ax


def _legend_above(ax: Axes) -> None:
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.2)
