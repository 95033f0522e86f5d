"""`reproduce`: all figures and numbers of the article and of this package, as one report."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from time import perf_counter

from equimorph.argument_checks import check_arguments
from equimorph.model import Progress, Silent
from equimorph.paper.examples import EXAMPLES, Example
from equimorph.storage.files import write_text
from equimorph.study import html
from equimorph.study.folder import writable


@dataclass(frozen=True)
class Quoted:
    """A number of the article."""

    example: str
    key: str
    """The example, and the key of ours among its numbers."""
    what: str
    theirs: float
    """What is quoted, and its value; True or False where the article says yes or no."""
    note: str = ""
    """One sentence where they differ by more than their last digit."""


@dataclass(frozen=True)
class QuotedTable:
    """A table of the article, ours in brackets."""

    example: str
    caption: str
    head: tuple[str, ...]
    """The example, what the table shows, and its column titles."""
    rows: tuple[tuple[str, tuple[tuple[str, str], ...]], ...]
    """The label of each row, and for each cell theirs and the key of ours."""


CONVENTION = (
    "The article's arch hangs down and its loads are negative, or it stands and they are positive; "
    "here it stands (Θ > 0) and loads press down (q > 0), which is the mirror image y → −y. "
    "Lengths are in units of L, loads of 4π²B/L², curvatures of 1/L; ν = sin 1."
)


def _value(text: str) -> float:
    return text == "yes" if text in ("yes", "no") else float(text)


def _read(path: Path) -> tuple[Quoted, ...]:
    """Rows of a table of quoted numbers."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return tuple(
        Quoted(each["example"], each["key"], each["what"], _value(each["theirs"]), each["note"])
        for each in rows
    )


QUOTED = _read(Path(__file__).with_name("quoted.csv"))

TABLES = (
    QuotedTable(
        "curvatures",
        "Largest curvatures at q = 2.5 for two loads and the actuators' settings: the article's, "
        "and in brackets ours. The article's Δ counts twice elsewhere (see the limit load at "
        "(0.9, 0.04)), and half of 1.16 is 0.58: there both loads agree with it best, 11.39 and "
        "3.76 against 11.7 and 3.35. The last two rows are the optima that are found here.",
        ("Θ, Δ", "uniform load", "left-half load"),
        (
            *(
                (
                    f"{theta:g}, {delta:g}".replace("-", "−"),
                    tuple(
                        (theirs, f"{load}: max |kappa| at ({theta:g}, {delta:g})")
                        for load, theirs in zip(("uniform", "left-half"), printed, strict=True)
                    ),
                )
                for theta, delta, printed in (
                    (0.96, 0.0, ("2.1", "7.6")),
                    (0.64, 1.16, ("11.7", "3.35")),
                    (0.64, -1.16, ("", "")),
                    (0.64, 0.58, ("", "")),
                    (0.64, -0.58, ("", "")),
                )
            ),
            (
                "0.936, 0",
                (
                    ("", "uniform: least max |kappa|"),
                    ("", "uniform: max |kappa| there under the other load"),
                ),
            ),
            (
                "0.647, 0.517",
                (
                    ("", "left-half: max |kappa| there under the other load"),
                    ("", "left-half: least max |kappa|"),
                ),
            ),
        ),
    ),
)


TITLE = "Quasi-static shape control of soft, morphing structures, reproduced"
SOURCE = (
    "E. Fehér, A. Á. Sipos, P. L. Várkonyi: Quasi-static shape control of soft, morphing "
    "structures, arXiv:2509.12916."
)
INTRODUCTION = (
    "Every figure, table and number of the article, reproduced: theirs, ours, the difference, "
    "and a sentence where they differ."
)
WIDE = ("tracking", "inside-out", "parameterisations", "space-route", "space-sideways")
"""Figures two columns wide."""
HEAD = ("what", "theirs", "ours", "difference", "")


@dataclass(frozen=True)
class Reproduction:
    """Key numbers of every example, by its name, and how long each took in seconds.

    A number that is True or False answers a question, and is shown as "yes" or "no".
    """

    numbers: Mapping[str, Mapping[str, float]]
    seconds: Mapping[str, float]

    def rows(self, example: str) -> list[tuple[Quoted, float]]:
        """What the article quotes of an example, with our numbers."""
        return [
            (each, self.numbers[example][each.key]) for each in QUOTED if each.example == example
        ]

    def tables(self, example: str) -> list[tuple[QuotedTable, list[list[str]]]]:
        """Tables of the article that belong to an example, with our numbers in their cells."""
        ours = self.numbers[example]
        return [
            (table, [[label, *(_cell(theirs, ours[key]) for theirs, key in cells)]
                     for label, cells in table.rows])
            for table in TABLES if table.example == example
        ]  # fmt: skip


