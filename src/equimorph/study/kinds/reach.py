"""Reachable and attainable sets: ``[[reach]]``."""

import csv
from collections.abc import Sequence
from functools import partial
from html import escape
from itertools import groupby
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from pydantic import Field
from rich.markup import escape as plain

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.study import html
from equimorph.study.answers import heading
from equimorph.study.fields import Number, requirement
from equimorph.study.question import Arguments, Figure, Kind, Question, still
from equimorph.tasks import Reach, attainable, reachable
from equimorph.tasks.reach import Answer

Reached = tuple[Reach, tuple[Answer, ...]]
"""What is reached, and answers to the queries in their order."""

ROUNDING = 1e-9
"""What of a range is shown as zero."""


class ReachKind(Kind[Reached]):
    """What stable motions lead to from a state, and what bounds it."""

    table = "reach"
    tasks = (reachable, attainable)
    names = MappingProxyType({"state": "start"})
    own = MappingProxyType(
        {
            "kind": (
                Literal["reachable", "attainable"],
                Field(
                    default="reachable",
                    description="From the start without a snap, or on any stable state.",
                ),
            ),
            "targets": (
                list[list[Number]],
                Field(
                    default_factory=list,
                    description="Values of the descriptors; the page says which can be reached.",
                ),
            ),
        }
    )

    def check(self, section: Any) -> None:
        """Refuse an accuracy of what is only cut, and targets of another length."""
        if section.kind == "attainable" and section.accuracy is not None:
            raise requirement("give an accuracy to reachable sets only")
        if any(len(target) != len(section.descriptors) for target in section.targets):
            raise requirement("give each target one value for each of its descriptors")

    def answer(self, question: Question, arguments: Arguments) -> Reached:
        """Cut the set, and ask for each of the targets."""
        task = attainable if question.section.kind == "attainable" else reachable
        reach: Reach = task(**arguments.of(task))
        descriptors = question["descriptors"]
        targets = [dict(zip(descriptors, x, strict=True)) for x in question.section.targets]
        return reach, tuple(reach.query(each) for each in targets)

    def write_tables(self, question: Question, answer: Reached, folder: Path) -> None:
        """Write the boundary: one row for each of its states."""
        reach, names = answer[0], answer[0].whole.names
        with (folder / f"{question.files}.csv").open("w", encoding="utf-8", newline="") as file:
            table = csv.writer(file, lineterminator="\n")
            shown = [each.name for each in question["descriptors"]]
            table.writerow(["piece", "kind", "detail", *names, *shown])
            for number, piece in enumerate(reach.boundary):
                columns = zip(*(piece.states[name].tolist() for name in names), strict=True)
                for setting, values in zip(columns, piece.values.tolist(), strict=True):
                    table.writerow([number, piece.kind, piece.detail, *setting, *values])

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Reached
    ) -> Sequence[Figure]:
        """Image and region, of two descriptors over two parameters."""
        reach = answer[0]
        if len(reach.descriptors) != 2 or len(reach.whole.names) != 2:
            return []
        image = partial(plotting.reach_plane, reach, targets=question.section.targets)
        region = partial(plotting.reach_parameters, reach)
        return [still(question.files, image), still(f"{question.files}-parameters", region)]

    def report(self, question: Question, answer: Reached, folder: Path) -> list[str]:
        """Size, boundary by kinds, and the targets."""
        reach, answers = answer
        captions = {
            f"{question.files}.png": "Values of the descriptors, with the kinds of their boundary.",
            f"{question.files}-parameters.png": "The same region over the parameters.",
        }
        words = [f"<p>{escape(line)}</p>" for line in (_extent(question, reach), reach.why) if line]
        rows = [
            [escape(kind), str(len(list(group)))]
            for kind, group in groupby(sorted(piece.kind for piece in reach.boundary))
        ]
        file = f"{question.files}.csv"
        return [
            heading(question),
            *words,
            html.pictures(folder, {}, captions),
            html.table(["boundary", "pieces"], rows),
            f'<p>All states of the boundary: <a href="{file}">{file}</a>.</p>',
            *([] if not answers else [_queries(question, answers)]),
        ]

    def verdict(self, question: Question, answer: Reached) -> str:
        """Its size, and how many targets are reached."""
        reach, answers = answer
        can = sum(each.can for each in answers)
        asked = f" {can} of {len(answers)} targets can be reached." if answers else ""
        head = f"{question.title}: [bold green]{reach.status}[/]"
        return f"{head}. {plain(_extent(question, reach))}{asked}"


def _extent(question: Question, reach: Reach) -> str:
    """Size of the image and how often it is covered."""
    home = reach.home
    ends = np.stack([home.values.min(axis=0), home.values.max(axis=0)])
    ends[np.abs(ends) < ROUNDING * np.ptp(ends, axis=0)] = 0.0
    ranges = ", ".join(
        f"{each.name} from {html.number(low)} to {html.number(high)}"
        for each, (low, high) in zip(question["descriptors"], ends.T, strict=True)
    )
    times = {0: "", 1: ""}.get(home.multiplicity, f", covered up to {home.multiplicity} times")
    regions = len(reach.regions)
    others = f" The stable piece has {regions} such regions." if regions > 1 else ""
    return f"{ranges}{times}.{others}"


def _queries(question: Question, answers: Sequence[Answer]) -> str:
    head = [*(each.name for each in question["descriptors"]), "answer", "margin", "why"]
    rows = [
        [
            *(html.number(value) for value in target),
            each.status,
            html.number(each.margin) if each.can else "",
            escape(each.why),
        ]
        for target, each in zip(question.section.targets, answers, strict=True)
    ]
    return html.table([escape(title) for title in head], rows, "words")
