"""Fields of a study file: numbers, intervals, points and comparisons, strict and finite."""

from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from pydantic_core import PydanticCustomError

from equimorph.errors import InputError
from equimorph.study.expressions import LARGEST, parse_comparison
from equimorph.study.names import task_files


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
Point = dict[str, Number]
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

    @property
    def needs_set(self) -> bool:
        """Whether it is asked of the set of the study."""
        return True

    def stems(self, table: str) -> list[str]:
        """Beginnings of the names of its files, which no other question may have."""
        return [task_files(table, self.name)]
