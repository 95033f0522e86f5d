"""The spring study from file to page."""

import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.plotting import style
from equimorph.plotting.film import suffixes
from equimorph.storage import read_results, read_schedule
from equimorph.study import Outcome, run_study
from studies import only_route
from typecheck import unchecked

FIGURES = ["surface", "stable-plane", "over-plane", "over-shapes"]


class Recorder:
    """Progress sink that remembers."""

    def __init__(self) -> None:
        self.stages: dict[str, list[tuple[int, int | None]]] = {}

    def report(self, stage: str, done: int, total: int | None) -> None:
        self.stages.setdefault(stage, []).append((done, total))


class Links(HTMLParser):
    """All places that a page refers to."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.places: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.places += [value or "" for name, value in attrs if name in ("src", "href", "srcset")]


def test_equilibria_of_the_spring_are_found(finished: tuple[Outcome, Path]):
    """Closed form at F = 0: cos δ = x_l or δ = 0. Tolerance: round-off of a polished state."""
    angles = np.sort(finished[0].points[0].z[:, 0])
    np.testing.assert_allclose(angles, [-np.arccos(0.8), 0.0, np.arccos(0.8)], atol=1e-12)


def test_the_route_leads_around_the_snap(finished: tuple[Outcome, Path]):
    """A stable way between both sides must pass x_l > 1, PHYSICS section 2."""
    route = only_route(finished[0])
    assert route.status == "arrived"
    assert route.path.states["x_l"].max() > 1.0
    assert (route.path.index == 0).all()


def test_a_run_leaves_all_its_files(finished: tuple[Outcome, Path]):
    out = finished[1]
    figures = [f"{name}.{kind}" for name in [*FIGURES, "over-margins"] for kind in ("png", "svg")]
    others = ["results.h5", "over-schedule.csv", "over-schedule.json", "index.html", "study.toml"]
    others += ["explorer.html", "results.vtkhdf"]
    films = [f"over-film{suffix}" for suffix in suffixes()]
    assert sorted(file.name for file in out.iterdir()) == sorted(
        [*figures, *others, *films, "equimorph.json", ".equimorph"]
    )


def test_the_folder_keeps_the_study_as_it_was_written(
    finished: tuple[Outcome, Path], spring_text: str
):
    assert (finished[1] / "study.toml").read_text() == spring_text


def test_stored_results_are_those_of_the_run(finished: tuple[Outcome, Path]):
    outcome, out = finished
    stored = read_results(out / "results.h5")
    np.testing.assert_array_equal(stored.equilibrium_set.points.z, outcome.equilibrium_set.points.z)
    schedule = read_schedule(out / "over-schedule.csv")
    np.testing.assert_array_equal(schedule.values, only_route(outcome).schedule.values)


def test_figures_are_pictures_and_the_film_moves(finished: tuple[Outcome, Path]):
    for name in FIGURES:
        with Image.open(finished[1] / f"{name}.png") as picture:
            assert min(picture.size) > 1.5 * style.RESOLUTION
            assert len(set(picture.convert("L").resize((64, 64)).tobytes())) > 10
    with Image.open(finished[1] / "over-film.gif") as film:
        assert film.n_frames > 10


def test_the_page_needs_nothing_from_elsewhere(finished: tuple[Outcome, Path]):
    page = (finished[1] / "index.html").read_text(encoding="utf-8")
    places = Links(page).places
    embedded = [place for place in places if place.startswith("data:")]
    assert len(embedded) == len(FIGURES) + 2
    for place in set(places) - set(embedded):
        assert (finished[1] / place).is_file(), place
    assert not re.search(r"https?://|@import|url\(", page)


def test_the_page_says_the_answers(finished: tuple[Outcome, Path]):
    outcome, out = finished
    page = (out / "index.html").read_text(encoding="utf-8")
    assert "<strong>Arrived</strong>" in page
    assert "3 found, 2 of them stable" in page
    assert "0.6435" in page
    assert "Audit: clean" in page
    assert f"smallest margin {only_route(outcome).margin:.4g}" in page


@pytest.mark.usefixtures("plain_figures")
def test_stages_report_up_to_their_end(spring_file: Path, out: Path):
    sink = Recorder()
    run_study(spring_file, out, progress=sink)
    for stage in ("questions", "figures"):
        done, total = sink.stages[stage][-1]
        assert done == total


@pytest.fixture
def copy(finished: tuple[Outcome, Path], tmp_path: Path) -> Path:
    """The results folder of the finished run, to change."""
    return Path(shutil.copytree(finished[1], tmp_path / "copy"))


def _contents(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir() if file.is_file()}


def test_a_finished_run_is_not_repeated(
    finished: tuple[Outcome, Path], spring_file: Path, copy: Path, monkeypatch: pytest.MonkeyPatch
):
    """Set, equilibria, routes, figures: nothing is computed or drawn, and no byte changes."""

    def fail(*_: object, **__: object) -> None:
        raise AssertionError

    for name in ("run.equilibrium_set", "question.Question.answer", "states.choose_state"):
        monkeypatch.setattr(f"equimorph.study.{name}", fail)
    for name in ("surface", "parameter_plane", "shapes", "margins", "film", "save"):
        monkeypatch.setattr(plotting, name, fail)
    again = run_study(spring_file, copy)
    assert again.reused
    assert not finished[0].reused
    assert _contents(copy) == _contents(finished[1])


@pytest.mark.usefixtures("plain_figures")
def test_answers_are_kept_though_no_results_were_stored(
    finished: tuple[Outcome, Path], spring_file: Path, out: Path
):
    """Bit for bit: a run goes on from the numbers that it stored."""
    again = run_study(spring_file, out)
    assert again.reused
    for name in ("results.h5", "over-schedule.csv", "over-schedule.json"):
        assert (out / name).read_bytes() == (finished[1] / name).read_bytes()


def test_a_figure_that_is_missing_or_damaged_is_drawn_again(
    finished: tuple[Outcome, Path], spring_file: Path, copy: Path
):
    (copy / "over-margins.svg").unlink()
    (copy / "surface.png").write_bytes(b"half")
    before = (copy / "over-film.gif").stat().st_mtime_ns
    run_study(spring_file, copy)
    assert _contents(copy) == _contents(finished[1])
    assert (copy / "over-film.gif").stat().st_mtime_ns == before


@pytest.mark.usefixtures("plain_figures")
def test_another_comment_reaches_the_page_and_nothing_else(
    finished: tuple[Outcome, Path], spring_text: str, copy: Path, tmp_path: Path
):
    (tmp_path / "spring.toml").write_text(spring_text + "# why\n")
    run_study(tmp_path / "spring.toml", copy)
    assert "# why" in (copy / "index.html").read_text(encoding="utf-8")
    before, now = _contents(finished[1]), _contents(copy)
    changed = {name for name in now if now[name] != before[name]}
    assert changed == {"study.toml", "index.html", "equimorph.json"}


@pytest.mark.usefixtures("plain_figures")
def test_an_edited_study_takes_over_the_set_but_not_the_routes(
    spring_text: str, copy: Path, tmp_path: Path
):
    (tmp_path / "edited.toml").write_text(spring_text[: spring_text.index("[[route]]")])
    edited = run_study(tmp_path / "edited.toml", copy, replace=True)
    assert edited.reused
    assert read_results(copy / "results.h5").routes == {}
    assert not list(copy.glob("over-*"))
    assert (copy / "parameter-plane.png").is_file()
    assert len(list((copy / ".equimorph" / "checkpoints").iterdir())) == 2


@pytest.mark.usefixtures("plain_figures")
def test_a_damaged_answer_is_computed_again(
    finished: tuple[Outcome, Path], spring_file: Path, out: Path
):
    for file in (out / ".equimorph" / "checkpoints").iterdir():
        content = bytearray(file.read_bytes())
        content[len(content) // 2] ^= 0xFF
        file.write_bytes(content)
    with unchecked():  # the tests of sets check shapes
        assert not run_study(spring_file, out).reused
    assert (out / "results.h5").read_bytes() == (finished[1] / "results.h5").read_bytes()


@pytest.mark.usefixtures("plain_figures")
def test_a_start_that_is_no_equilibrium_stops_the_run_until_it_is_corrected(
    spring_text: str, spring_file: Path, out: Path, tmp_path: Path
):
    wrong = spring_text.replace('highest = "angle"', "near = { angle = 0.3 }")
    (tmp_path / "wrong.toml").write_text(wrong)
    with pytest.raises(InputError, match=r"`route\[0\]\.start\.near` must be an equilibrium"):
        run_study(tmp_path / "wrong.toml", out)
    assert [file.name for file in out.iterdir()] == [".equimorph"]
    assert run_study(spring_file, out).reused


@pytest.mark.usefixtures("plain_figures")
def test_a_refused_route_is_an_answer(spring_text: str, out: Path, tmp_path: Path):
    (tmp_path / "tight.toml").write_text(spring_text + "margin = 50.0\n")
    outcome = run_study(tmp_path / "tight.toml", out)
    assert only_route(outcome).status == "refused"
    page = (out / "index.html").read_text(encoding="utf-8")
    assert "Refused." in page
    assert not (out / "over-schedule.csv").exists()
