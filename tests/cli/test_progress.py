import pytest

from equimorph.progress import ProgressBars


def test_nothing_is_drawn_before_the_first_report(capsys: pytest.CaptureFixture[str]):
    with ProgressBars():
        pass
    assert capsys.readouterr().err == ""


def test_a_stage_that_begins_ends_the_one_before(capsys: pytest.CaptureFixture[str]):
    with ProgressBars() as progress:
        progress.report("seeds", 0, 1)
        progress.report("edges", 40, None)
        progress.report("figures", 1, 2)
    lines = capsys.readouterr().err.splitlines()
    assert [line.split()[:2] for line in lines if "✓" in line] == [["✓", "seeds"], ["✓", "edges"]]
    assert any("figures" in line and "1/2" in line for line in lines)


def test_a_stage_that_goes_on_never_passes_its_total(capsys: pytest.CaptureFixture[str]):
    """Edges are lifted again after loops were closed, and then there are more of them."""
    with ProgressBars() as progress:
        progress.report("edges", 40, None)
        progress.report("loops", 0, 1)
        progress.report("edges", 60, None)
        progress.report("loops", 0, 1)
        progress.report("figures", 2, 1)
        progress.report("end", 1, 1)
    lines = capsys.readouterr().err.splitlines()
    shown = dict(line.split()[1:4:2] for line in lines if "✓" in line)
    assert shown == {"edges": "60/60", "loops": "1/1", "figures": "2/2", "end": "1/1"}
