"""What shows a study's answers: its figures, and a page that works offline, in one file."""

from functools import partial
from html import escape
from importlib.metadata import version
from pathlib import Path

import numpy as np

from equimorph import plotting
from equimorph.array_types import Int
from equimorph.explorer import explore
from equimorph.manifold import EquilibriumSet, SnapGraph
from equimorph.model import Descriptor, Progress
from equimorph.structures import States
from equimorph.study import html
from equimorph.study.folder import ResultsFolder
from equimorph.study.names import (
    DIAGRAM,
    EXPLORER,
    PLANE,
    STABLE_PLANE,
    SURFACE,
    route_name,
)
from equimorph.study.prepare import Outcome, Problem
from equimorph.study.question import Figure, pictures, still

ON_THE_SET = "The equilibrium set, to turn and to walk on"
"""Words of the page that shows it."""


def draw_figures(outcome: Outcome, folder: ResultsFolder, progress: Progress) -> None:
    """Draw all figures of an outcome that the folder does not hold yet.

    Parameters
    ----------
    outcome
        What was found.
    folder
        Where the files go, figure by figure.
    progress
        Receives the progress of the drawing.
    """
    figures = _figures(outcome)
    for done, figure in enumerate(figures):
        progress.report("figures", done, len(figures))
        if not folder.holds(figure.files):
            with folder.adding() as staging:
                figure.draw(staging)
    progress.report("figures", len(figures), len(figures))


def _figures(outcome: Outcome) -> list[Figure]:
    eset = outcome.equilibrium_set
    figures = [] if eset is None else [*_explorer(outcome, eset), *_figures_of_set(outcome, eset)]
    for each in outcome.answers:
        figures += each.question.kind.figures(each.question, eset, each.answer)
    return figures


def _explorer(outcome: Outcome, eset: EquilibriumSet) -> list[Figure]:
    """Page on which the set can be walked on, with all routes; none of an empty set."""
    if not len(eset.cells):
        return []
    routes = {
        route_name(name, k): route
        for name, found in outcome.of("route").items()
        for k, route in enumerate(found, 1)
    }
    known = next(iter(outcome.of("snap_graph").values()), None)
    reduction = next(iter(outcome.of("reduction").values()), None)

    def draw(folder: Path) -> None:
        explore(
            eset,
            routes,
            folder / EXPLORER,
            title=outcome.study.title,
            descriptors=_shown_descriptors(outcome.problem),
            reduction=reduction,
            snaps=None if known is None else SnapGraph(eset, *known[:2]),
        )

    return [Figure((EXPLORER,), draw, ON_THE_SET)]


def _figures_of_set(outcome: Outcome, eset: EquilibriumSet) -> list[Figure]:
    height = outcome.problem.ground.height
    if len(eset.names) == 1:
        caption = "Equilibria over the free parameter: stable ones as full lines."
        return [still(DIAGRAM, partial(plotting.diagram, eset, height), caption)]
    if len(eset.names) == 3:
        return []
    routes = [found[0] for found in outcome.of("route").values()]
    first = next((route for route in routes if route.arrived), None)
    figures = [
        still(
            SURFACE, partial(plotting.surface, eset, height, route=first),
            "The equilibrium set, coloured by index, with its folds.", wide=True,
        ),
        still(
            STABLE_PLANE, partial(plotting.parameter_plane, eset, count="stable"),
            "Number of stable equilibria.",
        ),
    ]  # fmt: skip
    # With routes, each of them is shown on this plane; once more without it would say nothing new.
    if not routes:
        caption = "Number of equilibria over the free parameters."
        figures.append(still(PLANE, partial(plotting.parameter_plane, eset), caption))
    return figures


def report(outcome: Outcome, folder: Path, text: str, title: str) -> str:
    """Return the page.

    Parameters
    ----------
    outcome
        What was found.
    folder
        Folder of the figures and of the page.
    text
        The study file as it was written.
    title
        Heading.
    """
    body = [f"<h1>{escape(title)}</h1>", _question(outcome.problem)]
    if (folder / EXPLORER).exists():
        body.append(html.embedded(EXPLORER, ON_THE_SET))
    for each in outcome.answers:
        body += each.question.kind.report(
            each.question, outcome.equilibrium_set, each.answer, folder
        )
    for point, states in zip(outcome.problem.points, outcome.points, strict=True):
        body += _equilibria(point, states, _shown_descriptors(outcome.problem))
    if outcome.equilibrium_set is not None:
        body += _set(outcome, outcome.equilibrium_set, folder)
    body += ["<h2>Study</h2>", f"<pre>{escape(text.strip())}</pre>", _colophon(outcome)]
    return html.page(title, body)


def _question(problem: Problem) -> str:
    words = [problem.structure.kind]
    wanted = problem.ground.extent
    if wanted is not None:
        words += html.extent(wanted.box, wanted.fixed, wanted.constraints)
    return f'<p class="lead">{escape(" · ".join(words))}</p>'


def _shown_descriptors(problem: Problem) -> list[Descriptor]:
    """Descriptors that the study speaks of, each once."""
    wanted = problem.ground.extent
    bounded = [] if wanted is None else [each.descriptor for each in wanted.constraints]
    return list({each.name: each for each in [problem.ground.height, *bounded]}.values())


def _in_space(stable: States) -> str:
    """How many of the states that are stable in their plane are so in space, if that is known."""
    index = stable.structure.index_out_of_plane(stable.z, stable.p)
    return "" if index is None else f" in their plane, {int((index == 0).sum())} also in space"


def _equilibria(
    point: dict[str, float], states: States, descriptors: list[Descriptor]
) -> list[str]:
    where = ", ".join(f"{name} = {html.number(value)}" for name, value in point.items())
    heading = f"<h2>Equilibria at {escape(where)}</h2>"
    if not len(states):
        return [heading, "<p>None within the constraints.</p>"]
    # The highest state comes first, which readers look for.
    order: Int[np.ndarray, " lanes"] = np.argsort(-descriptors[0](states))
    stable = states.stable
    return [
        heading,
        f"<p>{len(states)} found, {len(stable)} of them stable{_in_space(stable)}.</p>",
        html.table_of_states(states[order], descriptors),
        html.EXPLANATION,
    ]


def _set(outcome: Outcome, eset: EquilibriumSet, folder: Path) -> list[str]:
    audit = eset.audit
    word = "clean" if audit.clean else "not clean: do not rely on the set where it says so"
    rows = [[escape(what), escape(value)] for what, value in audit.rows()]
    return [
        "<h2>Equilibrium set</h2>",
        *pictures(folder, _figures_of_set(outcome, eset)),
        f"<h3>Audit: {word}</h3>",
        html.table([], rows, "words"),
        '<p>All of it is in <a href="results.h5">results.h5</a> for xarray '
        '(<code>xarray.open_datatree</code>), and under the name <a href="results.vtkhdf">'
        "results.vtkhdf</a> for ParaView and <code>pyvista.read</code>.</p>",
    ]


def _colophon(outcome: Outcome) -> str:
    stages = ", ".join(f"{name} {value:.1f} s" for name, value in outcome.seconds.items())
    reused = " The set was read from an earlier run." if outcome.reused else ""
    return (
        f'<p class="faint">equimorph {escape(version("equimorph"))}. Wall time: '
        f"{escape(stages)}.{reused}</p>"
    )
