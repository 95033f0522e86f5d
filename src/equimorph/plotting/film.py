"""Films as GIF or MP4: a structure that follows a route, next to its point in a plane."""

import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from PIL import Image

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Values
from equimorph.charts.regions import count_equilibria
from equimorph.equilibria import EnergyPath, Path
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, position
from equimorph.plotting import style
from equimorph.plotting.counts import hatch_cut, shade_regions
from equimorph.plotting.curves import path_of, states_along, track
from equimorph.plotting.depth import draw_triad
from equimorph.plotting.labels import descriptor_label, parameter_label, symbol
from equimorph.plotting.plane import draw_folds, draw_track, frame_plane
from equimorph.plotting.surroundings import Moving, Surroundings, frame_shapes, obstacles_of
from equimorph.plotting.transitions import energy_path
from equimorph.structures import States
from equimorph.tasks.route import Route

COLOURS = 64
"""Size of the palette that all pictures share."""
PAUSE_FIRST, PAUSE_LAST = 0.8, 1.6
"""Seconds for which the first and the last picture are shown."""
HUNDREDTHS = 10
"""Milliseconds in a hundredth of a second, the unit of time in GIF files."""
EVEN = "pad=ceil(iw/2)*2:ceil(ih/2)*2"
"""Filter of ffmpeg: players expect even numbers of pixels."""


def film_file(path: str | FilePath) -> FilePath:
    """Return the path of a film that can be written here.

    Refused if it is neither a GIF nor, with ffmpeg at hand, an MP4.
    """
    file = FilePath(path)
    kinds = suffixes()
    if file.suffix.lower() not in kinds:
        missing = "" if len(kinds) > 1 else " (.mp4 needs the program ffmpeg)"
        raise InputError(
            f"`path` of a film must end in {' or '.join(kinds)}{missing}; got {file.name!r}."
        )
    return file


def suffixes() -> tuple[str, ...]:
    """Kinds of files that films can be written to on this machine."""
    return (".gif", ".mp4") if shutil.which("ffmpeg") else (".gif",)


def write_film(pictures: Sequence[Image.Image], file: FilePath, fps: int) -> None:
    """Write pictures of one size as a film; the first and the last one stay longer.

    The file is what `film_file` returned; there are at most 50 pictures per second.
    """
    each = max(2, round(100 / fps)) * HUNDREDTHS
    shown = [int(1000 * PAUSE_FIRST), *[each] * (len(pictures) - 2), int(1000 * PAUSE_LAST)]
    if file.suffix.lower() == ".gif":
        _write_gif(pictures, file, shown)
        return
    with tempfile.TemporaryDirectory() as folder:
        still = FilePath(folder, "film.gif")
        _write_gif(pictures, still, shown)
        convert(still, file)


def convert(gif: FilePath, mp4: FilePath) -> None:
    """Write a GIF as an MP4 by ffmpeg; its last line is the error if it cannot."""
    command = ["ffmpeg", "-y", "-loglevel", "error", "-i", str(gif), "-vf", EVEN]
    command += ["-pix_fmt", "yuv420p", "-movflags", "+faststart", str(mp4)]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    if ran.returncode:
        raise OSError(f"ffmpeg cannot write {mp4.name}: {ran.stderr.strip().splitlines()[-1]}")


def _write_gif(pictures: Sequence[Image.Image], file: FilePath, durations: list[int]) -> None:
    """Write an endless GIF with one palette, so that still parts cost nothing."""
    # The palette is made from pictures all along the way: none of the colours is missed.
    sample = [np.asarray(pictures[k]) for k in np.linspace(0, len(pictures) - 1, 4).astype(int)]
    palette = Image.fromarray(np.concatenate(sample)).quantize(COLOURS, Image.Quantize.MAXCOVERAGE)
    reduced = [each.quantize(palette=palette, dither=Image.Dither.NONE) for each in pictures]
    reduced[0].save(
        file, save_all=True, append_images=reduced[1:], duration=durations, loop=0, optimize=False
    )


_WIDTH, _HEIGHT, _DOTS = 6.4, 3.1, 120
"""Inches of a frame, and pixels per inch."""
_LARGER = {"font.size": 9, "axes.labelsize": 9, "xtick.labelsize": 8, "ytick.labelsize": 8}
_CURVATURE = "max_curvature"
_START_AND_GOAL = "#cfcfcf"
_READING_PLACES = ((0.13, 0.085), (0.13, 0.025), (0.46, 0.085), (0.46, 0.025))
"""Right ends of the numbers, as shares of the frame: the free parameters above each other, margin
and curvature to the right of them."""
_NUMBER_WIDTH = 0.085
"""Width of a number, as a share of the frame."""
_LONGEST_UNIT = 4
"""Characters of a unit that has room behind its number."""


