"""Where snaps lead: the stability boundary, the energy released there, states before and after."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.charts.regions import count_equilibria
from equimorph.errors import InputError
from equimorph.manifold import Snap, SnapGraph
from equimorph.model import Descriptor
from equimorph.plotting import style
from equimorph.plotting.counts import hatch_cut, shade_regions
from equimorph.plotting.labels import descriptor_label, number_points
from equimorph.plotting.plane import draw_folds, frame_plane
from equimorph.tasks.start import check_two_parameters

_HEIGHT = 2.75
"""Inches of the figure."""
_GAP = 0.06
"""Between runs of the boundary, as a share of all of it."""
_LOOKS = {
    "in the set": ("o", "snaps to a state of the set"),
    "elsewhere": ("^", "snaps out of the set"),
    "held": ("x", "no snap"),
}
_MARK: dict[str, Any] = {"zorder": 5, "linewidths": 0.5, "edgecolors": style.INK, "s": 16}


@check_arguments
def snap_panels(graph: SnapGraph, descriptor: Descriptor | None = None) -> Figure:
    """Stability boundary of a set with the energy that snaps free, and where they land.

    Runs of the boundary from which all snaps lead to the same stratum are numbered where they
    begin, in both panels.

    Parameters
    ----------
    graph
        Snaps of a set over two free parameters.
    descriptor
        Told before and after each snap; the structure's elevation if not given.

    Returns
    -------
    The figure, two columns wide: the parameters, and the descriptor along the boundary.

    Raises
    ------
    InputError
        If the set is not one over two parameters, or has no stability boundary.
    """
    eset = graph.eset
    check_two_parameters(eset, "graph")
    if not graph.snaps:
        raise InputError("`graph` must have a stability boundary; got a set without one.")
    figure = style.Picture(style.DOUBLE_COLUMN, _HEIGHT)
    most = max(snap.released[1] for snap in graph.snaps)
    shades = ScalarMappable(Normalize(0.0, most or 1.0), style.progress_map())
    with style.house_style():
        plane, along = (
            figure.add_axes(place)
            for place in ((0.075, 0.235, 0.335, 0.695), (0.49, 0.235, 0.4, 0.695))
        )
        bar = figure.add_axes((0.915, 0.235, 0.014, 0.695))
        entries = _draw_plane(plane, graph, shades) + _entries(graph)
        _draw_along(along, graph, descriptor or eset.structure.elevation, shades)
        figure.colorbar(shades, cax=bar, label=f"energy released{_unit(graph)}")
        style.letter_panels("ab", (plane, along))
        figure.legend(handles=entries, loc="lower center", ncols=6, bbox_to_anchor=(0.5, 0.0))
    return figure


def _unit(graph: SnapGraph) -> str:
    unit = graph.eset.structure.descriptor("energy").unit
    return "" if unit in ("", "1") else f" ({unit})"


def _kind(snap: Snap) -> str:
    """Key of the looks of a run."""
    if snap.status == "held":
        return "held"
    return "in the set" if snap.target >= 0 else "elsewhere"


def _draw_plane(ax: Axes, graph: SnapGraph, shades: ScalarMappable) -> list[Line2D | Patch]:
    """Draw stable states and where snaps begin; return entries for a legend."""
    eset = graph.eset
    frame_plane(ax, eset)
    regions = count_equilibria(eset, stable_only=True)
    largest = shade_regions(ax, eset, regions)
    hatched = hatch_cut(ax, eset, regions, stable_only=True)
    lines = draw_folds(ax, eset, stable_only=True)
    for snap in graph.snaps:
        _scatter(ax, eset.coordinates[snap.vertices], snap, shades)
    number_points(ax, eset.coordinates[[snap.vertices[0] for snap in graph.snaps]])
    patches = [
        Patch(fc=shade, ec=style.FAINT, lw=0.4, label=f"{k} stable")
        for k, shade in enumerate(style.count_shades(largest)[1:], start=1)
    ]
    return [*patches, *lines, *hatched[:1]]


def _scatter(
    ax: Axes, places: Float[np.ndarray, "n 2"], snap: Snap, shades: ScalarMappable
) -> None:
    """Mark the tried vertices of a run."""
    freed = np.array([landing.released for landing in snap.landings])
    marker = _LOOKS[_kind(snap)][0]
    colours = shades.to_rgba(freed)
    if marker == "x":
        ax.scatter(
            places[:, 0], places[:, 1], marker="x", color=style.INK, s=14, linewidths=0.8, zorder=5
        )
    else:
        ax.scatter(places[:, 0], places[:, 1], marker=marker, c=colours, **_MARK)


def _draw_along(ax: Axes, graph: SnapGraph, descriptor: Descriptor, shades: ScalarMappable) -> None:
    """Draw the descriptor before and after each snap, along the runs one after the other."""
    eset = graph.eset
    lengths = [_length(graph, snap) for snap in graph.snaps]
    total = sum(float(length[-1]) for length in lengths) or 1.0
    start, ticks = 0.0, []
    for number, (snap, length) in enumerate(zip(graph.snaps, lengths, strict=True), start=1):
        whole = (start + length) / total
        ax.plot(
            whole, descriptor(eset.points[snap.along]), color=style.INK, linewidth=1.4, zorder=3
        )
        at, before = whole[_tried_vertices(snap)], descriptor(eset.points[snap.vertices])
        if _kind(snap) == "held":
            ax.scatter(at, before, marker="x", color=style.INK, s=14, linewidths=0.8, zorder=5)
        for place, low, landing in zip(at, before, snap.landings, strict=True):
            if not landing.landed:
                continue
            high = float(descriptor(landing.state))
            colour = shades.to_rgba(np.array([landing.released]))[0]
            ax.plot([place, place], [low, high], color=colour, linewidth=1.0, zorder=2)
            marker = _LOOKS[_kind(snap)][0]
            ax.scatter([place], [high], marker=marker, color=[colour], **_MARK)
        ticks.append((float(at[0]), str(number)))
        start += float(length[-1]) + _GAP * total
    ax.set_xticks([place for place, _ in ticks], [name for _, name in ticks])
    ax.set_xlabel("along the runs of the boundary, from their numbers")
    ax.set_ylabel(descriptor_label(descriptor))


def _length(graph: SnapGraph, snap: Snap) -> Float[np.ndarray, " n"]:
    """Length along a run, in ranges of the box."""
    eset = graph.eset
    places = eset.coordinates[snap.along] / (eset.box.upper - eset.box.lower)
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _tried_vertices(snap: Snap) -> list[int]:
    """Places of the tried vertices in the run; a closed one begins and ends at the same."""
    places: list[int] = []
    for vertex in snap.vertices:
        first = places[-1] + 1 if places else 0
        places.append(first + int(np.flatnonzero(snap.along[first:] == vertex)[0]))
    return places


def _entries(graph: SnapGraph) -> list[Line2D]:
    entries = []
    kinds = {_kind(snap) for snap in graph.snaps}
    for key, (marker, label) in _LOOKS.items():
        if key in kinds:
            face = "none" if marker == "x" else style.FAINT
            entries.append(
                Line2D([], [], color=style.INK, marker=marker, mfc=face, ls="none", ms=4,
                       mew=0.5, label=label)
            )  # fmt: skip
    return entries
