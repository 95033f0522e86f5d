"""The answers of a study as plain data for programs: numbers, words, lists and tables of these.

Of a result record the summary holds what is a number, a truth value or a word, short lists of
these, and the records inside; arrays of states stay in the results file.
"""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from math import isfinite
from typing import Any

import numpy as np
from rich.text import Text

from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor, Schedule, names_of
from equimorph.structures import State, States, Structure
from equimorph.study.prepare import Answered, Outcome

LONGEST = 20
"""Largest number of entries of a list in a summary; longer arrays are data of the results file."""
DEEPEST = 3
"""Records inside records inside the answer that a summary still describes."""
LEFT_OUT = (EquilibriumSet, Structure, States, Schedule, Descriptor)
"""Results that have files of their own, and objects that the study names itself."""


def summary(outcome: Outcome) -> dict[str, Any]:
    """Return what a run found: the set, the equilibria at points, and all answers.

    Parameters
    ----------
    outcome
        All answers of a study.

    Returns
    -------
    Entries ``set`` (number of vertices and components, audit), ``equilibria`` (parameters, index,
    margin, energy and height of every state, in the units of the study), ``answers`` (table, name,
    whether it was refused and why, one line, values by the names of the result's fields), and
    ``seconds`` of each stage. Numbers that are not finite are None.
    """
    eset = outcome.equilibrium_set
    points = zip(outcome.problem.points, outcome.points, strict=True)
    return {
        "set": None if eset is None else _of_set(eset, reused=outcome.reused),
        "equilibria": [
            {"at": dict(at), "states": _of_states(states, outcome.problem.ground.height)}
            for at, states in points
        ],
        "answers": [_of_answer(each) for each in outcome.answers],
        "seconds": {stage: round(taken, 3) for stage, taken in outcome.seconds.items()},
    }


def _of_set(eset: EquilibriumSet, *, reused: bool) -> dict[str, Any]:
    return {
        "vertices": len(eset.points),
        "components": len(eset.components),
        "clean": bool(eset.audit.clean),
        "faults": [str(fault) for fault in eset.audit.faults],
        "reused": reused,
    }


def _of_states(states: States, height: Descriptor) -> list[dict[str, Any]]:
    rows = zip(states.index, states.margin, states.energy, height(states), strict=True)
    names = ("index", "margin", "energy", height.name)
    return [dict(zip(names, map(_plain, row), strict=True)) for row in rows]


def _of_answer(each: Answered) -> dict[str, Any]:
    return {
        "table": each.question.kind.table,
        "name": each.name,
        "refused": bool(each.refusal),
        "why": each.refusal,
        "line": Text.from_markup(each.line).plain,
        "values": _plain(each.answer),
    }


def _plain(value: Any, depth: int = 0) -> Any:
    """Return the plain part of a value; None where it has none."""
    if isinstance(value, Enum):
        value = value.value
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist() if value.size <= LONGEST else None
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, State):
        return _of_state(value)
    if isinstance(value, LEFT_OUT) or depth > DEEPEST:
        return None
    return _inside(value, depth)


def _inside(value: Any, depth: int) -> Any:
    """Plain parts of what holds values: a mapping, a list, a record."""
    if isinstance(value, Mapping):
        pairs = {_name(key): _plain(inner, depth + 1) for key, inner in value.items()}
        return pairs if len(pairs) <= LONGEST else None
    if isinstance(value, tuple | list):
        return [_plain(inner, depth + 1) for inner in value] if len(value) <= LONGEST else None
    if is_dataclass(value):
        held = {each.name: _plain(getattr(value, each.name), depth + 1) for each in fields(value)}
        return {name: inner for name, inner in held.items() if inner is not None}
    return None


def _of_state(state: State) -> dict[str, Any]:
    names = names_of(state.structure.parameters)
    return {
        "parameters": {name: float(state[name]) for name in names},
        "index": int(state.index),
        "margin": _plain(float(state.margin)),
        "energy": _plain(float(state.energy)),
    }


def _name(key: Any) -> str:
    """Key of a table: the name of a descriptor, or what is written."""
    return str(getattr(key, "name", key))
