"""Tracking: ``[[track]]``."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np
from rich.markup import escape as plain

from equimorph.equilibria import Leg
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Progress
from equimorph.storage import write_schedule
from equimorph.study import html
from equimorph.study.choose import choose_state
from equimorph.study.kinds.found import heading
from equimorph.study.kinds.kind import Figure, Kind
from equimorph.study.kinds.legs import Legs, legs_of, limits_of
from equimorph.study.kinds.way import figures_of_way, pictures_of_way
from equimorph.study.lookup import Ground, at_key, check_state, constraints_of
from equimorph.study.names import schedule_table, task_files
from equimorph.study.sections.tasks import TrackSection
from equimorph.tasks import Route, Tracking, track

MOST_ROWS = 8
"""Compromises that a page shows."""


@dataclass(frozen=True)
class TrackTask:
    """A motion that is to be followed, with its names looked up."""

    key: str
    section: TrackSection
    legs: Legs
    actuators: Mapping[str, tuple[float, float]]
    constraints: tuple[Constraint, ...]

    @property
    def files(self) -> str:
        """Beginning of the names of its files."""
        return task_files(TrackKind.table, self.section.name)


class TrackKind(Kind[TrackSection, TrackTask, Tracking]):
    """Actuators that lead descriptors along given targets while loads move."""

    table = "track"

    def prepared(self, ground: Ground, section: TrackSection, key: str) -> TrackTask:
        """Look up start, targets, actuators and constraints; limits are those of the box."""
        structure = ground.structure
        check_state(ground, section.start, f"{key}.start")
        legs = legs_of(structure, section.targets, f"{key}.targets")
        actuators = limits_of(ground, section.actuators, f"{key}.actuators")
        constraints = constraints_of(structure, section.within, f"{key}.within")
        return TrackTask(key, section, legs, actuators, constraints)

    def answer(
        self, ground: Ground, eset: EquilibriumSet | None, task: TrackTask, sink: Progress
    ) -> Tracking:
        """Follow the motion, within the constraints of the set, too."""
        assert eset is not None
        start = choose_state(eset, task.section.start, f"{task.key}.start")
        legs: list[Leg] = [dict(leg) for leg in task.legs]
        with at_key(task.key):
            return track(
                start,
                legs,
                actuators=task.actuators,
                within=[*eset.constraints, *task.constraints],
                monitor=[ground.height],
                beyond=task.section.beyond,
            )

    def write_tables(self, task: TrackTask, answer: Tracking, folder: Path) -> None:
        """Write the schedule."""
        if answer.schedule is not None:
            write_schedule(answer.schedule, folder / schedule_table(task.files))

    def figures(
        self, ground: Ground, eset: EquilibriumSet | None, task: TrackTask, answer: Tracking
    ) -> Sequence[Figure]:
        """As of a route."""
        return figures_of_way(eset, task.files, _as_route(answer))

    def report(self, task: TrackTask, answer: Tracking, folder: Path) -> list[str]:
        """Verdict, schedule and figures."""
        head = heading(self.table, task.section.name)
        pictures = pictures_of_way(folder, task.files, "motion")
        if not answer.arrived:
            done = f"After {html.number(answer.last_good)} of {len(task.legs)} legs: {answer.why}"
            return [head, html.refused(done), *_compromise(answer), pictures]
        turn = answer.holonomy
        back = ""
        if turn is not None:
            change = max((abs(value) for value in turn.values()), default=0.0)
            back = f" The targets close; the actuators come back within {change:.0e}."
        return [
            head,
            '<p class="verdict"><strong>Arrived.</strong> Every state on the way is stable: '
            f"smallest margin {html.number(answer.margin)}.{back}</p>",
            html.schedule_links(schedule_table(task.files)),
            pictures,
        ]

    def verdict(self, task: TrackTask, answer: Tracking) -> str:
        """Say whether it can be followed."""
        head = f"Track {task.section.name}"
        if not answer.arrived:
            return (
                f"{head}: [bold red]refused[/] after {answer.last_good:.4g} of {len(task.legs)} "
                f"legs. {plain(answer.why)}"
            )
        return f"{head}: [bold green]arrived[/], smallest margin {answer.margin:.3f}."


def _compromise(answer: Tracking) -> list[str]:
    """What comes nearest to the targets after the failure, step by step."""
    found = answer.compromise
    if found is None:
        return []
    words = "The states nearest to the targets, by the sum of squares of what is missed:"
    misses = np.sqrt(2.0 * np.maximum(found.values, 0.0))
    shown = np.unique(np.linspace(0, len(found.states) - 1, MOST_ROWS).round().astype(int))
    names = list(answer.actuators)
    rows = [
        [html.number(found.at[k], 4), html.number(misses[k], 3)]
        + [html.number(found.states[k][name], 6) for name in names]
        for k in shown
    ]
    head = ["leg", "miss", *map(escape, names)]
    return [f"<p>{words}</p>", html.table(head, rows)]


def _as_route(answer: Tracking) -> Route:
    """The motion as a route, for figures."""
    way, status = answer.path, answer.status
    length = float(way.length[-1])
    return Route(status, answer.why, [], way, answer.margin, length, answer.schedule)
