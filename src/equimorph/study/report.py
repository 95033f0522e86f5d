"""The page that shows a study's answers: offline, in one file."""

from collections.abc import Mapping
from html import escape
from importlib.metadata import version
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from equimorph.manifold import Audit
from equimorph.model import Box, Constraint, Descriptor
from equimorph.structures import States
from equimorph.study import html
from equimorph.study.names import (
    PLANE,
    STABLE_PLANE,
    SURFACE,
    map_files,
    route_figures,
    schedule_table,
)
from equimorph.study.outcome import MapOutcome, Outcome, RouteOutcome
from equimorph.study.prepare import Problem
from equimorph.tasks import ActuatorMap

ROOM = 0.03
"""Empty border of a sketch, so that its line is not cut."""


def report(outcome: Outcome, folder: Path, text: str, title: str) -> str:
    """Return the page.

    Parameters
    ----------
    outcome
        What was found.
    folder
        Where the figures are; the page will lie beside them.
    text
        The study file as it was written.
    title
        Heading.
    """
    body = [f"<h1>{escape(title)}</h1>", _question(outcome.problem)]
    for each in outcome.routes:
        body += _route(each, folder)
    for amap in outcome.maps:
        body += _map(amap, folder)
    for point, states in zip(outcome.problem.points, outcome.points, strict=True):
        body += _equilibria(point, states, _shown_descriptors(outcome.problem))
    if outcome.equilibrium_set is not None:
        body += _set(outcome, outcome.equilibrium_set.audit, folder)
    body += ["<h2>Study</h2>", f"<pre>{escape(text.strip())}</pre>", _colophon(outcome)]
    return html.page(title, body)


def _question(problem: Problem) -> str:
    words = [problem.structure.kind]
    if problem.equilibrium_set is not None:
        wanted = problem.equilibrium_set
        words += _extent(wanted.box, wanted.fixed, wanted.constraints)
    return f'<p class="lead">{escape(" · ".join(words))}</p>'


def _extent(box: Box, fixed: Mapping[str, float], constraints: tuple[Constraint, ...]) -> list[str]:
    """Ranges, values and bounds in words."""
    ranges = [
        f"{name} ∈ [{html.number(low)}, {html.number(high)}]"
        for name, low, high in zip(box.names, box.lower, box.upper, strict=True)
    ]
    values = [f"{name} = {html.number(value)}" for name, value in fixed.items()]
    caps = [str(each).replace("<=", "≤").replace(">=", "≥") for each in constraints]
    return [*ranges, *values, *caps]


def _route(each: RouteOutcome, folder: Path) -> list[str]:
    names = route_figures(each.name)
    heading = f"<h2>Route {escape(each.name)}</h2>"
    plane = _still(folder, names.plane, "The route on the plane of the free parameters.")
    if not each.arrived:
        verdict = (
            f'<p class="verdict refused"><strong>Refused.</strong> {escape(each.route.why)}</p>'
        )
        return [heading, verdict, f'<div class="figures">{plane}</div>']
    pictures = [
        html.figure(folder / names.film, "The structure along the route.", wide=True),
        plane,
        _still(folder, names.shapes, "Shapes at equal steps along the route, start to goal."),
        _still(folder, names.margins, "How far each state is from instability along the route."),
    ]
    return [
        heading,
        '<p class="verdict"><strong>Arrived.</strong> Every state on the way is stable: smallest '
        f"margin {html.number(each.route.margin)}, length {html.number(each.route.length)}.</p>",
        _schedule_links(each.name),
        f'<div class="figures">{"".join(pictures)}</div>',
    ]


def _map(each: MapOutcome, folder: Path) -> list[str]:
    section, files = each.task.section, map_files(each.name)
    counts = [f"{count} {kind}" for kind, count in each.map.counts.items() if count]
    what, caption = "Limit loads", "Limit loads, with the curves on which they jump or bend."
    if section.at is not None:
        what = f"States at {section.load} = {html.number(section.at)}"
        caption = "The first stable state on each path; dots: a real loading snaps on the way."
    extent = _extent(each.map.grid.box, each.map.fixed, each.map.within)
    return [
        f"<h2>Map {escape(each.name)}</h2>",
        f'<p class="lead">{escape(" · ".join(extent))}</p>',
        f"<p>{escape(what)} at {each.map.value.size} settings: {escape(', '.join(counts))}.</p>",
        f'<div class="figures">{_still(folder, files, caption)}</div>',
        _accuracy(each.map),
        f'<p>Tables: <a href="{files}.csv">{files}.csv</a> (settings) and '
        f'<a href="{files}-curves.csv">{files}-curves.csv</a>.</p>',
    ]


