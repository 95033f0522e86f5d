"""Memory is estimated before a run, and watched while it lasts."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from equimorph.errors import InputError
from equimorph.structures import Rod
from equimorph.study import check_memory, memory, parse_study, prepare
from equimorph.study.template import template

MEASURE = """
import re, sys
from pathlib import Path
from equimorph.study import run_study
run_study(Path(sys.argv[1]), Path(sys.argv[2]))
peak = re.search(r"VmHWM:\\s+(\\d+) kB", Path("/proc/self/status").read_text())
print(1024 * int(peak[1]))
"""


def _with_intervals(kind: str, intervals: tuple[int, int]) -> str:
    return re.sub("intervals = .*", f"intervals = {list(intervals)}", template(kind))


@pytest.mark.slow
@pytest.mark.parametrize("intervals", [(12, 21), (24, 41), (47, 81), (93, 161)])
def test_the_estimate_is_above_the_peak_and_below_twice_the_peak(
    intervals: tuple[int, int], tmp_path: Path
):
    """The whole run of the arch in a process of its own, figures and film included."""
    study = tmp_path / "arch.toml"
    study.write_text(_with_intervals("arch", intervals))
    words = [sys.executable, "-c", MEASURE, str(study), str(tmp_path / "out")]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    peak = float(done.stdout.split()[-1])
    assert peak <= memory.estimated_memory(Rod().size, intervals) <= 2.0 * peak


def test_a_study_that_needs_too_much_is_refused_with_the_numbers():
    problem = prepare(parse_study(_with_intervals("arch", (100_000, 100_000)), "arch.toml"))
    line = (
        r"`set\.intervals` must fit into memory; got \[100000, 100000\], for which about "
        r"\d\.\de\+05 GB are needed and \d+\.\d\d GB are available\. Reduce `set\.intervals`\."
    )
    with pytest.raises(InputError, match=line):
        check_memory(problem)


def test_the_largest_need_counts_and_may_just_be_met(monkeypatch: pytest.MonkeyPatch):
    """A set of 9 × 9 and a map of 3 × 3 intervals: the set needs more."""
    words = '[structure]\nkind = "spring"\n[set.box]\nx_l = [0.5, 1.2]\nF = [-0.1, 0.1]\n'
    grid = (
        '[[map]]\nname = "a"\nkind = "limit_load_map"\nload = "F"\nintervals = [3, 3]\n'
        "box = { x_l = [0.5, 0.9], k = [1, 2] }\n"
    )
    study = words.replace("[set.box]", "[set]\nintervals = [9, 9]\n[set.box]") + grid
    problem = prepare(parse_study(study, "spring.toml"))
    assert len(problem.extents) == 2
    needed = memory.estimated_memory(problem.structure.size, (9, 9))
    monkeypatch.setattr(memory, "available_memory", lambda: 1.001 * needed)
    assert check_memory(problem) == needed
    monkeypatch.setattr(memory, "available_memory", lambda: 0.999 * needed)
    with pytest.raises(InputError, match=r"`set\.intervals` must fit into memory; got \[9, 9\]"):
        check_memory(problem)


SET = """
import ctypes, gc, re, sys
from pathlib import Path
from threading import Event, Thread
from equimorph.manifold import equilibrium_set
from equimorph.model import Box
from equimorph.structures import Rod
arch, d = Rod(), int(sys.argv[1])
small = {"Theta": (0.6, 1.4), "Delta": (-0.6, 0.6), "q": (0, 3)}
whole = {"Theta": (0.2, 2.5), "Delta": (-2, 2), "q": (0, 6)}
def build(ranges, intervals):
    fixed = {"Delta": 0.3, "q": 2.5} if d == 1 else {}
    box = Box(**dict(list(ranges.items())[:d]))
    equilibrium_set(arch, box, fixed=fixed, within=[arch.max_curvature <= 20],
                    intervals=intervals, checks=0)
