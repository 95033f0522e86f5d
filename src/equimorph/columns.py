"""Records of columns: what is known of many lanes, points or cells, one row for each."""

from collections.abc import Callable, Sequence
from functools import cache
from operator import attrgetter
from typing import Any, ClassVar, TypeVar

import numpy as np

from equimorph.arrays import Bool, Int, Some

Record = TypeVar("Record", bound="Columns")


class Columns:
    """Base of frozen dataclasses whose fields have one row for each lane.

    Fields are arrays, other such records, or None; anything else (a structure, a number, a
    function) is the same for all rows.
    """

    __match_args__: ClassVar[tuple[str, ...]] = ()

    def take(
        self: Record, rows: Int[np.ndarray, " some"] | Bool[np.ndarray, " all"] | slice
    ) -> Record:
        """Return a selection of the rows, by numbers, flags or a slice."""
        if isinstance(rows, np.ndarray) and rows.dtype == bool:
            rows = rows.nonzero()[0]
        numbers = not isinstance(rows, slice)
        return type(self)(
            *[
                # by numbers, `take` costs a fifth of brackets where rows are short
                field.take(rows, axis=0)
                if numbers and isinstance(field, np.ndarray)
                else _selection(field, rows)
                for field in self._fields
            ]
        )

    @classmethod
    def concatenate(cls: type[Record], parts: Sequence[Record]) -> Record:
        """All rows of some parts, at least one, part by part."""
        return cls(
            *(_chain(fields) for fields in zip(*(each._fields for each in parts), strict=True))
        )

    def with_rows(self: Record, rows: Some, others: Record) -> Record:
        """Return all rows, those with some numbers replaced."""
        pairs = zip(self._fields, others._fields, strict=True)
        return type(self)(*(_replacement(field, rows, other) for field, other in pairs))

    def where(self: Record, flags: Bool[np.ndarray, " rows"], others: Record) -> Record:
        """Return these rows where flags are set, and those of others elsewhere."""
        return self.with_rows(np.flatnonzero(~flags), others.take(~flags))

    @property
    def _fields(self) -> tuple[Any, ...]:
        return _reader(type(self))(self)


@cache
def _reader(kind: type[Columns]) -> Callable[[Any], tuple[Any, ...]]:
    """How the fields of records of a class are read, all at once."""
    names = kind.__match_args__
    if len(names) < 2:
        return lambda record: tuple(getattr(record, name) for name in names)
    return attrgetter(*names)


def _selection(field: Any, rows: Any) -> Any:
    if isinstance(field, np.ndarray):
        return field[rows]
    return field.take(rows) if hasattr(field, "take") else field


def _chain(fields: Sequence[Any]) -> Any:
    first = fields[0]
    if isinstance(first, np.ndarray):
        return np.concatenate(fields)
    return type(first).concatenate(fields) if isinstance(first, Columns) else first


def _replacement(field: Any, rows: Some, other: Any) -> Any:
    if isinstance(field, np.ndarray):
        field = field.copy()
        field[rows] = other
        return field
    return field.with_rows(rows, other) if isinstance(field, Columns) else field
