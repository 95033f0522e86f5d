"""Landscapes: ``[[landscape]]``."""

from functools import partial

import numpy as np

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.study import html
from equimorph.study.question import DataTable, Figure, Kind, Question, still
from equimorph.tables import Column, Table, units_of
from equimorph.tasks.optimising.landscapes import Landscape, landscape

NO_JUMP = 1e-9
"""Jump relative to the values that is rounding."""


class LandscapeKind(Kind[Landscape]):
    """The best stable state at every setting, with barriers and gaps between them."""

    table = "landscape"
    tasks = (landscape,)

    def tables(self, question: Question, answer: Landscape) -> list[DataTable]:
        """Return settings with their values, and the edges that cross barriers."""
        names, axes = answer.grid.names, answer.grid.axes()
        own, objective = question.structure.parameters, question["objective"]
        units = units_of((*own, objective))
        places = zip(names, np.meshgrid(*axes, indexing="ij"), strict=True)
        settings = {name: each.ravel() for name, each in places}
        settings[objective.name] = answer.value.ravel()
        barriers = answer.barriers
        edges: dict[str, Column] = {"kind": barriers.kind}
        for end in (0, 1):
            for k, name in enumerate(names):
                edges[f"{name} {end + 1}"] = barriers.ends[:, end, k]
                units[f"{name} {end + 1}"] = units[name]
        for end in (0, 1):
            edges[f"value {end + 1}"] = barriers.values[:, end]
            units[f"value {end + 1}"] = objective.unit
        files = question.files
        return [
            DataTable(f"{files}.csv", "settings", Table(settings, units)),
            DataTable(f"{files}-barriers.csv", "barriers", Table(edges, units)),
        ]

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Landscape
    ) -> list[Figure]:
        """Return the map with barriers and gaps."""
        objective = question["objective"]
        draw = partial(plotting.landscape, question.structure, answer, objective)
        caption = f"The {_word(question)} {objective.name} of stable states at each setting."
        return [still(question.files, draw, caption)]

    def words(self, question: Question, answer: Landscape) -> str:
        """Range, gaps and barriers in one line."""
        return "; ".join(f"{what}: {value}" for what, value in _summary(question, answer)) + "."

    def details(self, question: Question, answer: Landscape) -> list[str]:
        """What barriers mean, and the largest jump there."""
        jumps = np.abs(np.diff(answer.barriers.values, axis=1)).ravel()
        highest = ""
        if len(jumps):
            real = jumps.max() > NO_JUMP * np.abs(answer.barriers.values).max()
            where = f"there by at most {html.number(jumps.max())}" if real else "nowhere"
            highest = f" The value itself jumps {where}."
        return [
            "<p>At a barrier of stability the best state is lost on the way to the neighbouring "
            "setting; at one of preference it goes on, but another one is better there."
            f"{highest}</p>"
        ]


def _word(question: Question) -> str:
    return "least" if question.section.sense == "min" else "largest"


def _summary(question: Question, found: Landscape) -> list[tuple[str, str]]:
    """Summary, by name."""
    total, gaps = found.gaps.size, int(found.gaps.sum())
    known = found.value[~found.gaps]
    rows = []
    if len(known):
        ends = f"{html.number(known.min(), 6)} to {html.number(known.max(), 6)}"
        rows.append((f"{_word(question)} {question['objective'].name}", ends))
    rows.append(("settings without an allowed stable state", f"{gaps} of {total}"))
    for kind in ("stability", "preference"):
        count = sum(each == kind for each in found.barriers.kind)
        rows.append((f"grid edges that cross a barrier of {kind}", str(count)))
    return rows