def resident():
    found = re.search(r"RssAnon:\\s+(\\d+) kB", Path("/proc/self/status").read_text())
    return 1024 * int(found[1])
build(small, (3,) * d)
gc.collect()
ctypes.CDLL(None).malloc_trim(0)
before, seen, ended = resident(), [], Event()
def watch():
    while not ended.wait(0.005):
        seen.append(resident())
watcher = Thread(target=watch)
watcher.start()
build(whole, tuple(map(int, sys.argv[2:])))
ended.set()
watcher.join()
print(max(seen) - before)
"""


@pytest.mark.slow
@pytest.mark.parametrize("intervals", [(20_000,), (12, 15, 8)])
def test_the_estimate_for_sets_over_one_and_three_parameters(intervals: tuple[int, ...]):
    """The set alone, beyond what the program takes with a small one.

    Pages of files do not count, which the system may take back at any time; the smaller of two
    runs: the first may compile a kernel.
    """
    words = [sys.executable, "-c", SET, str(len(intervals)), *map(str, intervals)]
    runs = [subprocess.run(words, capture_output=True, text=True, check=True) for _ in range(2)]
    peak = min(float(done.stdout.split()[-1]) for done in runs)
    estimate = memory.estimated_memory(Rod().size, intervals) - memory.PROGRAM
    assert peak <= estimate <= 2.0 * peak


@pytest.mark.parametrize(
    ("box", "intervals"),
    [
        ("F = [-0.4, 0.4]", [1_000_000_000]),
        ("F = [-0.4, 0.4]\nx_l = [0.5, 1.2]\nk = [1, 2]", [900] * 3),
    ],
)
def test_sets_over_one_and_three_parameters_are_refused_if_too_large(
    box: str, intervals: list[int]
):
    head = 'title = "t"\n[structure]\nkind = "spring"'
    text = f"{head}\n[set]\nintervals = {intervals}\n[set.box]\n{box}\n"
    with pytest.raises(InputError, match=r"`set\.intervals` must fit into memory; got .* GB"):
        check_memory(prepare(parse_study(text, "spring.toml")))


def test_numbers_beyond_all_floats_are_refused():
    text = _with_intervals("spring", (10**400, 2))
    with pytest.raises(InputError, match=r"`set\.intervals\[0\]` must be at most"):
        parse_study(text, "spring.toml")


def test_what_is_available_is_what_linux_says():
    """MemAvailable of the machine bounds it from above; it changes while the test runs."""
    lines = Path("/proc/meminfo").read_text().splitlines()
    total = 1024.0 * float(lines[0].split()[1])
    assert 0.0 < memory.available_memory() <= total


@pytest.mark.parametrize("names", [("memory.max", "memory.current"), ("limit", "usage")])
def test_the_limit_of_a_control_group_counts(
    names: tuple[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Cached files count as used there, but give way."""
    (tmp_path / names[0]).write_text("3000000\n")
    (tmp_path / names[1]).write_text("2500000\n")
    (tmp_path / "memory.stat").write_text("active_file 7\ninactive_file 200000\n")
    monkeypatch.setattr(memory, "_GROUP_FILES", ((tmp_path, *names),))
    assert memory.available_memory() == 700_000.0
    (tmp_path / names[0]).write_text("max\n")
    assert memory.available_memory() > 700_000.0


def test_a_run_ends_before_the_system_kills_it(monkeypatch: pytest.MonkeyPatch):
    reports: list[str] = []

    class Sink:
        def report(self, stage: str, done: int, total: int | None) -> None:
            reports.append(stage)

    watch = memory.MemoryWatch(Sink())
    watch.report("seeds", 0, 1)
    monkeypatch.setattr(memory, "available_memory", lambda: 0.9 * memory.RESERVE)
    with pytest.raises(InputError, match=r"got 0\.14 GB left while lifting edges.*is kept"):
        watch.report("lifting edges", 1, None)
    assert reports == ["seeds"]
