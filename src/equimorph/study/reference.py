"""All keys of study files as a page, from the signatures and docstrings of the tasks.

``python -m equimorph.study.reference > docs/study-keys.md`` writes it.
"""

import inspect
import re
import sys
from collections.abc import Callable
from typing import Any, Literal, get_args, get_origin

from pydantic.fields import FieldInfo

from equimorph.manifold import equilibrium_set
from equimorph.structures import KINDS as STRUCTURES
from equimorph.study.fields import Section
from equimorph.study.kinds import KINDS
from equimorph.study.problem import SetSection
from equimorph.study.question import Kind
from equimorph.study.structures import SECTIONS

TITLE = """\
# Keys of study files

Written by `python -m equimorph.study.reference` from the signatures and docstrings of the tasks;
see [studies.md](studies.md) for what the tables are and how values are written. Keys without a
default must be given. Every question has a `name`, with which the names of its files begin.
"""
SHARED = {
    "box": "Ranges of two parameters; for questions about a set, by default the box of the set.",
    "intervals": "Intervals of the grid along each of them.",
    "rates": "Largest rates of parameters, for an objective with time.",
    "schedule": "Name of a schedule file, or `start` and `steps` instead.",
    "steps": "Values of parameters, step by step.",
    "lifts": "Largest number of straight lifts.",
    "batch": "Lifts side by side.",
    "reach": "Longest extension of a tree, in scaled parameters.",
    "slices": "Most sets over two of the actuators.",
    "seed": "Seed of the random numbers.",
    "probability": "With which a route survives normally distributed errors; else all of a box.",
    "accelerations": "Largest changes of rates per unit of time.",
    "jerks": "Largest changes of accelerations per unit of time; they need accelerations.",
    "links": "Links of each member of a chain.",
    "step": "Step in time, in units of T.",
    "damping": "Damping of elastic joints over their stiffness, in units of T.",
    "hold": "Time for which the last parameters are held, in units of T.",
}
"""Meanings of keys that several tables have."""


def reference() -> str:
    """Return the page as Markdown: each table with its tasks, keys, defaults and meanings."""
    pages = [TITLE, *map(_of_structure, sorted(SECTIONS)), _of_set()]
    return "\n".join([*pages, *map(_of_kind, KINDS)])


def meanings(task: Callable[..., Any]) -> dict[str, str]:
    """Return what each parameter of a task means: the first sentence of its docstring on it.

    Examples
    --------
    >>> import equimorph as em
    >>> sorted(meanings(em.least_snap))
    ['eset', 'state']
    """
    text = inspect.getdoc(task) or ""
    section = re.search(r"Parameters\n-+\n(.*?)(?:\n\n[A-Z]\w+\n-+\n|\Z)", text, re.DOTALL)
    found: dict[str, str] = {}
    names: list[str] = []
    for line in section[1].splitlines() if section else ():
        if line and not line.startswith(" "):
            names = [name.strip() for name in line.split(",")]
        else:
            found |= {name: f"{found.get(name, '')} {line.strip()}".strip() for name in names}
    return {name: _first_sentence(words) for name, words in found.items()}


def _of_structure(kind: str) -> str:
    structure = STRUCTURES[kind]
    return _page(f"[structure] of kind {kind}", [structure], SECTIONS[kind], meanings(structure))


def _of_set() -> str:
    return _page("[set]", [equilibrium_set], SetSection, meanings_of_set())


def _of_kind(kind: Kind[Any]) -> str:
    return _page(f"[[{kind.table}]]", kind.tasks, kind.section, meanings_of_kind(kind))


def meanings_of_set() -> dict[str, str]:
    """Return what each key of ``[set]`` means."""
    return {"box": "Ranges of one, two or three free parameters."} | meanings(equilibrium_set)


def meanings_of_kind(kind: Kind[Any]) -> dict[str, str]:
    """Return what each key of a kind of question means."""
    told = dict(SHARED)
    for task in reversed(kind.tasks):  # the first has the last word
        for name, words in meanings(task).items():
            told[kind.names.get(name, name)] = words
    for key, field in kind.section.model_fields.items():
        if field.description:
            told[key] = field.description
    return told


def _page(title: str, tasks: Any, section: type[Section], told: dict[str, str]) -> str:
    names = ", ".join(f"`{task.__name__}`" for task in tasks)
    head = ["| key | default | meaning |", "| --- | --- | --- |"]
    lines = [f"## `{title}`", "", names, "", *head]
    for key, field in section.model_fields.items():
        if key not in ("name", "kind"):
            words = f"{told.get(key, '')} {_choice(field)}".strip()
            lines.append(f"| `{key}` | {_default(field)} | {words} |")
    return "\n".join([*lines, ""])


def _choice(field: FieldInfo) -> str:
    """Words that a value may be."""
    words = get_args(field.annotation) if get_origin(field.annotation) is Literal else ()
    return f"One of {', '.join(f'`{word}`' for word in words)}." if words else ""


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return ""
    value = field.get_default(call_default_factory=True)
    words = {None: "none", True: "true", False: "false"}
    return f"`{words[value]}`" if value is None or isinstance(value, bool) else f"`{value!r}`"


def _first_sentence(text: str) -> str:
    found = re.match(r".*?\.(?=\s|$)", text)
    return (found[0] if found else f"{text}.").replace("``", "`").replace("|", "\\|")


if __name__ == "__main__":
    sys.stdout.write(reference())
