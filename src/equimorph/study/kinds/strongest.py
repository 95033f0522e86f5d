"""Settings that carry most: ``[[strongest]]``."""

from functools import partial
from html import escape

import numpy as np

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.study import html
from equimorph.study.answers import place_of
from equimorph.study.lookup import Extent
from equimorph.study.question import Arguments, Figure, Kind, Question, still
from equimorph.tasks.maps.limit_load import LimitLoadMap, limit_load_map
from equimorph.tasks.optimising.strength import StrongestSettings, strongest

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

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Answer
    ) -> list[Figure]:
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
        del question
        return f"{answer[1].why}." if answer[1].status == "refused" else ""


def _table(question: Question, answer: Answer) -> str:
    _, sure, robust = answer
    marks = [str(k) for k in range(1, len(sure.all) + 1)]
    found = list(sure.all)
    if robust is not None and robust.status == "found":
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
