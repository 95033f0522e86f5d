"""Inverse kinematics: ``[[shape]]``."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

from equimorph.manifold import EquilibriumSet
from equimorph.study import html
from equimorph.study.answers import figures_of_states, free_columns, heading, report_of_states
from equimorph.study.question import Figure, Kind, Question
from equimorph.tasks import Shapes, solve_shape


class ShapeKind(Kind[Shapes]):
    """All settings at which the structure takes a shape."""

    table = "shape"
    tasks = (solve_shape,)

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Shapes
    ) -> Sequence[Figure]:
        """Where they lie."""
        return figures_of_states(question, eset, answer.states)

    def report(self, question: Question, answer: Shapes, folder: Path) -> list[str]:
        """A table of them, with the way to each."""
        if not len(answer):
            return [heading(question), html.refusal_line(answer.why)]
        words = [] if answer.solved else [f"<p><strong>Fitted.</strong> {escape(answer.why)}</p>"]
        shown = list(question["targets"])
        more = free_columns(answer.states, question.free, shown)
        if answer.routes:
            more["route"] = [
                f"length {html.number(route.length)}" if route.arrived else route.why
                for route in answer.routes
            ]
        table = report_of_states(question, folder, answer.states, shown, more)
        return [heading(question), *words, *table]

    def refusal(self, question: Question, answer: Shapes) -> str:
        """Reason why there is none."""
        del question
        return "" if len(answer) else answer.why

    def verdict(self, question: Question, answer: Shapes) -> str:
        """How many there are."""
        head = f"{question.title}"
        stable = len(answer.stable)
        states = f"{len(answer)} states, {stable} of them stable"
        if len(answer) == 1:
            states = f"1 {'stable' if stable else 'unstable'} state"
        return f"{head}: [bold green]{answer.status}[/] by {states}."
