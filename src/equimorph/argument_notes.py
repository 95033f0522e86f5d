"""Kinds that annotations name: points, ranges, pairs of names, quantities with units.

They are written ``Annotated[Sequence[float], DIRECTION]``; see `argument_kinds`.
"""

import re
from itertools import pairwise
from typing import Any

from equimorph.argument_kinds import Kind, is_listed, is_number, number_kind
from equimorph.argument_vocabulary import FINITE, POSITIVE, RANGES, Range


def _are_numbers(value: Any, count: int) -> bool:
    listed = is_listed(value) and len(value) == count
    return listed and all(is_number(each) and FINITE.holds(each) for each in value)


def _is_range(value: Any, count: int) -> bool:
    return _are_numbers(value, count) and bool(value[0] < value[1])


PAIR = Kind(
    "two finite numbers (x, y)", "pairs of numbers (x, y)", lambda value: _are_numbers(value, 2)
)
DIRECTION = Kind(
    "two finite numbers (x, y), not both 0",
    "directions (x, y)",
    lambda value: _are_numbers(value, 2) and any(value),
)
LOAD_DIRECTION = Kind(
    "two numbers (x, y), not both 0, or for a rod in space three (x, y, z)",
    "directions (x, y) or (x, y, z)",
    lambda value: (_are_numbers(value, 2) or _are_numbers(value, 3)) and any(value),
)
BOUNDS = Kind(
    "two finite numbers (lower, upper), lower < upper",
    "pairs (lower, upper)",
    lambda value: _is_range(value, 2),
)
DIVIDED = Kind(
    "(lower, upper, intervals): finite lower < upper and a whole number of intervals >= 1",
    "triples (lower, upper, intervals)",
    lambda value: _is_range(value, 3) and value[2] >= 1 and value[2] == int(value[2]),
)
NAME = re.compile(r"[A-Za-z0-9_]+")
"""A name of a joint."""
TWO_NAMES = Kind(
    "two different names of joints, like ('A', 'B')",
    "pairs of joints, like ('A', 'B')",
    lambda value: (
        is_listed(value)
        and len(value) == 2
        and all(isinstance(each, str) and NAME.fullmatch(each) for each in value)
        and value[0] != value[1]
    ),
)
SEVERAL_NAMES = Kind(
    "two or more names of joints, successive ones different, like ('A', 'B', 'C')",
    "sequences of joints, like ('A', 'B', 'C')",
    lambda value: (
        is_listed(value)
        and len(value) >= 2
        and all(isinstance(each, str) and NAME.fullmatch(each) for each in value)
        and all(a != b for a, b in pairwise(value))
    ),
)
SPACE_DIRECTION = Kind(
    "three finite numbers (x, y, z), not all 0",
    "directions (x, y, z)",
    lambda value: _are_numbers(value, 3) and any(value),
)
QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)")
"""A number and what follows it: its unit."""


def quantity(_: Any, name: str) -> Kind:
    """Kind of a number, or a text of one with its unit; both in the range of the name."""
    return _quantity_in(RANGES.get(name, FINITE))


def positive_quantity(_: Any, __: str) -> Kind:
    """Kind of a positive number, or a text of one with its unit, whatever it is called."""
    return _quantity_in(POSITIVE)


def _quantity_in(allowed: Range) -> Kind:
    number = number_kind(float, "", allowed)

    def fits(value: Any) -> bool:
        if not isinstance(value, str):
            return number.fits(value)
        found = QUANTITY.fullmatch(value)
        return found is not None and found.group(2) != "" and allowed.holds(float(found.group(1)))

    text = "a text with its unit, like '2.5 mm'"
    return Kind(f"{allowed.words}, or {text}", f"{allowed.several}, or texts", fits, number.convert)


THREE_QUANTITIES = Kind(
    "three finite numbers, or texts with their units",
    "triples of numbers or texts",
    lambda value: (
        is_listed(value)
        and len(value) == 3
        and all(_quantity_in(FINITE).fits(each) for each in value)
    ),
)
