"""State estimation: ``[[estimate]]``."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

from rich.markup import escape as plain

from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.study import html
from equimorph.study.answers import figures_of_states, free_columns, heading, report_of_states
from equimorph.study.question import Figure, Kind, Question
from equimorph.tasks import StateEstimate, estimate_state


class EstimateKind(Kind[StateEstimate]):
    """On which branch, and under which load, a measured structure is."""

    table = "estimate"
    tasks = (estimate_state,)

    def look_up_more(self, question: Question) -> None:
        """Every measured value needs its error."""
        section = question.section
        if set(section.measured) != set(section.errors):
            raise InputError(
                f"`{question.key}.errors` must give the standard error of each value of `measured` "
                f"({', '.join(section.measured)}); got {', '.join(section.errors)}."
            )

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: StateEstimate
    ) -> Sequence[Figure]:
        """Where the candidates lie."""
        return figures_of_states(question, eset, answer.states)

    def report(self, question: Question, answer: StateEstimate, folder: Path) -> list[str]:
        """A table of the candidates."""
        words = {
            "known": '<p class="verdict"><strong>Known.</strong></p>',
            "ambiguous": f"<p><strong>Ambiguous.</strong> {escape(answer.why)}</p>",
            "refused": html.refusal_line(answer.why),
        }[answer.status]
        shown = list(question["measured"])
        more = free_columns(answer.states, question.free, shown)
        for free, error in answer.standard_errors.items():
            more[f"± {free}"] = [html.number(value, 2) for value in error]
        more["χ²"] = [html.number(value) for value in answer.chi2]
        more["weight"] = [html.number(value) for value in answer.weight]
        table = report_of_states(question, folder, answer.states, shown, more)
        return [heading(question), words, *table]

    def verdict(self, question: Question, answer: StateEstimate) -> str:
        """Name the best candidate."""
        head = f"{question.title}"
        where = ", ".join(
            f"{name} = {html.number(answer.state[name], 6)}" for name in question.free
        )
        colour = "green" if answer.known else "yellow"
        best = f"{where} with weight {html.number(answer.weight[0])}. {plain(answer.why)}"
        return f"{head}: [bold {colour}]{answer.status}[/], {best}".rstrip()
