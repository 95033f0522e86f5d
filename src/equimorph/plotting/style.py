"""One place for the looks of every figure: sizes, fonts, colours, saving.

Figures are drawn for the printed column of a journal. Each is a separate object-oriented
`Figure` with the Agg canvas; neither pyplot's state nor the global ``rcParams`` is touched.
Colours are ordered by lightness, so that they survive greyscale, and are safe for the
colour-blind (blue, orange and yellow after Okabe and Ito).
"""

from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from io import BytesIO
from itertools import pairwise
from pathlib import Path as FilePath
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, LinearSegmentedColormap, to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.patheffects import AbstractPathEffect, withStroke
from matplotlib.ticker import FixedLocator, MaxNLocator, NullLocator
from matplotlib.transforms import Bbox
from mpl_toolkits.axes_grid1 import make_axes_locatable

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float

MILLIMETRE = 1 / 25.4
"""In inches."""
SINGLE_COLUMN = 89 * MILLIMETRE
DOUBLE_COLUMN = 183 * MILLIMETRE
RESOLUTION = 200
"""Pixels per inch of saved pictures."""
SCREEN = 140
"""Pixels per inch of pictures in a notebook."""

INK = "#1a1a1a"
FAINT = "#8c8c8c"
_LABELS, _LEGEND_ROW, _LEGEND_GAP = 0.4, 0.15, 0.06
"""Inches of the labels below a frame, of a row of the legend below them, and of the gap between."""
HAIRLINE = 0.5
"""Width of axes and ticks, in typographic points."""
ROUTE_COLOUR = "#d1004b"
LIMIT_LINE: dict[str, Any] = {"color": INK, "linewidth": 1.2, "linestyle": (0, (2.4, 1.0))}
"""Bounds that a set was not cut at: wider than its edges, longer dashes than hidden folds."""


def rim(width: float, colour: Any = "white") -> list[AbstractPathEffect]:
    """Return the effect that sets off a line or letters from what lies below, by default in white.

    `width` is that of the line with its rim, in typographic points.
    """
    return [withStroke(linewidth=width, foreground=colour)]


RIM = rim(2.0)
"""White around letters that lie on lines."""

# Lightness (CIE L*) 38, 67, 86, 94: four greys that are distinct in print.
INDEX_COLOURS = ("#1f5f99", "#e8902a", "#f3d65c", "#ececec")

# From none (white) to many; dark enough to count, light enough for black lines and numbers on top.
_COUNT_ANCHORS = ("#ffffff", "#e3edf6", "#bdd3e8", "#90b4d6", "#6f9bc8", "#5e8cbd")
_PROGRESS_ANCHORS = ("#2b1a5a", "#5b2a86", "#9b3b82", "#d45c6a", "#ee9350", "#f2c261")

_SETTINGS: dict[str, Any] = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same letters on every machine
    "mathtext.fontset": "dejavusans",
    "font.size": 7,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "legend.borderaxespad": 0.3,
    "axes.linewidth": HAIRLINE,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.labelpad": 3,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.width": HAIRLINE,
    "ytick.major.width": HAIRLINE,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "lines.solid_joinstyle": "round",
    "lines.solid_capstyle": "round",
    "grid.linewidth": 0.3,
    "hatch.linewidth": 0.4,
    "grid.color": "#d5d5d5",
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "svg.fonttype": "path",  # the picture looks the same where the font is missing
    "svg.hashsalt": "equimorph",  # the same input gives the same file
}


@check_arguments
@contextmanager
def house_style(changes: Mapping[str, Any] | None = None) -> Generator[None]:
    """Apply the settings of the house, with `changes`, inside a ``with`` block and only there."""
    settings: Any = _SETTINGS | dict(changes or {})
    with mpl.rc_context(settings):
        yield


class Picture(Figure):
    """A figure that needs no screen; notebooks show it, and any of its axes, at the prompt."""

    def __init__(self, width: float, height: float) -> None:
        super().__init__(figsize=(width, height))
        FigureCanvasAgg(self)
        self.add_axobserver(_show_axes)

    def _repr_png_(self) -> bytes:
        file = BytesIO()
        with house_style():
            self.savefig(file, format="png", dpi=SCREEN, bbox_inches=whole_figure(self))
        return file.getvalue()


def _show_axes(figure: Any) -> None:
    for ax in figure.axes:
        ax._repr_png_ = figure._repr_png_


