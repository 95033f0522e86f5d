"""Optimisation: ``[[optimum]]``."""

from collections.abc import Sequence
from pathlib import Path

from rich.markup import escape as plain

from equimorph.manifold import EquilibriumSet
from equimorph.storage import write_schedule
from equimorph.study import html
from equimorph.study.answers import figures_of_states, free_columns, heading, report_of_states
from equimorph.study.names import schedule_table
from equimorph.study.question import Figure, Kind, Question
from equimorph.tasks import Optima, optimise


class OptimumKind(Kind[Optima]):
    """The stable states at which an objective is least or largest."""

    table = "optimum"
    tasks = (optimise,)

    def write_tables(self, question: Question, answer: Optima, folder: Path) -> None:
        """Write the schedule that leads to the best one."""
        if answer.found and answer.schedule is not None:
            write_schedule(answer.schedule, folder / self._table(question))

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Optima
    ) -> Sequence[Figure]:
        """Where they lie."""
        if not answer.found:
            return []
        return figures_of_states(question, eset, answer.states)

    def report(self, question: Question, answer: Optima, folder: Path) -> list[str]:
        """A table of the optima, best first, with the certificate of each."""
        if not answer.found:
            return [heading(question), html.refusal_line(answer.why)]
        certificates = [each.certificate for each in answer.all]
        shown = [question["objective"]]
        more = free_columns(answer.states, question.free, shown)
        more["where"] = [", ".join([each.kind, *each.active]) for each in certificates]
        more["KKT"] = [f"{each.residual:.0e}" for each in certificates]
        table = report_of_states(question, folder, answer.states, shown, more)
        links = [html.schedule_links(self._table(question))] if answer.schedule is not None else []
        return [heading(question), *links, *table]

    def verdict(self, question: Question, answer: Optima) -> str:
        """Name the best one."""
        head = f"{question.title}"
        if not answer.found:
            return f"{head}: [bold red]refused[/]. {plain(answer.why)}"
        best = answer.best
        where = ", ".join(f"{name} = {html.number(best.state[name], 6)}" for name in question.free)
        value = f"{plain(question['objective'].name)} = {html.number(best.value, 6)}"
        return f"{head}: [bold green]found[/], {value} at {where} ({best.certificate.kind})."

    def _table(self, question: Question) -> str:
        return schedule_table(question.files)
