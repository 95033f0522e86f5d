"""Optima under imperfections: ``[[robust_optimum]]``."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np
from rich.markup import escape as plain

from equimorph.manifold import EquilibriumSet
from equimorph.structures import States
from equimorph.study import html
from equimorph.study.answers import figures_of_states, free_columns, heading, report_of_states
from equimorph.study.question import Figure, Kind, Question
from equimorph.tasks import RobustOptimum, robust_optimum

ROUNDING = 1e-12
"""Price that is shown as zero."""


class RobustOptimumKind(Kind[RobustOptimum]):
    """The stable state that is best in the worst case over a box of imperfections."""

    table = "robust_optimum"
    tasks = (robust_optimum,)

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: RobustOptimum
    ) -> Sequence[Figure]:
        """Where the nominal and the robust optimum lie."""
        return figures_of_states(question, eset, _states(answer)) if answer.found else []

    def report(self, question: Question, answer: RobustOptimum, folder: Path) -> list[str]:
        """What is guaranteed and its price, and both optima in a table."""
        if not answer.found:
            return [heading(question), html.refusal_line(answer.why)]
        shown = [question["objective"]]
        states = _states(answer)
        more = {"": ["nominal optimum", "robust optimum"]}
        more |= free_columns(states, question.free, shown)
        worst = (answer.at_risk, answer.guaranteed)
        more["worst case"] = [_value(each) for each in worst]
        words = f"<p>{escape(_in_words(question, answer))}</p>"
        return [heading(question), words, *report_of_states(question, folder, states, shown, more)]

    def verdict(self, question: Question, answer: RobustOptimum) -> str:
        """What is guaranteed, and its price."""
        if not answer.found:
            return f"{question.title}: [bold red]refused[/]. {plain(answer.why)}"
        return f"{question.title}: [bold green]found[/]. {plain(_in_words(question, answer))}"


def _states(answer: RobustOptimum) -> States:
    """The nominal and the robust optimum."""
    assert answer.nominal is not None
    assert answer.state is not None
    both = (answer.nominal.state, answer.state)
    z, p = (np.stack([getattr(each, name) for each in both]) for name in "zp")
    return States(answer.state.structure, z, p)


def _value(value: float) -> str:
    return html.number(value, 6) if np.isfinite(value) else "stability is lost"


def _in_words(question: Question, answer: RobustOptimum) -> str:
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
