"""Maps over two actuators: ``[[map]]``."""

from functools import partial
from html import escape
from types import MappingProxyType
from typing import Any, Literal

from pydantic import Field

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor
from equimorph.study import html
from equimorph.study.composite_arguments import unloaded_load
from equimorph.study.fields import Number, requirement
from equimorph.study.lookup import Extent, at_key
from equimorph.study.question import Arguments, DataTable, Figure, Kind, Question, still
from equimorph.tasks.maps.actuator_map import ActuatorMap
from equimorph.tasks.maps.curvature import CurvatureMap, curvature_map
from equimorph.tasks.maps.limit_load import LimitLoadMap, limit_load_map


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

    def tables(self, question: Question, answer: ActuatorMap) -> list[DataTable]:
        """Return settings and curves."""
        files = question.files
        return [
            DataTable(f"{files}.csv", "settings", answer.table),
            DataTable(f"{files}-curves.csv", "curves", answer.curve_table),
        ]

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: ActuatorMap
    ) -> list[Figure]:
        """Return the map with its curves."""
        if isinstance(answer, CurvatureMap):
            caption = "The first stable state on each path; dots: a real loading snaps on the way."
            return [still(question.files, partial(plotting.curvature_map, answer), caption)]
        assert isinstance(answer, LimitLoadMap)
        caption = "Limit loads, with the curves on which they jump or bend."
        return [still(question.files, partial(plotting.load_map, answer), caption)]

    def words(self, question: Question, answer: ActuatorMap) -> str:
        """How many settings ended in which way."""
        section = question.section
        counts = ", ".join(f"{count} {kind}" for kind, count in answer.counts.items() if count)
        what = "limit loads"
        if section.at is not None:
            what = f"states at {section.load} = {html.number(section.at)}"
        return f"{what} at {answer.value.size} settings: {counts}."

    def details(self, question: Question, answer: ActuatorMap) -> list[str]:
        """Extent of the map, and how well the places of curves are known, kind by kind."""
        extent = html.extent(answer.grid.box, answer.fixed, answer.within)
        lead = f'<p class="lead">{escape(" · ".join(extent))}</p>'
        worst: dict[str, float] = {}
        for curve in answer.curves:
            error = float(curve.errors.max(initial=0.0))
            worst[curve.kind] = max(worst.get(curve.kind, 0.0), error)
        errors = escape(", ".join(f"{kind} {error:.0e}" for kind, error in worst.items()))
        told = f"<p>Curves, with the largest error of a place along a grid line: {errors}.</p>"
        return [lead, told] if worst else [lead]


def _check_level(question: Question) -> None:
    section = question.section
    low = unloaded_load(question.structure, section, question["grid"])
    if section.at is not None and not low < section.at < section.bound:
        raise InputError(
            f"`at` must lie between {section.load} = {low:g} and `bound` = "
            f"{section.bound:g}; got {section.at:g}."
        )
