"""Routes: ``[[route]]`` on a set, and ``[[sampled_route]]`` for many actuators."""

from collections.abc import Sequence
from functools import partial
from html import escape
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.storage import write_schedule
from equimorph.study import html
from equimorph.study.answers import (
    figures_of_way,
    heading,
    pictures_of_way,
    report_of_snaps,
    snaps_in_words,
)
from equimorph.study.fields import Name, Positive, requirement
from equimorph.study.names import PLANE, STABLE_PLANE, route_name, schedule_table
from equimorph.study.question import Arguments, Figure, Kind, Question, still
from equimorph.study.signatures import MEANINGS
from equimorph.study.states import NaturalSection
from equimorph.tasks import Route, alternatives, plan, plan_sampled, smoothed

Routes = tuple[Route, ...]
"""The route, or its refusal; then alternatives, if the study asks for them."""


def _check_name(name: str) -> str:
    """Refuse names under which files of the set are stored."""
    if f"{name}-plane" in (STABLE_PLANE, PLANE):
        raise requirement("be another name: figures of the set begin with it")
    return name


class RouteKind(Kind[Routes]):
    """Routes between two states: along way-points, planned, with snaps, or several of them."""

    table = "route"
    tasks = (plan, alternatives, smoothed)
    names = MappingProxyType({"count": "alternatives", "tolerance": "smooth"})
    left_out = ("route",)
    own = MappingProxyType(
        {
            "name": (Annotated[Name, AfterValidator(_check_name)], ...),
            "alternatives": (MEANINGS["count"] | None, None),
            "smooth": (Positive | None, None),
        }
    )

    def stems(self, section: Any) -> list[str]:
        """Names of all its routes."""
        return [route_name(section.name, k + 1) for k in range(section.alternatives or 1)]

    def check(self, section: Any) -> None:
        """Refuse demands that exclude each other."""
        given = ("via", "snap_price", "alternatives")
        both = [key for key in given if getattr(section, key) is not None]
        if len(both) > 1:
            raise requirement(f"give one of {', '.join(given)} (not {' and '.join(both)})")
        if section.smooth is not None and section.snap_price is not None:
            raise requirement("give one of smooth, snap_price: routes that snap have corners")

    def look_up_more(self, question: Question) -> None:
        """Refuse alternatives where there is no plane."""
        if question.section.alternatives is not None and len(question.free) != 2:
            raise InputError(
                f"`{question.key}.alternatives` needs a set over two parameters; "
                f"got one over {len(question.free)}."
            )

    def answer(self, question: Question, arguments: Arguments) -> Routes:
        """Plan; round the corners of every route that arrived, if the section says so."""
        if question.section.alternatives is not None:
            routes = tuple(alternatives(**arguments.of(alternatives)))
        else:
            routes = (plan(**arguments.of(plan)),)
        if question.section.smooth is None:
            return routes
        bounds = dict.fromkeys((*arguments.eset.constraints, *question.within))
        demands = arguments.of(smoothed) | {"within": tuple(bounds)}
        return tuple(smoothed(route, **demands) if route.arrived else route for route in routes)

    def write_tables(self, question: Question, answer: Routes, folder: Path) -> None:
        """Write the schedules."""
        for name, route in _name_routes(question, answer):
            if route.schedule is not None:
                write_schedule(route.schedule, folder / schedule_table(name))

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Routes
    ) -> Sequence[Figure]:
        """Shapes, margins, plane and film of the best; all of them on one plane."""
        found = [*figures_of_way(eset, question.name, answer[0])]
        if len(answer) > 1 and eset is not None:
            draw = partial(plotting.alternative_routes, eset, answer)
            found.insert(0, still(_overview(question), draw))
        return found

    def report(self, question: Question, answer: Routes, folder: Path) -> list[str]:
        """Verdict, schedule and figures."""
        name, route = question.name, answer[0]
        heading = f"<h2>Route {escape(name)}</h2>"
        pictures = pictures_of_way(folder, name, "route")
        if not route.arrived:
            return [heading, html.refusal_line(route.why), pictures]
        snapping = "Every state between the snaps" if route.snaps else "Every state on the way"
        return [
            heading,
            f'<p class="verdict"><strong>Arrived.</strong> {snapping} is stable: '
            f"{_size(route, html.number)}{_cost(route)}{_rounding(question)}.</p>",
            *report_of_snaps(route),
            html.schedule_links(schedule_table(name)),
            *_report_of_all(question, answer, folder),
            pictures,
        ]

    def refusal(self, question: Question, answer: Routes) -> str:
        """Reason why there is no route."""
        del question
        return "" if answer[0].arrived else answer[0].why

    def verdict(self, question: Question, answer: Routes) -> str:
        """Say how it arrived."""
        route, head = answer[0], f"{question.title}"
        others = f" {len(answer)} routes differ in how they pass holes." if len(answer) > 1 else ""
        how = snaps_in_words(route) or "without a snap"
        size = _size(route, lambda value: f"{value:.3f}")
        return f"{head}: [bold green]arrived[/] {how}, {size}{_cost(route)}.{others}"


