import pytest

from equimorph.cli.progress import ScreenProgress


def test_nothing_is_drawn_before_the_first_report(capsys: pytest.CaptureFixture[str]):
    with ScreenProgress():
        pass
    assert capsys.readouterr().err == ""


def test_a_stage_that_begins_ends_the_one_before(capsys: pytest.CaptureFixture[str]):
    with ScreenProgress() as progress:
        progress.report("seeds", 0, 1)
        progress.report("edges", 40, None)
        progress.report("figures", 1, 2)
    lines = capsys.readouterr().err.splitlines()
    assert [line.split()[:2] for line in lines if "✓" in line] == [["✓", "seeds"], ["✓", "edges"]]
    assert any("figures" in line and "1/2" in line for line in lines)
