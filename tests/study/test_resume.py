"""A study that is interrupted keeps its whole answers: what is finished is not computed again."""

from pathlib import Path

import pytest

from equimorph.errors import CancelledError
from equimorph.study import Outcome, run, run_study
from studies import SPRING, draw_dots
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


@pytest.mark.parametrize(("stage", "again"), [("closing loops", True), ("questions", False)])
def test_a_set_that_a_cancelled_study_had_lifted_is_not_lifted_again(
    stage: str,
    again: bool,
    finished: tuple[Outcome, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
):
    """Cancelled inside the lift, it begins anew; cancelled later, the set is there."""
    draw_dots(monkeypatch)
    study, out = tmp_path / "spring.toml", tmp_path / "out"
    study.write_text(SPRING)
    with unchecked():
        with pytest.raises(CancelledError):
            run_study(study, out, progress=CancelledWhile(stage))
        if not again:
            monkeypatch.setattr(run, "equilibrium_set", _never)
        run_study(study, out)
    assert (out / "results.h5").read_bytes() == (finished[1] / "results.h5").read_bytes()
    assert not list(out.rglob("*.journal"))
