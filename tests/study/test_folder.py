"""A results folder is never half-written and never takes what is not ours."""

import json
import os
from pathlib import Path

import pytest

from equimorph.errors import InputError
from equimorph.study.folder import MANIFEST, RESULTS, open_results_folder, study_digests
from equimorph.study.problem import Study, parse_study


@pytest.fixture
def study(spring_text: str) -> Study:
    return parse_study(spring_text, "spring.toml")


@pytest.fixture
def other(spring_text: str) -> Study:
    return parse_study(spring_text.replace("0.8", "0.7"), "spring.toml")


def test_files_arrive_when_the_block_ends(study: Study, tmp_path: Path):
    folder = open_results_folder(tmp_path / "a" / "out", study)
    with folder.adding() as staging:
        (staging / "x.txt").write_text("x")
        assert not (folder.path / "x.txt").exists()
    assert (folder.path / "x.txt").read_text() == "x"
    assert sorted(file.name for file in folder.path.iterdir()) == [MANIFEST, "x.txt"]


def test_nothing_arrives_when_the_block_fails(study: Study, tmp_path: Path):
    folder = open_results_folder(tmp_path / "out", study)

    def add_half() -> None:
        with folder.adding() as staging:
            (staging / "x.txt").write_text("half")
            raise KeyError

    with pytest.raises(KeyError):
        add_half()
    assert [file.name for file in folder.path.iterdir()] == [MANIFEST]


def test_what_a_killed_run_left_is_swept_away_but_not_what_a_living_one_makes(
    study: Study, tmp_path: Path
):
    folder = open_results_folder(tmp_path, study)
    left = tmp_path / ".partial-left"
    left.mkdir()
    os.utime(left, (0, 0))
    with folder.adding() as living:
        open_results_folder(tmp_path, study)
        assert living.is_dir()
    assert not left.exists()


def test_the_same_study_may_come_back_and_replace_its_files(study: Study, tmp_path: Path):
    open_results_folder(tmp_path, study).add_text("x.txt", "old")
    again = open_results_folder(tmp_path, study)
    assert again.holds("x.txt")
    again.add_text("x.txt", "new")
    assert (tmp_path / "x.txt").read_text() == "new"


def test_another_study_is_refused_and_nothing_changes(study: Study, other: Study, tmp_path: Path):
    open_results_folder(tmp_path, study).add_text("x.txt", "x")
    before = (tmp_path / MANIFEST).read_bytes()
    with pytest.raises(InputError, match="results of another study"):
        open_results_folder(tmp_path, other)
    assert (tmp_path / MANIFEST).read_bytes() == before


def test_replacing_takes_another_study_but_not_foreign_files(
    study: Study, other: Study, tmp_path: Path
):
    open_results_folder(tmp_path, study).add_text("x.txt", "x")
    (tmp_path / "mine.txt").write_text("mine")
    folder = open_results_folder(tmp_path, other, replace=True)
    assert folder.files() == []
    assert sorted(file.name for file in tmp_path.iterdir()) == [MANIFEST, "mine.txt"]


def test_replacing_keeps_the_set_that_both_studies_ask_for(
    study: Study, other: Study, spring_text: str, tmp_path: Path
):
    another_set = parse_study(spring_text.replace("1.3]", "1.4]"), "spring.toml")
    first = open_results_folder(tmp_path, study)
    first.add_text(RESULTS, "a set")
    first.add_text("x.txt", "x")
    assert open_results_folder(tmp_path, other, replace=True).files() == [RESULTS]
    assert open_results_folder(tmp_path, another_set, replace=True).files() == []


def test_replacing_does_not_take_a_folder_that_was_never_ours(study: Study, tmp_path: Path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="with other files"):
        open_results_folder(tmp_path, study, replace=True)
    assert [file.name for file in tmp_path.iterdir()] == ["mine.txt"]


def test_a_foreign_file_of_the_same_name_is_kept(study: Study, tmp_path: Path):
    folder = open_results_folder(tmp_path, study)
    (tmp_path / "index.html").write_text("mine")
    with pytest.raises(InputError, match=r"must not hold a file of its own at .*index\.html"):
        folder.add_text("index.html", "ours")
    assert (tmp_path / "index.html").read_text() == "mine"
    assert sorted(file.name for file in tmp_path.iterdir()) == [MANIFEST, "index.html"]


def test_a_place_below_a_file_is_refused(study: Study, tmp_path: Path):
    (tmp_path / "file").write_text("mine")
    for place in (tmp_path / "file", tmp_path / "file" / "out"):
        with pytest.raises(InputError, match=r"must be a folder that can be written; .*--out"):
            open_results_folder(place, study)
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize(
    "content",
    ["{", "[]", '{"format": "x"}', '{"format": "equimorph results folder", "version": 99}'],
)
def test_a_manifest_that_is_not_understood_is_refused(content: str, study: Study, tmp_path: Path):
    (tmp_path / MANIFEST).write_text(content)
    with pytest.raises(InputError, match="damaged or newer"):
        open_results_folder(tmp_path, study, replace=True)
    assert (tmp_path / MANIFEST).read_text() == content


def test_a_manifest_never_reaches_out_of_the_folder(study: Study, tmp_path: Path):
    (tmp_path / "mine.txt").write_text("mine")
    inner = tmp_path / "out"
    open_results_folder(inner, study)
    manifest = json.loads((inner / MANIFEST).read_text())
    (inner / MANIFEST).write_text(json.dumps({**manifest, "files": ["../mine.txt"]}))
    with pytest.raises(InputError, match="damaged or newer"):
        open_results_folder(inner, study, replace=True)
    assert (tmp_path / "mine.txt").exists()


def test_comments_and_title_do_not_make_another_study(spring_text: str):
    plain = parse_study(spring_text, "a.toml")
    titled = parse_study('title = "T" # why\n' + spring_text, "b.toml")
    assert study_digests(plain) == study_digests(titled)
