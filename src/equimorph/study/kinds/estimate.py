"""State estimation: ``[[estimate]]``."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from rich.markup import escape as plain

from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor, Progress
from equimorph.study import html
from equimorph.study.kinds.found import (
    figures_of_states,
    free_columns,
    heading,
    report_of_states,
)
from equimorph.study.kinds.kind import Figure, Kind
from equimorph.study.lookup import Ground, at_key, descriptors_of
from equimorph.study.sections.tasks import EstimateSection
from equimorph.tasks import StateEstimate, estimate_state


@dataclass(frozen=True)
class EstimateTask:
    """What was measured, with the names looked up."""

    key: str
    section: EstimateSection
    free: tuple[str, ...]
    measured: Mapping[Descriptor, float]
    errors: Mapping[Descriptor, float]


class EstimateKind(Kind[EstimateSection, EstimateTask, StateEstimate]):
    """On which branch, and under which load, a measured structure is."""

    table = "estimate"

    def prepared(self, ground: Ground, section: EstimateSection, key: str) -> EstimateTask:
        """Look up what was measured; every value needs its error."""
        if set(section.measured) != set(section.errors):
            raise InputError(
                f"`{key}.errors` must give the standard error of each value of `measured` "
                f"({', '.join(section.measured)}); got {', '.join(section.errors)}."
            )
        measured = descriptors_of(ground.structure, section.measured, f"{key}.measured")
        errors = descriptors_of(ground.structure, section.errors, f"{key}.errors")
        return EstimateTask(key, section, ground.box.names, measured, errors)

    def answer(
        self, ground: Ground, eset: EquilibriumSet | None, task: EstimateTask, sink: Progress
    ) -> StateEstimate:
        """Fit the set to what was measured."""
        assert eset is not None
        with at_key(task.key):
            return estimate_state(
                eset,
                dict(task.measured.items()),
                dict(task.errors.items()),
                confidence=task.section.confidence,
            )

    def figures(
        self, ground: Ground, eset: EquilibriumSet | None, task: EstimateTask, answer: StateEstimate
    ) -> Sequence[Figure]:
        """Where the candidates lie."""
        return figures_of_states(eset, self.table, task.section.name, answer.states)

    def report(self, task: EstimateTask, answer: StateEstimate, folder: Path) -> list[str]:
        """A table of the candidates."""
        name = task.section.name
        words = {
            "known": '<p class="verdict"><strong>Known.</strong></p>',
            "ambiguous": f"<p><strong>Ambiguous.</strong> {escape(answer.why)}</p>",
            "refused": html.refused(answer.why),
        }[answer.status]
        shown = list(task.measured)
        more = free_columns(answer.states, task.free, shown)
        for free, error in answer.standard_errors.items():
            more[f"± {free}"] = [html.number(value, 2) for value in error]
        more["χ²"] = [html.number(value) for value in answer.chi2]
        more["weight"] = [html.number(value) for value in answer.weight]
        table = report_of_states(folder, self.table, name, answer.states, shown, more)
        return [heading(self.table, name), words, *table]

    def verdict(self, task: EstimateTask, answer: StateEstimate) -> str:
        """Name the best candidate."""
        head = f"Estimate {task.section.name}"
        if answer.status == "refused":
            return f"{head}: [bold red]refused[/]. {plain(answer.why)}"
        where = ", ".join(f"{name} = {html.number(answer.state[name], 6)}" for name in task.free)
        colour = "green" if answer.known else "yellow"
        best = f"{where} with weight {html.number(answer.weight[0])}. {plain(answer.why)}"
        return f"{head}: [bold {colour}]{answer.status}[/], {best}".rstrip()
