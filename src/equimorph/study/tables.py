"""Tables of states for the page: a sketch of each, and what people want to know of it."""

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

from equimorph.arrays import Values
from equimorph.model import Descriptor
from equimorph.structures import States
from equimorph.study import html

ROOM = 0.03
"""Empty border of a sketch, so that its line is not cut."""
EXPLANATION = (
    "<p>Index: number of directions in which the energy falls. Margin: smallest stiffness in "
    "any direction, negative where unstable.</p>"
)


def table_of_states(
    states: States,
    descriptors: Sequence[Descriptor],
    more: Mapping[str, list[str]] | None = None,
    *,
    numbered: bool = False,
) -> str:
    """Return a table with one row per state.

    Parameters
    ----------
    states
        At least one.
    descriptors
        Columns.
    more
        Further columns, ready texts by their titles.
    numbered
        Whether rows are numbered from 1, as on a figure beside.
    """
    shapes = states.shape()
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
            html.sketch(shape, box),
            *(escape(column[k]) for column in columns.values()),
        ]
        for k, shape in enumerate(shapes)
    ]
    return html.table(head, rows, ["" if index == 0 else "unstable" for index in states.index])


def numbers(values: Values) -> list[str]:
    """Return numbers for reading."""
    return [html.number(value) for value in values]
