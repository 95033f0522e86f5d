"""One preferred state over each point: ``[[reduction]]``."""

from collections.abc import Sequence
from functools import partial
from html import escape
from pathlib import Path

from rich.markup import escape as plain

from equimorph import plotting
from equimorph.charts import Reduction, reduce
from equimorph.manifold import EquilibriumSet
from equimorph.study import html
from equimorph.study.answers import heading
from equimorph.study.question import Figure, Kind, Question, still


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
            f"<p>{escape(_in_words(answer))}</p>",
            html.pictures(folder, {f"{question.files}.png": caption}, {}),
            *([html.table(head, rows)] if rows else []),
        ]

    def verdict(self, question: Question, answer: Reduction) -> str:
        """How many barriers and gaps there are."""
        return f"{question.title}: {plain(_in_words(answer))}"


def _in_words(found: Reduction) -> str:
    barriers = len(found.barriers)
    count = {0: "no barriers", 1: "1 barrier"}.get(barriers, f"{barriers} barriers")
    size = found.gaps.size
    gaps = f"gaps of size {html.number(size)}" if size > 0.0 else "no gaps"
    lost = f" {found.lost} edges end where no end was found." if found.lost else ""
    return f"{found.rule}: {count}, {gaps}.{lost}"
