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
        if isinstance(rows, slice):
            return type(self)(*[_selection(field, rows) for field in self._fields])
        some = np.asarray(rows)
        numbers = some.nonzero()[0] if some.dtype == bool else some
        return type(self)(
            *[
                # by numbers, `take` costs a fifth of brackets where rows are short
                field.take(numbers, axis=0)
                if isinstance(field, np.ndarray)
                else _selection(field, numbers)
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
        return _reader(self.__match_args__)(self)


@cache
def _reader(names: tuple[str, ...]) -> Callable[[Any], tuple[Any, ...]]:
    """How fields of records are read, all at once."""
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
