"""Derivatives of descriptors: ``[[sensitivity]]``."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from pathlib import Path

from rich.markup import escape as plain

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor, Progress
from equimorph.plotting.robustness import MOST_BARS
from equimorph.structures import Structure
from equimorph.study import html
from equimorph.study.choose import choose_state
from equimorph.study.kinds.found import heading
from equimorph.study.kinds.kind import Figure, Kind, still
from equimorph.study.lookup import Ground, at_key, check_parameters, check_state, descriptor_at
from equimorph.study.names import task_files
from equimorph.study.sections.robustness import SensitivitySection
from equimorph.tasks import Sensitivity, sensitivity


@dataclass(frozen=True)
class SensitivityTask:
    """Derivatives that are wanted, with their names looked up."""

    key: str
    section: SensitivitySection
    structure: Structure
    descriptors: tuple[Descriptor, ...]


class SensitivityKind(Kind[SensitivitySection, SensitivityTask, Sensitivity]):
    """How descriptors change with parameters."""

    table = "sensitivity"

    def prepared(self, ground: Ground, section: SensitivitySection, key: str) -> SensitivityTask:
        """Look up state, descriptors and parameters."""
        check_state(ground, section.state, f"{key}.state")
        check_parameters(ground.structure, section.parameters or (), f"{key}.parameters")
        descriptors = tuple(
            descriptor_at(ground.structure, text, f"{key}.descriptors[{i}]")
            for i, text in enumerate(section.descriptors)
        )
        return SensitivityTask(key, section, ground.structure, descriptors)

    def answer(
        self, ground: Ground, eset: EquilibriumSet | None, task: SensitivityTask, sink: Progress
    ) -> Sensitivity:
        """Differentiate."""
        assert eset is not None
        state = choose_state(eset, task.section.state, f"{task.key}.state")
        with at_key(task.key):
            return sensitivity(state, task.descriptors, task.section.parameters)

    def figures(
        self,
        ground: Ground,
        eset: EquilibriumSet | None,
        task: SensitivityTask,
        answer: Sensitivity,
    ) -> Sequence[Figure]:
        """Bars, where they are few enough to be read."""
        if len(answer.names) * len(answer.descriptors) > MOST_BARS:
            return []
        draw = partial(plotting.sensitivities, ground.structure, answer)
        return [still(task_files(self.table, task.section.name), draw)]

    def report(self, task: SensitivityTask, answer: Sensitivity, folder: Path) -> list[str]:
        """A table: one row for each parameter."""
        files = task_files(self.table, task.section.name)
        rows = [
            [escape(name), *(html.number(answer[each, name], 6) for each in answer.descriptors)]
            for name in answer.names
        ]
        head = ["", *(f"d {escape(each)}" for each in answer.descriptors)]
        caption = "Changes of the descriptors for one scale of each parameter."
        return [
            heading(self.table, task.section.name),
            html.table(head, rows),
            html.pictures(folder, {}, {f"{files}.png": caption}),
        ]

    def verdict(self, task: SensitivityTask, answer: Sensitivity) -> str:
        """Name the largest change."""
        scales = {each.name: each.scale for each in task.structure.parameters}
        lines = []
        for each in answer.descriptors:
            name = max(answer.names, key=lambda one: abs(answer[each, one]) * scales[one])
            lines.append(f"d {plain(each)}/d {name} = {html.number(answer[each, name], 6)}")
        return f"Sensitivity {task.section.name}: largest are {', '.join(lines)}."
