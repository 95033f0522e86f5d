"""Landscapes: ``[[landscape]]``."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from pathlib import Path

import numpy as np
from rich.markup import escape as plain

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Descriptor, Grid, Progress
from equimorph.study import html
from equimorph.study.choose import chosen_start
from equimorph.study.kinds.found import heading
from equimorph.study.kinds.kind import Figure, Kind, still
from equimorph.study.lookup import (
    Ground,
    at_key,
    check_point,
    check_state,
    constraints_of,
    descriptor_at,
)
from equimorph.study.names import task_files
from equimorph.study.sections.best import LandscapeSection
from equimorph.tasks import Landscape, landscape

NO_JUMP = 1e-9
"""Jump relative to the values that is rounding."""


@dataclass(frozen=True)
class LandscapeTask:
    """A landscape that is wanted, with its names looked up."""

    key: str
    section: LandscapeSection
    objective: Descriptor
    grid: Grid
    constraints: tuple[Constraint, ...]

    @property
    def files(self) -> str:
        """Beginning of the names of its files."""
        return task_files(LandscapeKind.table, self.section.name)


class LandscapeKind(Kind[LandscapeSection, LandscapeTask, Landscape]):
    """The best stable state at every setting, with barriers and gaps between them."""

    table = "landscape"

    def prepared(self, ground: Ground, section: LandscapeSection, key: str) -> LandscapeTask:
        """Look up objective, grid, start and constraints."""
        objective = descriptor_at(ground.structure, section.objective, f"{key}.objective")
        if section.start is not None:
            check_state(ground, section.start, f"{key}.start")
        constraints = constraints_of(ground.structure, section.within, f"{key}.within")
        return LandscapeTask(key, section, objective, _grid(ground, section, key), constraints)

    def answer(
        self, ground: Ground, eset: EquilibriumSet | None, task: LandscapeTask, sink: Progress
    ) -> Landscape:
        """Reduce the set."""
        assert eset is not None
        section = task.section
        start = chosen_start(eset, section.start, f"{task.key}.start")
        with at_key(task.key):
            return landscape(
                eset, task.objective, task.grid, sense=section.sense, within=task.constraints,
                start=start,
            )  # fmt: skip

    def write_tables(self, task: LandscapeTask, answer: Landscape, folder: Path) -> None:
        """Write settings with their values, and the edges that cross barriers."""
        names, axes = answer.grid.names, answer.grid.axes()
        rows = [
            [*map(repr, (x, y)), repr(value) if np.isfinite(value) else ""]
            for x, line in zip(axes[0].tolist(), answer.value.tolist(), strict=True)
            for y, value in zip(axes[1].tolist(), line, strict=True)
        ]
        _write(folder / f"{task.files}.csv", [[*names, task.objective.name], *rows])
        barriers = answer.barriers
        head = [
            "kind",
            *(f"{name} {end}" for end in (1, 2) for name in names),
            "value 1",
            "value 2",
        ]
        rows = [
            [kind, *map(repr, [*ends.ravel().tolist(), *values.tolist()])]
            for kind, ends, values in zip(
                barriers.kind, barriers.ends, barriers.values, strict=True
            )
        ]
        _write(folder / f"{task.files}-barriers.csv", [head, *rows])

    def figures(
        self, ground: Ground, eset: EquilibriumSet | None, task: LandscapeTask, answer: Landscape
    ) -> Sequence[Figure]:
        """Return the map with barriers and gaps."""
        draw = partial(plotting.landscape, ground.structure, answer, task.objective)
        return [still(task.files, draw)]

    def report(self, task: LandscapeTask, answer: Landscape, folder: Path) -> list[str]:
        """Range, gaps and barriers, the figure, and the tables."""
        files = task.files
        rows = [[escape(what), escape(value)] for what, value in _summary(task, answer)]
        jumps = np.abs(np.diff(answer.barriers.values, axis=1)).ravel()
        highest = ""
        if len(jumps):
            real = jumps.max() > NO_JUMP * np.abs(answer.barriers.values).max()
            size = f"at most {html.number(jumps.max())}" if real else "nowhere"
            highest = f" The value itself jumps there by {size}.".replace("by nowhere", "nowhere")
        caption = f"The {_word(task)} {task.objective.name} of stable states at each setting."
        return [
            heading(self.table, task.section.name),
            html.table([], rows, "words"),
            html.pictures(folder, {}, {f"{files}.png": caption}),
            "<p>At a barrier of stability the best state is lost on the way to the neighbouring "
            "setting; at one of preference it goes on, but another one is better there."
            f"{highest}</p>",
            f'<p>Tables: <a href="{files}.csv">{files}.csv</a> (settings) and '
            f'<a href="{files}-barriers.csv">{files}-barriers.csv</a>.</p>',
        ]

    def verdict(self, task: LandscapeTask, answer: Landscape) -> str:
        """Range, gaps and barriers in one line."""
        words = "; ".join(f"{what}: {value}" for what, value in _summary(task, answer))
        return f"Landscape {task.section.name}: {plain(words)}."


def _grid(ground: Ground, section: LandscapeSection, key: str) -> Grid:
    box = ground.box
    if len(box.names) != 2:
        raise InputError(
            f"`{key}` must be asked of a set over two parameters; got one over {len(box.names)}."
        )
    sides = dict(zip(box.names, zip(box.lower, box.upper, strict=True), strict=True))
    for end in (0, 1):
        corner = {name: bounds[end] for name, bounds in (section.box or {}).items()}
        if corner:
            check_point(box, corner, f"{key}.box")
    chosen = {name: (section.box or sides)[name] for name in box.names}
    counted = zip(chosen.items(), section.intervals, strict=True)
    return Grid(**{name: (*map(float, bounds), count) for (name, bounds), count in counted})


def _word(task: LandscapeTask) -> str:
    return "least" if task.section.sense == "min" else "largest"


def _summary(task: LandscapeTask, found: Landscape) -> list[tuple[str, str]]:
    """What is told, by name."""
    total, gaps = found.gaps.size, int(found.gaps.sum())
    known = found.value[~found.gaps]
    rows = []
    if len(known):
        ends = f"{html.number(known.min(), 6)} to {html.number(known.max(), 6)}"
        rows.append((f"{_word(task)} {task.objective.name}", ends))
    rows.append(("settings without an allowed stable state", f"{gaps} of {total}"))
    for kind in ("stability", "preference"):
        count = sum(each == kind for each in found.barriers.kind)
        rows.append((f"grid edges that cross a barrier of {kind}", str(count)))
    return rows


def _write(path: Path, rows: Sequence[Sequence[str]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)