def new_axes(width: float, height: float, room: tuple[float, float, float, float]) -> Axes:
    """One empty axes on a new figure; sizes, and the room around the frame, are in inches.

    Room for labels is given (left, bottom, right, top), not searched for: every figure of a kind
    has its frame in the same place, and drawing takes half the time.
    """
    figure = Picture(width, height)
    left, bottom, right, top = room
    return figure.add_axes(
        (left / width, bottom / height, 1 - (left + right) / width, 1 - (bottom + top) / height)
    )


def grow_below(ax: Axes, inches: float) -> None:
    """Make the figure of an axes taller at its bottom; the frame keeps its size and place."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    width, height = figure.get_size_inches()
    taller, frame = height + inches, ax.get_position(original=True)
    figure.set_size_inches(width, taller)
    left, bottom, across, up = frame.bounds
    ax.set_position((left, (bottom * height + inches) / taller, across, up * height / taller))


def legend_below(ax: Axes, entries: Sequence[Artist], *, room: bool, columns: int = 2) -> None:
    """Legend below the labels of a frame, after the entries that are there.

    `room`: whether the figure grows by the height of the legend; `columns`: how many entries stand
    side by side.
    """
    legend = ax.get_legend()
    known = [] if legend is None else [each for each in legend.legend_handles if each is not None]
    handles = [*known, *entries]
    if not handles:
        return
    if room:
        rows, before = (-(-len(each) // columns) for each in (handles, known))
        grow_below(ax, (0.0 if known else _LEGEND_GAP) + (rows - before) * _LEGEND_ROW)
    figure = ax.get_figure(root=True)
    assert figure is not None
    frame = ax.get_position(original=True).height * figure.get_size_inches()[1]
    made = ax.legend(
        handles=handles, loc="upper center", ncols=columns, borderaxespad=0.0, borderpad=0.0,
        bbox_to_anchor=(0.5, -(_LABELS + 0.5 * _LEGEND_GAP) / frame),
    )  # fmt: skip
    if room and columns > 1 and made.get_window_extent().width > figure.bbox.width:
        grow_below(ax, (len(handles) - -(-len(handles) // columns)) * _LEGEND_ROW)
        legend_below(ax, [], room=False, columns=1)


def colour_bar(ax: Axes, shades: ScalarMappable, label: str) -> Any:
    """Scale of the colours at the right of a frame; returns the bar, for its ticks."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    beside = make_axes_locatable(ax).append_axes("right", size=0.08, pad=0.06)
    bar = figure.colorbar(shades, cax=beside)
    bar.outline.set_linewidth(HAIRLINE)
    bar.set_label(label)
    return bar


def area(loops: Sequence[Float[np.ndarray, "_ 2"]], **look: Any) -> PathPatch:
    """Area inside closed lines, and outside those that lie within others."""
    outline = Outline.make_compound_path(*(Outline(loop, closed=True) for loop in loops))
    return PathPatch(outline, **look)


def letter_panels(letters: str, panels: Sequence[Axes]) -> None:
    """Write bold letters in brackets above the left corners of panels."""
    for letter, ax in zip(letters, panels, strict=True):
        ax.set_title(f"({letter})", loc="left", weight="bold", pad=3)


def few_ticks() -> MaxNLocator:
    """Ticks at few round numbers, for axes a few centimetres long."""
    return MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10])


def rgba(colour: str, alpha: float = 1.0) -> Float[np.ndarray, "4"]:
    """Return the red, green, blue and opacity of a colour."""
    return np.array(to_rgba(colour, alpha))


def index_colour(index: int) -> str:
    """Colour of a piece of the set by its index; all indices from 3 on share the lightest."""
    return INDEX_COLOURS[min(index, len(INDEX_COLOURS) - 1)]


def index_label(index: int) -> str:
    """Name of a piece of the set by its index, as a legend prints it."""
    if index == 0:
        return "stable"
    last = len(INDEX_COLOURS) - 1
    return f"index {index}" if index < last else f"index ≥ {last}"


def progress_map() -> Colormap:
    """Colours from start to goal: dark to light in even steps, and never too pale for paper."""
    return LinearSegmentedColormap.from_list("progress", list(_PROGRESS_ANCHORS))


def count_shades(largest: int) -> list[tuple[float, float, float, float]]:
    """Shades for 0, 1, …, `largest` equilibria, from white to mid blue."""
    shades = LinearSegmentedColormap.from_list("count", list(_COUNT_ANCHORS))
    return [shades(k / max(largest, 1)) for k in range(largest + 1)]


