"""Optimisation: ``[[optimum]]``."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.markup import escape as plain

from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Descriptor, Progress
from equimorph.storage import write_schedule
from equimorph.study import html
from equimorph.study.choose import chosen_start
from equimorph.study.kinds.found import (
    figures_of_states,
    free_columns,
    heading,
    report_of_states,
)
from equimorph.study.kinds.kind import Figure, Kind
from equimorph.study.lookup import Ground, at_key, check_state, constraints_of, descriptor_at
from equimorph.study.names import schedule_table, task_files
from equimorph.study.sections.best import OptimumSection
from equimorph.tasks import Optima, optimise


@dataclass(frozen=True)
class OptimumTask:
    """An optimum that is wanted, with its names looked up."""

    key: str
    section: OptimumSection
    free: tuple[str, ...]
    objective: Descriptor
    constraints: tuple[Constraint, ...]


class OptimumKind(Kind[OptimumSection, OptimumTask, Optima]):
    """The stable states at which an objective is least or largest."""

    table = "optimum"

    def prepared(self, ground: Ground, section: OptimumSection, key: str) -> OptimumTask:
        """Look up objective, start and constraints."""
        if section.start is not None:
            check_state(ground, section.start, f"{key}.start")
        objective = descriptor_at(ground.structure, section.objective, f"{key}.objective")
        constraints = constraints_of(ground.structure, section.within, f"{key}.within")
        return OptimumTask(key, section, ground.box.names, objective, constraints)

    def answer(
        self, ground: Ground, eset: EquilibriumSet | None, task: OptimumTask, sink: Progress
    ) -> Optima:
        """Find the local optima."""
        assert eset is not None
        section = task.section
        start = chosen_start(eset, section.start, f"{task.key}.start")
        with at_key(task.key):
            return optimise(
                eset,
                task.objective,
                sense=section.sense,
                within=task.constraints,
                start=start,
                margin=section.margin,
            )

    def write_tables(self, task: OptimumTask, answer: Optima, folder: Path) -> None:
        """Write the schedule that leads to the best one."""
        if answer.found and answer.schedule is not None:
            write_schedule(answer.schedule, folder / self._table(task))

    def figures(
        self, ground: Ground, eset: EquilibriumSet | None, task: OptimumTask, answer: Optima
    ) -> Sequence[Figure]:
        """Where they lie."""
        if not answer.found:
            return []
        return figures_of_states(eset, self.table, task.section.name, answer.states)

    def report(self, task: OptimumTask, answer: Optima, folder: Path) -> list[str]:
        """A table of them, best first, with what makes each an optimum."""
        name = task.section.name
        if not answer.found:
            return [heading(self.table, name), html.refused(answer.why)]
        certificates = [each.certificate for each in answer.all]
        shown = [task.objective]
        more = free_columns(answer.states, task.free, shown)
        more["where"] = [", ".join([each.kind, *each.active]) for each in certificates]
        more["KKT"] = [f"{each.residual:.0e}" for each in certificates]
        table = report_of_states(folder, self.table, name, answer.states, shown, more)
        links = [html.schedule_links(self._table(task))] if answer.schedule is not None else []
        return [heading(self.table, name), *links, *table]

    def verdict(self, task: OptimumTask, answer: Optima) -> str:
        """Name the best one."""
        head = f"Optimum {task.section.name}"
        if not answer.found:
            return f"{head}: [bold red]refused[/]. {plain(answer.why)}"
        best = answer.best
        where = ", ".join(f"{name} = {html.number(best.state[name], 6)}" for name in task.free)
        value = f"{plain(task.objective.name)} = {html.number(best.value, 6)}"
        return f"{head}: [bold green]found[/], {value} at {where} ({best.certificate.kind})."

    def _table(self, task: OptimumTask) -> str:
        return schedule_table(task_files(self.table, task.section.name))
