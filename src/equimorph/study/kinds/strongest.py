"""Settings that carry most: ``[[strongest]]``."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from pathlib import Path

import numpy as np
from rich.markup import escape as plain

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Grid, Progress
from equimorph.study import html
from equimorph.study.kinds.actuator_grid import common_of, grid_of
from equimorph.study.kinds.found import heading
from equimorph.study.kinds.kind import Figure, Kind, still
from equimorph.study.lookup import Extent, Ground, at_key, constraints_of
from equimorph.study.names import task_files
from equimorph.study.sections.maps import StrongestSection
from equimorph.tasks import LimitLoadMap, StrongestSettings, limit_load_map, strongest


@dataclass(frozen=True)
class StrongestTask:
    """Strongest settings that are wanted, with grid and constraints as objects."""

    key: str
    section: StrongestSection
    grid: Grid
    constraints: tuple[Constraint, ...]

    @property
    def files(self) -> str:
        """Beginning of the names of its files."""
        return task_files(StrongestKind.table, self.section.name)


Answer = tuple[LimitLoadMap, StrongestSettings, StrongestSettings | None]
"""Map, its largest values, and those that errors of the settings leave."""


class StrongestKind(Kind[StrongestSection, StrongestTask, Answer]):
    """Settings with the largest limit load, sure and robust."""

    table = "strongest"

    def prepared(self, ground: Ground, section: StrongestSection, key: str) -> StrongestTask:
        """Look up actuators, load, offsets and constraints."""
        grid = grid_of(ground.structure, section, key)
        unknown = [name for name in section.offsets if name not in grid.names]
        if unknown:
            raise InputError(
                f"`{key}.offsets` must be of actuators of its box ({', '.join(grid.names)}); "
                f"got {', '.join(unknown)}."
            )
        constraints = constraints_of(ground.structure, section.within, f"{key}.within")
        return StrongestTask(key, section, grid, constraints)

    def extent(self, task: StrongestTask) -> Extent:
        """Grid of the map."""
        grid = task.grid
        return Extent(grid.box, task.section.fixed, task.constraints, grid.intervals)

    def answer(
        self, ground: Ground, eset: EquilibriumSet | None, task: StrongestTask, sink: Progress
    ) -> Answer:
        """Map the limit loads, and climb from its highest vertices and curves."""
        section = task.section
        with at_key(task.key):
            common = common_of(section, task.constraints, sink)
            amap = limit_load_map(ground.structure, task.grid, section.load, **common)
            sure = strongest(amap)
            offsets = section.offsets
            return amap, sure, strongest(amap, offsets=offsets) if offsets else None

    def figures(
        self, ground: Ground, eset: EquilibriumSet | None, task: StrongestTask, answer: Answer
    ) -> Sequence[Figure]:
        """Where they are on the map; what is left of the load beside the best."""
        amap, sure, robust = answer
        if sure.status == "refused":
            return []
        best = (sure, robust) if robust is not None else (sure,)
        places = partial(plotting.strongest_settings, amap, sure, robust)
        beside = partial(plotting.beside_strongest, amap, [each.best for each in best])
        return [still(task.files, places), still(f"{task.files}-beside", beside)]

    def report(self, task: StrongestTask, answer: Answer, folder: Path) -> list[str]:
        """A table of them, the price of being sure, and the figures."""
        amap, sure, robust = answer
        head = heading(self.table, task.section.name)
        lead = html.extent(amap.grid.box, amap.fixed, amap.within)
        if sure.status == "refused":
            return [head, html.refused(f"{sure.why}.")]
        captions = {
            f"{task.files}.png": "Limit loads with their largest values, numbered as in the table"
            + (" (□: robust, with its box of errors)." if robust is not None else "."),
            f"{task.files}-beside.png": "Limit loads on both sides of the best, ever closer.",
        }
        return [
            head,
            f'<p class="lead">{escape(" · ".join(lead))}</p>',
            f"<p>{escape(_in_words(task, answer))}</p>",
            _table(task, answer),
            html.pictures(folder, {}, captions),
        ]

    def verdict(self, task: StrongestTask, answer: Answer) -> str:
        """Name the best one, and the price of a robust one."""
        head = f"Strongest {task.section.name}"
        if answer[1].status == "refused":
            return f"{head}: [bold red]refused[/]. {plain(answer[1].why)}."
        return f"{head}: [bold green]found[/]. {plain(_in_words(task, answer))}"


def _in_words(task: StrongestTask, answer: Answer) -> str:
    _, sure, robust = answer
    load, best = task.section.load, sure.best
    largest = html.number(best.value, 6)
    words = f"Largest limit load {load} = {largest} at {_place(best.setting)} ({best.kind})."
    if robust is None:
        return words
    if robust.status == "refused":
        return f"{words} No robust setting: {robust.why}."
    errors = ", ".join(f"{name} ± {size:g}" for name, size in robust.offsets.items())
    loads = (robust.at_risk, robust.guaranteed, robust.best.value)
    at_risk, guaranteed, nominal = (html.number(each, 6) for each in loads)
    return (
        f"{words} With errors {errors} as little as {at_risk} is left of it. The robust setting "
        f"{_place(robust.best.setting)} carries {guaranteed} at least, and {nominal} without "
        f"errors: its price is {html.number(robust.price)}."
    )


def _place(setting: Mapping[str, float]) -> str:
    numbers = {name: html.number(round(value, 12), 6) for name, value in setting.items()}
    return ", ".join(f"{name} = {each}" for name, each in numbers.items())


def _table(task: StrongestTask, answer: Answer) -> str:
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
    names = [escape(name) for name in task.grid.names]
    load = escape(task.section.load)
    return html.table(["", *names, f"limit load {load}", "where", "one side", "other side"], rows)
