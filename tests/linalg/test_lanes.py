"""Batches of lanes shared out among threads."""

import threading

import numpy as np
import pytest

from equimorph.linalg.lanes import in_background, over_lanes, results_of, threads


def _double(x, out):
    out[:] = 2.0 * x


def test_shares_of_a_batch_make_up_the_whole():
    """Equal: the same operation on every lane, however many threads there are."""
    x, out = np.arange(3000.0), np.zeros(3000)
    over_lanes(_double, (), [x], [out])
    np.testing.assert_array_equal(out, 2.0 * x)


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
