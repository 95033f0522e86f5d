"""A journal keeps whole sets: what it gives back is what was computed, bit for bit."""

import random
from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from equimorph.errors import CancelledError, InputError
from equimorph.manifold import EquilibriumSet, build, equilibrium_set, refine
from equimorph.manifold.refining import refine as refinement
from equimorph.model import Box, Journal, Progress
from equimorph.storage import open_journal
from equimorph.storage.journal import MARK
from equimorph.structures import Rod, Spring
from typecheck import unchecked

Lift = Callable[[Progress | None, Journal | None], EquilibriumSet]


@pytest.fixture(autouse=True)
def _without_checks_of_shapes() -> Iterator[None]:
    with unchecked():
        yield


def spring(progress: Progress | None, journal: Journal | None) -> EquilibriumSet:
    """Over two parameters, refined."""
    box = Box(x_l=(0.3, 1.3), F=(-0.5, 0.5))
    return equilibrium_set(
        Spring(), box, intervals=(4, 4), checks=0, accuracy=0.05, progress=progress, journal=journal
    )


def spring_in_three(progress: Progress | None, journal: Journal | None) -> EquilibriumSet:
    box = Box(x_l=(0.5, 1.2), F=(-0.2, 0.2), k=(0.5, 1.5))
    return equilibrium_set(
        Spring(), box, intervals=(3, 3, 2), checks=1, progress=progress, journal=journal
    )


def spring_slice(progress: Progress | None, journal: Journal | None) -> EquilibriumSet:
    """Symmetric: two sheets cross, and branches are switched."""
    box = Box(x_l=(0.5, 1.3), k=(0.5, 1.5))
    return equilibrium_set(
        Spring(), box, fixed={"F": 0.0}, intervals=(5, 3), progress=progress, journal=journal
    )


def arch(progress: Progress | None, journal: Journal | None) -> EquilibriumSet:
    rod = Rod()
    return equilibrium_set(
        rod, Box(Theta=(0.2, 2.5), Delta=(-2, 2)), fixed={"q": 2.5},
        within=[rod.max_curvature <= 20], intervals=(5, 9), progress=progress, journal=journal,
    )  # fmt: skip


def same(one: EquilibriumSet, other: EquilibriumSet) -> bool:
    arrays = [(one.points.z, other.points.z), (one.points.p, other.points.p)]
    for each in fields(EquilibriumSet):
        pair = getattr(one, each.name), getattr(other, each.name)
        if isinstance(pair[0], np.ndarray):
            arrays.append(pair)
    pieces = [(*each.folds, *each.crossings) for each in (one, other)]
    arrays.extend(zip(*pieces, strict=True))
    arrays.extend(
        (a.vertices, b.vertices) for a, b in zip(one.boundaries, other.boundaries, strict=True)
    )
    for name in ("audit", "components", "strata", "intervals", "fixed"):
        assert getattr(one, name) == getattr(other, name)
    kinds = [[piece.kind for piece in each.boundaries] for each in (one, other)]
    return kinds[0] == kinds[1] and all(np.array_equal(a, b) for a, b in arrays)


class Cancelling:
    """Progress sink that cancels at the report of some number."""

    def __init__(self, at: float) -> None:
        self.at, self.count = at, 0

    def report(self, stage: str, done: int, total: int | None) -> None:
        self.count += 1
        if self.count == self.at:
            raise CancelledError(stage)


def interrupted(lift: Lift, path: Path, at: float) -> EquilibriumSet | None:
    """Lift with a journal until a report of some number."""
    try:
        with open_journal(path) as journal:
            return lift(Cancelling(at), journal)
    except CancelledError:
        return None


SLOW = [
    pytest.param(each, marks=pytest.mark.slow) for each in (spring_in_three, spring_slice, arch)
]


@pytest.mark.parametrize("lift", [spring, *SLOW])
def test_a_set_that_is_cancelled_again_and_again_is_the_same_in_the_end(lift: Lift, tmp_path: Path):
    watch = Cancelling(np.inf)
    whole = lift(watch, None)
    generator = random.Random(0)
    path = tmp_path / "journal"
    for _ in range(3):
        assert interrupted(lift, path, generator.randint(1, watch.count)) is None
    last = interrupted(lift, path, np.inf)
    assert last is not None
    assert same(last, whole)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[EquilibriumSet, bytes]:
    """The refined set of the spring, and its journal."""
    path = tmp_path_factory.mktemp("finished") / "journal"
    with unchecked(), open_journal(path) as journal:
        return spring(None, journal), path.read_bytes()


