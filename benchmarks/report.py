"""The benchmark report: times as JSON, and their ratios to those of an earlier report.

``python benchmarks/report.py OUT.json [--before EARLIER.json] [GROUP …]``; groups are limits,
paths, sets, tasks and threads, by default all. ``make bench`` runs it. On a busy machine compare
seconds of CPU, of a run before and one after in turn; those of the clock say nothing.
"""

import argparse
import json
import platform
import statistics
import subprocess
import sys
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from os import getloadavg
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

from equimorph.linalg.lanes import cores
from report_rows import GROUPS, Row
from report_threads import sharing

ROOT = Path(__file__).parents[1]
SHARING = "threads"
"""Group of the measurements of `report_threads`."""
PACKAGES = ("numba", "numpy", "scipy")

Times = dict[str, float]


def main(arguments: Sequence[str]) -> None:
    """Measure, write the report, and print its ratios to an earlier one."""
    groups = (*GROUPS, SHARING)
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--before", type=Path)
    parser.add_argument("groups", nargs="*", metavar="GROUP")
    given = parser.parse_intermixed_args(arguments)
    if unknown := set(given.groups) - set(groups):
        parser.error(f"groups are {', '.join(groups)}; got {', '.join(unknown)}")
    before = json.loads(given.before.read_text()) if given.before else {"rows": {}}
    chosen = given.groups or groups
    report: dict[str, Any] = {"where": machine(), "rows": {}}
    sys.stdout.write(f"{report['where']}\n{'':24}  clock s    CPU s  per second")
    sys.stdout.write("  clock, CPU relative to before\n" if given.before else "\n")
    for name in chosen:
        if name == SHARING:
            report["sharing"] = sharing()
            continue
        for row in GROUPS[name]():
            report["rows"][row.name] = times = measure(row)
            sys.stdout.write(line(row.name, times, before["rows"].get(row.name)))
            sys.stdout.flush()
    given.out.parent.mkdir(parents=True, exist_ok=True)
    given.out.write_text(json.dumps(report, indent=1) + "\n")


def measure(row: Row) -> Times:
    """Median, least and first time by the clock, and median of the CPU time of all threads."""
    clock, cpu = [], []
    for _ in range(row.rounds):
        start, began = process_time(), perf_counter()
        found = row.work()
        clock.append(perf_counter() - began)
        cpu.append(process_time() - start)
    count, middle = row.count(found), statistics.median(clock)
    return {
        "wall": middle,
        "least": min(clock),
        "first": clock[0],
        "cpu": statistics.median(cpu),
        "count": count,
        "per_second": count / middle,
    }


def line(name: str, times: Times, before: Mapping[str, float] | None) -> str:
    """One row as text."""
    text = f"{name:24} {times['wall']:8.4f} {times['cpu']:8.4f} {times['per_second']:11.0f}"
    if before:
        clock, cpu = (times[each] / before[each] for each in ("wall", "cpu"))
        text += f"  {clock:5.2f} {cpu:5.2f}"
    return text + "\n"


def machine() -> dict[str, Any]:
    """What the times depend on: processor, cores, load of the machine, packages, commit."""
    models = [
        each.partition(":")[2].strip()
        for each in _lines(Path("/proc/cpuinfo"))
        if each.startswith("model name")
    ]
    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty"],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    return {
        "processor": models[0] if models else platform.processor() or platform.machine(),
        "cores": cores(),
        "load": getloadavg()[0],
        "Python": platform.python_version(),
        **{name: version(name) for name in PACKAGES},
        "commit": commit.stdout.strip(),
    }


def _lines(path: Path) -> list[str]:
    return path.read_text().splitlines() if path.exists() else []


if __name__ == "__main__":
    main(sys.argv[1:])
