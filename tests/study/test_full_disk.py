"""A disk that fills up at any write: one line, nothing finished lost, nothing half-written read."""

import errno
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from equimorph.errors import InputError
from equimorph.study import Outcome, run_study
from faults import Operations
from typecheck import unchecked

EVERYTHING = 10**9


@pytest.fixture(autouse=True)
def _without_checks_of_shapes() -> Iterator[None]:
    with unchecked():
        yield


def _full() -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _contents(folder: Path) -> dict[str, bytes]:
    """Files of a results folder, without those that tell how long the run took."""
    told = {"index.html", "equimorph.json"}
    files = (file for file in folder.iterdir() if file.is_file() and file.name not in told)
    return {file.name: file.read_bytes() for file in files}


@pytest.fixture
def known_set(finished: tuple[Outcome, Path], monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Hand out the known set in place of computing it, and count how often."""
    asked: list[int] = []

    def hand_out(*_: object, **__: object) -> object:
        asked.append(1)
        return finished[0].equilibrium_set

    monkeypatch.setattr("equimorph.study.run.equilibrium_set", hand_out)
    return asked


def _run_on_full_disk(spring_file: Path, out: Path, at: int) -> int:
    """Run with a disk that fills up; return the number of operations tried."""
    with pytest.MonkeyPatch.context() as patch:
        operations = Operations(out, at, _full).install(patch)
        if at == EVERYTHING:
            run_study(spring_file, out)
        else:
            with pytest.raises(InputError, match="No space left on device") as found:
                run_study(spring_file, out)
            assert "\n" not in str(found.value)
    return operations.count


def _check(spring_file: Path, base: Path, places: range, known_set: list[int]) -> None:
    for at in places:
        out = base / f"out-{at}"
        _run_on_full_disk(spring_file, out, at)
        checkpoints = out / ".equimorph" / "checkpoints"
        finished = any(len(file.name) > 64 for file in checkpoints.glob("*"))
        known_set.clear()
        run_study(spring_file, out)
        assert bool(known_set) != finished, f"at operation {at}"
        assert _contents(out) == _contents(base / "undisturbed"), f"at operation {at}"
        assert not list(out.rglob("*partial*"))


@pytest.fixture
def operations(spring_file: Path, tmp_path: Path, plain_figures: None, known_set: list[int]) -> int:
    """Number of operations of an undisturbed run."""
    return _run_on_full_disk(spring_file, tmp_path / "undisturbed", EVERYTHING)


def test_a_full_disk_at_some_operations(
    operations: int, spring_file: Path, tmp_path: Path, known_set: list[int]
):
    """A prime step, so that all kinds of operations take their turn."""
    assert operations > 100
    _check(spring_file, tmp_path, range(0, operations, 67), known_set)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(10))
def test_a_full_disk_at_every_operation(
    operations: int, spring_file: Path, tmp_path: Path, known_set: list[int], first: int
):
    """All ten cases together."""
    _check(spring_file, tmp_path, range(first, operations, 10), known_set)
