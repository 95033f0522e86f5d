"""Schedules executed by imperfect structures: ``[[trials]]``."""

from collections import Counter
from collections.abc import Sequence
from functools import partial
from html import escape
from pathlib import Path

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.model import Progress
from equimorph.study import html
from equimorph.study.kinds.found import heading
from equimorph.study.kinds.given import GivenWay, given_way
from equimorph.study.kinds.kind import Figure, Kind, still
from equimorph.study.lookup import Ground, at_key, check_parameters
from equimorph.study.names import task_files
from equimorph.study.sections.ways import TrialsSection
from equimorph.tasks import Trials, random_trials


class TrialsKind(Kind[TrialsSection, GivenWay, Trials]):
    """What becomes of a schedule under random imperfections."""

    table = "trials"

    def prepared(self, ground: Ground, section: TrialsSection, key: str) -> GivenWay:
        """Look up the way and the parameters that are off."""
        check_parameters(ground.structure, section.spreads, f"{key}.spreads")
        return given_way(ground, section, key)

    def answer(
        self, ground: Ground, eset: EquilibriumSet | None, task: GivenWay, sink: Progress
    ) -> Trials:
        """Execute it many times."""
        section = task.section
        assert isinstance(section, TrialsSection)
        start = task.start(ground, eset)
        with at_key(task.key):
            return random_trials(
                start,
                task.schedule,
                section.spreads,
                trials=section.trials,
                within=task.bounds(eset),
                seed=section.seed,
            )

    def figures(
        self, ground: Ground, eset: EquilibriumSet | None, task: GivenWay, answer: Trials
    ) -> Sequence[Figure]:
        """Return the trials by their offsets."""
        draw = partial(plotting.trials, ground.structure, answer)
        return [still(task_files(self.table, task.section.name), draw)]

    def report(self, task: GivenWay, answer: Trials, folder: Path) -> list[str]:
        """Share that arrived, and how the others ended."""
        files = task_files(self.table, task.section.name)
        counts = Counter(answer.kind.tolist())
        rows = [[escape(kind), str(count)] for kind, count in counts.most_common()]
        caption = "Each trial by how far the parameters were off."
        return [
            heading(self.table, task.section.name),
            f"<p>{escape(_share(answer))}</p>",
            html.table(["ended at", "trials"], rows),
            html.pictures(folder, {}, {f"{files}.png": caption}),
        ]

    def verdict(self, task: GivenWay, answer: Trials) -> str:
        """Return the share that arrived."""
        return f"Trials {task.section.name}: {_share(answer)}"


def _share(trials: Trials) -> str:
    low, high = trials.interval
    return (
        f"{int(trials.arrived.sum())} of {len(trials.kind)} arrived; with 95 % confidence the "
        f"probability lies between {html.number(low, 3)} and {html.number(high, 3)}."
    )
