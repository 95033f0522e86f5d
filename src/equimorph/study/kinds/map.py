"""Maps over two actuators: ``[[map]]``."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from matplotlib.axes import Axes

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Descriptor, Grid, Progress
from equimorph.storage import write_map
from equimorph.structures import Structure
from equimorph.study import html
from equimorph.study.kinds.actuator_grid import common_of, grid_of, unloaded_load
from equimorph.study.kinds.kind import Figure, Kind, still
from equimorph.study.lookup import Extent, Ground, at_key, constraints_of
from equimorph.study.names import map_files
from equimorph.study.sections.maps import MapSection
from equimorph.tasks import (
    ActuatorMap,
    CurvatureMap,
    LimitLoadMap,
    curvature_map,
    limit_load_map,
)


@dataclass(frozen=True)
class MapTask:
    """A map that is wanted, with its grid, constraints and descriptor as objects."""

    key: str
    section: MapSection
    structure: Structure
    grid: Grid
    constraints: tuple[Constraint, ...]
    descriptor: Descriptor | None


class MapKind(Kind[MapSection, MapTask, ActuatorMap]):
    """Limit loads, or the first stable states under a load, over two actuators."""

    table = "map"

    def prepared(self, ground: Ground, section: MapSection, key: str) -> MapTask:
        """Look up actuators, load and descriptor."""
        structure = ground.structure
        grid = grid_of(structure, section, key)
        with at_key(key):
            _check_level(structure, section, grid)
            shown = "max_curvature" if section.descriptor is None else section.descriptor
            descriptor = structure.descriptor(shown) if section.at is not None else None
        constraints = constraints_of(structure, section.within, f"{key}.within")
        return MapTask(key, section, structure, grid, constraints, descriptor)

    def extent(self, task: MapTask) -> Extent:
        """Grid of the map."""
        grid, section = task.grid, task.section
        return Extent(grid.box, section.fixed, task.constraints, grid.intervals)

    def answer(
        self, ground: Ground, eset: EquilibriumSet | None, task: MapTask, sink: Progress
    ) -> ActuatorMap:
        """Compute the map."""
        section, structure = task.section, ground.structure
        common = common_of(section, task.constraints, sink)
        with at_key(task.key):
            if section.at is None:
                return limit_load_map(structure, task.grid, section.load, **common)
            return curvature_map(
                structure,
                task.grid,
                section.load,
                section.at,
                descriptor=task.descriptor,
                **common,
            )

    def write_tables(self, task: MapTask, answer: ActuatorMap, folder: Path) -> None:
        """Write settings and curves."""
        write_map(answer, folder / f"{map_files(task.section.name)}.csv")

    def figures(
        self, ground: Ground, eset: EquilibriumSet | None, task: MapTask, answer: ActuatorMap
    ) -> Sequence[Figure]:
        """Return the map with its curves."""

        def draw() -> Axes:
            if isinstance(answer, CurvatureMap):
                return plotting.curvature_map(answer)
            assert isinstance(answer, LimitLoadMap)
            return plotting.load_map(answer)

        return [still(map_files(task.section.name), draw)]

    def report(self, task: MapTask, answer: ActuatorMap, folder: Path) -> list[str]:
        """How many settings ended in which way, the figure, and the tables."""
        section, files = task.section, map_files(task.section.name)
        counts = [f"{count} {kind}" for kind, count in answer.counts.items() if count]
        what, caption = "Limit loads", "Limit loads, with the curves on which they jump or bend."
        if section.at is not None:
            what = f"States at {section.load} = {html.number(section.at)}"
            caption = "The first stable state on each path; dots: a real loading snaps on the way."
        extent = html.extent(answer.grid.box, answer.fixed, answer.within)
        return [
            f"<h2>Map {escape(section.name)}</h2>",
            f'<p class="lead">{escape(" · ".join(extent))}</p>',
            f"<p>{escape(what)} at {answer.value.size} settings: {escape(', '.join(counts))}.</p>",
            f'<div class="figures">{html.still(folder, files, caption)}</div>',
            _accuracy(answer),
            f'<p>Tables: <a href="{files}.csv">{files}.csv</a> (settings) and '
            f'<a href="{files}-curves.csv">{files}-curves.csv</a>.</p>',
        ]

    def verdict(self, task: MapTask, answer: ActuatorMap) -> str:
        """How many settings ended in which way."""
        counts = ", ".join(f"{count} {kind}" for kind, count in answer.counts.items() if count)
        return f"Map {task.section.name}: {counts}."


def _check_level(structure: Structure, section: MapSection, grid: Grid) -> None:
    low = unloaded_load(structure, section, grid)
    if section.at is not None and not low < section.at < section.bound:
        raise InputError(
            f"`at` must lie between {section.load} = {low:g} and `bound` = "
            f"{section.bound:g}; got {section.at:g}."
        )


def _accuracy(amap: ActuatorMap) -> str:
    """How well the places of curves are known, kind by kind."""
    worst: dict[str, float] = {}
    for curve in amap.curves:
        worst[curve.kind] = max(worst.get(curve.kind, 0.0), float(curve.errors.max(initial=0.0)))
    if not worst:
        return ""
    words = ", ".join(f"{kind} {error:.0e}" for kind, error in worst.items())
    return f"<p>Curves, with the largest error of a place along a grid line: {escape(words)}.</p>"
