"""Schedules executed by imperfect structures: ``[[trials]]``."""

from collections import Counter
from collections.abc import Sequence
from functools import partial
from html import escape
from pathlib import Path

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.study import html
from equimorph.study.answers import heading
from equimorph.study.question import Figure, Kind, Question, still
from equimorph.tasks import Trials, random_trials


class TrialsKind(Kind[Trials]):
    """What becomes of a schedule under random imperfections."""

    table = "trials"
    tasks = (random_trials,)
    within_set = True

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Trials
    ) -> Sequence[Figure]:
        """Return the trials by their offsets."""
        draw = partial(plotting.trials, question.structure, answer)
        return [still(question.files, draw)]

    def report(self, question: Question, answer: Trials, folder: Path) -> list[str]:
        """Share of the trials that arrived, and the ends of the rest."""
        files = question.files
        counts = Counter(answer.kind.tolist())
        rows = [[escape(kind), str(count)] for kind, count in counts.most_common()]
        caption = "Each trial by the errors of the parameters."
        return [
            heading(question),
            f"<p>{escape(_share(answer))}</p>",
            html.table(["ended at", "trials"], rows),
            html.pictures(folder, {}, {f"{files}.png": caption}),
        ]

    def verdict(self, question: Question, answer: Trials) -> str:
        """Return the share that arrived."""
        return f"{question.title}: {_share(answer)}"


def _share(trials: Trials) -> str:
    low, high = trials.interval
    return (
        f"{int(trials.arrived.sum())} of {len(trials.kind)} arrived; with 95 % confidence the "
        f"probability lies between {html.number(low, 3)} and {html.number(high, 3)}."
    )
