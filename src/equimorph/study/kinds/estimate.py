"""State estimation: ``[[estimate]]``."""

from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.study import html
from equimorph.study.answers import figures_of_states, free_columns, place_of, table_of_states
from equimorph.study.question import Figure, Kind, Question
from equimorph.tasks.estimation import StateEstimate, estimate_state


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
    ) -> list[Figure]:
        """Where the candidates lie."""
        return figures_of_states(question, eset, answer.states)

    def words(self, question: Question, answer: StateEstimate) -> str:
        """Name the best candidate."""
        where, weight = place_of(answer.state, question.free), html.number(answer.weight[0])
        return f"**{answer.status}**: {where} with weight {weight}. {answer.why}".rstrip()

    def details(self, question: Question, answer: StateEstimate) -> list[str]:
        """A table of the candidates."""
        shown = list(question["measured"])
        more = free_columns(answer.states, question.free, shown)
        for free, error in answer.standard_errors.items():
            more[f"± {free}"] = [html.number(value, 2) for value in error]
        more["χ²"] = [html.number(value) for value in answer.chi2]
        more["weight"] = [html.number(value) for value in answer.weight]
        return table_of_states(answer.states, shown, more) if len(answer.states) else []
