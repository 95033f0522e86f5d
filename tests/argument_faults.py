"""Calls with one wrong argument, and what comes of them."""

import inspect
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from equimorph.errors import InputError
from typecheck import unchecked


def outcome(function: Callable[..., Any], arguments: Mapping[str, Any]) -> str:
    """Outcome of a call with one fault: empty if it is refused as it should be."""
    parameters = inspect.signature(function).parameters
    first = [name for name, each in parameters.items() if each.kind is each.POSITIONAL_ONLY]
    try:
        with unchecked():
            function(
                *(arguments[name] for name in first if name in arguments),
                **{name: value for name, value in arguments.items() if name not in first},
            )
    except InputError as error:
        text = str(error)
        return "" if "\n" not in text and "; got" in text else f"refused in other words: {text}"
    except Exception as error:
        return f"raw {type(error).__name__}: {error}"
    return "accepted"


STRANGE = (object(), 3 + 4j, b"bytes", {None: 1.0}, [[None]], np.array([1j]))
"""Values that stand for nothing that a structure is made of."""
NO_NUMBERS = (np.nan, np.inf, -np.inf, True, "2", "two", [1.0], 10**400)
NO_NAMES = ("no such thing", "")
FREE = {"unit", "name", "natural"}
"""Keys whose texts are free, or formulas."""
FORMULAS = {"draw", "forces"}
"""Keys under which the text of a number is a formula."""
UNLIMITED = {"lower", "upper", "period"}
OPTIONAL = {"guesses", "normal"}


def mutants(value: Any, key: str = "") -> Iterator[Any]:
    """Right data, nested to any depth, with one wrong value, key or shape."""
    yield from STRANGE
    if isinstance(value, Mapping):
        yield from _mappings(value)
    elif isinstance(value, list | tuple):
        yield from () if key in OPTIONAL else (None,)
        yield from ([[*value[:at], None, *value[at + 1 :]] for at in range(len(value))])
        for at, each in enumerate(value):
            for wrong in mutants(each, key):
                yield [*value[:at], wrong, *value[at + 1 :]]
    elif isinstance(value, bool):
        yield from (1, 0.0, "yes")
    elif isinstance(value, int | float):
        allowed = (np.inf, -np.inf) if key in UNLIMITED else ("2",) if key in FORMULAS else ()
        yield from (wrong for wrong in NO_NUMBERS if wrong not in allowed)
    elif isinstance(value, str) and key not in FREE:
        yield from NO_NAMES


def _mappings(value: Mapping[str, Any]) -> Iterator[Any]:
    yield from (7, "text", [("A", 1.0)])
    for key, each in value.items():
        rest = {name: other for name, other in value.items() if name != key}
        yield from ({**rest, wrong: each} for wrong in (3, None, ("A", "B"), "no such thing"))
        yield from ({**rest, key: wrong} for wrong in mutants(each, key))
