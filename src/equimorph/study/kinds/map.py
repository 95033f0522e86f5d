"""Maps over two actuators: ``[[map]]``."""

from collections.abc import Sequence
from html import escape
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from matplotlib.axes import Axes
from pydantic import Field

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor
from equimorph.storage import write_map
from equimorph.study import html
from equimorph.study.composite_arguments import unloaded_load
from equimorph.study.fields import Number, requirement
from equimorph.study.lookup import Extent, at_key
from equimorph.study.names import map_files
from equimorph.study.question import Arguments, Figure, Kind, Question, still
from equimorph.tasks import (
    ActuatorMap,
    CurvatureMap,
    LimitLoadMap,
    curvature_map,
    limit_load_map,
)


class MapKind(Kind[ActuatorMap]):
    """Limit loads, or the first stable states under a load, over two actuators."""

    table = "map"
    tasks = (limit_load_map, curvature_map)
    left_out = ("options", "descriptor")
    own = MappingProxyType(
        {
            "kind": (
                Literal["limit_load_map", "curvature_map"],
                Field(description="What is mapped."),
            ),
            "at": (Number | None, None),
            "descriptor": (
                str | None,
                Field(
                    default=None,
                    description="Descriptor shown by a curvature map; the largest curvature.",
                ),
            ),
        }
    )

    def check(self, section: Any) -> None:
        """A level and a descriptor belong to curvature maps."""
        if (section.kind == "curvature_map") != (section.at is not None):
            raise requirement("give the load `at` in a curvature_map, and only there")
        if section.kind == "limit_load_map" and section.descriptor is not None:
            raise requirement("give a descriptor in a curvature_map only")

    def look_up_more(self, question: Question) -> Descriptor | None:
        """Look up the descriptor of a curvature map, and refuse a level out of range."""
        section = question.section
        with at_key(question.key):
            _check_level(question)
            shown = "max_curvature" if section.descriptor is None else section.descriptor
            return None if section.at is None else question.structure.descriptor(shown)

    def extent(self, question: Question) -> Extent:
        """Grid of the map."""
        grid, fixed = question["grid"], question["fixed"] or {}
        return Extent(grid.box, fixed, question.within, grid.intervals)

    def answer(self, question: Question, arguments: Arguments) -> ActuatorMap:
        """Compute the map."""
        if question.section.at is None:
            return limit_load_map(**arguments.of(limit_load_map))
        return curvature_map(**arguments.of(curvature_map), descriptor=question.extra)

    def write_tables(self, question: Question, answer: ActuatorMap, folder: Path) -> None:
        """Write settings and curves."""
        write_map(answer, folder / f"{map_files(question.name)}.csv")

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: ActuatorMap
    ) -> Sequence[Figure]:
        """Return the map with its curves."""

        def draw() -> Axes:
            if isinstance(answer, CurvatureMap):
                return plotting.curvature_map(answer)
            assert isinstance(answer, LimitLoadMap)
            return plotting.load_map(answer)

        return [still(map_files(question.name), draw)]

    def report(self, question: Question, answer: ActuatorMap, folder: Path) -> list[str]:
        """How many settings ended in which way, the figure, and the tables."""
        section, files = question.section, map_files(question.name)
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

    def verdict(self, question: Question, answer: ActuatorMap) -> str:
        """How many settings ended in which way."""
        counts = ", ".join(f"{count} {kind}" for kind, count in answer.counts.items() if count)
        return f"{question.title}: {counts}."


def _check_level(question: Question) -> None:
    section = question.section
    low = unloaded_load(question.structure, section, question["grid"])
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
