"""Pieces of a page that needs nothing but itself."""

import base64
import re
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path

import numpy as np

from equimorph.arrays import Float, Values
from equimorph.model import Box, Constraint, Descriptor
from equimorph.plotting.depth import flat_shapes
from equimorph.structures import States

ROOM = 0.03
"""Empty border of a sketch, so that its line is not cut."""
EXPLANATION = (
    "<p>Index: number of directions in which the energy falls. Margin: smallest stiffness in "
    "any direction, negative where unstable.</p>"
)
BOLD = re.compile(r"\*\*(.+?)\*\*")
"""What is bold on page and screen, in the words on an answer."""
_MEDIA = {".png": "image/png", ".gif": "image/gif"}
_LARGER = {".png": ".svg", ".gif": ".mp4"}


def page(title: str, body: Sequence[str]) -> str:
    """Return a whole page with the style sheet inside: a plain title, and pieces of HTML."""
    style = files("equimorph.study").joinpath("report.css").read_text(encoding="utf-8")
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n<main>\n"
        + "\n".join(body)
        + "\n</main>\n</body>\n</html>\n"
    )


def figure(file: Path, caption: str, *, larger: str = "", wide: bool = False) -> str:
    """Return a picture, PNG or GIF, with its caption; the picture itself goes into the page.

    The caption is plain text, and also read aloud. `larger` is a file in the folder of the page
    that the picture links to; a wide one takes a whole row.
    """
    data = base64.b64encode(file.read_bytes()).decode("ascii")
    words = escape(caption)
    image = f'<img src="data:{_MEDIA[file.suffix]};base64,{data}" alt="{words}">'
    linked = f'<a href="{escape(larger)}">{image}</a>' if larger else image
    kind = ' class="wide"' if wide else ""
    return f"<figure{kind}>{linked}<figcaption>{words}</figcaption></figure>"


def pictures(folder: Path, wide: Mapping[str, str], small: Mapping[str, str]) -> str:
    """Return those of some pictures that are in a folder, by file name with their captions.

    A PNG links to the SVG of the same name, a GIF to the MP4 if there is one.
    """
    shown = [
        figure(folder / name, text, larger=_larger(folder / name), wide=name in wide)
        for name, text in {**wide, **small}.items()
        if (folder / name).exists()
    ]
    return f'<div class="figures">{"".join(shown)}</div>'


def _larger(file: Path) -> str:
    other = file.with_suffix(_LARGER[file.suffix])
    return other.name if other.suffix == ".svg" or other.exists() else ""


def answer_line(words: str) -> str:
    """Return the paragraph of an answer; what stands between two pairs of stars is bold."""
    text = BOLD.sub(lambda bold: f"<strong>{bold[1].capitalize()}</strong>", escape(words), count=1)
    kind = ' class="verdict"' if text.startswith("<strong>") else ""
    return f"<p{kind}>{text}</p>"


def embed(file: str, caption: str) -> str:
    """Return a frame with another page of the folder, and a link to it."""
    words = escape(caption)
    return (
        f'<p><a href="{file}">{words}</a>, in a window of its own.</p>\n'
        f'<iframe class="page" src="{file}" title="{words}"></iframe>'
    )


def refusal_line(why: str) -> str:
    """Return the line of an answer without a result, with the reason."""
    return f'<p class="verdict refused"><strong>Refused.</strong> {escape(why)}</p>'


def schedule_links(table: str) -> str:
    """Return a line with links to a schedule and its sidecar."""
    sidecar = table.replace(".csv", ".json")
    return (
        f'<p>Actuator schedule: <a href="{table}">{table}</a>, with the structure, the first state '
        f'and the loads in <a href="{sidecar}">{sidecar}</a>.</p>'
    )


def table_links(contents: Mapping[str, str]) -> list[str]:
    """Return a line with links to tables, each with what is in it; nothing without tables."""
    links = ", ".join(
        f'<a href="{file}">{file}</a> ({escape(content)})' for file, content in contents.items()
    )
    return [f"<p>Tables: {links}.</p>"] if links else []


