"""Running a compiled kernel over many lanes on several threads."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any

import numpy as np

SMALLEST_SHARE = 256
"""Lanes below which handing a share to another thread costs more than it saves."""


@lru_cache(maxsize=1)
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(_threads(), thread_name_prefix="lanes")


def _threads() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def over_lanes(kernel: Callable[..., Any], shared: tuple[Any, ...], *batches: np.ndarray) -> None:
    """Call ``kernel(*shared, *batches)``, the batches cut along their lanes into one per thread.

    Kernels treat lanes independently, so that the result does not depend on the number of threads.
    """
    lanes = len(batches[0])
    shares = min(_threads(), lanes // SMALLEST_SHARE)
    if shares < 2:
        kernel(*shared, *batches)
        return
    cuts = [(lanes * i // shares + 7) // 8 * 8 for i in range(shares)] + [lanes]
    jobs = [
        _pool().submit(kernel, *shared, *[batch[a:b] for batch in batches])
        for a, b in zip(cuts[:-1], cuts[1:], strict=True)
    ]
    for job in jobs:
        job.result()