@check_arguments
def save(
    drawing: Axes | Figure,
    folder: str | FilePath,
    name: str,
    formats: Sequence[str] = ("png", "svg"),
) -> tuple[FilePath, ...]:
    """Write a figure in each format and name the files.

    It grows where legends or names reach beyond it, and has fewer ticks where labels would touch.

    Parameters
    ----------
    drawing
        A figure, or any axes on it.
    folder
        Where the files go; made if it does not exist.
    name
        File name without extension.
    formats
        Extensions that matplotlib knows; "png" is written with 200 dots per inch.

    Returns
    -------
    The files written, in the order of `formats`.
    """
    figure = drawing if isinstance(drawing, Figure) else drawing.get_figure(root=True)
    assert figure is not None
    folder = FilePath(folder)
    folder.mkdir(parents=True, exist_ok=True)
    files = tuple(folder / f"{name}.{extension}" for extension in formats)
    with house_style():
        box = whole_figure(figure)
        for file in files:
            # No date inside the file: an unchanged picture stays an unchanged file.
            metadata = {"Date": None} if file.suffix == ".svg" else None
            figure.savefig(file, dpi=RESOLUTION, metadata=metadata, bbox_inches=box)
    return files


APART = 1.0
"""Pixels between tick labels."""
EDGE = 0.03
"""Inches around what reaches beyond a figure."""
SLACK = 0.015
"""Inches beyond a figure that are the empty border of a letter's box."""
FEWEST = 1
"""Intervals between ticks at the least."""


def whole_figure(figure: Figure) -> Bbox | None:
    """Box of a figure in inches with all that is drawn; None if nothing leaves the figure.

    Tick labels that would touch are thinned out first. Frames have fixed places, which is right for
    usual names; what does not fit is found on the boxes that are drawn.
    """
    drawn = figure.get_tightbbox()  # which also puts all frames into their places
    plane = [ax for ax in figure.axes if ax.name != "3d"]
    thinned = [_thin_out(axis) for ax in plane for axis in (ax.xaxis, ax.yaxis)]
    thinned += [_clear_corner(ax) for ax in figure.axes if ax.name == "3d"]
    if any(thinned):
        drawn = figure.get_tightbbox()
    inside = Bbox.from_bounds(0.0, 0.0, *figure.get_size_inches())
    roomy = inside.padded(SLACK)
    if all(roomy.contains(*corner) for corner in (drawn.min, drawn.max)):
        return None
    return Bbox.union([inside, drawn.padded(EDGE)])


def label_boxes(axis: Axis) -> list[Bbox]:
    """Boxes of the tick labels that are drawn, in pixels, along the axis."""
    ax = axis.axes
    if not (ax.get_visible() and axis.get_visible() and ax.axison):
        return []
    low, high = sorted(axis.get_view_interval())
    slack = 1e-9 * (high - low)
    shown = [
        tick.label1
        for tick in axis.get_major_ticks()
        if low - slack <= tick.get_loc() <= high + slack
        and tick.label1.get_visible()
        and tick.label1.get_text()
    ]
    return [each.get_window_extent() for each in shown]


def touching(axis: Axis) -> bool:
    """Whether two neighbouring tick labels of an axis touch."""
    return any(
        Bbox.intersection(one.padded(0.5 * APART), other.padded(0.5 * APART)) is not None
        for one, other in pairwise(label_boxes(axis))
    )


def _clear_corner(ax: Axes) -> bool:
    """Leave out the outer ticks of x in space where a label touches one of y, and say whether."""
    across = [box.padded(0.5 * APART) for box in label_boxes(ax.yaxis)]
    along = [box.padded(0.5 * APART) for box in label_boxes(ax.xaxis)]
    if not any(Bbox.intersection(one, other) is not None for one in along for other in across):
        return False
    low, high = sorted(ax.xaxis.get_view_interval())
    inside = [each for each in ax.xaxis.get_majorticklocs() if low <= each <= high]
    ax.xaxis.set_major_locator(FixedLocator(inside[1:-1]))
    return True


def _thin_out(axis: Axis) -> bool:
    """Take fewer ticks until their labels stand apart, and say whether; chosen places stay."""
    if isinstance(axis.get_major_locator(), FixedLocator | NullLocator) or not touching(axis):
        return False
    count = len(label_boxes(axis))
    while touching(axis) and count > FEWEST:
        count -= 1
        bins, steps = max(count - 1, FEWEST), [1, 2, 2.5, 5, 10]
        axis.set_major_locator(MaxNLocator(nbins=bins, steps=steps, min_n_ticks=1))
    if touching(axis):
        low, high = sorted(axis.get_view_interval())
        inside = [each for each in axis.get_majorticklocs() if low <= each <= high]
        axis.set_major_locator(FixedLocator(inside[:1]))
    return True
