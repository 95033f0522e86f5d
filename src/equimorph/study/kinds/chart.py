"""Internal parameterisations: ``[[chart]]``, and ``[[reduction]]`` to one state over each point."""

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from html import escape
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal

from pydantic import Field
from rich.markup import escape as plain

from equimorph import plotting
from equimorph.charts import Atlas, Chart, DescriptorChart, Projection, Reduction, dissect, reduce
from equimorph.manifold import EquilibriumSet, part
from equimorph.study import html
from equimorph.study.answers import heading
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
            raise requirement('give coordinates to a chart of the kind "descriptors", only there')

    def answer(self, question: Question, arguments: Arguments) -> Chart | Atlas:
        """Parameterise the stable part of the set, or all of it."""
        eset, make = arguments.eset, MAKERS[question.section.kind]
        if question.section.stable:
            arguments["eset"] = part(eset, eset.cell_index == 0)
        chart: Chart | Atlas = make(**arguments.of(make))
        return chart

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Chart | Atlas
    ) -> Sequence[Figure]:
        """Return the part of the set that is covered above, the domains of the charts below."""
        if len(answer.coordinates.names) != 2:
            return []
        draw = partial(plotting.parameterisation, [answer], question.ground.height)
        return [still(question.files, draw)]

    def report(self, question: Question, answer: Chart | Atlas, folder: Path) -> list[str]:
        """Where it fails: overlaps of a chart, or transitions of an atlas."""
        caption = "Above, the part of the set that is covered; below, the domain of each chart."
        return [
            heading(question),
            f"<p>{escape(_chart_in_words(answer))}</p>",
            html.pictures(folder, {f"{question.files}.png": caption}, {}),
            *([] if isinstance(answer, Atlas) else _overlaps(answer)),
        ]

    def verdict(self, question: Question, answer: Chart | Atlas) -> str:
        """Whether it is single-valued, or how many charts there are."""
        return f"{question.title}: {plain(_chart_in_words(answer))}"


def _chart_in_words(chart: Chart | Atlas) -> str:
    names = ", ".join(chart.coordinates.names)
    if isinstance(chart, Atlas):
        kinds = Counter(each.kind for each in chart.transitions)
        number = "1 chart" if len(chart) == 1 else f"{len(chart)} charts"
        joined = ", ".join(f"{count} of kind {kind}" for kind, count in sorted(kinds.items()))
        return f"{number} over {names}; transitions: {joined or 'none'}."
    if chart.single_valued:
        return f"({names}) are coordinates: one state over each point."
    return f"({names}) are not single-valued: several states lie over some points."


def _overlaps(chart: Chart) -> list[str]:
    if not chart.overlaps:
        return []
    rows = [
        [escape(each.kind), ", ".join(map(str, each.sheets)), html.number(each.domain.size)]
        for each in chart.overlaps
    ]
    return [html.table(["overlap", "sheets", "size"], rows)]


class ReductionKind(Kind[Reduction]):
    """A set reduced to at most one preferred state over each point, with barriers and gaps."""

    table = "reduction"
    tasks = (reduce,)

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Reduction
    ) -> Sequence[Figure]:
        """Return the preferred part of the set above, its domain with barriers and gaps below."""
        if len(answer.names) != 2:
            return []
        draw = partial(plotting.parameterisation, [answer], question.ground.height)
        return [still(question.files, draw)]

    def report(self, question: Question, answer: Reduction, folder: Path) -> list[str]:
        """Barriers with their jumps, and gaps."""
        caption = "Above, the preferred part of the set; below, its domain with barriers and gaps."
        rows = [
            [escape(each.kind), *(html.number(jump) for jump in (each.jump.min(), each.jump.max()))]
            for each in answer.barriers
        ]
        head = ["barrier", "least jump", "largest jump"]
        return [
            heading(question),
            f"<p>{escape(_reduction_in_words(answer))}</p>",
            html.pictures(folder, {f"{question.files}.png": caption}, {}),
            *([html.table(head, rows)] if rows else []),
        ]

    def verdict(self, question: Question, answer: Reduction) -> str:
        """How many barriers and gaps there are."""
        return f"{question.title}: {plain(_reduction_in_words(answer))}"


def _reduction_in_words(found: Reduction) -> str:
    barriers = len(found.barriers)
    count = {0: "no barriers", 1: "1 barrier"}.get(barriers, f"{barriers} barriers")
    size = found.gaps.size
    gaps = f"gaps of size {html.number(size)}" if size > 0.0 else "no gaps"
    lost = f" {found.lost} edges end where no end was found." if found.lost else ""
    return f"{found.rule}: {count}, {gaps}.{lost}"
