"""Derivatives of descriptors: ``[[sensitivity]]``."""

from collections.abc import Sequence
from functools import partial
from html import escape
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

from pydantic import Field
from rich.markup import escape as plain

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.plotting.robustness import MOST_BARS
from equimorph.study import html
from equimorph.study.answers import heading
from equimorph.study.question import Figure, Kind, Question, still
from equimorph.tasks import Sensitivity, sensitivity


class SensitivityKind(Kind[Sensitivity]):
    """How descriptors change with parameters."""

    table = "sensitivity"
    tasks = (sensitivity,)
    names = MappingProxyType({"names": "parameters"})
    own = MappingProxyType({"descriptors": (Annotated[list[str], Field(min_length=1)], ...)})

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Sensitivity
    ) -> Sequence[Figure]:
        """Bars, where they are few enough to be read."""
        if len(answer.names) * len(answer.descriptors) > MOST_BARS:
            return []
        draw = partial(plotting.sensitivities, question.structure, answer)
        return [still(question.files, draw)]

    def report(self, question: Question, answer: Sensitivity, folder: Path) -> list[str]:
        """A table: one row for each parameter."""
        files = question.files
        rows = [
            [escape(name), *(html.number(answer[each, name], 6) for each in answer.descriptors)]
            for name in answer.names
        ]
        head = ["", *(f"d {escape(each)}" for each in answer.descriptors)]
        caption = "Changes of the descriptors for one scale of each parameter."
        return [
            heading(question),
            html.table(head, rows),
            html.pictures(folder, {}, {f"{files}.png": caption}),
        ]

    def verdict(self, question: Question, answer: Sensitivity) -> str:
        """Name the largest change."""
        scales = {each.name: each.scale for each in question.structure.parameters}
        lines = []
        for each in answer.descriptors:
            name = max(answer.names, key=lambda one: abs(answer[each, one]) * scales[one])
            lines.append(f"d {plain(each)}/d {name} = {html.number(answer[each, name], 6)}")
        return f"{question.title}: largest are {', '.join(lines)}."
