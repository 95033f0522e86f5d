"""Internal parameterisations: ``[[chart]]``, and ``[[reduction]]`` to one state over each point."""

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from html import escape
from types import MappingProxyType
from typing import Annotated, Any, Literal

from pydantic import Field

from equimorph import plotting
from equimorph.charts import Atlas, Chart, DescriptorChart, Projection, Reduction, dissect, reduce
from equimorph.manifold import part
from equimorph.study import html
from equimorph.study.answers import count_of
from equimorph.study.fields import requirement
from equimorph.study.question import Arguments, Figure, Kind, Question, still

MAKERS: dict[str, Callable[..., Any]] = {
    "projection": Projection,
    "descriptors": DescriptorChart,
    "atlas": dissect,
}


class ChartKind(Kind[Chart | Atlas]):
    """Coordinates of a set: free parameters, descriptors, or charts that cover it one by one."""

    table = "chart"
    tasks = (Projection, DescriptorChart, dissect)
    names = MappingProxyType({"chosen": "coordinates"})
    own = MappingProxyType(
        {
            "kind": (
                Literal["projection", "descriptors", "atlas"],
                Field(default="projection", description="Coordinates."),
            ),
            "coordinates": (
                Annotated[list[str], Field(min_length=1)] | None,
                Field(
                    default=None,
                    description="Descriptors or parameters, for the kind `descriptors`.",
                ),
            ),
            "stable": (
                bool,
                Field(default=True, description="Whether only stable states are covered."),
            ),
        }
    )

    def check(self, section: Any) -> None:
        """Coordinates belong to charts over descriptors."""
        if (section.kind == "descriptors") != (section.coordinates is not None):
            raise requirement(
                'give coordinates to a chart of the kind "descriptors", and only there'
            )

    def answer(self, question: Question, arguments: Arguments) -> Chart | Atlas:
        """Parameterise the stable part of the set, or all of it."""
        eset, make = arguments.eset, MAKERS[question.section.kind]
        if question.section.stable:
            arguments["eset"] = part(eset, eset.cell_index == 0)
        chart: Chart | Atlas = make(**arguments.of(make))
        return chart

    def figures(self, question: Question, answer: Chart | Atlas) -> list[Figure]:
        """Return the part of the set that is covered above, the domains of the charts below."""
        caption = "Above, the part of the set that is covered; below, the domain of each chart."
        return _draw(question, answer, answer.coordinates.names, caption)

    def words(self, question: Question, answer: Chart | Atlas) -> str:
        """Whether it is single-valued, or how many charts there are."""
        names = ", ".join(answer.coordinates.names)
        if isinstance(answer, Atlas):
            kinds = Counter(each.kind for each in answer.transitions)
            joined = ", ".join(f"{count} of kind {kind}" for kind, count in sorted(kinds.items()))
            charts = count_of(len(answer), "chart")
            return f"{charts} over {names}; transitions: {joined or 'none'}."
        if answer.single_valued:
            return f"({names}) are coordinates: one state over each point."
        return f"({names}) are not single-valued: several states lie over some points."

    def details(self, question: Question, answer: Chart | Atlas) -> list[str]:
        """Where a chart fails: its overlaps."""
        if isinstance(answer, Atlas) or not answer.overlaps:
            return []
        rows = [
            [escape(each.kind), ", ".join(map(str, each.sheets)), html.number(each.domain.size)]
            for each in answer.overlaps
        ]
        return [html.table(["overlap", "sheets", "size"], rows)]


class ReductionKind(Kind[Reduction]):
    """A set reduced to at most one preferred state over each point, with barriers and gaps."""

    table = "reduction"
    tasks = (reduce,)

    def figures(self, question: Question, answer: Reduction) -> list[Figure]:
        """Return the preferred part of the set above, its domain with barriers and gaps below."""
        caption = "Above, the preferred part of the set; below, its domain with barriers and gaps."
        return _draw(question, answer, answer.names, caption)

    def words(self, question: Question, answer: Reduction) -> str:
        """How many barriers and gaps there are."""
        count = count_of(len(answer.barriers), "barrier") if answer.barriers else "no barriers"
        size = answer.gaps.size
        gaps = f"gaps of size {html.number(size)}" if size > 0.0 else "no gaps"
        lost = f" {answer.lost} edges end where no end was found." if answer.lost else ""
        return f"{answer.rule}: {count}, {gaps}.{lost}"

    def details(self, question: Question, answer: Reduction) -> list[str]:
        """Barriers with their jumps."""
        rows = [
            [escape(each.kind), *(html.number(jump) for jump in (each.jump.min(), each.jump.max()))]
            for each in answer.barriers
        ]
        return [html.table(["barrier", "least jump", "largest jump"], rows)] if rows else []


def _draw(
    question: Question, chart: Chart | Atlas, names: Sequence[str], caption: str
) -> list[Figure]:
    """Return the figure of a chart over two coordinates."""
    draw = partial(plotting.parameterisation, [chart], question.ground.height)
    return [still(question.files, draw, caption, wide=True)] if len(names) == 2 else []
