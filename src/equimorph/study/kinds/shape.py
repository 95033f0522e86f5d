"""Inverse kinematics: ``[[shape]]``."""

from equimorph.manifold import EquilibriumSet
from equimorph.study import html
from equimorph.study.answers import figures_of_states, free_columns, table_of_states
from equimorph.study.question import Figure, Kind, Question
from equimorph.tasks.shapes.solutions import Shapes, solve_shape


class ShapeKind(Kind[Shapes]):
    """All settings at which the structure takes a shape."""

    table = "shape"
    tasks = (solve_shape,)

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Shapes
    ) -> list[Figure]:
        """Where they lie."""
        return figures_of_states(question, eset, answer.states)

    def words(self, question: Question, answer: Shapes) -> str:
        """How many there are."""
        stable, fitted = len(answer.stable), "" if answer.solved else f" {answer.why}"
        states = f"{len(answer)} states, {stable} of them stable"
        if len(answer) == 1:
            states = f"1 {'stable' if stable else 'unstable'} state"
        return f"**{answer.status}** by {states}.{fitted}"

    def details(self, question: Question, answer: Shapes) -> list[str]:
        """A table of them, with the way to each."""
        if not len(answer):
            return []
        shown = list(question["targets"])
        more = free_columns(answer.states, question.free, shown)
        if answer.routes:
            more["route"] = [
                f"length {html.number(route.length)}" if route.arrived else route.why
                for route in answer.routes
            ]
        return table_of_states(answer.states, shown, more)

    def refusal(self, question: Question, answer: Shapes) -> str:
        """Reason why there is none."""
        del question
        return "" if len(answer) else answer.why
