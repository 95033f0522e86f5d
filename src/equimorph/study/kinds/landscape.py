"""Landscapes: ``[[landscape]]``."""

from collections.abc import Sequence
from functools import partial
from html import escape
from pathlib import Path

import numpy as np
from rich.markup import escape as plain

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.study import html
from equimorph.study.answers import heading, write_rows
from equimorph.study.question import Figure, Kind, Question, still
from equimorph.tasks import Landscape, landscape

NO_JUMP = 1e-9
"""Jump relative to the values that is rounding."""


class LandscapeKind(Kind[Landscape]):
    """The best stable state at every setting, with barriers and gaps between them."""

    table = "landscape"
    tasks = (landscape,)

    def write_tables(self, question: Question, answer: Landscape, folder: Path) -> None:
        """Write settings with their values, and the edges that cross barriers."""
        names, axes = answer.grid.names, answer.grid.axes()
        rows = [
            [*map(repr, (x, y)), repr(value) if np.isfinite(value) else ""]
            for x, line in zip(axes[0].tolist(), answer.value.tolist(), strict=True)
            for y, value in zip(axes[1].tolist(), line, strict=True)
        ]
        write_rows(folder / f"{question.files}.csv", [[*names, question["objective"].name], *rows])
        barriers = answer.barriers
        head = [
            "kind",
            *(f"{name} {end}" for end in (1, 2) for name in names),
            "value 1",
            "value 2",
        ]
        rows = [
            [kind, *map(repr, [*ends.ravel().tolist(), *values.tolist()])]
            for kind, ends, values in zip(
                barriers.kind, barriers.ends, barriers.values, strict=True
            )
        ]
        write_rows(folder / f"{question.files}-barriers.csv", [head, *rows])

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: Landscape
    ) -> Sequence[Figure]:
        """Return the map with barriers and gaps."""
        draw = partial(plotting.landscape, question.structure, answer, question["objective"])
        return [still(question.files, draw)]

    def report(self, question: Question, answer: Landscape, folder: Path) -> list[str]:
        """Range, gaps and barriers, the figure, and the tables."""
        files = question.files
        rows = [[escape(what), escape(value)] for what, value in _summary(question, answer)]
        jumps = np.abs(np.diff(answer.barriers.values, axis=1)).ravel()
        highest = ""
        if len(jumps):
            real = jumps.max() > NO_JUMP * np.abs(answer.barriers.values).max()
            size = f"at most {html.number(jumps.max())}" if real else "nowhere"
            highest = f" The value itself jumps there by {size}.".replace("by nowhere", "nowhere")
        caption = (
            f"The {_word(question)} {question['objective'].name} of stable states at each setting."
        )
        return [
            heading(question),
            html.table([], rows, "words"),
            html.pictures(folder, {}, {f"{files}.png": caption}),
            "<p>At a barrier of stability the best state is lost on the way to the neighbouring "
            "setting; at one of preference it goes on, but another one is better there."
            f"{highest}</p>",
            f'<p>Tables: <a href="{files}.csv">{files}.csv</a> (settings) and '
            f'<a href="{files}-barriers.csv">{files}-barriers.csv</a>.</p>',
        ]

    def verdict(self, question: Question, answer: Landscape) -> str:
        """Range, gaps and barriers in one line."""
        words = "; ".join(f"{what}: {value}" for what, value in _summary(question, answer))
        return f"{question.title}: {plain(words)}."


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
