"""Maps and trials on workers: the same bits as without, whoever computes the chunks."""

import dataclasses
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import equimorph as em
from equimorph.columns import Columns
from equimorph.model.journal import LEAST, MOST, cut_rows, map_rows
from same_records import assert_equal
from typecheck import unchecked


class Here:
    """Workers that compute here, and remember what they were asked."""

    def __init__(self) -> None:
        self.chunks: list[int] = []

    def map(self, function, chunks) -> Iterator:
        for chunk in chunks:
            self.chunks.append(len(next(iter(vars(chunk).values()))))
            yield function(chunk)


@dataclasses.dataclass(frozen=True)
class Numbered(Columns):
    """Rows with a number each."""

    number: np.ndarray


class Cancels:
    """A sink that cancels the computation after some reports."""

    def __init__(self, left: int) -> None:
        self.left = left

    def report(self, stage, done, total) -> None:
        self.left -= 1
        if self.left == 0:
            raise em.CancelledError(stage)


@pytest.fixture(scope="module")
def processes() -> Iterator[ProcessPoolExecutor]:
    """Two processes that begin empty, with one thread each."""
    with ProcessPoolExecutor(2, get_context("spawn"), em.set_threads, (1,)) as pool:
        yield pool


@pytest.fixture(scope="module")
def maps():
    """Functions of the workers: a map of limit loads, one of a descriptor, and trials."""
    spring = em.Spring()
    grid = em.Grid(x_l=(0.55, 1.2, 40), k=(1.0, 2.0, 40))
    start = em.lift(spring.natural_state(x_l=0.8), {"F": 0.01}).end.state
    return (
        lambda workers, sink=None: em.limit_load_map(
            spring, grid, "F", within=[abs(spring.angle) <= 1.0], progress=sink, workers=workers
        ),
        lambda workers, sink=None: em.curvature_map(
            spring, grid, "F", 0.02, descriptor=spring.angle, progress=sink, workers=workers
        ),
        lambda workers, sink=None: em.random_trials(
            start, [{"x_l": 0.9}, {"F": 0.03}], {"F": 0.01, "k": 0.05}, trials=1200,
            progress=sink, workers=workers,
        ),
    )  # fmt: skip


@pytest.fixture(scope="module")
def alone(maps):
    with unchecked():
        return [each(None) for each in maps]


@pytest.mark.parametrize("number", range(3))
def test_processes_find_the_same_bits(maps, alone, processes, number):
    with unchecked():
        found = maps[number](processes)
    for each in dataclasses.fields(found):
        assert_equal(getattr(found, each.name), getattr(alone[number], each.name))


@pytest.mark.parametrize("number", range(3))
def test_rows_are_computed_by_workers_alone(maps, number):
    """41² = 1681 settings and 1200 trials in chunks of 512 rows or fewer."""
    here = Here()
    with unchecked():
        maps[number](here)
    assert sum(here.chunks) == (1681, 1681, 1200)[number]
    assert len(here.chunks) > 1
    assert max(here.chunks) <= LEAST


@pytest.mark.parametrize("number", range(3))
def test_a_sink_cancels_what_workers_compute(maps, number):
    here = Here()
    with unchecked(), pytest.raises(em.CancelledError):
        maps[number](here, Cancels(2))
    assert len(here.chunks) == 1


def test_a_result_of_another_process_is_that_of_this_one(processes):
    arch = em.Rod(load="uniform")
    rest = arch.natural_state(Theta=0.9, Delta=0.1)
    with unchecked():
        here = em.limit_load(rest, "q", within=[arch.max_curvature <= 10.0])
        there = processes.submit(em.limit_load, rest, "q", within=[arch.max_curvature <= 10.0])
        assert_equal(there.result(), here)


def test_chunks_are_neither_small_nor_large():
    pool = ThreadPoolExecutor(1)
    assert cut_rows(10**6, None) == [slice(0, 10**6)]
    for count in (0, 1, LEAST, 20_000, 10**6):
        cuts = cut_rows(count, pool)
        assert sum(len(range(count)[cut]) for cut in cuts) == count
        assert all(cut.stop - cut.start <= MOST for cut in cuts)
        assert all(cut.stop - cut.start >= min(count, LEAST) for cut in cuts)


def test_finished_chunks_are_counted_from_one():
    """What is reported after each of three chunks; the rows come back in their order."""
    rows, reports = Numbered(np.arange(6)), []
    cuts = [slice(0, 2), slice(2, 3), slice(3, 6)]
    found = map_rows(lambda part: part, rows, cuts, Here(), reports.append)
    assert reports == [1, 2, 3]
    assert found.number.tolist() == list(range(6))


def test_what_cannot_map_is_refused():
    spring = em.Spring()
    grid = em.Grid(x_l=(0.6, 0.9, 2), k=(1.0, 2.0, 2))
    with unchecked(), pytest.raises(em.InputError, match="`workers` must be workers with the"):
        em.limit_load_map(spring, grid, "F", workers=2)