def extent(box: Box, fixed: Mapping[str, float], constraints: Sequence[Constraint]) -> list[str]:
    """Return ranges, values and bounds in words, as plain text."""
    ranges = [
        f"{name} ∈ [{number(low)}, {number(high)}]"
        for name, low, high in zip(box.names, box.lower, box.upper, strict=True)
    ]
    values = [f"{name} = {number(value)}" for name, value in fixed.items()]
    caps = [str(each).replace("<=", "≤").replace(">=", "≥") for each in constraints]
    return [*ranges, *values, *caps]


def table(
    head: Sequence[str], rows: Sequence[Sequence[str]], classes: Sequence[str] | str = ""
) -> str:
    """Return a table of ready pieces of HTML, with a head unless that is empty.

    `classes` is the class of the table, or one for each row.
    """
    whole = classes if isinstance(classes, str) else ""
    each = [""] * len(rows) if isinstance(classes, str) else classes
    titles = "".join(f'<th scope="col">{cell}</th>' for cell in head)
    lines = [
        f'<tr class="{kind}">' + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>"
        for kind, row in zip(each, rows, strict=True)
    ]
    top = f"<thead><tr>{titles}</tr></thead>" if head else ""
    return (
        f'<div class="scroll"><table class="{whole}">{top}<tbody>'
        + "\n".join(lines)
        + "</tbody></table></div>"
    )


def sketch(shape: Float[np.ndarray, "points 2"], box: Float[np.ndarray, "2 2"]) -> str:
    """Return a small drawing of a shape, whose y points upward.

    The corners of the box are those of what is drawn, so that several sketches share their scale.
    """
    (left, low), (right, high) = box
    points = " ".join(f"{x:.4f},{-y:.4f}" for x, y in shape)
    view = f"{left:.4f} {-high:.4f} {right - left:.4f} {high - low:.4f}"
    return f'<svg viewBox="{view}" aria-hidden="true"><polyline points="{points}"/></svg>'


def number(value: float, digits: int = 4) -> str:
    """Return a number for reading; minus signs are proper ones.

    Examples
    --------
    >>> number(-0.149633)
    '−0.1496'
    """
    rounded = f"{value:.{digits}g}"
    return "0" if float(rounded) == 0 else rounded.replace("-", "−")


def table_of_states(
    states: States,
    descriptors: Sequence[Descriptor],
    more: Mapping[str, list[str]] | None = None,
    *,
    numbered: bool = False,
) -> str:
    """Return a table with one row per state, and a column for each descriptor.

    `more` are further columns, ready texts by their titles; numbers from 1 are those of the
    accompanying figure.
    """
    shapes = flat_shapes(states.structure, states.shape())
    box = np.stack([shapes.min(axis=(0, 1)) - ROOM, shapes.max(axis=(0, 1)) + ROOM])
    columns = {"": ["stable" if index == 0 else f"index {index}" for index in states.index]}
    for each in descriptors:
        columns[f"{each.name} ({each.unit})"] = numbers(each(states))
    energy = states.structure.descriptor("energy")
    columns |= {"margin": numbers(states.margin)}
    columns |= {f"{energy.name} ({energy.unit})": numbers(states.energy), **(more or {})}
    marks = [str(k) for k in range(1, len(states) + 1)] if numbered else None
    head = [*([""] if marks else []), "shape", *map(escape, columns)]
    rows = [
        [
            *([marks[k]] if marks else []),
            sketch(shape, box),
            *(escape(column[k]) for column in columns.values()),
        ]
        for k, shape in enumerate(shapes)
    ]
    return table(head, rows, ["" if index == 0 else "unstable" for index in states.index])


def numbers(values: Values) -> list[str]:
    """Return numbers for reading."""
    return [number(value) for value in values]
