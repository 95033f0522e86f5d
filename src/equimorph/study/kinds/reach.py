"""Reachable and attainable sets: ``[[reach]]``."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from itertools import groupby
from pathlib import Path

import numpy as np
from rich.markup import escape as plain

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Descriptor, Progress
from equimorph.study import html
from equimorph.study.choose import choose_state
from equimorph.study.kinds.found import heading
from equimorph.study.kinds.kind import Figure, Kind, still
from equimorph.study.lookup import Ground, at_key, check_state, constraints_of, descriptor_at
from equimorph.study.names import task_files
from equimorph.study.sections.tasks import ReachSection
from equimorph.tasks import Reach, attainable, reachable
from equimorph.tasks.reach import Answer

Reached = tuple[Reach, tuple[Answer, ...]]
"""What is reached, and answers to the queries in their order."""

ROUNDING = 1e-9
"""What of a range is shown as zero."""


@dataclass(frozen=True)
class ReachTask:
    """A reachable set that is wanted, with its names looked up."""

    key: str
    section: ReachSection
    descriptors: tuple[Descriptor, ...]
    constraints: tuple[Constraint, ...]

    @property
    def files(self) -> str:
        """Beginning of the names of its files."""
        return task_files(ReachKind.table, self.section.name)


class ReachKind(Kind[ReachSection, ReachTask, Reached]):
    """What stable motions lead to from a state, and what bounds it."""

    table = "reach"

    def prepared(self, ground: Ground, section: ReachSection, key: str) -> ReachTask:
        """Look up start, descriptors and constraints."""
        check_state(ground, section.start, f"{key}.start")
        descriptors = tuple(
            descriptor_at(ground.structure, text, f"{key}.descriptors[{i}]")
            for i, text in enumerate(section.descriptors)
        )
        constraints = constraints_of(ground.structure, section.within, f"{key}.within")
        return ReachTask(key, section, descriptors, constraints)

    def answer(
        self, ground: Ground, eset: EquilibriumSet | None, task: ReachTask, sink: Progress
    ) -> Reached:
        """Cut the set, and ask for each of the targets."""
        assert eset is not None
        section = task.section
        start = choose_state(eset, section.start, f"{task.key}.start")
        with at_key(task.key):
            reach = (
                attainable(eset, start, task.descriptors, within=task.constraints)
                if section.kind == "attainable"
                else reachable(
                    eset, start, task.descriptors, within=task.constraints,
                    accuracy=section.accuracy,
                )
            )  # fmt: skip
            targets = [dict(zip(task.descriptors, each, strict=True)) for each in section.targets]
            return reach, tuple(reach.query(each) for each in targets)

    def write_tables(self, task: ReachTask, answer: Reached, folder: Path) -> None:
        """Write the boundary: one row for each of its states."""
        reach, names = answer[0], answer[0].whole.names
        with (folder / f"{task.files}.csv").open("w", encoding="utf-8", newline="") as file:
            table = csv.writer(file, lineterminator="\n")
            shown = [each.name for each in task.descriptors]
            table.writerow(["piece", "kind", "detail", *names, *shown])
            for number, piece in enumerate(reach.boundary):
                columns = zip(*(piece.states[name].tolist() for name in names), strict=True)
                for setting, values in zip(columns, piece.values.tolist(), strict=True):
                    table.writerow([number, piece.kind, piece.detail, *setting, *values])

    def figures(
        self, ground: Ground, eset: EquilibriumSet | None, task: ReachTask, answer: Reached
    ) -> Sequence[Figure]:
        """Image and region, of two descriptors over two parameters."""
        reach = answer[0]
        if len(reach.descriptors) != 2 or len(reach.whole.names) != 2:
            return []
        image = partial(plotting.reach_plane, reach, targets=task.section.targets)
        region = partial(plotting.reach_parameters, reach)
        return [still(task.files, image), still(f"{task.files}-parameters", region)]

    def report(self, task: ReachTask, answer: Reached, folder: Path) -> list[str]:
        """Size, boundary by kinds, and what was asked."""
        reach, answers = answer
        captions = {
            f"{task.files}.png": "Values of the descriptors, with what bounds them.",
            f"{task.files}-parameters.png": "The same region over the parameters.",
        }
        words = [f"<p>{escape(line)}</p>" for line in (_extent(task, reach), reach.why) if line]
        rows = [
            [escape(kind), str(len(list(group)))]
            for kind, group in groupby(sorted(piece.kind for piece in reach.boundary))
        ]
        file = f"{task.files}.csv"
        return [
            heading(self.table, task.section.name),
            *words,
            html.pictures(folder, {}, captions),
            html.table(["boundary", "pieces"], rows),
            f'<p>All states of the boundary: <a href="{file}">{file}</a>.</p>',
            *([] if not answers else [_queries(task, answers)]),
        ]

    def verdict(self, task: ReachTask, answer: Reached) -> str:
        """Its size, and how many targets are reached."""
        reach, answers = answer
        can = sum(each.can for each in answers)
        asked = f" {can} of {len(answers)} targets can be reached." if answers else ""
        head = f"Reach {task.section.name}: [bold green]{reach.status}[/]"
        return f"{head}. {plain(_extent(task, reach))}{asked}"


def _extent(task: ReachTask, reach: Reach) -> str:
    """Size of the image and how often it is covered."""
    home = reach.home
    ends = np.stack([home.values.min(axis=0), home.values.max(axis=0)])
    ends[np.abs(ends) < ROUNDING * np.ptp(ends, axis=0)] = 0.0
    ranges = ", ".join(
        f"{each.name} from {html.number(low)} to {html.number(high)}"
        for each, (low, high) in zip(task.descriptors, ends.T, strict=True)
    )
    times = {0: "", 1: ""}.get(home.multiplicity, f", covered up to {home.multiplicity} times")
    regions = len(reach.regions)
    others = f" The stable piece has {regions} such regions." if regions > 1 else ""
    return f"{ranges}{times}.{others}"


def _queries(task: ReachTask, answers: Sequence[Answer]) -> str:
    head = [*(each.name for each in task.descriptors), "answer", "margin", "why"]
    rows = [
        [
            *(html.number(value) for value in target),
            each.status,
            html.number(each.margin) if each.can else "",
            escape(each.why),
        ]
        for target, each in zip(task.section.targets, answers, strict=True)
    ]
    return html.table([escape(title) for title in head], rows, "words")
