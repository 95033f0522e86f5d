"""What answers of several kinds have in common: states of the set, ways on it, snaps on a way."""

import csv
from collections.abc import Mapping, Sequence
from functools import partial
from html import escape
from pathlib import Path
from typing import Literal

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor
from equimorph.plotting.curves import snap_steps
from equimorph.structures import States
from equimorph.study import html
from equimorph.study.names import route_figures
from equimorph.study.question import Figure, Question, still
from equimorph.tasks import Route, Tracking, Verification


def heading(question: Question) -> str:
    """Return the heading of an answer."""
    return f"<h2>{escape(question.title)}</h2>"


def figures_of_states(
    question: Question, eset: EquilibriumSet | None, states: States
) -> list[Figure]:
    """Where the states lie on the plane of two free parameters."""
    assert eset is not None
    if len(eset.names) != 2:
        return []
    return [still(question.files, partial(plotting.solutions, eset, states))]


def report_of_states(
    question: Question,
    folder: Path,
    states: States,
    descriptors: Sequence[Descriptor],
    more: Mapping[str, list[str]] | None = None,
) -> list[str]:
    """Return a numbered table of states, with the plane on which they lie."""
    file = f"{question.files}.png"
    picture = html.pictures(folder, {}, {file: "Where they lie: full dots are stable."})
    table = html.table_of_states(states, descriptors, more, numbered=True)
    return [picture, table, html.EXPLANATION]


def free_columns(
    states: States, names: Sequence[str], shown: Sequence[Descriptor]
) -> dict[str, list[str]]:
    """Columns with the values of parameters that no descriptor shows."""
    known = {each.name for each in shown}
    return {
        name: [html.number(value, 7) for value in states[name]]
        for name in names
        if name not in known
    }


def as_route(answer: Tracking | Verification, status: Literal["arrived", "refused"]) -> Route:
    """The way of a motion or a schedule as a route, for figures."""
    way, length = answer.path, float(answer.path.length[-1])
    return Route(status, answer.why, [], way, answer.margin, length, answer.schedule)


def figures_of_way(eset: EquilibriumSet | None, name: str, route: Route) -> Sequence[Figure]:
    """Shapes and margins; the plane (alone if refused) and a film over two parameters.

    Over fewer or more, the parameters that move instead.
    """
    names = route_figures(name)
    shapes = still(names.shapes, partial(plotting.shapes, route))
    margins = still(names.margins, partial(plotting.margins, route))
    if eset is None or len(eset.names) != 2:
        if not route.arrived or route.schedule is None:
            return []
        moves = still(names.parameters, partial(plotting.schedule_strips, route.schedule))
        return [moves, shapes, margins]
    plane = still(names.plane, partial(plotting.parameter_plane, eset, route))
    film = Figure((names.film,), partial(_draw_film, eset, route, names.film))
    return [plane, shapes, margins, film] if route.arrived else [plane]


def pictures_of_way(folder: Path, name: str, what: str) -> str:
    """Those of the figures that there are, with captions; `what` is "route" or "motion"."""
    names = route_figures(name)
    captions = {
        f"{names.plane}.png": f"The {what} on the plane of the free parameters.",
        f"{names.parameters}.png": f"Parameters that move along the {what}.",
        f"{names.shapes}.png": f"Shapes at equal steps along the {what}, start to goal.",
        f"{names.margins}.png": f"How far each state is from instability along the {what}.",
    }
    return html.pictures(folder, {names.film: f"The structure along the {what}."}, captions)


def _draw_film(eset: EquilibriumSet, route: Route, name: str, folder: Path) -> None:
    plotting.film(route, folder / name, eset=eset)


def snaps_in_words(route: Route) -> str:
    """Return how many snaps there are, and what energy they release; nothing without one."""
    if not route.snaps:
        return ""
    count = len(route.snaps)
    released = html.number(sum(each.released for each in route.snaps))
    snaps = "1 snap that releases" if count == 1 else f"{count} snaps that release"
    return f"by {snaps} {released} of energy"


def report_of_snaps(route: Route) -> list[str]:
    """Return a table of the snaps: where, from what to what, and the energy released."""
    if not route.snaps:
        return []
    assert route.path is not None
    before = [route.path.states[int(step)] for step in snap_steps(route)]
    height, energy = before[0].structure.elevation, before[0].structure.descriptor("energy")
    moved = [
        each.name
        for each, lowest, highest in zip(
            before[0].structure.parameters, *_range(route), strict=True
        )
        if highest > lowest
    ]
    rows = [
        [
            str(number),
            *(html.number(state[name], 6) for name in moved),
            html.number(float(height(state)), 5),
            html.number(float(height(snap.state)), 5),
            html.number(snap.released, 5),
        ]
        for number, (state, snap) in enumerate(zip(before, route.snaps, strict=True), 1)
    ]
    named = f"{height.name} ({height.unit})"
    head = ["snap", *moved, f"{named} before", f"{named} after", f"{energy.name} released"]
    return [html.table([escape(each) for each in head], rows)]


def _range(route: Route) -> tuple[list[float], list[float]]:
    assert route.path is not None
    p = route.path.states.p
    return p.min(axis=0).tolist(), p.max(axis=0).tolist()


def write_rows(path: Path, rows: Sequence[Sequence[object]]) -> None:
    """Write a table of texts and numbers."""
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)
