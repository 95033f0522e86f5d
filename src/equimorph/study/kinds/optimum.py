"""Optimisation: ``[[optimum]]``, and under imperfections ``[[robust_optimum]]``."""

from collections.abc import Mapping

import numpy as np

from equimorph.manifold import EquilibriumSet
from equimorph.model import Schedule
from equimorph.structures import States, join_states
from equimorph.study import html
from equimorph.study.answers import figures_of_states, free_columns, place_of, table_of_states
from equimorph.study.question import Figure, Kind, Question
from equimorph.tasks.optimising.optimum import Optima, optimise
from equimorph.tasks.optimising.robust import RobustOptimum, robust_optimum

ROUNDING = 1e-12
"""Price that is shown as zero."""


class OptimumKind(Kind[Optima]):
    """The stable states at which an objective is least or largest."""

    table = "optimum"
    tasks = (optimise,)

    def schedules(self, question: Question, answer: Optima) -> Mapping[str, Schedule]:
        """Return that which leads to the best one."""
        return super().schedules(question, answer) if answer.found else {}

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Optima
    ) -> list[Figure]:
        """Where they lie."""
        return figures_of_states(question, eset, answer.states) if answer.found else []

    def words(self, question: Question, answer: Optima) -> str:
        """Name the best one."""
        best = answer.best
        value = f"{question['objective'].name} = {html.number(best.value, 6)}"
        where = place_of(best.state, question.free)
        return f"**found**: {value} at {where} ({best.certificate.kind})."

    def details(self, question: Question, answer: Optima) -> list[str]:
        """A table of the optima, best first, with the certificate of each."""
        if not answer.found:
            return []
        certificates = [each.certificate for each in answer.all]
        shown = [question["objective"]]
        more = free_columns(answer.states, question.free, shown)
        more["where"] = [", ".join([each.kind, *each.active]) for each in certificates]
        more["KKT"] = [f"{each.residual:.0e}" for each in certificates]
        return table_of_states(answer.states, shown, more)


class RobustOptimumKind(Kind[RobustOptimum]):
    """The stable state that is best in the worst case over a box of imperfections."""

    table = "robust_optimum"
    tasks = (robust_optimum,)

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: RobustOptimum
    ) -> list[Figure]:
        """Where the nominal and the robust optimum lie."""
        return figures_of_states(question, eset, _both_optima(answer)) if answer.found else []

    def words(self, question: Question, answer: RobustOptimum) -> str:
        """What is guaranteed, and its price."""
        return f"**found**. {_price_in_words(question, answer)}"

    def details(self, question: Question, answer: RobustOptimum) -> list[str]:
        """Both optima in a table."""
        if not answer.found:
            return []
        shown, states = [question["objective"]], _both_optima(answer)
        more = {"": ["nominal optimum", "robust optimum"]}
        more |= free_columns(states, question.free, shown)
        more["worst case"] = [_value(each) for each in (answer.at_risk, answer.guaranteed)]
        return table_of_states(states, shown, more)


def _both_optima(answer: RobustOptimum) -> States:
    """The nominal and the robust optimum."""
    assert answer.nominal is not None
    assert answer.state is not None
    return join_states(answer.state.structure, (answer.nominal.state, answer.state))


def _value(value: float) -> str:
    return html.number(value, 6) if np.isfinite(value) else "stability is lost"


def _price_in_words(question: Question, answer: RobustOptimum) -> str:
    name = question["objective"].name
    assert answer.state is not None
    assert answer.nominal is not None
    errors = ", ".join(f"{each} ± {size:g}" for each, size in answer.offsets.items())
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
        f"With errors {errors} {risk}. At {place_of(answer.state, question.free)} {name} is "
        f"{html.number(answer.guaranteed, 6)} in the worst case, and "
        f"{html.number(answer.value, 6)} without errors: its price is "
        f"{html.number(answer.price if answer.price > ROUNDING else 0.0)}.{edge}"
    )
