"""Schedules executed by imperfect structures: ``[[trials]]``."""

from collections import Counter
from functools import partial
from html import escape

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.study import html
from equimorph.study.question import Figure, Kind, Question, still
from equimorph.tasks.robustness.trials import Trials, random_trials


class TrialsKind(Kind[Trials]):
    """What becomes of a schedule under random imperfections."""

    table = "trials"
    tasks = (random_trials,)
    within_set = True

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Trials
    ) -> list[Figure]:
        """Return the trials by their offsets."""
        draw = partial(plotting.trials, question.structure, answer)
        return [still(question.files, draw, "Each trial by the errors of the parameters.")]

    def words(self, question: Question, answer: Trials) -> str:
        """Return the share that arrived."""
        low, high = (html.number(end, 3) for end in answer.interval)
        return (
            f"{int(answer.arrived.sum())} of {len(answer.kind)} arrived; with 95 % confidence the "
            f"probability lies between {low} and {high}."
        )

    def details(self, question: Question, answer: Trials) -> list[str]:
        """How many ended where."""
        counts = Counter(answer.kind.tolist())
        rows = [[escape(kind), str(count)] for kind, count in counts.most_common()]
        return [html.table(["ended at", "trials"], rows)]
