"""Running a compiled kernel over many lanes on several threads.

See docs/decisions.md, "Results do not depend on threads or on the order of lanes".
"""

import os
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.errors import InputError
from equimorph.linalg.simd import LANES

SMALLEST_SHARE = 256
"""Lanes below which handing a share to another thread costs more than it saves."""

Result = TypeVar("Result")

_FILLED = [np.minimum(np.arange(LANES), max(lanes - 1, 0)) for lanes in range(LANES)]
"""Lanes of blocks that are filled up with copies of the last one."""


VARIABLE = "EQUIMORPH_THREADS"
"""Environment variable for the number of threads."""


@lru_cache(maxsize=1)
def _pool_of(count: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(count, thread_name_prefix="lanes", initializer=_mark)


def _pool() -> ThreadPoolExecutor:
    return _pool_of(_number.chosen)


@check_arguments
def set_threads(count: int | None = None) -> None:
    """Set how many threads this process computes on; results do not depend on it.

    Before the first call, and after one without a count, it is the environment variable
    ``EQUIMORPH_THREADS``, or else the number of processors that the process may use. Threads of
    the linear algebra library are left alone.

    Raises
    ------
    InputError
        If the count, or that in the environment, is not a whole number above zero.

    Examples
    --------
    >>> import equimorph as em
    >>> em.set_threads(1)  # one process for each processor, as in a pool of processes
    >>> em.set_threads()
    """
    _number.chosen = cores() if count is None else count


def cores() -> int:
    """Processors to compute on: as many as the environment says, or all."""
    text = os.environ.get(VARIABLE, "").strip()
    if text:
        if not text.isdecimal() or int(text) < 1:
            raise InputError(f"`{VARIABLE}` must be a whole number >= 1; got {text!r}.")
        return int(text)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class _Number:
    """Number of threads of this process, read from the environment when it is first asked for."""

    @cached_property
    def chosen(self) -> int:
        return cores()


_number = _Number()

_worker = threading.local()


def _mark() -> None:
    """Mark a thread of the pool: what it computes is not shared out once more."""
    _worker.own = True


@contextmanager
def one_thread() -> Generator[None]:
    """Share nothing out among threads while a block lasts: what the calling thread computes."""
    before = hasattr(_worker, "own")
    _mark()
    try:
        yield
    finally:
        if not before:
            del _worker.own


def in_background(tasks: Sequence[Callable[[], None]]) -> list[Future[None]]:
    """Start tasks on threads of the pool, one on each."""
    return [_pool().submit(task) for task in tasks]


def results_of(tasks: Sequence[Callable[[], Result]]) -> Iterator[Result]:
    """Results of tasks in their order, as soon as they are there; run on all threads of the pool.

    Tasks must not wait for each other.
    """
    if len(tasks) < 2 or threads() < 2:
        for task in tasks:
            yield task()
        return
    jobs = [_pool().submit(task) for task in tasks]
    try:
        for job in jobs:
            yield job.result()
    finally:
        for job in jobs:
            job.cancel()


def start(task: Callable[[], Result]) -> Callable[[], Result]:
    """Start a task on another thread, if there is one; what is returned waits for its result."""
    return task if threads() < 2 else _pool().submit(task).result


def threads() -> int:
    """Number of threads that share the work, see `set_threads`; 1 inside a thread of the pool."""
    return 1 if hasattr(_worker, "own") else _number.chosen


def shares_of(lanes: int) -> int:
    """Return how many threads share lanes; fewer than two: the calling one computes them all."""
    return min(threads(), lanes // SMALLEST_SHARE)


def over_lanes(
    kernel: Callable[..., Any],
    shared: tuple[Any, ...],
    inputs: Sequence[np.ndarray],
    outputs: Sequence[np.ndarray],
) -> None:
    """Call ``kernel(*shared, *inputs, *outputs)``, the batches cut along lanes into one per thread.

    Kernels treat lanes independently, so that the result does not depend on the number of threads.
    They need at least a vector of lanes: fewer are filled up with copies of the last one.
    """
    lanes = len(inputs[0])
    if 0 < lanes < LANES:
        at = _FILLED[lanes]
        wide = [np.empty((LANES, *array.shape[1:]), array.dtype) for array in outputs]
        kernel(*shared, *[array.take(at, axis=0) for array in inputs], *wide)
        for array, result in zip(outputs, wide, strict=True):
            array[:] = result[:lanes]
        return
    if lanes < 2 * SMALLEST_SHARE or (shares := shares_of(lanes)) < 2:
        kernel(*shared, *inputs, *outputs)
        return
    cuts = [(lanes * i // shares + 7) // 8 * 8 for i in range(shares)] + [lanes]
    parts = [(*shared, *[batch[a:b] for batch in (*inputs, *outputs)]) for a, b in pairwise(cuts)]
    jobs = [_pool().submit(kernel, *part) for part in parts[1:]]
    kernel(*parts[0])
    for job, part in zip(jobs, parts[1:], strict=True):
        if job.cancel():  # no processor was free: the other threads have not begun
            kernel(*part)
        else:
            job.result()