@check_arguments
def film(
    route: Route | Path | EnergyPath,
    path: str | FilePath,
    eset: EquilibriumSet | None = None,
    *,
    frames: int = 72,
    fps: int = 20,
) -> FilePath:
    """Write a film: the structure on the left, its point in the parameter plane on the right.

    Every frame shows an equilibrium of the route, at even distances along it. Without a set the
    point moves over the parameter that changes most, at the height of the structure's elevation. On
    a minimum-energy path it moves over the length of the path, at the energy.

    Parameters
    ----------
    route
        A route with a path, a lifted path, or a minimum-energy path.
    path
        File to write, a GIF, or an MP4 if the program ffmpeg is there; its folder must exist.
    eset
        The equilibrium set on whose parameter plane the route is shown, if there is one.
    frames
        Number of pictures, at least 2.
    fps
        Pictures per second.

    Returns
    -------
    The file.

    Raises
    ------
    InputError
        If the route has no path, `frames` or `fps` is too small, or the file cannot be of the kind
        that its name says.
    """
    file = film_file(path)
    board: _Board | _Landscape
    if isinstance(route, EnergyPath):
        board, states = _Landscape(route), route.along(frames)
    else:
        board, states = _Board(route, eset), states_along(path_of(route), frames)
    with style.house_style(_LARGER):
        stage = _set_stage(states, board)
        pictures = _pictures(stage, states, board)
    write_film(pictures, file, fps)
    return file


class _Reading(NamedTuple):
    """A number under the pictures."""

    label: str
    unit: str
    form: str
    values: Values


