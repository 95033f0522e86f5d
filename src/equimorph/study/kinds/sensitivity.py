"""Derivatives of descriptors: ``[[sensitivity]]``."""

from functools import partial
from html import escape
from types import MappingProxyType
from typing import Annotated

from pydantic import Field

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.plotting.robustness import MOST_BARS
from equimorph.study import html
from equimorph.study.question import Figure, Kind, Question, still
from equimorph.tasks.robustness.derivatives import Sensitivity, sensitivity


class SensitivityKind(Kind[Sensitivity]):
    """How descriptors change with parameters."""

    table = "sensitivity"
    tasks = (sensitivity,)
    names = MappingProxyType({"names": "parameters"})
    own = MappingProxyType({"descriptors": (Annotated[list[str], Field(min_length=1)], ...)})

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Sensitivity
    ) -> list[Figure]:
        """Bars, where they are few enough to be read."""
        draw = partial(plotting.sensitivities, question.structure, answer)
        caption = "Changes of the descriptors for one scale of each parameter."
        few = len(answer.names) * len(answer.descriptors) <= MOST_BARS
        return [still(question.files, draw, caption)] if few else []

    def words(self, question: Question, answer: Sensitivity) -> str:
        """Name the largest change."""
        scales = {each.name: each.scale for each in question.structure.parameters}
        lines = []
        for each in answer.descriptors:
            name = max(answer.names, key=lambda one: abs(answer[each, one]) * scales[one])
            lines.append(f"d {each}/d {name} = {html.number(answer[each, name], 6)}")
        return f"largest are {', '.join(lines)}."

    def details(self, question: Question, answer: Sensitivity) -> list[str]:
        """A table: one row for each parameter."""
        rows = [
            [escape(name), *(html.number(answer[each, name], 6) for each in answer.descriptors)]
            for name in answer.names
        ]
        return [html.table(["", *(f"d {escape(each)}" for each in answer.descriptors)], rows)]
