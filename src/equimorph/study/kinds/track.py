"""Tracking: ``[[track]]``."""

from html import escape

import numpy as np

from equimorph.manifold import EquilibriumSet
from equimorph.study import html
from equimorph.study.answers import as_route, figures_of_way
from equimorph.study.question import Figure, Kind, Question
from equimorph.tasks.motion.tracking import Tracking, track

MOST_ROWS = 8
"""Compromises that a page shows."""


class TrackKind(Kind[Tracking]):
    """Actuators that lead descriptors along given targets while loads move."""

    table = "track"
    tasks = (track,)
    within_set = True

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Tracking
    ) -> list[Figure]:
        """As for a route."""
        return figures_of_way(eset, question.files, as_route(answer, answer.status), "motion")

    def words(self, question: Question, answer: Tracking) -> str:
        """Say how near to instability it leads, and whether the actuators come back."""
        turn, back = answer.holonomy, ""
        if turn is not None:
            change = max((abs(value) for value in turn.values()), default=0.0)
            back = f" The targets close; the actuators come back within {change:.0e}."
        margin = html.number(answer.margin)
        return f"**arrived** on stable states alone, smallest margin {margin}.{back}"

    def details(self, question: Question, answer: Tracking) -> list[str]:
        """What comes nearest to the targets after a failure."""
        return _compromise(answer)

    def refusal(self, question: Question, answer: Tracking) -> str:
        """Reason why it cannot be followed further, and where."""
        legs = f"{html.number(answer.last_good)} of {len(question['targets'])} legs"
        return "" if answer.arrived else f"After {legs}: {answer.why}"


def _compromise(answer: Tracking) -> list[str]:
    """What comes nearest to the targets after the failure, step by step."""
    found = answer.compromise
    if found is None:
        return []
    words = "The states nearest to the targets, by the sum of squares of what is missed:"
    misses = np.sqrt(2.0 * np.maximum(found.values, 0.0))
    shown = np.unique(np.linspace(0, len(found.states) - 1, MOST_ROWS).round().astype(int))
    names = list(answer.actuators)
    rows = [
        [html.number(found.at[k], 4), html.number(misses[k], 3)]
        + [html.number(found.states[k][name], 6) for name in names]
        for k in shown
    ]
    head = ["leg", "miss", *map(escape, names)]
    return [f"<p>{words}</p>", html.table(head, rows)]
