"""Docstrings are written for the prompt; marks that Sphinx needs in them are added here."""

import re

import equimorph

KEY = re.compile(r"\[([A-Z]\w+\d{4}\w?)\]_")
ENTRY = re.compile(r"^- \*\*\[(\w+)\]\*\*", re.MULTILINE)
LITERAL = re.compile(r"(``.*?``)")
NAME = re.compile(r"(?<![`\w:])`([^`<>]+)`(s\b)?")


def marked(line: str) -> str:
    r"""Return a line of a docstring with links to public names and publications, and bars as bars.

    >>> print(marked("`State`s with |κ| < `bound` [Feher2025]_"))
    :py:obj:`~equimorph.State`\ s with \|κ\| < ``bound`` :ref:`[Feher2025] <feher2025>`
    """
    parts = LITERAL.split(line)
    parts[::2] = [
        KEY.sub(
            lambda key: f":ref:`[{key[1]}] <{key[1].lower()}>`",
            NAME.sub(_linked, part).replace("|", r"\|"),
        )
        for part in parts[::2]
    ]
    return "".join(parts)


def _linked(name: re.Match[str]) -> str:
    known = name[1].split(".")[0] in equimorph.__all__
    mark = f":py:obj:`~equimorph.{name[1]}`" if known else f"``{name[1]}``"
    return mark + (rf"\ {name[2]}" if name[2] else "")


def mark_docstring(app, what, name, thing, options, lines):
    """Mark the lines of a docstring; code that stands in it stays."""
    lines[:] = [each if ">>>" in each else marked(each) for each in lines]


def anchor_entries(app, name, source):
    """Give each entry of the bibliography an anchor."""
    if name == "references":
        source[0] = ENTRY.sub(r"- [**\1**]{#\1}", source[0])


def setup(app):
    """Connect both."""
    app.connect("autodoc-process-docstring", mark_docstring, priority=900)
    app.connect("source-read", anchor_entries)
    return {"parallel_read_safe": True}