@check_arguments
def reproduce(
    folder: Path, *, examples: Sequence[Example] = EXAMPLES, progress: Progress | None = None
) -> Reproduction:
    """Compute all examples; write their figures, and the report as HTML and as Markdown.

    Parameters
    ----------
    folder
        Where everything goes; made if it does not exist.
    examples
        Which to compute.
    progress
        Receives the progress.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    sink = progress or Silent()
    with writable(folder):
        folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "index.html", "")  # says at once if the folder cannot be written
    numbers: dict[str, dict[str, float]] = {}
    seconds: dict[str, float] = {}
    for done, example in enumerate(examples):
        sink.report("examples", done, len(examples))
        start = perf_counter()
        numbers[example.name] = example.main(folder)
        seconds[example.name] = perf_counter() - start
    sink.report("examples", len(examples), len(examples))
    found = Reproduction(numbers, seconds)
    write_text(folder / "report.md", markdown(found, examples))
    write_text(folder / "index.html", page(found, examples, folder))
    return found


def markdown(found: Reproduction, examples: Sequence[Example]) -> str:
    """Return the report as Markdown."""
    lines = [f"# {TITLE}", "", SOURCE, "", INTRODUCTION, "", CONVENTION, ""]
    for example in examples:
        lines += [f"## {example.title}", ""]
        for name, caption in example.captions.items():
            lines += [f"![{caption}]({name}.png)", "", f"*{caption}*", ""]
        for table, cells in found.tables(example.name):
            lines += [f"*{table.caption}*", "", *_markdown_rows(table.head, cells), ""]
        rows = found.rows(example.name)
        if rows:
            lines += [*_markdown_rows(HEAD, [_cells(*row) for row in rows]), ""]
        ours = found.numbers[example.name].items()
        lines += [*(f"- {key}: {in_words(value, 8)}" for key, value in ours), ""]
    return "\n".join(lines)


def page(found: Reproduction, examples: Sequence[Example], folder: Path) -> str:
    """Return the report as one page; the figures are in the folder."""
    body = [f"<h1>{escape(TITLE)}</h1>", f'<p class="lead">{escape(SOURCE)}</p>']
    body += [f"<p>{escape(text)}</p>" for text in (INTRODUCTION, CONVENTION)]
    for example in examples:
        body.append(f"<h2>{escape(example.title)}</h2>")
        wide, small = (
            {f"{k}.png": text for k, text in example.captions.items() if (k in WIDE) is large}
            for large in (True, False)
        )
        body.append(html.pictures(folder, wide, small))
        for table, cells in found.tables(example.name):
            body.append(f'<p class="faint">{escape(table.caption)}</p>')
            body.append(html.table(table.head, [[escape(c) for c in row] for row in cells]))
        rows = [[escape(cell) for cell in _cells(*row)] for row in found.rows(example.name)]
        if rows:
            body.append(html.table(HEAD, rows, "notes"))
        ours = found.numbers[example.name].items()
        listed = [[escape(key), in_words(value, 8)] for key, value in ours]
        if listed:
            body += ["<h3>Our numbers</h3>", html.table([], listed, "words")]
    times = ", ".join(f"{name} {value:.1f} s" for name, value in found.seconds.items())
    body.append(f'<p class="faint">Wall time: {escape(times)}.</p>')
    return html.page(TITLE, body)


def _markdown_rows(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return [f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |" for row in lines]


def _cell(theirs: str, ours: float) -> str:
    """Theirs, if there is any, and ours in brackets."""
    return f"{theirs} ({html.number(ours, 4)})".strip()


def _cells(quoted: Quoted, ours: float) -> list[str]:
    """Theirs, ours, the difference, and the sentence."""
    asked = isinstance(quoted.theirs, bool)
    difference = "" if asked else html.number(ours - quoted.theirs, 2)
    words = in_words(quoted.theirs, 6), in_words(bool(ours) if asked else ours, 7)
    return [quoted.what, *words, difference, quoted.note]


def in_words(value: float, digits: int) -> str:
    """Return a number for reading, or "yes" or "no"."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return html.number(value, digits)
