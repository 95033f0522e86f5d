"""Inverse kinematics: ``[[shape]]``."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from rich.markup import escape as plain

from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Descriptor, Progress
from equimorph.study import html
from equimorph.study.choose import chosen_start
from equimorph.study.kinds.found import (
    figures_of_states,
    free_columns,
    heading,
    report_of_states,
)
from equimorph.study.kinds.kind import Figure, Kind
from equimorph.study.lookup import (
    Ground,
    at_key,
    check_state,
    constraints_of,
    descriptors_of,
)
from equimorph.study.sections.tasks import ShapeSection
from equimorph.tasks import Shapes, solve_shape


@dataclass(frozen=True)
class ShapeTask:
    """A shape that is wanted, with its names looked up."""

    key: str
    section: ShapeSection
    free: tuple[str, ...]
    targets: dict[Descriptor, float]
    constraints: tuple[Constraint, ...]


class ShapeKind(Kind[ShapeSection, ShapeTask, Shapes]):
    """All settings at which the structure takes a shape."""

    table = "shape"

    def prepared(self, ground: Ground, section: ShapeSection, key: str) -> ShapeTask:
        """Look up targets, start and constraints."""
        if section.start is not None:
            check_state(ground, section.start, f"{key}.start")
        targets = descriptors_of(ground.structure, section.targets, f"{key}.targets")
        constraints = constraints_of(ground.structure, section.within, f"{key}.within")
        return ShapeTask(key, section, ground.box.names, targets, constraints)

    def answer(
        self, ground: Ground, eset: EquilibriumSet | None, task: ShapeTask, sink: Progress
    ) -> Shapes:
        """Find all of them."""
        assert eset is not None
        section = task.section
        start = chosen_start(eset, section.start, f"{task.key}.start")
        with at_key(task.key):
            return solve_shape(
                eset, task.targets, within=task.constraints, start=start, rank=section.rank
            )

    def figures(
        self, ground: Ground, eset: EquilibriumSet | None, task: ShapeTask, answer: Shapes
    ) -> Sequence[Figure]:
        """Where they lie."""
        return figures_of_states(eset, self.table, task.section.name, answer.states)

    def report(self, task: ShapeTask, answer: Shapes, folder: Path) -> list[str]:
        """A table of them, with the way to each."""
        name = task.section.name
        if not len(answer):
            return [heading(self.table, name), html.refused(answer.why)]
        words = [] if answer.solved else [f"<p><strong>Fitted.</strong> {escape(answer.why)}</p>"]
        shown = list(task.targets)
        more = free_columns(answer.states, task.free, shown)
        if answer.routes:
            more["route"] = [
                f"length {html.number(route.length)}" if route.arrived else route.why
                for route in answer.routes
            ]
        table = report_of_states(folder, self.table, name, answer.states, shown, more)
        return [heading(self.table, name), *words, *table]

    def verdict(self, task: ShapeTask, answer: Shapes) -> str:
        """How many there are."""
        head = f"Shape {task.section.name}"
        if not len(answer):
            return f"{head}: [bold red]refused[/]. {plain(answer.why)}"
        stable = len(answer.stable)
        states = f"{len(answer)} states, {stable} of them stable"
        if len(answer) == 1:
            states = f"1 {'stable' if stable else 'unstable'} state"
        return f"{head}: [bold green]{answer.status}[/] by {states}."