def _accuracy(amap: ActuatorMap) -> str:
    """How well the places of curves are known, kind by kind."""
    worst: dict[str, float] = {}
    for curve in amap.curves:
        worst[curve.kind] = max(worst.get(curve.kind, 0.0), float(curve.errors.max(initial=0.0)))
    if not worst:
        return ""
    words = ", ".join(f"{kind} {error:.0e}" for kind, error in worst.items())
    return f"<p>Curves, with the largest error of a place along a grid line: {escape(words)}.</p>"


def _schedule_links(name: str) -> str:
    table = schedule_table(name)
    sidecar = table.replace(".csv", ".json")
    return (
        f'<p>Actuator schedule: <a href="{table}">{table}</a>, with the structure, the first state '
        f'and the loads in <a href="{sidecar}">{sidecar}</a>.</p>'
    )


def _still(folder: Path, name: str, caption: str) -> str:
    return html.figure(folder / f"{name}.png", caption, larger=f"{name}.svg")


def _shown_descriptors(problem: Problem) -> list[Descriptor]:
    """Descriptors that the study speaks of, each once."""
    wanted = problem.equilibrium_set
    bounded = [] if wanted is None else [each.descriptor for each in wanted.constraints]
    return list({each.name: each for each in [problem.height, *bounded]}.values())


def _equilibria(
    point: dict[str, float], states: States, descriptors: list[Descriptor]
) -> list[str]:
    where = ", ".join(f"{name} = {html.number(value)}" for name, value in point.items())
    heading = f"<h2>Equilibria at {escape(where)}</h2>"
    if not len(states):
        return [heading, "<p>None within the constraints.</p>"]
    # Leading with what a reader looks for: the highest first.
    order: Int[np.ndarray, " lanes"] = np.argsort(-descriptors[0](states))
    states = states[order]
    shapes = states.shape()
    box = np.stack([shapes.min(axis=(0, 1)) - ROOM, shapes.max(axis=(0, 1)) + ROOM])
    columns = [_numbers(each(states)) for each in descriptors]
    stability = ["stable" if index == 0 else f"index {index}" for index in states.index]
    numbers = zip(
        stability, *columns, _numbers(states.margin), _numbers(states.energy), strict=True
    )
    rows = [[html.sketch(shape, box), *cells] for shape, cells in zip(shapes, numbers, strict=True)]
    shown = [*descriptors, states.structure.descriptor("energy")]
    units = [f"{escape(each.name)} ({escape(each.unit)})" for each in shown]
    head = ["shape", "", *units[:-1], "margin", units[-1]]
    kinds = ["" if index == 0 else "unstable" for index in states.index]
    return [
        heading,
        f"<p>{len(states)} found, {len(states.stable)} of them stable.</p>",
        html.table(head, rows, kinds),
        "<p>Index: number of directions in which the energy falls. Margin: smallest stiffness in "
        "any direction, negative where unstable.</p>",
    ]


def _numbers(values: Float[np.ndarray, " lanes"]) -> list[str]:
    return [html.number(value) for value in values]


def _set(outcome: Outcome, audit: Audit, folder: Path) -> list[str]:
    word = "clean" if audit.clean else "not clean: do not rely on the set where it says so"
    pictures = [
        html.figure(
            folder / f"{SURFACE}.png",
            "The equilibrium set, coloured by index, with its folds.",
            larger=f"{SURFACE}.svg",
            wide=True,
        ),
        _still(folder, STABLE_PLANE, "Number of stable equilibria."),
    ]
    if not outcome.routes:
        caption = "Number of equilibria over the free parameters."
        pictures.append(_still(folder, PLANE, caption))
    rows = [[escape(what), escape(value)] for what, value in audit.rows()]
    return [
        "<h2>Equilibrium set</h2>",
        f'<div class="figures">{"".join(pictures)}</div>',
        f"<h3>Audit: {word}</h3>",
        html.table([], rows, "words"),
        '<p>All of it is in <a href="results.h5">results.h5</a>, for ParaView '
        "(<code>/VTKHDF</code>) and xarray (engine h5netcdf, group <code>set</code>).</p>",
    ]


def _colophon(outcome: Outcome) -> str:
    stages = ", ".join(f"{name} {value:.1f} s" for name, value in outcome.seconds.items())
    reused = " The set was read from an earlier run." if outcome.reused else ""
    return (
        f'<p class="faint">equimorph {escape(version("equimorph"))}. Wall time: '
        f"{escape(stages)}.{reused}</p>"
    )
