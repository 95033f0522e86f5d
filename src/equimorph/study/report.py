"""What shows a study's answers: figures, a page that works offline, and data for programs.

Of a result record the summary for programs holds what is a number, a truth value or a word, short
lists of these, and the records inside; arrays of states stay in the results file.
"""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import partial
from html import escape
from importlib.metadata import version
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from rich.text import Text

from equimorph import plotting
from equimorph.arrays import Int
from equimorph.explorer import explore
from equimorph.manifold import EquilibriumSet, SnapGraph
from equimorph.model import Descriptor, Progress, Schedule, names_of
from equimorph.structures import State, States, Structure
from equimorph.study import html
from equimorph.study.folder import ResultsFolder
from equimorph.study.prepare import Answered, Outcome, Problem
from equimorph.study.question import (
    DIAGRAM,
    EXPLORER,
    PLANE,
    STABLE_PLANE,
    SURFACE,
    Figure,
    pictures,
    route_name,
    still,
)

ON_THE_SET = "The equilibrium set, to turn and to walk on"
"""Words of the page that shows it."""


def draw_figures(outcome: Outcome, folder: ResultsFolder, progress: Progress) -> None:
    """Draw all figures of an outcome that the folder does not hold yet."""
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
        figures += each.question.kind.figures(each.question, each.answer)
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
            outcome.problem.ground.field if outcome.of("barriers") else eset,
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
    """Return the page on what was found, with figures of a folder and the study as written."""
    body = [f"<h1>{escape(title)}</h1>", _question(outcome.problem)]
    if (folder / EXPLORER).exists():
        body.append(html.embed(EXPLORER, ON_THE_SET))
    for each in outcome.answers:
        body += each.question.kind.report(each.question, each.answer, folder)
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


LONGEST = 20
"""Largest number of entries of a list in a summary; longer arrays are data of the results file."""
DEEPEST = 3
"""Records inside records inside the answer that a summary still describes."""
LEFT_OUT = (EquilibriumSet, Structure, States, Schedule, Descriptor)
"""Results that have files of their own, and objects that the study names itself."""


def summary(outcome: Outcome) -> dict[str, Any]:
    """Return what a run found: the set, the equilibria at points, and all answers.

    Parameters
    ----------
    outcome
        All answers of a study.

    Returns
    -------
    Entries ``set`` (number of vertices and components, audit), ``equilibria`` (parameters, index,
    margin, energy and height of every state, in the units of the study), ``answers`` (table, name,
    whether it was refused and why, one line, values by the names of the result's fields), and
    ``seconds`` of each stage. Numbers that are not finite are None.
    """
    eset = outcome.equilibrium_set
    points = zip(outcome.problem.points, outcome.points, strict=True)
    return {
        "set": None if eset is None else _of_set(eset, reused=outcome.reused),
        "equilibria": [
            {"at": dict(at), "states": _of_states(states, outcome.problem.ground.height)}
            for at, states in points
        ],
        "answers": [_of_answer(each) for each in outcome.answers],
        "seconds": {stage: round(taken, 3) for stage, taken in outcome.seconds.items()},
    }


def _of_set(eset: EquilibriumSet, *, reused: bool) -> dict[str, Any]:
    return {
        "vertices": len(eset.points),
        "components": len(eset.components),
        "clean": bool(eset.audit.clean),
        "faults": [str(fault) for fault in eset.audit.faults],
        "reused": reused,
    }


def _of_states(states: States, height: Descriptor) -> list[dict[str, Any]]:
    rows = zip(states.index, states.margin, states.energy, height(states), strict=True)
    names = ("index", "margin", "energy", height.name)
    return [dict(zip(names, map(_plain, row), strict=True)) for row in rows]


def _of_answer(each: Answered) -> dict[str, Any]:
    return {
        "table": each.question.kind.table,
        "name": each.name,
        "refused": bool(each.refusal),
        "why": each.refusal,
        "line": Text.from_markup(each.line).plain,
        "values": _plain(each.answer),
    }


def _plain(value: Any, depth: int = 0) -> Any:
    """Return the plain part of a value; None where it has none."""
    if isinstance(value, Enum):
        value = value.value
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist() if value.size <= LONGEST else None
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, State):
        return _of_state(value)
    if isinstance(value, LEFT_OUT) or depth > DEEPEST:
        return None
    return _inside(value, depth)


def _inside(value: Any, depth: int) -> Any:
    """Plain parts of what holds values: a mapping, a list, a record."""
    if isinstance(value, Mapping):
        pairs = {
            str(getattr(key, "name", key)): _plain(inner, depth + 1) for key, inner in value.items()
        }
        return pairs if len(pairs) <= LONGEST else None
    if isinstance(value, tuple | list):
        return [_plain(inner, depth + 1) for inner in value] if len(value) <= LONGEST else None
    if is_dataclass(value):
        held = {each.name: _plain(getattr(value, each.name), depth + 1) for each in fields(value)}
        return {name: inner for name, inner in held.items() if inner is not None}
    return None


def _of_state(state: State) -> dict[str, Any]:
    names = names_of(state.structure.parameters)
    return {
        "parameters": {name: float(state[name]) for name in names},
        "index": int(state.index),
        "margin": _plain(float(state.margin)),
        "energy": _plain(float(state.energy)),
    }
