"""The best stable state over two parameters, with barriers and gaps."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from equimorph.argument_checks import check_arguments
from equimorph.array_types import Float
from equimorph.manifold.geometry.topology import chains
from equimorph.model import Descriptor
from equimorph.plotting import style
from equimorph.plotting.labels import descriptor_label, parameter_label
from equimorph.plotting.maps import GROUND, new_map_axes, value_colours
from equimorph.structures import Structure
from equimorph.tasks.optimising.landscapes import Landscape

_LOOKS: dict[str, dict[str, Any]] = {
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
    for kind, look in _LOOKS.items():
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
