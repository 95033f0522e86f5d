"""Study files that are wrong in any way get one line; those that are sound can be run."""

import shutil
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import pytest
from hypothesis import HealthCheck, event, example, given, settings

from equimorph.cli import main
from mutants import MUTANTS, plausible_mutants
from studies import ARCH, SPRING, draw_dots
from typecheck import unchecked

PATIENCE = 15.0
"""Seconds of the processor for one mutant."""


def _command(*words: str) -> tuple[int, str, str]:
    """Exit code, output and complaint of the command line."""
    out, err = StringIO(), StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setattr(sys, "argv", ["equimorph", *words])
        try:
            main()
            code: object = 0
        except SystemExit as stop:
            code = stop.code or 0
    assert isinstance(code, int)
    return code, out.getvalue(), err.getvalue()


def _are_lines(complaint: str) -> bool:
    """Whether each mistake has one line."""
    lines = complaint.removesuffix("\n").split("\n")
    return all(
        line.startswith("equimorph: ") and line.isprintable() and 20 < len(line) < 500
        for line in lines
    )


@contextmanager
def _patience(seconds: float) -> Iterator[None]:
    """End a run as Ctrl-C does when it takes longer: some mutants ask for very much."""
    before = signal.signal(signal.SIGVTALRM, signal.default_int_handler)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("mutants")


def _check(content: bytes, file: Path) -> bool:
    """Whether a study is sound; if it is not, there is a line for each mistake."""
    file.write_bytes(content)
    with unchecked():
        code, said, complaint = _command("check", str(file))
    event("sound" if code == 0 else "refused")
    if code == 0:
        assert "is valid: it asks for" in said
        assert complaint == ""
    else:
        assert code == 2
        assert _are_lines(complaint), complaint
    return code == 0


ARBITRARY = settings(deadline=None, suppress_health_check=list(HealthCheck))


@settings(ARBITRARY, max_examples=120)
@given(content=MUTANTS)
@example(content=b"")
@example(content=b"a = " + b"[" * 5000)
@example(content=b"a = " + b"{a=" * 5000)
@example(content=b"[" + b"a." * 5000 + b"a]")
@example(content=SPRING.encode() + b"\x00")
@example(content=b"\xef\xbb\xbf" + SPRING.encode())
@example(content=SPRING.replace("\n", "\r\n").encode())
@example(content=SPRING.replace("11, 11", "1" * 5000 + ", 11").encode())
@example(content=ARCH.replace('"uniform"', "[[0, 1e308], [1, -1e308]]").encode())
@example(content=ARCH.replace('load = "uniform"', "elements = 1000000000").encode())
def test_a_mutated_study_is_sound_or_gets_one_line(content: bytes, folder: Path):
    _check(content, folder / "study.toml")


@pytest.mark.slow
@pytest.mark.parametrize("hundred", range(10))
@settings(ARBITRARY, max_examples=100)
@given(content=MUTANTS)
def test_a_mutated_study_is_run_or_gets_one_line(content: bytes, folder: Path, hundred: int):
    """On tiny grids, which are no less sound than fine ones; each hundred are others."""
    if _check(content, folder / "study.toml"):
        _run(folder / "study.toml", folder / "out")


@pytest.mark.slow
@settings(ARBITRARY, max_examples=50)
@given(content=plausible_mutants())
def test_a_plausible_study_is_run_or_gets_one_line(content: bytes, folder: Path):
    if _check(content, folder / "study.toml"):
        _run(folder / "study.toml", folder / "out")


ENDS = {0: "run", 3: "question refused", 2: "refused", 130: "still running at its end"}


def _run(file: Path, out: Path) -> None:
    shutil.rmtree(out, ignore_errors=True)
    with unchecked(), pytest.MonkeyPatch.context() as patch, _patience(PATIENCE):
        draw_dots(patch)
        code, said, complaint = _command("run", str(file), "--out", str(out))
    event(ENDS[code])
    if code in (0, 3):
        assert "Equilibrium set computed" in said or "Map " in said
        assert (out / "index.html").is_file()
    else:
        assert _are_lines(complaint.splitlines()[-1] + "\n"), complaint
        assert not (out / "index.html").exists()