def _name_routes(question: Question, answer: Routes) -> list[tuple[str, Route]]:
    return [(route_name(question.name, k), route) for k, route in enumerate(answer, 1)]


def _size(route: Route, number: Any) -> str:
    least = "" if route.snaps else f"smallest margin {number(route.margin)}, "
    return f"{least}length {number(route.length)}"


def _cost(route: Route) -> str:
    """What it was planned for, if that is not the length alone; rounding forgets other costs."""
    if not np.isfinite(route.cost) or (route.objective == "length" and not route.snaps):
        return ""
    priced = " with the price of the snaps" if route.snaps else ""
    return f", {route.objective}{priced} {html.number(route.cost)}"


def _rounding(question: Question) -> str:
    smooth = question.section.smooth
    return "" if smooth is None else f", corners rounded by {html.number(smooth)} at most"


def _report_of_all(question: Question, answer: Routes, folder: Path) -> list[str]:
    """Routes side by side; nothing where there is only one."""
    if question.section.alternatives is None:
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
        for number, (name, route) in enumerate(_name_routes(question, answer), 1)
    ]
    head = ["", "length", "smallest margin", escape(answer[0].objective), "schedule"]
    caption = "Routes that cannot be drawn into each other; the first is the best."
    return [
        html.table(head, rows),
        html.pictures(folder, {}, {f"{_overview(question)}.png": caption}),
    ]


def _overview(question: Question) -> str:
    """Beginning of the name of the figure with all routes."""
    return f"{question.name}-alternatives"


class SampledRouteKind(Kind[Route]):
    """Routes by random trees of lifted edges, where no set can be computed."""

    table = "sampled_route"
    tasks = (plan_sampled,)
    natural = True
    own = MappingProxyType({"goal": (NaturalSection | None, None)})

    def check(self, section: Any) -> None:
        """It ends at a goal, or under loads."""
        if section.goal is None and not section.loads:
            raise requirement("give a goal, or loads, of which the last one holds at the goal")

    def look_up_more(self, question: Question) -> None:
        """Refuse actuators among the loads."""
        section = question.section
        for i, leg in enumerate(section.loads):
            both = [name for name in leg if name in section.actuators]
            if both:
                raise InputError(
                    f"`{question.key}.loads[{i}]` must not move actuators; got {both[0]}."
                )

    def write_tables(self, question: Question, answer: Route, folder: Path) -> None:
        """Write the schedule."""
        if answer.schedule is not None:
            write_schedule(answer.schedule, folder / schedule_table(question.files))

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Route
    ) -> Sequence[Figure]:
        """Parameters, shapes and margins."""
        return figures_of_way(None, question.files, answer)

    def report(self, question: Question, answer: Route, folder: Path) -> list[str]:
        """Verdict, schedule and figures."""
        head = heading(question)
        if not answer.arrived:
            return [head, html.refusal_line(answer.why)]
        length = html.number(answer.length)
        return [
            head,
            '<p class="verdict"><strong>Arrived.</strong> Every state on the way is stable: '
            f"smallest margin {html.number(answer.margin)}, length {length}.</p>",
            html.schedule_links(schedule_table(question.files)),
            pictures_of_way(folder, question.files, "route"),
        ]

    def verdict(self, question: Question, answer: Route) -> str:
        """Say how it arrived."""
        return (
            f"{question.title}: [bold green]arrived[/] without a snap, smallest margin "
            f"{answer.margin:.3f}, length {answer.length:.3f}."
        )
