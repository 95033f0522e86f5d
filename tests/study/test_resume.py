"""A study that is interrupted while its set is lifted goes on inside the lift."""

from pathlib import Path

import pytest

from equimorph.errors import CancelledError
from equimorph.manifold import build
from equimorph.study import Outcome, run_study
from runner import Runner
from studies import ARCH, SPRING, draw_dots
from typecheck import unchecked


class CancelledWhile:
    """Progress sink that cancels at a report of a stage."""

    def __init__(self, stage: str) -> None:
        self.stage = stage

    def report(self, stage: str, done: int, total: int | None) -> None:
        if stage == self.stage:
            raise CancelledError(stage)


def _never(*_: object) -> None:
    raise AssertionError


def _contents(out: Path) -> dict[str, bytes]:
    told = {"index.html", "equimorph.json"}
    files = (file for file in out.iterdir() if file.is_file() and file.name not in told)
    return {file.name: file.read_bytes() for file in files}


def test_a_cancelled_study_goes_on_inside_the_lift_of_its_set(
    finished: tuple[Outcome, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The search for seeds, which is over when loops are closed, is not asked for again."""
    draw_dots(monkeypatch)
    study, out = tmp_path / "spring.toml", tmp_path / "out"
    study.write_text(SPRING)
    with unchecked():
        with pytest.raises(CancelledError):
            run_study(study, out, progress=CancelledWhile("closing loops"))
        assert len(list(out.rglob("*.journal"))) == 1
        monkeypatch.setattr(build, "seeds", _never)
        run_study(study, out)
    assert (out / "results.h5").read_bytes() == (finished[1] / "results.h5").read_bytes()
    assert not list(out.rglob("*.journal"))


@pytest.mark.slow
def test_an_arch_killed_again_and_again_ends_in_less_than_its_own_time_each(tmp_path: Path):
    """Killed every time before a whole lift could end: it ends because nothing is lost."""
    study = tmp_path / "study.toml"
    study.write_text(ARCH.replace("intervals = [5, 9]", "intervals = [47, 81]"))
    runner = Runner()
    try:
        assert runner.run(study, tmp_path / "undisturbed", dots=True) == 0
        out, code, kills, size = tmp_path / "out", 1, 0, 0
        while code != 0:
            code = runner.run(study, out, dots=True, after=1.0 + 0.25 * kills)
            kills += code != 0
            journals = list(out.rglob("*.journal"))
            if journals and code != 0:
                grown = journals[0].stat().st_size
                assert grown >= size  # what was found is never lost
                size = grown
            assert kills < 40
        assert kills > 1
    finally:
        runner.close()
    assert _contents(out) == _contents(tmp_path / "undisturbed")
