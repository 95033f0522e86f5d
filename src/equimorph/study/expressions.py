"""Comparisons as text: ``max_curvature <= 20``.

Nothing is evaluated: the structure looks up the descriptor, the bound is a number.
"""

import re
from dataclasses import dataclass
from typing import Literal, cast

from equimorph.equilibria import worst_named
from equimorph.errors import InputError
from equimorph.model import Constraint
from equimorph.structures import Structure

LARGEST = 1e9
"""Largest number of a study; all scales of a structure are near 1."""

_FORM = re.compile(r"\s*([^<>=]*[^<>=\s])\s*(<=|>=)\s*([-+.\deE]+)\s*")


@dataclass(frozen=True)
class Comparison:
    """A constraint as it is written: descriptor, ``<=`` or ``>=``, bound."""

    descriptor: str
    sense: Literal["<=", ">="]
    bound: float

    def on(self, structure: Structure) -> Constraint:
        """Return the same comparison with the descriptor of a structure."""
        return Constraint(worst_named(structure, self.descriptor), self.sense, self.bound)


def parse_comparison(text: str) -> Comparison:
    """Read ``descriptor <= number`` or ``descriptor >= number``.

    Raises
    ------
    InputError
        If `text` has another form.

    Examples
    --------
    >>> parse_comparison("height(1/3) >= 0.1")
    Comparison(descriptor='height(1/3)', sense='>=', bound=0.1)
    """
    found = _FORM.fullmatch(text)
    try:
        bound = float(found[3]) if found else None
    except ValueError:
        bound = None
    if found is None or bound is None or not abs(bound) <= LARGEST:
        raise InputError(
            f"`constraint` must read like max_curvature <= 20 or height(0.5) >= 0, with a number "
            f"up to {LARGEST:g}; got {text!r}."
        )
    return Comparison(found[1], cast(Literal["<=", ">="], found[2]), bound)
