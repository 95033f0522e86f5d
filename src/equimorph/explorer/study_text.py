"""The part of a study file that says what a set is, for routes that the page exports."""

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def study_text(eset: EquilibriumSet, title: str) -> str:
    """Title, structure and set as a study file, to which the page adds routes.

    Raises
    ------
    InputError
        If the structure cannot be written down, as with loads that are functions.
    """
    structure = {k: v for k, v in eset.structure.identity().items() if v is not None}
    sides = zip(eset.names, eset.box.lower.tolist(), eset.box.upper.tolist(), strict=True)
    section: dict[str, Any] = {"box": {name: [low, high] for name, low, high in sides}}
    if eset.fixed:
        section["fixed"] = {name: float(value) for name, value in eset.fixed.items()}
    validity = {str(each) for each in eset.structure.validity}
    within = [str(each) for each in eset.constraints if str(each) not in validity]
    if within:
        section["within"] = within
    section["intervals"] = list(eset.intervals)
    lines = [f"title = {toml(title)}", "", "[structure]"]
    lines += [f"{_key(key)} = {toml(value)}" for key, value in structure.items()]
    lines += ["", "[set]", *(f"{_key(key)} = {toml(value)}" for key, value in section.items())]
    return "\n".join(lines) + "\n"


def toml(value: Any) -> str:
    """A value as TOML on one line.

    Raises
    ------
    InputError
        For what TOML has no form for.

    Examples
    --------
    >>> toml({"a": [1, 2.5], "b c": "d"})
    '{ a = [1, 2.5], "b c" = "d" }'
    """
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        items = [f"{_key(k)} = {toml(v)}" for k, v in value.items() if v is not None]
        return "{ " + ", ".join(items) + " }" if items else "{}"
    if isinstance(value, bool | str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, Sequence):
        return "[" + ", ".join(toml(each) for each in value) + "]"
    raise InputError(f"`structure` must be plain data to be written down; got {value!r}.")


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else json.dumps(name, ensure_ascii=False)
