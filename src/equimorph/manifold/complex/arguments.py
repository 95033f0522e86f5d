"""What callers give, checked at the door."""

from collections.abc import Mapping, Sequence
from numbers import Real
from types import UnionType
from typing import Any

import numpy as np
from jaxtyping import Float

from equimorph.errors import InputError
from equimorph.model import Box, Constraint, Descriptor


def whole_number(name: str, value: Any, least: int) -> int:
    """Value of an argument that must be a whole number.

    Raises
    ------
    InputError
        If it is none, or smaller than `least`.
    """
    number = float(value) if isinstance(value, Real) else float("nan")
    if not number >= least or not number.is_integer():
        raise InputError(f"`{name}` must be a whole number >= {least}; got {value!r}.")
    return int(number)


def constraints(within: Any) -> tuple[Constraint, ...]:
    """Constraints in a list of such.

    Raises
    ------
    InputError
        If it is no list, or holds anything else.
    """
    alone = isinstance(within, Constraint | str) or not isinstance(within, Sequence)
    wrong = [within] if alone else [each for each in within if not isinstance(each, Constraint)]
    if wrong:
        raise InputError(
            "`within` must be a list of constraints, like `[rod.max_curvature <= 6]`; "
            f"got {wrong[0]!r}."
        )
    return tuple(within)


def numbers(name: str, values: Any, *, each: str) -> Float[np.ndarray, "..."]:
    """Values of a parameter as an array.

    Raises
    ------
    InputError
        If they are no numbers, with `each` for what is wanted.
    """
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"`{name}` must be {each}; got {values!r}.") from None


def check_kind(name: str, given: Any, kind: type | UnionType, wanted: str) -> None:
    """Check the type.

    Raises
    ------
    InputError
        If the type differs; the message names the expected type.
    """
    if not isinstance(given, kind):
        raise InputError(f"`{name}` must be {wanted}; got {given!r}.")


def check_descriptors(name: str, given: Any) -> None:
    """Refuse what is no sequence of descriptors, or none.

    Raises
    ------
    InputError
        With what was given.
    """
    each = given if isinstance(given, Sequence) and not isinstance(given, str) else [given]
    for one in each:
        check_kind(name, one, Descriptor, "a descriptor, like `rod.max_curvature`")


def check_box(box: Any, fixed: Any) -> None:
    """Refuse what is no box, and fixed values that are not given by name.

    Raises
    ------
    InputError
        With what is allowed instead.
    """
    check_kind("box", box, Box, "a box, like `Box(q=(0.0, 2.5))`")
    if fixed is not None and not isinstance(fixed, Mapping):
        raise InputError(f'`fixed` must give values by name, like `{{"q": 2.5}}`; got {fixed!r}.')


def check_accuracy(accuracy: Any) -> None:
    """Refuse what is no accuracy.

    Raises
    ------
    InputError
        If it is no positive finite number.
    """
    number = float(accuracy) if isinstance(accuracy, Real) else float("nan")
    if not 0.0 < number < float("inf"):
        raise InputError(f"`accuracy` must be positive and finite; got {accuracy!r}.")