def test_what_is_in_the_journal_is_not_computed_again(
    finished: tuple[EquilibriumSet, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    whole, content = finished
    path = tmp_path / "journal"
    path.write_bytes(content)
    monkeypatch.setattr(build, "_of_grid", None)
    with open_journal(path) as journal:
        assert same(spring(None, journal), whole)
    assert path.read_bytes() == content


def test_a_journal_that_is_damaged_anywhere_or_ends_anywhere_is_mended(
    finished: tuple[EquilibriumSet, bytes], tmp_path: Path
):
    whole, content = finished
    generator = random.Random(1)
    head = len(MARK) + 65
    for number in range(4):
        at = generator.randrange(head, len(content))
        flipped = bytes([content[at] ^ (1 << generator.randrange(8))])
        damaged = content[:at] if number % 2 else content[:at] + flipped + content[at + 1 :]
        path = tmp_path / f"{number}"
        path.write_bytes(damaged)
        with open_journal(path) as journal:
            assert same(spring(None, journal), whole)
        assert path.read_bytes() == content


def test_a_journal_cut_in_its_head_begins_anew(
    finished: tuple[EquilibriumSet, bytes], tmp_path: Path
):
    _, content = finished
    for length in (0, 3, len(MARK) + 7):
        path = tmp_path / f"{length}"
        path.write_bytes(content[:length])
        with open_journal(path) as journal:
            journal.begin("a question")
            assert journal.recall("a step") is None


def test_the_journal_of_another_set_is_refused_and_kept(
    finished: tuple[EquilibriumSet, bytes], tmp_path: Path
):
    whole, content = finished
    path = tmp_path / "journal"
    path.write_bytes(content)
    with (
        open_journal(path) as journal,
        pytest.raises(InputError, match="must be that of this very computation; got "),
    ):
        spring_slice(None, journal)
    with open_journal(path) as journal, pytest.raises(InputError, match="of another computation"):
        refine(whole, 0.01, journal=journal)
    assert path.read_bytes() == content
    with open_journal(path, replace=True) as journal:
        journal.begin("a question")
        assert journal.recall("a step") is None
    assert len(path.read_bytes()) == len(MARK) + 65


def test_another_file_is_refused_and_kept(tmp_path: Path):
    path = tmp_path / "notes"
    path.write_text("x")
    with (
        open_journal(path, replace=True) as journal,
        pytest.raises(InputError, match="another kind of file"),
    ):
        spring(None, journal)
    assert path.read_text() == "x"


def test_a_journal_in_use_and_a_place_that_cannot_be_written_are_named(tmp_path: Path):
    with open_journal(tmp_path / "one") as first, open_journal(tmp_path / "one") as second:
        first.begin("a question")
        with pytest.raises(InputError, match="must not be in use by another computation"):
            second.begin("a question")
    for path in (tmp_path, tmp_path / "missing" / "journal"):
        with open_journal(path) as journal, pytest.raises(InputError, match="can be written") as no:
            journal.begin("a question")
        assert "\n" not in str(no.value)


def test_steps_that_are_not_those_of_the_journal_are_found_anew(tmp_path: Path):
    """As by another release of a library, which gives other round-off."""
    path = tmp_path / "journal"
    with open_journal(path) as journal:
        journal.begin("a question")
        for number in range(3):
            assert journal.recall(f"step {number}") is None
            journal.keep(f"step {number}", (np.full(2, number), np.zeros((0, 3))))
        journal.begin("a question")
        (numbers, nothing) = journal.recall("step 0") or ((), ())
        assert list(numbers) == [0, 0]
        assert np.shape(nothing) == (0, 3)
        assert journal.recall("another step") is None
        assert journal.recall("step 2") is None
        journal.keep("another step", ())
        journal.begin("a question")
        assert journal.recall("step 0") is not None
        assert journal.recall("another step") == ()
        assert journal.recall("step 2") is None


def test_a_refined_set_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    eset = spring(None, None)
    with open_journal(tmp_path / "journal") as journal:
        whole = refine(eset, 0.01, None, journal)
    monkeypatch.setattr(refinement, "fabric_of", None)
    with open_journal(tmp_path / "journal") as journal:
        assert same(refine(eset, 0.01, None, journal), whole)
