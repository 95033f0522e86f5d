"""Reachable and attainable sets: ``[[reach]]``."""

from collections import Counter
from collections.abc import Sequence
from functools import partial
from html import escape
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from pydantic import Field

from equimorph import plotting
from equimorph.study import html
from equimorph.study.fields import Number, requirement
from equimorph.study.question import Arguments, DataTable, Figure, Kind, Question, still
from equimorph.tables import Column, Table, units_of
from equimorph.tasks.reach.query import Answer
from equimorph.tasks.reach.reachable_sets import Reach, attainable, reachable

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

    def tables(self, question: Question, answer: Reached) -> list[DataTable]:
        """Return the boundary: one row for each of its states."""
        reach, names = answer[0], answer[0].whole.names
        shown, pieces = question["descriptors"], reach.boundary
        of = np.repeat(np.arange(len(pieces)), [len(each.states) for each in pieces])
        words = {key: np.array([getattr(each, key) for each in pieces], object)[of]
                 for key in ("kind", "detail")}  # fmt: skip
        columns: dict[str, Column] = {"piece": of, **words}
        for name in names:
            columns[name] = np.concatenate([np.zeros(0), *(each.states[name] for each in pieces)])
        for k, each in enumerate(shown):
            values = [piece.values[:, k] for piece in pieces]
            columns[each.name] = np.concatenate([np.zeros(0), *values])
        table = Table(columns, units_of((*question.structure.parameters, *shown)))
        return [DataTable(f"{question.files}.csv", "all states of the boundary", table)]

    def figures(self, question: Question, answer: Reached) -> list[Figure]:
        """Image and region, of two descriptors over two parameters."""
        reach, files = answer[0], question.files
        if len(reach.descriptors) != 2 or len(reach.whole.names) != 2:
            return []
        image = partial(plotting.reach_plane, reach, targets=question.section.targets)
        region = partial(plotting.reach_parameters, reach)
        caption = "Values of the descriptors, with the kinds of their boundary."
        return [
            still(files, image, caption),
            still(f"{files}-parameters", region, "The same region over the parameters."),
        ]

    def words(self, question: Question, answer: Reached) -> str:
        """Its size, and how many targets are reached."""
        reach, answers = answer
        can = sum(each.can for each in answers)
        asked = f" {can} of {len(answers)} targets can be reached." if answers else ""
        why = f" {reach.why}" if reach.why else ""
        return f"**{reach.status}**: {_extent(question, reach)}{asked}{why}"

    def details(self, question: Question, answer: Reached) -> list[str]:
        """Boundary by kinds, and the targets."""
        reach, answers = answer
        kinds = Counter(piece.kind for piece in reach.boundary)
        rows = [[escape(kind), str(count)] for kind, count in sorted(kinds.items())]
        queries = [_queries(question, answers)] if answers else []
        return [html.table(["boundary", "pieces"], rows), *queries]

    def refusal(self, question: Question, answer: Reached) -> str:
        """Reason why nothing is reached."""
        return super().refusal(question, answer[0])  # type: ignore[arg-type]  # its status and why


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
