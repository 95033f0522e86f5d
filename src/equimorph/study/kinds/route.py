"""Routes: ``[[route]]``."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape as plain

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Progress
from equimorph.storage import write_schedule
from equimorph.structures import State
from equimorph.study import html
from equimorph.study.choose import choose_state
from equimorph.study.kinds.kind import Figure, Kind, still
from equimorph.study.kinds.landings import report_of_snaps, snaps_in_words
from equimorph.study.kinds.way import figures_of_way, pictures_of_way
from equimorph.study.lookup import (
    Ground,
    at_key,
    check_parameters,
    check_point,
    check_state,
    constraints_of,
)
from equimorph.study.names import route_name, schedule_table
from equimorph.study.sections.routes import RouteSection
from equimorph.tasks import Route, alternatives, plan, smoothed

Routes = tuple[Route, ...]
"""The route that was asked for, or its refusal; then others, if any were asked for."""


@dataclass(frozen=True)
class RouteTask:
    """A route that is wanted, with its constraints as objects."""

    key: str
    section: RouteSection
    constraints: tuple[Constraint, ...]

    @property
    def overview(self) -> str:
        """Beginning of the name of the figure with all routes."""
        return f"{self.section.name}-alternatives"


class RouteKind(Kind[RouteSection, RouteTask, Routes]):
    """Routes between two states: along way-points, planned, with snaps, or several of them."""

    table = "route"

    def prepared(self, ground: Ground, section: RouteSection, key: str) -> RouteTask:
        """Look up ends, way-points, rates and constraints."""
        for end, state in (("start", section.start), ("goal", section.goal)):
            check_state(ground, state, f"{key}.{end}")
        for i, corner in enumerate(section.via or ()):
            check_point(ground.box, corner, f"{key}.via[{i}]", whole=False)
        check_parameters(ground.structure, section.rates or (), f"{key}.rates")
        if section.alternatives is not None and len(ground.box.names) != 2:
            raise InputError(
                f"`{key}.alternatives` must be asked of a set over two parameters; "
                f"got one over {len(ground.box.names)}."
            )
        constraints = constraints_of(ground.structure, section.within, f"{key}.within")
        return RouteTask(key, section, constraints)

    def answer(
        self, ground: Ground, eset: EquilibriumSet | None, task: RouteTask, sink: Progress
    ) -> Routes:
        """Choose both ends, plan, and round the corners if that is wanted."""
        assert eset is not None
        section = task.section
        start = choose_state(eset, section.start, f"{task.key}.start")
        goal = choose_state(eset, section.goal, f"{task.key}.goal")
        with at_key(task.key):
            return tuple(_routes(ground, eset, task, (start, goal)))

    def write_tables(self, task: RouteTask, answer: Routes, folder: Path) -> None:
        """Write the schedules."""
        for name, route in _named(task, answer):
            if route.schedule is not None:
                write_schedule(route.schedule, folder / schedule_table(name))

    def figures(
        self, ground: Ground, eset: EquilibriumSet | None, task: RouteTask, answer: Routes
    ) -> Sequence[Figure]:
        """Shapes, margins, plane and film of the best; all of them on one plane."""
        found = [*figures_of_way(eset, task.section.name, answer[0])]
        if len(answer) > 1 and eset is not None:
            draw = partial(plotting.alternative_routes, eset, answer)
            found.insert(0, still(task.overview, draw))
        return found

    def report(self, task: RouteTask, answer: Routes, folder: Path) -> list[str]:
        """Verdict, schedule and figures."""
        name, route = task.section.name, answer[0]
        heading = f"<h2>Route {escape(name)}</h2>"
        pictures = pictures_of_way(folder, name, "route")
        if not route.arrived:
            return [heading, html.refused(route.why), pictures]
        snapping = "Every state between the snaps" if route.snaps else "Every state on the way"
        return [
            heading,
            f'<p class="verdict"><strong>Arrived.</strong> {snapping} is stable: '
            f"{_size(route, html.number)}{_cost(route)}{_rounding(task)}.</p>",
            *report_of_snaps(route),
            html.schedule_links(schedule_table(name)),
            *_report_of_all(task, answer, folder),
            pictures,
        ]

    def verdict(self, task: RouteTask, answer: Routes) -> str:
        """Say whether it arrived."""
        route, head = answer[0], f"Route {task.section.name}"
        if not route.arrived:
            return f"{head}: [bold red]refused[/]. {plain(route.why)}"
        others = f" {len(answer)} routes differ in how they pass holes." if len(answer) > 1 else ""
        how = snaps_in_words(route) or "without a snap"
        size = _size(route, lambda value: f"{value:.3f}")
        return f"{head}: [bold green]arrived[/] {how}, {size}{_cost(route)}.{others}"


def _routes(
    ground: Ground, eset: EquilibriumSet, task: RouteTask, ends: tuple[State, State]
) -> list[Route]:
    """Plan; every route is rounded that arrived."""
    section, monitor = task.section, [ground.height]
    demands: dict[str, Any] = {
        "within": task.constraints, "margin": section.margin, "monitor": monitor
    }  # fmt: skip
    wanted = {**demands, "objective": section.wish}
    if section.alternatives is not None:
        routes = list(alternatives(eset, *ends, section.alternatives, **wanted))
    else:
        routes = [plan(eset, *ends, via=section.via, snap_price=section.snap_price, **wanted)]
    if section.smooth is None:
        return routes
    demands["within"] = tuple(dict.fromkeys((*eset.constraints, *task.constraints)))
    return [
        smoothed(route, section.smooth, **demands) if route.arrived else route for route in routes
    ]


def _named(task: RouteTask, answer: Routes) -> list[tuple[str, Route]]:
    return [(route_name(task.section.name, k), route) for k, route in enumerate(answer, 1)]


def _size(route: Route, number: Any) -> str:
    least = "" if route.snaps else f"smallest margin {number(route.margin)}, "
    return f"{least}length {number(route.length)}"


def _cost(route: Route) -> str:
    """What it was planned for, if that is not the length alone; rounding forgets other costs."""
    if not np.isfinite(route.cost) or (route.objective == "length" and not route.snaps):
        return ""
    priced = " with the price of the snaps" if route.snaps else ""
    return f", {route.objective}{priced} {html.number(route.cost)}"


def _rounding(task: RouteTask) -> str:
    smooth = task.section.smooth
    return "" if smooth is None else f", corners rounded by {html.number(smooth)} at most"


def _report_of_all(task: RouteTask, answer: Routes, folder: Path) -> list[str]:
    """Routes side by side; nothing where there is only one."""
    if task.section.alternatives is None:
        return []
    if len(answer) == 1:
        return ["<p>No other route passes the holes of the stable set differently.</p>"]
    rows = [
        [
            str(number),
            html.number(route.length),
            html.number(route.margin),
            html.number(route.cost),
            f'<a href="{schedule_table(name)}">{schedule_table(name)}</a>',
        ]
        for number, (name, route) in enumerate(_named(task, answer), 1)
    ]
    head = ["", "length", "smallest margin", escape(answer[0].objective), "schedule"]
    caption = "Routes that cannot be drawn into each other; the first is the best."
    return [
        html.table(head, rows),
        html.pictures(folder, {}, {f"{task.overview}.png": caption}),
    ]
