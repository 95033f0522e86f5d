"""The spring study from file to page."""

import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from equimorph.errors import InputError
from equimorph.storage import read_results, read_schedule
from equimorph.study import Outcome, run_study

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
    route = finished[0].routes[0].route
    assert route.status == "arrived"
    assert route.path.states["x_l"].max() > 1.0
    assert (route.path.index == 0).all()


def test_a_run_leaves_all_its_files(finished: tuple[Outcome, Path]):
    out = finished[1]
    figures = [f"{name}.{kind}" for name in [*FIGURES, "over-margins"] for kind in ("png", "svg")]
    others = ["results.h5", "over-schedule.csv", "over-schedule.json", "index.html", "study.toml"]
    assert sorted(file.name for file in out.iterdir()) == sorted(
        [*figures, *others, "over-film.gif", "equimorph.json"]
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
    np.testing.assert_array_equal(schedule.values, outcome.routes[0].route.schedule.values)


def test_figures_are_pictures_and_the_film_moves(finished: tuple[Outcome, Path]):
    for name in FIGURES:
        with Image.open(finished[1] / f"{name}.png") as picture:
            assert min(picture.size) > 300
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
    assert "Arrived." in page
    assert "3 found, 2 of them stable" in page
    assert "0.6435" in page
    assert "Audit: clean" in page
    assert f"smallest margin {outcome.routes[0].route.margin:.4g}" in page


@pytest.mark.usefixtures("plain_figures")
def test_stages_report_up_to_their_end(spring_file: Path, tmp_path: Path):
    sink = Recorder()
    run_study(spring_file, tmp_path / "out", progress=sink)
    for stage in ("routes", "figures"):
        done, total = sink.stages[stage][-1]
        assert done == total


@pytest.mark.usefixtures("plain_figures")
def test_running_again_reads_the_set_of_the_first_run(
    finished: tuple[Outcome, Path], spring_file: Path, tmp_path: Path
):
    out = tmp_path / "out"
    shutil.copytree(finished[1], out)
    again = run_study(spring_file, out)
    assert again.reused
    assert not finished[0].reused
    assert again.routes[0].route.margin == pytest.approx(
        finished[0].routes[0].route.margin, rel=1e-9
    )


@pytest.mark.usefixtures("plain_figures")
def test_an_edited_study_takes_over_the_set_but_not_the_routes(
    finished: tuple[Outcome, Path], spring_text: str, tmp_path: Path
):
    out = tmp_path / "out"
    shutil.copytree(finished[1], out)
    (tmp_path / "edited.toml").write_text(spring_text[: spring_text.index("[[route]]")])
    edited = run_study(tmp_path / "edited.toml", out, replace=True)
    assert edited.reused
    assert read_results(out / "results.h5").routes == {}
    assert not list(out.glob("over-*"))
    assert (out / "parameter-plane.png").is_file()


@pytest.mark.usefixtures("plain_figures")
def test_a_damaged_earlier_set_is_computed_again(
    finished: tuple[Outcome, Path], spring_file: Path, tmp_path: Path
):
    out = tmp_path / "out"
    shutil.copytree(finished[1], out)
    (out / "results.h5").write_bytes((out / "results.h5").read_bytes()[:500])
    assert not run_study(spring_file, out).reused
    assert len(read_results(out / "results.h5").routes) == 1


@pytest.mark.usefixtures("plain_figures")
def test_a_start_that_is_no_equilibrium_stops_the_run(spring_text: str, tmp_path: Path):
    wrong = spring_text.replace('highest = "angle"', "near = { angle = 0.3 }")
    (tmp_path / "wrong.toml").write_text(wrong)
    with pytest.raises(InputError, match=r"`route\[0\]\.start\.near` must be an equilibrium"):
        run_study(tmp_path / "wrong.toml", tmp_path / "out")


@pytest.mark.usefixtures("plain_figures")
def test_a_refused_route_is_an_answer(spring_text: str, tmp_path: Path):
    (tmp_path / "tight.toml").write_text(spring_text + "margin = 50.0\n")
    outcome = run_study(tmp_path / "tight.toml", tmp_path / "out")
    assert outcome.routes[0].route.status == "refused"
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert "Refused." in page
    assert not (tmp_path / "out" / "over-schedule.csv").exists()
