"""Maps over two actuators, ``[[map]]``, and settings that carry most, ``[[strongest]]``."""

from functools import partial
from html import escape
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from pydantic import Field

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.model import Descriptor
from equimorph.study import html
from equimorph.study.answers import place_of
from equimorph.study.composite_arguments import unloaded_load
from equimorph.study.fields import Number, requirement
from equimorph.study.lookup import Extent, at_key
from equimorph.study.question import Arguments, DataTable, Figure, Kind, Question, still
from equimorph.tasks.maps.actuator_map import ActuatorMap
from equimorph.tasks.maps.curvature import CurvatureMap, curvature_map
from equimorph.tasks.maps.limit_load import LimitLoadMap, limit_load_map
from equimorph.tasks.optimising.strength import StrongestSettings, strongest


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

    def figures(self, question: Question, answer: ActuatorMap) -> list[Figure]:
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


Answer = tuple[LimitLoadMap, StrongestSettings, StrongestSettings | None]
"""Map, its largest values, and those that errors of the settings leave."""


class StrongestKind(Kind[Answer]):
    """Settings with the largest limit load, without and with errors."""

    table = "strongest"
    tasks = (limit_load_map, strongest)
    left_out = ("options", "lmap")

    def look_up_more(self, question: Question) -> None:
        """Refuse offsets of other parameters than the actuators."""
        names = question["grid"].names
        unknown = [name for name in question["offsets"] or () if name not in names]
        if unknown:
            raise InputError(
                f"`{question.key}.offsets` must be of actuators of its box ({', '.join(names)}); "
                f"got {', '.join(unknown)}."
            )

    def extent(self, question: Question) -> Extent:
        """Grid of the map."""
        grid, fixed = question["grid"], question["fixed"] or {}
        return Extent(grid.box, fixed, question.within, grid.intervals)

    def answer(self, question: Question, arguments: Arguments) -> Answer:
        """Map the limit loads, and climb from its highest vertices and curves."""
        lmap, offsets = limit_load_map(**arguments.of(limit_load_map)), question["offsets"]
        return lmap, strongest(lmap), strongest(lmap, offsets=offsets) if offsets else None

    def figures(self, question: Question, answer: Answer) -> list[Figure]:
        """The settings on the map, and limit loads near the best one."""
        amap, sure, robust = answer
        if sure.status == "refused":
            return []
        best = (sure, robust) if robust is not None else (sure,)
        places = partial(plotting.strongest_settings, amap, sure, robust)
        beside = partial(plotting.beside_strongest, amap, [each.best for each in best])
        errors = "" if robust is None else " (□: robust, with its box of errors)"
        numbered = f"Limit loads with their largest values, numbered as in the table{errors}."
        closer = "Limit loads on both sides of the best, ever closer."
        files = question.files
        return [still(files, places, numbered), still(f"{files}-beside", beside, closer)]

    def words(self, question: Question, answer: Answer) -> str:
        """Name the best one, and the price of a robust one."""
        _, sure, robust = answer
        names, best = question["grid"].names, sure.best
        load = f"limit load {question.section.load} = {html.number(best.value, 6)}"
        words = f"**found**: largest {load} at {place_of(best.setting, names)} ({best.kind})."
        if robust is None:
            return words
        if robust.status == "refused":
            return f"{words} No robust setting: {robust.why}."
        errors = ", ".join(f"{name} ± {size:g}" for name, size in robust.offsets.items())
        loads = (robust.at_risk, robust.guaranteed, robust.best.value)
        at_risk, guaranteed, nominal = (html.number(each, 6) for each in loads)
        return (
            f"{words} With errors {errors} it falls to {at_risk}. The robust setting "
            f"{place_of(robust.best.setting, names)} carries {guaranteed} at least, and {nominal} "
            f"without errors: its price is {html.number(robust.price)}."
            f"{f' Not converged: {robust.why}.' if robust.why else ''}"
        )

    def details(self, question: Question, answer: Answer) -> list[str]:
        """Extent of the map, and a table of the settings."""
        amap, sure, _ = answer
        if sure.status == "refused":
            return []
        lead = html.extent(amap.grid.box, amap.fixed, amap.within)
        return [f'<p class="lead">{escape(" · ".join(lead))}</p>', _table(question, answer)]

    def refusal(self, question: Question, answer: Answer) -> str:
        """Reason why no setting carries anything."""
        return f"{answer[1].why}." if answer[1].status == "refused" else ""


def _table(question: Question, answer: Answer) -> str:
    _, sure, robust = answer
    marks = [str(k) for k in range(1, len(sure.all) + 1)]
    found = list(sure.all)
    if robust is not None and robust.status != "refused":
        marks.append("□")
        found.append(robust.best)
    rows = [
        [
            mark,
            *(html.number(round(value, 12), 6) for value in each.setting.values()),
            html.number(each.value, 7),
            escape(each.kind),
            *(html.number(limit, 6) if np.isfinite(limit) else "none" for limit in each.one_sided),
        ]
        for mark, each in zip(marks, found, strict=True)
    ]
    names = [escape(name) for name in question["grid"].names]
    load = escape(question.section.load)
    return html.table(["", *names, f"limit load {load}", "where", "one side", "other side"], rows)
