"""Routes: ``[[route]]``."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from rich.markup import escape as plain

from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Progress
from equimorph.storage import write_schedule
from equimorph.storage.parts import JOURNEY_PART, Journey
from equimorph.study import html
from equimorph.study.choose import choose_state
from equimorph.study.kinds.kind import Figure, Kind
from equimorph.study.kinds.way import figures_of_way, pictures_of_way
from equimorph.study.lookup import Ground, at_key, check_point, check_state, constraints_of
from equimorph.study.names import schedule_table
from equimorph.study.sections.tasks import RouteSection
from equimorph.tasks import Route, plan


@dataclass(frozen=True)
class RouteTask:
    """A route that is wanted, with its constraints as objects."""

    key: str
    section: RouteSection
    constraints: tuple[Constraint, ...]


class RouteKind(Kind[RouteSection, RouteTask, Journey]):
    """Routes between two states, along way-points or planned freely."""

    table = "route"
    part = JOURNEY_PART

    def prepared(self, ground: Ground, section: RouteSection, key: str) -> RouteTask:
        """Look up ends, way-points and constraints."""
        for end, state in (("start", section.start), ("goal", section.goal)):
            check_state(ground, state, f"{key}.{end}")
        for i, corner in enumerate(section.via or ()):
            check_point(ground.box, corner, f"{key}.via[{i}]", whole=False)
        constraints = constraints_of(ground.structure, section.within, f"{key}.within")
        return RouteTask(key, section, constraints)

    def answer(
        self, ground: Ground, eset: EquilibriumSet | None, task: RouteTask, sink: Progress
    ) -> Journey:
        """Choose both ends and plan."""
        assert eset is not None
        section = task.section
        start = choose_state(eset, section.start, f"{task.key}.start")
        goal = choose_state(eset, section.goal, f"{task.key}.goal")
        with at_key(task.key):
            route = plan(
                eset,
                start,
                goal,
                via=section.via,
                within=task.constraints,
                margin=section.margin,
                objective=section.objective,
                monitor=[ground.height],
            )
        return Journey(start, goal, route)

    def write_tables(self, task: RouteTask, answer: Journey, folder: Path) -> None:
        """Write the schedule."""
        if answer.route.schedule is not None:
            write_schedule(answer.route.schedule, folder / schedule_table(task.section.name))

    def figures(
        self, ground: Ground, eset: EquilibriumSet | None, task: RouteTask, answer: Journey
    ) -> Sequence[Figure]:
        """Shapes, margins, plane and film."""
        return figures_of_way(eset, task.section.name, answer.route)

    def report(self, task: RouteTask, answer: Journey, folder: Path) -> list[str]:
        """Verdict, schedule and figures."""
        name, route = task.section.name, answer.route
        heading = f"<h2>Route {escape(name)}</h2>"
        pictures = pictures_of_way(folder, name, "route")
        if not route.arrived:
            return [heading, html.refused(route.why), pictures]
        return [
            heading,
            '<p class="verdict"><strong>Arrived.</strong> Every state on the way is stable: '
            f"smallest margin {html.number(route.margin)}, length {html.number(route.length)}"
            f"{_cost(route)}.</p>",
            html.schedule_links(schedule_table(name)),
            pictures,
        ]

    def verdict(self, task: RouteTask, answer: Journey) -> str:
        """Say whether it arrived."""
        route, head = answer.route, f"Route {task.section.name}"
        if not route.arrived:
            return f"{head}: [bold red]refused[/]. {plain(route.why)}"
        return (
            f"{head}: [bold green]arrived[/] without a snap, smallest margin "
            f"{route.margin:.3f}, length {route.length:.3f}{_cost(route)}."
        )


def _cost(route: Route) -> str:
    """What it was planned for, if that is not the length."""
    if route.objective == "length":
        return ""
    return f", {route.objective} {html.number(route.cost)}"
