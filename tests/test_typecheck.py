"""Checks of types and shapes find what the plain checks find, at every call."""

import os
import sys
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import jaxtyping
import numpy as np
import pytest
from beartype.roar import BeartypeCallHintViolation
from jaxtyping import Bool, Float, Int, install_import_hook, jaxtyped

from equimorph.linalg import solve_bordered
from typecheck import MARK, check, checked, unchecked

Row = Float[np.ndarray, " n"]
Table = Float[np.ndarray, "m n"]
Whole = Int[np.ndarray, "n *m"]
Result = Float[np.ndarray, "... n"]


def _first(row: Row, table: Table, **_: object) -> Row:
    """The first row, or too much of it when asked."""
    return table[0] if row[0] == 0 else np.append(table[0], 0.0)


def _refused(call: Callable[..., Any], *args: Any, **kwargs: Any) -> bool:
    try:
        call(*args, **kwargs)
    except BeartypeCallHintViolation:
        return True
    return False


RIGHT = np.zeros(3), np.zeros((2, 3))


def test_a_wrong_shape_is_found_after_right_ones():
    first = checked(_first)
    for _ in range(3):
        assert not _refused(first, *RIGHT)
        assert _refused(first, np.zeros(4), RIGHT[1])
        assert _refused(first, row=RIGHT[0], table=np.zeros((3, 2)))
        assert _refused(first, np.zeros(3, dtype=int), RIGHT[1])
        assert _refused(first, RIGHT[0], RIGHT[1].tolist())


def test_a_wrong_result_is_found_after_right_ones_of_the_same_arguments():
    first = checked(_first)
    for _ in range(3):
        assert not _refused(first, *RIGHT)
        assert _refused(first, np.ones(3), RIGHT[1])


def test_a_right_result_of_another_shape_than_before_passes():
    @checked
    def some(row: Row, count: int) -> Float[np.ndarray, " some"]:
        return row[:count]

    assert [some(RIGHT[0], count).size for count in (3, 2, 1)] == [3, 2, 1]


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ((1.0, np.zeros(2)), (1.0, np.zeros(2, dtype=bool))),
        ((1, np.zeros(2)), ("1", np.zeros(2))),
        ((1.0, np.zeros(2)), (1.0, np.zeros(2), 1.0)),
    ],
)
def test_entries_of_tuples_are_looked_at(right, wrong):
    @checked
    def pair(it: tuple[float, Row]) -> None:
        del it

    assert not _refused(pair, right)
    assert _refused(pair, wrong)


def test_entries_of_lists_and_mappings_are_looked_at():
    @checked
    def both(rows: list[Row], named: Mapping[str, Row]) -> None:
        del rows, named

    row = np.zeros(2)
    assert not _refused(both, [row, row], {"a": row})
    assert _refused(both, [np.zeros((1, 2))], {"a": row})
    assert _refused(both, [row, row], {"a": np.zeros(3)})
    assert _refused(both, [row, row], {1: row})


def test_literals_are_told_from_other_values_of_their_type():
    @checked
    def sense(it: Literal["min", "max"], order: Literal[1, 2]) -> None:
        del it, order

    assert not _refused(sense, "min", 1)
    assert _refused(sense, "mean", 1)
    assert _refused(sense, "min", 3)


def test_closures_share_what_passed_and_nothing_else():
    def made(result: Any, hint: Any) -> Callable[..., Any]:
        def call(row: Row) -> hint:
            del row
            return result

        return checked(call)

    assert not _refused(made(np.zeros(3), Row), np.zeros(3))
    assert _refused(made(np.zeros(2), Row), np.zeros(3))
    assert _refused(made(np.zeros(3), Int[np.ndarray, " n"]), np.zeros(3))


def test_fields_of_dataclasses_are_checked():
    @checked
    @dataclass(frozen=True)
    class Points:
        x: Row
        flags: Bool[np.ndarray, " n"]

    Points(np.zeros(2), np.zeros(2, dtype=bool))
    assert _refused(Points, np.zeros(2), np.zeros(3, dtype=bool))
    assert _refused(Points, np.zeros(2), flags=np.zeros(2))


def test_calls_are_refused_where_the_plain_check_refuses_them():
    """Two hundred calls of few shapes, many of them seen before."""

    def last(a: Row, b: Table | Whole, c: Any) -> Result:
        del a, b
        return c

    remembering, plain = checked(last), jaxtyped(last, typechecker=check)
    generator = np.random.default_rng(0)
    refused = np.zeros(2)
    for _ in range(200):
        call = [
            np.zeros(
                generator.integers(1, 3, size=generator.choice([least, least + 1], p=[0.9, 0.1])),
                dtype=generator.choice(["f8", "i8"], p=[0.9, 0.1]),
            )
            for least in (1, 2, 1)
        ]
        wrong = _refused(plain, *call)
        assert _refused(remembering, *call) == wrong
        refused[int(wrong)] += 1
    assert refused.min() > 20


def test_checks_in_several_threads_keep_their_calls_apart():
    """Every call has a shape of its own, so that each is checked; threads change often."""

    @checked
    def twice(row: Row) -> Row:
        return 2.0 * row

    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            found = list(pool.map(lambda n: twice(np.full(n, float(n))), range(1, 401)))
    finally:
        sys.setswitchinterval(before)
    assert [len(each) for each in found] == list(range(1, 401))


def test_modules_are_checked_as_they_are_imported(tmp_path: Path, monkeypatch):
    (tmp_path / "planted_shapes.py").write_text(
        "import numpy as np\n"
        "from jaxtyping import Float\n"
        "def twice(x: Float[np.ndarray, ' n']) -> Float[np.ndarray, ' n']:\n"
        "    return np.append(x, x) if x.any() else x\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(jaxtyping, "jaxtyped", checked)
    with install_import_hook("planted_shapes", "typecheck.check"):
        import planted_shapes  # noqa: PLC0415
    del sys.modules["planted_shapes"]
    planted_shapes.twice(np.zeros(2))
    with pytest.raises(BeartypeCallHintViolation, match=r"planted_shapes\.twice\(\) return"):
        planted_shapes.twice(np.ones(2))
    with pytest.raises(BeartypeCallHintViolation, match=r"planted_shapes\.twice\(\) parameter x"):
        planted_shapes.twice(np.ones((2, 2)))
    with unchecked():
        assert planted_shapes.twice(np.ones(2)).size == 4


def test_the_package_is_checked_unless_told_otherwise():
    unwanted = os.environ.get("EQUIMORPH_SHAPES") == "unchecked"
    assert hasattr(solve_bordered, MARK) != unwanted
