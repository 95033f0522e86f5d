"""Runs that are killed and run again end with the results of an undisturbed run."""

import itertools
import os
import random
import re
import signal
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from equimorph.cli import main
from runner import Runner
from studies import ARCH, SPRING

PARTS = 10
"""Tests into which long series are split: one for each tenth of the slow ones."""


@dataclass
class Trial:
    """A study, its undisturbed results, how long they took, and whether figures are dots."""

    runner: Runner
    study: Path
    dots: bool
    expected: dict[str, bytes]
    seconds: float

    def survives(self, out: Path, ends: list[dict[str, float]]) -> list[str]:
        """Run until the end with these ends in between; return the stages at which they came."""
        stages, code = [], 1
        for end in ends:
            code = self.runner.run(self.study, out, dots=self.dots, **end)
            assert code != 1
            if code == 0:
                break
            stages.append(self._stage(out))
        assert code == 0 or self.runner.run(self.study, out, dots=self.dots) == 0
        assert contents(out) == self.expected
        assert {file.name for file in (out / ".equimorph").iterdir()} == {"checkpoints", "lock"}
        return stages

    def _stage(self, out: Path) -> str:
        """What a run was at when it ended, by what it left."""
        if not (out / "results.h5").exists():
            answers = len(list((out / ".equimorph" / "checkpoints").glob("*-*")))
            return ("equilibrium set", "equilibria", "route", "results")[answers]
        left = self.expected.keys() - {file.name for file in out.iterdir()}
        return "figures" if left - {"index.html"} else "page"


def contents(out: Path) -> dict[str, bytes]:
    """All results; of the page and the manifest what does not tell how long the run took."""
    found = {file.name: file.read_bytes() for file in out.iterdir() if file.is_file()}
    found["index.html"] = re.sub(rb"Wall time: [^<]*", b"", found["index.html"])
    found["equimorph.json"] = re.sub(rb'"index.html": "\w*"', b"", found["equimorph.json"])
    return found


@pytest.fixture(scope="module")
def runner() -> Iterator[Runner]:
    runner = Runner()
    yield runner
    runner.close()


def _trial(runner: Runner, folder: Path, text: str, *, dots: bool) -> Trial:
    study = folder / "study.toml"
    study.write_text(text)
    assert runner.run(study, folder / "undisturbed", dots=dots) == 0
    start = time.monotonic()  # the first run may have compiled kernels
    assert runner.run(study, folder / "again", dots=dots) == 0
    seconds = time.monotonic() - start
    expected = contents(folder / "undisturbed")
    assert contents(folder / "again") == expected
    return Trial(runner, study, dots, expected, seconds)


@pytest.fixture(scope="module")
def dotted(runner: Runner, tmp_path_factory: pytest.TempPathFactory) -> Trial:
    """The spring, with dots in place of figures."""
    return _trial(runner, tmp_path_factory.mktemp("dotted"), SPRING, dots=True)


@pytest.fixture(scope="module")
def spring(runner: Runner, tmp_path_factory: pytest.TempPathFactory) -> Trial:
    return _trial(runner, tmp_path_factory.mktemp("spring"), SPRING, dots=False)


@pytest.fixture(scope="module")
def arch(runner: Runner, tmp_path_factory: pytest.TempPathFactory) -> Trial:
    return _trial(runner, tmp_path_factory.mktemp("arch"), ARCH, dots=False)


def _kill(trial: Trial, count: int, folder: Path, seed: int, until: float = 0.8) -> Counter[str]:
    """Kill runs before a share `until` of their time; up to three times in each folder."""
    generator = random.Random(seed)
    stages: Counter[str] = Counter()
    series = 0
    while stages.total() < count:
        assert series < 10 * count
        left = min(3, count - stages.total())
        moments = [generator.uniform(0.0, until * trial.seconds) for _ in range(left)]
        out = folder / f"out-{series}"
        stages.update(trial.survives(out, [{"after": moment} for moment in moments]))
        series += 1
    return stages


@pytest.mark.slow
def test_some_kills_at_random_times_change_nothing(dotted: Trial, tmp_path: Path):
    _kill(dotted, 4, tmp_path, seed=0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(PARTS))
def test_kills_at_random_times_change_nothing(
    dotted: Trial, spring: Trial, tmp_path: Path, seed: int,
    record_property: Callable[[str, object], None],
):  # fmt: skip
    """100 kills: 70 in runs that mostly compute, 30 in runs that mostly draw."""
    stages = _kill(dotted, 70 // PARTS, tmp_path / "dotted", seed=2 * seed)
    stages += _kill(spring, 30 // PARTS, tmp_path / "spring", seed=2 * seed + 1)
    for more in range(10):  # on a busy machine a run may be slower than the one that was timed
        if "figures" in stages:
            break
        folder, until = tmp_path / f"more-{more}", 0.8 + 0.2 * more
        stages += _kill(spring, 1, folder, seed=100 + 10 * seed + more, until=until)
    record_property("stages", dict(stages))
    assert stages.total() >= 100 // PARTS
    assert "figures" in stages
    assert {"equilibrium set", "route"} & set(stages)


@pytest.mark.slow
def test_kills_of_an_arch_change_nothing(
    arch: Trial, tmp_path: Path, record_property: Callable[[str, object], None]
):
    record_property("stages", dict(_kill(arch, 10, tmp_path, seed=0)))


def test_death_at_some_operations_on_files_changes_nothing(dotted: Trial, tmp_path: Path):
    """At the lock, while the first answers are stored, and in the results."""
    assert len(dotted.survives(tmp_path / "out", [{"at": at} for at in (3, 10, 29)])) == 3


@pytest.mark.slow
@pytest.mark.parametrize("part", range(PARTS))
def test_death_at_operations_on_files_changes_nothing(dotted: Trial, tmp_path: Path, part: int):
    """Up to the end; every operation while answers are stored, then some of each file's."""
    every = itertools.chain(range(60), itertools.count(60, 7))
    for at in itertools.islice(every, part, None, PARTS):
        stages = dotted.survives(tmp_path / f"out-{at}", [{"at": at}])
        if not stages:
            break
    assert at > 100


@pytest.mark.slow
def test_other_signals_change_nothing(dotted: Trial, tmp_path: Path):
    ends = [(0.2, signal.SIGINT), (0.3, signal.SIGTERM)]
    timed = [{"after": share * dotted.seconds, "by": by} for share, by in ends]
    dotted.survives(tmp_path / "out", timed)


def test_two_runs_do_not_share_a_folder_and_a_dead_one_does_not_keep_it(
    dotted: Trial,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
):
    """The first run is stopped while it has the folder, then killed."""
    out = tmp_path / "out"
    process = dotted.runner.start(dotted.study, out)
    lock = out / ".equimorph" / "lock"
    while not (lock.exists() and lock.read_text()):
        time.sleep(0.001)
    os.kill(process, signal.SIGSTOP)
    monkeypatch.setattr("sys.argv", ["equimorph", "run", str(dotted.study), "--out", str(out)])
    with pytest.raises(SystemExit) as stop:
        main()
    assert stop.value.code == 2
    complaint = capsys.readouterr().err
    assert complaint.count("\n") == 1
    assert f"got one that process {process} on " in complaint
    os.kill(process, signal.SIGKILL)
    assert dotted.runner.wait() == -signal.SIGKILL
    assert dotted.survives(out, []) == []
