"""Fields of a study file: numbers, intervals, points and comparisons, strict and finite.

Comparisons are texts like ``max_curvature <= 20``. Nothing is evaluated: the structure looks up the
descriptor, the bound is a number.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, cast

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from pydantic_core import PydanticCustomError

from equimorph.equilibria import worst_named
from equimorph.errors import InputError
from equimorph.model import Constraint, Descriptor
from equimorph.structures import Structure

LARGEST = 1e9
"""Largest number of a study; all scales of a structure are near 1."""

_FORM = re.compile(
    r"""\s*([^<>=]*[^<>=\s])\s*(<=|>=)\s*"?\s*([-+.\deE]+)\s*([A-Za-z1][^<>="]*?)?\s*"?\s*"""
)


@dataclass(frozen=True)
class Comparison:
    """A constraint as it is written: descriptor, ``<=`` or ``>=``, bound and perhaps its unit."""

    descriptor: str
    sense: Literal["<=", ">="]
    bound: float
    unit: str = field(default="", repr=False)

    def on(self, structure: Structure, known: Mapping[str, Descriptor] | None = None) -> Constraint:
        """Return the same comparison with the descriptor of a structure, or a known one."""
        of = worst_named(structure, self.descriptor, known)
        bound = f"{self.bound!r} {self.unit}" if self.unit else self.bound
        return of <= bound if self.sense == "<=" else of >= bound


def parse_comparison(text: str) -> Comparison:
    """Read ``descriptor <= number`` or ``descriptor >= number``, with or without a unit.

    Raises `InputError` if `text` has another form.

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
    return Comparison(found[1], cast(Literal["<=", ">="], found[2]), bound, found[4] or "")


def requirement(text: str) -> PydanticCustomError:
    """Refuse a value; `text` completes the sentence "`key` must ..."."""
    return PydanticCustomError("requirement", text.replace("{", "{{").replace("}", "}}"))


def _increasing(bounds: list[float]) -> list[float]:
    if not bounds[0] < bounds[1]:
        raise requirement("be [lower, upper] with lower < upper")
    return bounds


def two(table: dict[str, Any]) -> dict[str, Any]:
    """Refuse tables that have not two parameters."""
    if len(table) != 2:
        raise requirement("span exactly two free parameters")
    return table


def one(table: dict[str, Any]) -> dict[str, Any]:
    """Refuse tables that have not one descriptor."""
    if len(table) != 1:
        raise requirement("hold exactly one descriptor with its value")
    return table


def _comparison(text: str) -> str:
    try:
        parse_comparison(text)
    except InputError as error:
        raise requirement("read like max_curvature <= 20 or height(0.5) >= 0") from error
    return text


def is_number(value: Any) -> bool:
    """Whether it is a number of a study."""
    return type(value) in (int, float) and abs(value) <= LARGEST


def is_table(value: Any) -> bool:
    """Whether it is a table of at least two rows of two numbers."""
    rows = value if isinstance(value, list) else []
    return len(rows) >= 2 and all(
        isinstance(row, list) and len(row) == 2 and all(map(is_number, row)) for row in rows
    )


Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Interval = Annotated[list[Number], Field(min_length=2, max_length=2), AfterValidator(_increasing)]
Positive = Annotated[float, Field(gt=0, le=LARGEST)]
NotNegative = Annotated[float, Field(ge=0, le=LARGEST)]
Point = dict[str, Number]
Step = Annotated[Point, Field(min_length=1)]
Seed = Annotated[int, Field(ge=0, le=2**31)]
ComparisonText = Annotated[str, AfterValidator(_comparison)]
Count = Annotated[int, Field(ge=2, le=int(LARGEST))]
Intervals = Annotated[list[Count], Field(min_length=2, max_length=2)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=80)]


class Section(BaseModel):
    """A table of the file: strict types, finite numbers, no unknown keys."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class TaskSection(Section):
    """A question of a study; its files begin with its name."""

    name: Name
