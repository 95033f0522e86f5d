"""Batches of lanes shared out among threads."""

import threading

import numpy as np
import pytest

import equimorph as em
from equimorph.linalg.lanes import in_background, over_lanes, results_of, threads
from equimorph.linalg.simd import LANES


def _double(x, out):
    out[:] = 2.0 * x


def test_shares_of_a_batch_make_up_the_whole():
    """Equal: the same operation on every lane, however many threads there are."""
    x, out = np.arange(3000.0), np.zeros(3000)
    over_lanes(_double, (), [x], [out])
    np.testing.assert_array_equal(out, 2.0 * x)


@pytest.mark.parametrize("lanes", range(10))
def test_a_few_lanes_are_filled_up_to_a_whole_vector(lanes: int):
    """Kernels see a vector of lanes or more, and copies of the last one where there are fewer."""
    seen = []

    def kernel(x, out):
        seen.append(x.copy())
        _double(x, out)

    x, out = np.arange(1.0, lanes + 1.0), np.zeros(lanes)
    over_lanes(kernel, (), [x], [out])
    np.testing.assert_array_equal(out, 2.0 * x)
    if 0 < lanes < LANES:
        assert seen[0].tolist() == [*x, *[lanes] * (LANES - lanes)]


def test_shares_begin_at_whole_vectors_and_none_is_small():
    """Whole vectors; a share of fewer than 256 lanes costs more than it saves."""
    shares = []
    x, out = np.arange(1037.0), np.zeros(1037)

    def kernel(x, out):
        shares.append((int(x[0]), len(x)))
        _double(x, out)

    over_lanes(kernel, (), [x], [out])
    assert sum(count for _, count in shares) == 1037
    assert all(start % 8 == 0 for start, _ in shares)
    assert min(count for _, count in shares) >= 256


def test_a_thread_of_the_pool_shares_out_nothing_more():
    """It would wait for threads that wait for it."""
    counts = []
    (held,) = in_background([lambda: counts.append(threads())])
    held.result()
    assert counts == [1]


def test_a_batch_does_not_wait_for_threads_that_are_busy():
    """All threads of the pool are held up: the caller does their shares itself."""
    go = threading.Event()
    held = in_background([go.wait for _ in range(threads())])
    x, out = np.arange(3000.0), np.zeros(3000)
    over_lanes(_double, (), [x], [out])
    np.testing.assert_array_equal(out, 2.0 * x)
    go.set()
    for each in held:
        each.result()


def test_results_of_tasks_come_in_their_order():
    """The first task waits for the second one, which runs on another thread."""
    go = threading.Event()

    def first() -> int:
        go.wait(5.0 if threads() > 1 else 0.0)
        return 1

    def second() -> int:
        go.set()
        return 2

    assert list(results_of([first, second])) == [1, 2]


def test_what_a_task_raises_reaches_the_caller():
    def fails() -> int:
        raise ValueError("no")

    results = results_of([int, fails, int])
    assert next(results) == 0
    with pytest.raises(ValueError, match="no"):
        next(results)


def test_tasks_that_have_not_begun_are_dropped_after_an_error():
    """All threads but one are held up, and the one fails: what waits for a thread never runs."""
    go, begun = threading.Event(), []
    held = in_background([go.wait for _ in range(threads() - 1)])

    def fails() -> None:
        raise ValueError("no")

    def waits() -> None:
        go.wait(5.0)

    results = results_of([fails, waits, *[lambda: begun.append(1)] * 3])
    with pytest.raises(ValueError, match="no"):
        next(results)
    go.set()
    for each in [*held, *in_background([int] * threads())]:
        each.result()
    assert begun == []


@pytest.fixture
def restored():
    yield
    em.set_threads()


@pytest.mark.usefixtures("restored")
def test_results_are_the_same_bits_on_any_number_of_threads():
    """Chunks of lanes and tasks are computed alone, whoever computes them."""
    spring = em.Spring()
    box = em.Box(x_l=(0.5, 1.3), F=(-0.2, 0.2))
    p = np.column_stack([np.linspace(0.6, 0.95, 700), np.zeros(700), np.ones(700)])
    starts = em.States(spring, spring.natural(p)[0], p)
    seen = []
    for count in (1, 2, 5):
        em.set_threads(count)
        assert threads() == count
        eset = em.equilibrium_set(spring, box, intervals=(8, 8), checks=0)
        limits = em.limit_load(starts, "F")
        seen.append(
            [
                eset.points.z,
                eset.points.p,
                eset.cells,
                limits.value,
                limits.states.z,
                limits.states.margin,
            ]
        )
    for others in seen[1:]:
        for one, other in zip(seen[0], others, strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.usefixtures("restored")
def test_the_environment_says_how_many_threads_there_are(monkeypatch):
    monkeypatch.setenv("EQUIMORPH_THREADS", " 3 ")
    em.set_threads()
    assert threads() == 3
    monkeypatch.setenv("EQUIMORPH_THREADS", "many")
    with pytest.raises(
        em.InputError, match=r"`EQUIMORPH_THREADS` must be a whole number >= 1; got 'many'"
    ):
        em.set_threads()
    assert threads() == 3
    with pytest.raises(em.InputError, match=r"`count` must be a whole number from 1"):
        em.set_threads(0)