@dataclass(frozen=True)
class _Board:
    """The plane in which the point moves.

    route: what it follows; eset: the set whose parameters are the plane, if there is one.
    """

    route: Route | Path
    eset: EquilibriumSet | None

    @property
    def path(self) -> Path:
        return path_of(self.route)

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters to read: the free ones of the set, or the two that change most."""
        if self.eset is not None:
            return tuple(self.eset.names)
        states = self.path.states
        change = np.ptp(states.p, axis=0) / states.structure.scales
        most = np.argsort(-change, kind="stable")[:2]
        return tuple(states.structure.parameters[k].name for k in most if change[k] > 0.0)

    def places(self, states: States) -> Float[np.ndarray, "states 2"]:
        """Where states are in the plane."""
        if self.eset is not None:
            return track(self.eset, states)
        heights = np.asarray(states.structure.elevation(states))
        return np.column_stack([states[self.names[0]], heights])

    def draw(self, ax: Axes) -> None:
        """Draw what the point moves over."""
        if self.eset is None:
            structure = self.path.states.structure
            ax.plot(*self.places(self.path.states).T, color=style.ROUTE_COLOUR, linewidth=0.8)
            ax.set_xlabel(parameter_label(structure, self.names[0]))
            ax.set_ylabel(descriptor_label(structure.elevation))
            return
        frame_plane(ax, self.eset)
        regions = count_equilibria(self.eset)
        shade_regions(ax, self.eset, regions)
        hatch_cut(ax, self.eset, regions, stable_only=False)
        draw_folds(ax, self.eset)
        assert isinstance(self.route, Route), "a plane of parameters shows a route"
        draw_track(ax, self.eset, self.route, self.path).set_linewidth(0.8)

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """Those of the set."""
        return () if self.eset is None else self.eset.constraints

    def readings(self, states: States) -> list[_Reading]:
        """Free parameters, stability margin, and curvature if the schedule has it."""
        parameters = states.structure.parameters
        free = [parameters[position(parameters, name)] for name in self.names]
        readings = [_Reading(symbol(p.name), p.unit, "{:.2f}", states[p.name]) for p in free]
        readings.append(_Reading("stability margin", "", "{:.2f}", states.margin))
        schedule = self.route.schedule if isinstance(self.route, Route) else None
        if schedule is not None and _CURVATURE in schedule.descriptors:
            kappa = states.structure.descriptor(_CURVATURE)
            readings.append(_Reading(kappa.symbol, kappa.unit, "{:.1f}", kappa(states)))
        return readings


@dataclass(frozen=True)
class _Landscape:
    """The energy along a minimum-energy path, over its length."""

    path: EnergyPath
    constraints: tuple[Constraint, ...] = ()

    def places(self, states: States) -> Float[np.ndarray, "states 2"]:
        """Where configurations along the path are in the diagram."""
        return np.column_stack([replace(self.path, states=states).length, states.energy])

    def draw(self, ax: Axes) -> None:
        """Draw the diagram."""
        energy_path(self.path, ax, shapes=False)

    def readings(self, states: States) -> list[_Reading]:
        """The energy above that of the start."""
        unit = states.structure.descriptor("energy").unit
        return [_Reading("$\\Delta E$", unit, "{:.4f}", states.energy - states.energy[0])]


@dataclass(frozen=True)
class _Stage:
    """The figure, drawn once, and what moves on it."""

    canvas: Any  # matplotlib's canvas has no types
    background: Any
    shape: Moving
    parts: tuple[Moving, ...]
    travelled: Line2D
    point: Line2D
    texts: tuple[Text, ...]
    numbers: list[tuple[str, ...]]

    def picture(self) -> Image.Image:
        """Return the background with the moving artists as they are now, from back to front."""
        self.canvas.restore_region(self.background)
        renderer = self.canvas.get_renderer()
        for artist in self._moving():
            artist.draw(renderer)
        return Image.fromarray(np.asarray(self.canvas.buffer_rgba())).convert("RGB")

    def _moving(self) -> tuple[Artist, ...]:
        parts = (self.shape.artist, *(part.artist for part in self.parts))
        in_depth = sorted(parts, key=lambda each: each.get_zorder())
        return (*in_depth, self.travelled, self.point, *self.texts)


def _set_stage(states: States, board: _Board | _Landscape) -> _Stage:
    """Draw what stays and prepare what moves."""
    figure = Figure(figsize=(_WIDTH, _HEIGHT), dpi=_DOTS)
    canvas: Any = FigureCanvasAgg(figure)
    left = figure.add_axes((0.01, 0.15, 0.54, 0.84))
    right = figure.add_axes((0.64, 0.17, 0.335, 0.79))
    around = Surroundings(states, obstacles_of(board.constraints))
    frame_shapes(left, around, room=0.1)
    left.axis("off")
    around.draw_grounds(left)
    if around.viewpoint is not None:
        draw_triad(left, around.viewpoint, states.structure.length_unit)
    Surroundings(states[[0, -1]]).draw_shapes(left, [_START_AND_GOAL] * 2, 1, linewidths=2.0)
    board.draw(right)
    shape = around.moving_shape(left, style.INDEX_COLOURS[0])
    (travelled,) = right.plot([], [], color=style.ROUTE_COLOUR, linewidth=2.4, zorder=8)
    (point,) = right.plot([], [], "o", color=style.INK, markeredgecolor="white", ms=7, zorder=9)
    parts = around.moving_parts(left)
    texts, numbers = _place_readings(figure, board.readings(states))
    # Animated artists are left out of the background.
    stage = _Stage(canvas, None, shape, parts, travelled, point, texts, numbers)
    for artist in stage._moving():
        artist.set_animated(True)
    canvas.draw()
    return replace(stage, background=canvas.copy_from_bbox(figure.bbox))


def _pictures(stage: _Stage, states: States, board: _Board | _Landscape) -> list[Image.Image]:
    """One picture per state."""
    places = board.places(states)
    ways = _ways(board, places)
    pictures = []
    for k in range(len(states)):
        stage.shape.place(k)
        for part in stage.parts:
            part.place(k)
        stage.travelled.set_data(*ways[k].T)
        stage.point.set_data(*places[k : k + 1].T)
        for text, number in zip(stage.texts, stage.numbers[k], strict=True):
            text.set_text(number)
        pictures.append(stage.picture())
    return pictures


def _ways(
    board: _Board | _Landscape, places: Float[np.ndarray, "frames 2"]
) -> list[Float[np.ndarray, "_ 2"]]:
    """Way to each place through all corners passed before it."""
    path = board.path
    length = np.linspace(path.length[0], path.length[-1], len(places))
    passed, corners = np.searchsorted(path.length, length), board.places(path.states)
    return [
        np.concatenate([corners[:count], place[None]])
        for count, place in zip(passed, places, strict=True)
    ]


def _place_readings(
    figure: Figure, readings: list[_Reading]
) -> tuple[tuple[Text, ...], list[tuple[str, ...]]]:
    """Write labels in two rows; return the texts for the numbers, and the numbers of each state."""
    texts = []
    for reading, (x, y) in zip(readings, _READING_PLACES, strict=False):
        figure.text(x - _NUMBER_WIDTH, y, reading.label, ha="right")
        texts.append(figure.text(x, y, "", ha="right", weight="bold"))
        if len(reading.unit) <= _LONGEST_UNIT:
            figure.text(x + 0.008, y, reading.unit, ha="left")
    printed = [[r.form.format(x).replace("-", "−") for x in r.values] for r in readings]
    return tuple(texts), list(zip(*printed, strict=True))
