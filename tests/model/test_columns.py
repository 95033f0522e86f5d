"""Records of columns: selections, joins and replacements of rows."""

from dataclasses import dataclass

import numpy as np
import pytest

from equimorph.columns import Columns


@dataclass(frozen=True)
class Inner(Columns):
    """One column."""

    values: np.ndarray


@dataclass(frozen=True)
class Record(Columns):
    """A nested record, columns, one that is missing, and something that all rows share."""

    inner: Inner
    wide: np.ndarray
    missing: np.ndarray | None
    shared: str


def record(first: int, count: int) -> Record:
    """Rows with the numbers from `first` on."""
    rows = first + np.arange(count)
    return Record(Inner(rows), np.stack([rows, -rows], axis=1), None, "shared")


@pytest.mark.parametrize(
    "rows", [np.array([3, 0]), np.array([True, False, False, True]), slice(1, 3)]
)
def test_a_selection_takes_the_same_rows_of_all_columns(rows):
    """Numbers, flags and slices, as of arrays."""
    some = record(0, 4).take(rows)
    np.testing.assert_array_equal(some.inner.values, np.arange(4)[rows])
    np.testing.assert_array_equal(some.wide[:, 1], -some.inner.values)
    assert (some.missing, some.shared) == (None, "shared")


def test_parts_follow_each_other():
    """The rows of the first part come first."""
    whole = Record.concatenate([record(0, 2), record(2, 3)])
    np.testing.assert_array_equal(whole.inner.values, np.arange(5))
    np.testing.assert_array_equal(whole.wide[:, 0], np.arange(5))


def test_rows_are_replaced_in_a_copy():
    """The record itself stays what it is."""
    here = record(0, 3)
    there = here.with_rows(np.array([1]), record(7, 1))
    np.testing.assert_array_equal(there.inner.values, [0, 7, 2])
    np.testing.assert_array_equal(here.inner.values, [0, 1, 2])
    mixed = here.where(np.array([False, True, False]), record(10, 3))
    np.testing.assert_array_equal(mixed.wide[:, 0], [10, 1, 12])
