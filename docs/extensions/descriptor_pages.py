"""The page of descriptors, from the annotations and docstrings of the methods of structures."""

import inspect
from functools import cached_property
from pathlib import Path

from public_names import descriptors_of, first_line_of, function, write_if_new

import equimorph as em

GENERAL = (
    "value_of",
    "effort_of",
    "margin_of",
    "distance_to",
    "outside",
    "worst_over",
    "stable_over",
)
TITLE = """\
# Descriptors

A descriptor is a scalar of a state. `rod.height(0.5)` in Python is `height(0.5)` in a study file;
compared with a number it is a constraint. This page is generated from the structures.

## Of every structure

In study files parameters stand by their names; `effort(Theta)`, `stability_margin`,
`distance(disc(x, y, r))`, `distance(half_plane(x, y, nx, ny))`, `distance(room(x, y, r))`,
`outside(Theta 1 to 2, Delta 0 to 1)`, `shape_x(0.3)`, `shape_y(0.3)`, `abs(...)` of any, and
`worst(... for F +- 0.01)` as an objective or a bound.

"""


def page() -> str:
    """Return the page as Markdown."""
    parts = [TITLE, _table([(f"[`em.{n}`](names/{n}.md)", getattr(em, n)) for n in GENERAL])]
    for kind, structure in sorted(em.structures.KINDS.items()):
        rows = [
            (f"`{each}{arguments(structure, each)}`", function(structure, each))
            for each in descriptors_of(structure)
        ]
        if rows:
            name = structure.__name__
            parts.append(
                f'## {name}\n\n`kind = "{kind}"`; [`em.{name}`](names/{name}.md)\n\n{_table(rows)}'
            )
    energy = "## EnergyStructure\n\nEvery unknown, `energy`, and what its `descriptors=` names.\n"
    return "\n".join([*parts, energy])


def arguments(structure: type, name: str) -> str:
    """Return the arguments of a method by name; none for a property.

    >>> arguments(em.Rod, "height")
    '(s)'
    """
    if isinstance(inspect.getattr_static(structure, name), property | cached_property):
        return ""
    names = list(inspect.signature(function(structure, name)).parameters)[1:]
    return f"({', '.join(names)})" if names else ""


def _table(rows: list[tuple[str, object]]) -> str:
    lines = [f"| {words} | {first_line_of(thing)} |" for words, thing in rows]
    return "\n".join(["| descriptor | |", "| --- | --- |", *lines, ""])


def setup(app):
    """Write the page before Sphinx looks for sources."""
    app.connect(
        "builder-inited",
        lambda app: write_if_new(Path(app.srcdir) / "reference" / "descriptors.md", page()),
    )
    return {"parallel_read_safe": True}
