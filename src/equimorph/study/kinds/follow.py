"""Optima that move: ``[[follow]]``."""

from functools import partial
from html import escape
from types import MappingProxyType

import numpy as np

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.study import html
from equimorph.study.question import Figure, Kind, Question, still
from equimorph.tasks.optimising.certificates import Certificate
from equimorph.tasks.optimising.moving_optimum import follow_optimum
from equimorph.tasks.optimising.optimum_path import FollowedOptimum

MOST_ROWS = 12
"""Optima that a page shows."""
ROUNDING = 1e-9
"""Margin on the stability boundary, where it is zero."""


class FollowKind(Kind[FollowedOptimum]):
    """How the best state moves while loads and targets do, and where it jumps."""

    table = "follow"
    tasks = (follow_optimum,)
    names = MappingProxyType({"to": "targets"})
    within_set = True

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: FollowedOptimum
    ) -> list[Figure]:
        """Objective and actuators along the legs."""
        if not len(answer.states):
            return []
        actuators = tuple(question["actuators"])
        draw = partial(plotting.followed, answer, question["objective"], actuators)
        caption = "Objective and actuators along the legs; dotted where the optimum jumps."
        return [still(question.files, draw, caption)]

    def words(self, question: Question, answer: FollowedOptimum) -> str:
        """Both ends, and how often it jumps."""
        first, last = (html.number(answer.values[k], 6) for k in (0, -1))
        jumps = len(answer.jumps)
        often = {0: "does not jump", 1: "jumps once"}.get(jumps, f"jumps {jumps} times")
        name = question["objective"].name
        return f"**arrived**: {name} goes from {first} to {last} and {often}."

    def details(self, question: Question, answer: FollowedOptimum) -> list[str]:
        """Jumps, and optima along the way."""
        if not len(answer.states):
            return []
        return [*_jumps(question, answer), _table(question, answer)]

    def refusal(self, question: Question, answer: FollowedOptimum) -> str:
        """Reason why the optimum could be followed no further, and where."""
        if answer.arrived or not len(answer.at):
            return answer.why
        return f"After {html.number(answer.at[-1])} of {len(question['to'])} legs: {answer.why}."


def _jumps(question: Question, found: FollowedOptimum) -> list[str]:
    """Table of both sides of every jump."""
    if not found.jumps:
        return []
    names = list(question["actuators"])
    rows = [
        [
            html.number(jump.at, 6),
            *(html.number(value, 6) if np.isfinite(value) else "none" for value in jump.values),
            *(
                f"{html.number(jump.before[name], 5)} → "
                f"{'none' if jump.after is None else html.number(jump.after[name], 5)}"
                for name in names
            ),
        ]
        for jump in found.jumps
    ]
    value = escape(question["objective"].name)
    return [html.table(["jump at leg", f"{value} before", "after", *map(escape, names)], rows)]


def _limits(certificate: Certificate) -> list[str]:
    """Active constraints but stability, which the kind of the optimum shows."""
    return [each for each in certificate.active if not each.startswith("stable ")]


def _table(question: Question, found: FollowedOptimum) -> str:
    """Selected optima along the way."""
    names = list(question["actuators"])
    shown = np.unique(np.linspace(0, len(found.states) - 1, MOST_ROWS).round().astype(int))
    states = found.states
    margins = states.margin
    rows = [
        [
            html.number(found.at[k], 4),
            *(html.number(states[name][k], 6) for name in names),
            html.number(found.values[k], 6),
            html.number(margins[k] if abs(margins[k]) > ROUNDING else 0.0),
            escape(", ".join([found.certificates[k].kind, *_limits(found.certificates[k])])),
        ]
        for k in shown.tolist()
    ]
    titles = ["leg", *names, question["objective"].name, "margin", "where"]
    return html.table([escape(title) for title in titles], rows)
