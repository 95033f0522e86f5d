"""One place for the looks of every figure: sizes, fonts, colours, saving.

Figures are drawn for the printed column of a journal. Each is a separate object-oriented
`Figure` with the Agg canvas; neither pyplot's state nor the global ``rcParams`` is touched.
Colours are ordered by lightness, so that they survive greyscale, and are safe for the
colour-blind (blue, orange and yellow after Okabe and Ito).
"""

from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path as FilePath
from typing import Any

import matplotlib as mpl
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Colormap, LinearSegmentedColormap, to_rgba
from matplotlib.figure import Figure
from matplotlib.patheffects import AbstractPathEffect, withStroke
from matplotlib.ticker import MaxNLocator

from equimorph.argument_checks import check_arguments

MILLIMETRE = 1 / 25.4
"""In inches."""
SINGLE_COLUMN = 89 * MILLIMETRE
DOUBLE_COLUMN = 183 * MILLIMETRE
RESOLUTION = 200
"""Pixels per inch of saved pictures."""

INK = "#1a1a1a"
FAINT = "#8c8c8c"
HAIRLINE = 0.5
"""Width of axes and ticks, in typographic points."""
ROUTE_COLOUR = "#d1004b"
LIMIT_LINE: dict[str, Any] = {"color": INK, "linewidth": 1.2, "linestyle": (0, (2.4, 1.0))}
"""Bounds that a set was not cut at: wider than its edges, longer dashes than hidden folds."""

RIM: list[AbstractPathEffect] = [withStroke(linewidth=2.0, foreground="white")]
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


def new_axes(width: float, height: float, room: tuple[float, float, float, float]) -> Axes:
    """One empty axes on a new figure.

    Room for labels is given, not searched for: every figure of a kind has its frame in the same
    place, and drawing takes half the time.

    Parameters
    ----------
    width, height
        Size of the figure in inches.
    room
        Inches left free at the left, bottom, right and top of the frame.

    Returns
    -------
    The axes; its figure is ``axes.figure``.
    """
    figure = attach_canvas(Figure(figsize=(width, height)))
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


def attach_canvas(figure: Figure) -> Figure:
    """Give a figure the canvas that draws without a screen."""
    FigureCanvasAgg(figure)
    return figure


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
        for file in files:
            # No date inside the file: an unchanged picture stays an unchanged file.
            metadata = {"Date": None} if file.suffix == ".svg" else None
            figure.savefig(file, dpi=RESOLUTION, metadata=metadata)
    return files
