"""How much memory a study will take, and whether this machine has it."""

import math
import os
from pathlib import Path

import numpy as np

from equimorph.errors import InputError
from equimorph.model import Progress
from equimorph.study.prepare import Problem

PROGRAM = 820e6
"""Bytes of libraries, the frames of a film, and kernels while they are compiled (550e6 without)."""
PER_VERTEX = {1: 8000.0, 2: 6500.0, 3: 108000.0}
"""Bytes per vertex of the grid, by the number of parameters: curves, cells, their book-keeping."""
PER_UNKNOWN = 70.0
"""Bytes per vertex of the grid and unknown: states, and work space while they are lifted."""
RESERVE = 150e6
"""Bytes that must stay free: below, the system would soon kill the run without a word."""

_CGROUP = Path("/sys/fs/cgroup")
_GROUP_FILES = (
    (_CGROUP, "memory.max", "memory.current"),
    (_CGROUP / "memory", "memory.limit_in_bytes", "memory.usage_in_bytes"),
)


def estimated_memory(size: int, intervals: tuple[int, ...]) -> float:
    """Peak of the resident memory of a run in bytes, by unknowns and multipliers and the grid.

    For sets with one or two equilibria over most points, like those of the arch and the spring (in
    three parameters, up to seven): there the measured peak lies between half of the estimate and
    all of it.
    """
    vertices = math.prod(count + 1 for count in intervals)
    return PROGRAM + vertices * (PER_VERTEX[len(intervals)] + PER_UNKNOWN * size)


def available_memory() -> float:
    """Bytes that this process may still take: what the machine has left, or its group's limit."""
    return min(_room_on_machine(), _room_in_group())


def check_memory(problem: Problem) -> float:
    """Memory that a study needs, in bytes.

    Raises
    ------
    InputError
        If the machine has less: names the need, the memory at hand, and what to reduce.
    """
    available, most = available_memory(), 0.0
    for key, extent in problem.extents.items():
        intervals = extent.intervals
        needed = estimated_memory(problem.structure.size, intervals)
        most = max(most, needed)
        if needed > available:
            raise InputError(
                f"`{key}.intervals` must fit into memory; got {list(intervals)}, for which about "
                f"{amount(needed)} are needed and {amount(available)} are available. "
                f"Reduce `{key}.intervals`."
            )
    return most


class MemoryWatch:
    """Progress sink that ends a run in good time when it takes more memory than was expected.

    A set may have many more equilibria over each point than can be known before.

    Parameters
    ----------
    sink
        Gets all reports.
    """

    def __init__(self, sink: Progress) -> None:
        self._sink = sink

    def report(self, stage: str, done: int, total: int | None) -> None:
        """Pass a report on, unless memory has run out."""
        available = available_memory()
        if available < RESERVE:
            raise InputError(
                f"the study must fit into memory; got {amount(available)} left while {stage}. "
                "Reduce `intervals` or `box`, or tighten `within`, of the set or map; what is "
                "finished is kept."
            )
        self._sink.report(stage, done, total)


def amount(size: float) -> str:
    """Bytes for reading.

    Examples
    --------
    >>> amount(552_000_000)
    '0.55 GB'
    """
    return f"{size / 1e9:.2f} GB" if size < 1e11 else f"{size / 1e9:.1e} GB"


def _room_on_machine() -> float:
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        sizes = {line.partition(":")[0]: line.split()[1] for line in lines}
        return 1024.0 * float(sizes["MemAvailable"])
    except (OSError, KeyError):
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))


def _room_in_group() -> float:
    """Rest below the limit of this process's control group; ∞ without one."""
    for root, limit, used in _GROUP_FILES:
        for group in (root / _own_group(root), root):
            try:
                rest = float((group / limit).read_text()) - float((group / used).read_text())
                return rest + _reclaimable(group)
            except (OSError, ValueError):  # not this kind of group, or "max": no limit
                continue
    return np.inf


def _own_group(root: Path) -> str:
    """Path of this process's group below the root of its hierarchy."""
    controller = "memory" if root != _CGROUP else ""
    try:
        lines = Path("/proc/self/cgroup").read_text(encoding="utf-8").splitlines()
    except OSError:
        return ""
    paths = (line.split(":", 2) for line in lines)
    return next((path.lstrip("/") for _, name, path in paths if name == controller), "")


def _reclaimable(group: Path) -> float:
    """Cached files, which count as used but give way."""
    lines = (group / "memory.stat").read_text(encoding="ascii").splitlines()
    sizes = dict(line.split() for line in lines)
    return float(sizes.get("inactive_file", 0))
