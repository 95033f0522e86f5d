"""Tables with units: tidy frames for pandas, rows for CSV files, HTML for notebooks."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from numbers import Integral, Real
from typing import Any, Protocol

import numpy as np

from equimorph.arrays import Shaped
from equimorph.errors import load_package

Column = Shaped[np.ndarray, " rows"] | Sequence[object]


@dataclass(frozen=True)
class Table:
    """Columns of one length by name, with units."""

    columns: Mapping[str, Column]
    """Numbers or texts, one for each row; None and NaN are empty cells of files."""
    units: Mapping[str, str] = field(default_factory=dict)
    """By the name of the column; the others are texts, or numbers without a unit."""

    def rows(self) -> list[list[str]]:
        """Texts of all cells, below the heads ``name (unit)``."""
        heads = [heading(name, self.units.get(name, "")) for name in self.columns]
        cells = [[_cell(each) for each in values] for values in self.columns.values()]
        return [heads, *map(list, zip(*cells, strict=True))]

    def frame(self) -> Any:
        """A `pandas.DataFrame` of the columns, with the units by column in ``attrs["units"]``.

        Raises
        ------
        MissingError
            If pandas is not installed.
        """
        frame = load_package("pandas", "tables", "frame").DataFrame(dict(self.columns))
        frame.attrs["units"] = {name: self.units.get(name, "") for name in self.columns}
        return frame


class Tabular(ABC):
    """Results that are a table."""

    @property
    @abstractmethod
    def table(self) -> Table:
        """The table; see `frame`."""

    def frame(self) -> Any:
        """The table as a tidy `pandas.DataFrame`, with the units of its columns in ``attrs``.

        Raises
        ------
        InputError
            If pandas is not installed.

        Examples
        --------
        ``eset.frame().query("index == 0")``, ``schedule.frame().attrs["units"]["time"]``
        """
        return self.table.frame()


class Quantity(Protocol):
    """Parameters, descriptors: what has a name and a unit."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def unit(self) -> str:
        """Its unit."""


def units_of(quantities: Iterable[Quantity]) -> dict[str, str]:
    """Units by name."""
    return {each.name: each.unit for each in quantities}


def heading(name: str, unit: str) -> str:
    """Head of a column; numbers without unit have none.

    Examples
    --------
    >>> heading("theta_A", "rad"), heading("progress", "1")
    ('theta_A (rad)', 'progress')
    """
    return f"{name} ({unit})" if unit not in ("", "1") else name


def number_text(value: float) -> str:
    """Return the shortest decimal that gives a number back exactly; nothing for no number."""
    return repr(float(value)) if math.isfinite(value) else ""


def _cell(value: object) -> str:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return number_text(value)
    return "" if value is None else str(value)


DIGITS = 6
"""Digits of numbers in tables."""


def html_table(title: str, head: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a table with a title; all texts are escaped.

    Parameters
    ----------
    title
        Plain text above the table.
    head
        Titles of the columns; empty: none are shown.
    rows
        Texts, which are set to the left, and numbers, set to the right with six digits.

    Examples
    --------
    >>> html_table("a < b", [], [["angle", 0.5]])
    '<table><caption>a &lt; b</caption><tr><td style="text-align: left">angle</td><td>0.5</td></tr></table>'
    """  # noqa: E501
    titles = "".join(f"<th>{escape(each)}</th>" for each in head)
    lines = [f"<tr>{titles}</tr>"] if head else []
    lines += ["<tr>" + "".join(map(_html_cell, row)) + "</tr>" for row in rows]
    return f"<table><caption>{escape(title)}</caption>{''.join(lines)}</table>"


def _html_cell(value: Any) -> str:
    if isinstance(value, Integral) and not isinstance(value, bool):
        return f"<td>{int(value)}</td>"
    if isinstance(value, Real) and not isinstance(value, bool):
        return f"<td>{float(value):.{DIGITS}g}</td>"
    return f'<td style="text-align: left">{escape(str(value))}</td>'
