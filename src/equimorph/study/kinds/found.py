"""What kinds have in common whose answers are states of the set."""

from collections.abc import Mapping, Sequence
from functools import partial
from html import escape
from pathlib import Path

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor
from equimorph.structures import States
from equimorph.study import html
from equimorph.study.kinds.kind import Figure, still
from equimorph.study.names import task_files
from equimorph.study.tables import EXPLANATION, table_of_states


def figures_of_states(
    eset: EquilibriumSet | None, table: str, name: str, states: States
) -> list[Figure]:
    """Where the states lie on the plane of two free parameters."""
    assert eset is not None
    if len(eset.names) != 2:
        return []
    return [still(task_files(table, name), partial(plotting.solutions, eset, states))]


def report_of_states(  # what is told, piece by piece
    folder: Path,
    table: str,
    name: str,
    states: States,
    descriptors: Sequence[Descriptor],
    more: Mapping[str, list[str]] | None = None,
) -> list[str]:
    """Return a numbered table of states, with the plane on which they lie."""
    file = f"{task_files(table, name)}.png"
    picture = html.pictures(folder, {}, {file: "Where they lie: full dots are stable."})
    return [picture, table_of_states(states, descriptors, more, numbered=True), EXPLANATION]


def heading(table: str, name: str) -> str:
    """Return the heading of an answer."""
    return f"<h2>{table.replace('_', ' ').capitalize()} {escape(name)}</h2>"


def free_columns(
    states: States, names: Sequence[str], shown: Sequence[Descriptor]
) -> dict[str, list[str]]:
    """Columns with the values of parameters that no descriptor shows."""
    known = {each.name for each in shown}
    return {
        name: [html.number(value, 7) for value in states[name]]
        for name in names
        if name not in known
    }
