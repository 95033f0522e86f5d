"""Tracking: ``[[track]]``."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np

from equimorph.manifold import EquilibriumSet
from equimorph.storage import write_schedule
from equimorph.study import html
from equimorph.study.answers import as_route, figures_of_way, heading, pictures_of_way
from equimorph.study.names import schedule_table
from equimorph.study.question import Figure, Kind, Question
from equimorph.tasks import Tracking, track

MOST_ROWS = 8
"""Compromises that a page shows."""


class TrackKind(Kind[Tracking]):
    """Actuators that lead descriptors along given targets while loads move."""

    table = "track"
    tasks = (track,)
    within_set = True

    def write_tables(self, question: Question, answer: Tracking, folder: Path) -> None:
        """Write the schedule."""
        if answer.schedule is not None:
            write_schedule(answer.schedule, folder / schedule_table(question.files))

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Tracking
    ) -> Sequence[Figure]:
        """As for a route."""
        return figures_of_way(eset, question.files, as_route(answer, answer.status))

    def report(self, question: Question, answer: Tracking, folder: Path) -> list[str]:
        """Verdict, schedule and figures."""
        head = heading(question)
        pictures = pictures_of_way(folder, question.files, "motion")
        if not answer.arrived:
            refused = html.refusal_line(self.refusal(question, answer))
            return [head, refused, *_compromise(answer), pictures]
        turn = answer.holonomy
        back = ""
        if turn is not None:
            change = max((abs(value) for value in turn.values()), default=0.0)
            back = f" The targets close; the actuators come back within {change:.0e}."
        return [
            head,
            '<p class="verdict"><strong>Arrived.</strong> Every state on the way is stable: '
            f"smallest margin {html.number(answer.margin)}.{back}</p>",
            html.schedule_links(schedule_table(question.files)),
            pictures,
        ]

    def refusal(self, question: Question, answer: Tracking) -> str:
        """Reason why it cannot be followed further, and where."""
        legs = f"{html.number(answer.last_good)} of {len(question['targets'])} legs"
        return "" if answer.arrived else f"After {legs}: {answer.why}"

    def verdict(self, question: Question, answer: Tracking) -> str:
        """Say how near to instability it leads."""
        return f"{question.title}: [bold green]arrived[/], smallest margin {answer.margin:.3f}."


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
