"""How work is shared out: two threads against two processes, and what holds the interpreter lock.

Two threads of one process compute once; two independent processes of one thread each compute the
same at the same time. Where the lock and serial parts cost nothing, threads finish the work in half
the time that each process takes. On one thread, time inside compiled kernels that release the lock
is told from the rest, which is what threads cannot share: T(k) = held + free / k is a model of k
threads, and held the floor that no number of threads gets below.
"""

import json
import statistics
import subprocess
import sys
from collections.abc import Callable
from time import perf_counter, process_time, thread_time
from typing import Any

from numba.core.dispatcher import Dispatcher

import equimorph as em
from report_rows import GROUPS

CHOSEN = {
    "limits": "limit loads 1e4",
    "paths": "paths 1e4 default",
    "sets": "set lifted 86x149",
}
"""Rows that are measured, by group."""
ROUNDS = 5
MANY = 64
"""Threads for which the model is worked out."""


def sharing() -> dict[str, dict[str, float]]:
    """Seconds of each chosen row: by the clock, of the processor, and of what holds the lock."""
    out = {}
    sys.stdout.write(
        f"{'':24} one thread  two threads  two processes  lock held of CPU  "
        f"{MANY} threads at most\n"
    )
    for group, name in CHOSEN.items():
        (one,), (two,) = _together(group, 1, 1), _together(group, 2, 1)
        both = _together(group, 1, 2)
        free, cpu = one["free"], one["cpu"]
        held = cpu - free
        out[name] = {
            "one thread": one["wall"],
            "two threads": two["wall"],
            "two processes": statistics.mean(each["wall"] for each in both),
            "CPU of one thread": cpu,
            "CPU of two threads": two["cpu"],
            "CPU of each process": statistics.mean(each["cpu"] for each in both),
            "lock held": held,
            "speed of threads": cpu / (held + free / MANY),
        }
        each = out[name]
        sys.stdout.write(
            f"{name:24} {each['one thread']:10.3f}  {each['two threads']:11.3f}"
            f"  {each['two processes']:13.3f}  {held:7.3f} {cpu:8.3f}"
            f"  {each['speed of threads']:6.1f} times\n"
        )
        sys.stdout.flush()
    return out


def _together(group: str, threads: int, number: int) -> list[dict[str, float]]:
    """Times of a row in processes that compute at the same time."""
    command = [sys.executable, __file__, group, str(threads)]
    pipe = subprocess.PIPE
    running = [subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) for _ in range(number)]
    for each in running:
        each.stdout.readline()  # it is ready
    for each in running:
        each.stdin.write("\n")
        each.stdin.flush()
    return [json.loads(each.communicate()[0]) for each in running]


def alone(group: str, threads: int) -> None:
    """Measure a row in this process as soon as a line comes in; write the times."""
    em.set_threads(threads)
    row = next(each for each in GROUPS[group]() if each.name == CHOSEN[group])
    row.work()
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    sys.stdin.readline()
    wall, cpu = [], []
    for _ in range(ROUNDS):
        start, began = process_time(), perf_counter()
        row.work()
        wall.append(perf_counter() - began)
        cpu.append(process_time() - start)
    times = {"wall": statistics.median(wall), "cpu": statistics.median(cpu)}
    if threads == 1:
        times["free"] = free_time(row.work) / ROUNDS
    sys.stdout.write(json.dumps(times))


def free_time(work: Callable[[], Any]) -> float:
    """CPU time inside compiled kernels that release the interpreter lock, of several runs."""
    spent = 0.0

    def timed(kernel: Dispatcher) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            nonlocal spent
            start = thread_time()
            try:
                return kernel(*arguments)
            finally:
                spent += thread_time() - start

        return call

    places = [
        (module, name, each)
        for key, module in sys.modules.items()
        if key.startswith("equimorph")
        for name, each in vars(module).items()
        if isinstance(each, Dispatcher) and each.targetoptions.get("nogil")
    ]
    for module, name, kernel in places:
        setattr(module, name, timed(kernel))
    for _ in range(ROUNDS):
        work()
    for module, name, kernel in places:
        setattr(module, name, kernel)
    return spent


if __name__ == "__main__":
    alone(sys.argv[1], int(sys.argv[2]))
