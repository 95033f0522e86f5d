"""Optimisation: ``[[optimum]]``, and under imperfections ``[[robust_optimum]]``."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np
from rich.markup import escape as plain

from equimorph.manifold import EquilibriumSet
from equimorph.storage import write_schedule
from equimorph.structures import States
from equimorph.study import html
from equimorph.study.answers import figures_of_states, free_columns, heading, report_of_states
from equimorph.study.names import schedule_table
from equimorph.study.question import Figure, Kind, Question
from equimorph.tasks import Optima, RobustOptimum, optimise, robust_optimum

ROUNDING = 1e-12
"""Price that is shown as zero."""


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
        best = answer.best
        where = ", ".join(f"{name} = {html.number(best.state[name], 6)}" for name in question.free)
        value = f"{plain(question['objective'].name)} = {html.number(best.value, 6)}"
        return f"{head}: [bold green]found[/], {value} at {where} ({best.certificate.kind})."

    def _table(self, question: Question) -> str:
        return schedule_table(question.files)


class RobustOptimumKind(Kind[RobustOptimum]):
    """The stable state that is best in the worst case over a box of imperfections."""

    table = "robust_optimum"
    tasks = (robust_optimum,)

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: RobustOptimum
    ) -> Sequence[Figure]:
        """Where the nominal and the robust optimum lie."""
        return figures_of_states(question, eset, _both_optima(answer)) if answer.found else []

    def report(self, question: Question, answer: RobustOptimum, folder: Path) -> list[str]:
        """What is guaranteed and its price, and both optima in a table."""
        if not answer.found:
            return [heading(question), html.refusal_line(answer.why)]
        shown = [question["objective"]]
        states = _both_optima(answer)
        more = {"": ["nominal optimum", "robust optimum"]}
        more |= free_columns(states, question.free, shown)
        worst = (answer.at_risk, answer.guaranteed)
        more["worst case"] = [_value(each) for each in worst]
        words = f"<p>{escape(_price_in_words(question, answer))}</p>"
        return [heading(question), words, *report_of_states(question, folder, states, shown, more)]

    def verdict(self, question: Question, answer: RobustOptimum) -> str:
        """What is guaranteed, and its price."""
        return f"{question.title}: [bold green]found[/]. {plain(_price_in_words(question, answer))}"


def _both_optima(answer: RobustOptimum) -> States:
    """The nominal and the robust optimum."""
    assert answer.nominal is not None
    assert answer.state is not None
    both = (answer.nominal.state, answer.state)
    z, p = (np.stack([getattr(each, name) for each in both]) for name in "zp")
    return States(answer.state.structure, z, p)


def _value(value: float) -> str:
    return html.number(value, 6) if np.isfinite(value) else "stability is lost"


def _price_in_words(question: Question, answer: RobustOptimum) -> str:
    name = question["objective"].name
    assert answer.state is not None
    assert answer.nominal is not None
    errors = ", ".join(f"{each} ± {size:g}" for each, size in answer.offsets.items())
    place = ", ".join(f"{each} = {html.number(answer.state[each], 6)}" for each in question.free)
    risk = (
        f"the worst value of the nominal optimum is {html.number(answer.at_risk, 6)}"
        if np.isfinite(answer.at_risk)
        else "the nominal optimum may lose its stability"
    )
    edge = ""
    if answer.edge:
        corner = ", ".join(f"{each} {'+' if x > 0 else '−'}" for each, x in answer.edge.items())
        edge = f" Its box touches the edge of stability at the corner {corner}."
    return (
        f"With errors {errors} {risk}. At {place} {name} is {html.number(answer.guaranteed, 6)} in "
        f"the worst case, and {html.number(answer.value, 6)} without errors: its price is "
        f"{html.number(answer.price if answer.price > ROUNDING else 0.0)}.{edge}"
    )
