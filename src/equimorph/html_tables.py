"""Tables that notebooks show of results, as HTML."""

from collections.abc import Iterable, Sequence
from html import escape
from numbers import Integral, Real
from typing import Any

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
    lines += ["<tr>" + "".join(map(_cell, row)) + "</tr>" for row in rows]
    return f"<table><caption>{escape(title)}</caption>{''.join(lines)}</table>"


def _cell(value: Any) -> str:
    if isinstance(value, Integral) and not isinstance(value, bool):
        return f"<td>{int(value)}</td>"
    if isinstance(value, Real) and not isinstance(value, bool):
        return f"<td>{float(value):.{DIGITS}g}</td>"
    return f'<td style="text-align: left">{escape(str(value))}</td>'
