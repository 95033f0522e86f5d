"""Optima that move: ``[[follow]]``."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from pathlib import Path

import numpy as np
from rich.markup import escape as plain

from equimorph import plotting
from equimorph.equilibria import Leg
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Descriptor, Progress
from equimorph.storage import write_schedule
from equimorph.study import html
from equimorph.study.choose import choose_state
from equimorph.study.kinds.found import heading
from equimorph.study.kinds.kind import Figure, Kind, still
from equimorph.study.kinds.legs import Legs, legs_of, limits_of
from equimorph.study.lookup import Ground, at_key, check_state, constraints_of, descriptor_at
from equimorph.study.names import schedule_table, task_files
from equimorph.study.sections.best import FollowSection
from equimorph.tasks import Certificate, FollowedOptimum, follow_optimum

MOST_ROWS = 12
"""Optima that a page shows."""
ROUNDING = 1e-9
"""Margin on the stability boundary, where it is zero."""


@dataclass(frozen=True)
class FollowTask:
    """An optimum that is to be followed, with its names looked up."""

    key: str
    section: FollowSection
    objective: Descriptor
    legs: Legs
    actuators: Mapping[str, tuple[float, float]]
    constraints: tuple[Constraint, ...]

    @property
    def files(self) -> str:
        """Beginning of the names of its files."""
        return task_files(FollowKind.table, self.section.name)


class FollowKind(Kind[FollowSection, FollowTask, FollowedOptimum]):
    """How the best state moves while loads and targets do, and where it jumps."""

    table = "follow"

    def prepared(self, ground: Ground, section: FollowSection, key: str) -> FollowTask:
        """Look up objective, start, legs, actuators and constraints."""
        check_state(ground, section.start, f"{key}.start")
        structure = ground.structure
        return FollowTask(
            key,
            section,
            descriptor_at(structure, section.objective, f"{key}.objective"),
            legs_of(structure, section.targets, f"{key}.targets"),
            limits_of(ground, section.actuators, f"{key}.actuators"),
            constraints_of(structure, section.within, f"{key}.within"),
        )

    def answer(
        self, ground: Ground, eset: EquilibriumSet | None, task: FollowTask, sink: Progress
    ) -> FollowedOptimum:
        """Follow it, within the constraints of the set, too."""
        assert eset is not None
        section = task.section
        start = choose_state(eset, section.start, f"{task.key}.start")
        legs: list[Leg] = [dict(leg) for leg in task.legs]
        with at_key(task.key):
            return follow_optimum(
                start,
                task.objective,
                legs,
                actuators=task.actuators,
                within=[*eset.constraints, *task.constraints],
                sense=section.sense,
                margin=section.margin,
            )

    def write_tables(self, task: FollowTask, answer: FollowedOptimum, folder: Path) -> None:
        """Write the schedule."""
        if answer.schedule is not None:
            write_schedule(answer.schedule, folder / schedule_table(task.files))

    def figures(
        self, ground: Ground, eset: EquilibriumSet | None, task: FollowTask, answer: FollowedOptimum
    ) -> Sequence[Figure]:
        """Objective and actuators along the legs."""
        if not len(answer.states):
            return []
        draw = partial(plotting.followed, answer, task.objective, tuple(task.actuators))
        return [still(task.files, draw)]

    def report(self, task: FollowTask, answer: FollowedOptimum, folder: Path) -> list[str]:
        """Verdict, jumps, and optima along the way."""
        head = heading(self.table, task.section.name)
        legs = len(task.legs)
        if not len(answer.states):
            return [head, html.refused(answer.why)]
        first = f"After {html.number(answer.at[-1])} of {legs} legs: {answer.why}."
        words = (
            f'<p class="verdict"><strong>Arrived.</strong> {escape(_ends(task, answer))}</p>'
            if answer.arrived
            else html.refused(first)
        )
        caption = "Objective and actuators along the legs; dotted where the optimum jumps."
        pictures = html.pictures(folder, {}, {f"{task.files}.png": caption})
        links = (
            [html.schedule_links(schedule_table(task.files))] if answer.schedule is not None else []
        )
        return [head, words, *links, pictures, *_jumps(task, answer), _table(task, answer)]

    def verdict(self, task: FollowTask, answer: FollowedOptimum) -> str:
        """Say how far it could be followed."""
        head = f"Follow {task.section.name}"
        if not answer.arrived:
            done = f" after {answer.at[-1]:.4g} of {len(task.legs)} legs" if len(answer.at) else ""
            return f"{head}: [bold red]refused[/]{done}. {plain(answer.why)}"
        return f"{head}: [bold green]arrived[/]. {plain(_ends(task, answer))}"


def _ends(task: FollowTask, found: FollowedOptimum) -> str:
    jumps = {0: "It does not jump.", 1: "It jumps once."}
    return (
        f"{task.objective.name} from {html.number(found.values[0], 6)} to "
        f"{html.number(found.values[-1], 6)}. "
        f"{jumps.get(len(found.jumps), f'It jumps {len(found.jumps)} times.')}"
    )


def _jumps(task: FollowTask, found: FollowedOptimum) -> list[str]:
    """Table of both sides of every jump."""
    if not found.jumps:
        return []
    names = list(task.actuators)
    rows = [
        [
            html.number(jump.at, 6),
            *(html.number(value, 6) if np.isfinite(value) else "none" for value in jump.values),
            *(
                f"{html.number(jump.before[name], 5)} → "
                f"{'none' if jump.after is None else html.number(jump.after[name], 5)}"
                for name in names
            ),
        ]
        for jump in found.jumps
    ]
    value = escape(task.objective.name)
    return [html.table(["jump at leg", f"{value} before", "after", *map(escape, names)], rows)]


def _limits(certificate: Certificate) -> list[str]:
    """Active constraints; stability is told by the kind."""
    return [each for each in certificate.active if not each.startswith("stable ")]


def _table(task: FollowTask, found: FollowedOptimum) -> str:
    """Optima along the way, some of many."""
    names = list(task.actuators)
    shown = np.unique(np.linspace(0, len(found.states) - 1, MOST_ROWS).round().astype(int))
    states = found.states
    margins = states.margin
    rows = [
        [
            html.number(found.at[k], 4),
            *(html.number(states[name][k], 6) for name in names),
            html.number(found.values[k], 6),
            html.number(margins[k] if abs(margins[k]) > ROUNDING else 0.0),
            escape(", ".join([found.certificates[k].kind, *_limits(found.certificates[k])])),
        ]
        for k in shown.tolist()
    ]
    titles = ["leg", *names, task.objective.name, "margin", "where"]
    return html.table([escape(title) for title in titles], rows)
