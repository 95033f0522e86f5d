"""Batches of lanes shared out among threads."""

import threading

import numpy as np

from equimorph.linalg.lanes import in_background, over_lanes, threads


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
