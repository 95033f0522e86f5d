"""A results folder is never half-written and never takes what is not ours."""

import json
from pathlib import Path

import pytest

from equimorph.errors import InputError
from equimorph.study.folder import (
    MANIFEST,
    PRIVATE,
    ResultsFolder,
    open_results_folder,
    study_fingerprint,
)
from equimorph.study.problem import Study, parse_study


@pytest.fixture
def study(spring_text: str) -> Study:
    return parse_study(spring_text, "spring.toml")


@pytest.fixture
def other(spring_text: str) -> Study:
    return parse_study(spring_text.replace("0.8", "0.7"), "spring.toml")


def _add(folder: ResultsFolder, name: str, text: str) -> None:
    with folder.adding() as staging:
        (staging / name).write_text(text)


def _run(path: Path, study: Study, *, replace: bool = False, **files: str) -> None:
    """A run that adds text files; ``x_txt`` stands for ``x.txt``."""
    with open_results_folder(path, study, replace=replace) as folder:
        for name, text in files.items():
            _add(folder, name.replace("_", "."), text)


def _names(path: Path) -> list[str]:
    return sorted(file.name for file in path.iterdir())


def test_files_arrive_when_the_block_ends(study: Study, tmp_path: Path):
    out = tmp_path / "a" / "out"
    with open_results_folder(out, study) as folder, folder.adding() as staging:
        (staging / "x.txt").write_text("x")
        assert _names(out) == [PRIVATE]
    assert (out / "x.txt").read_text() == "x"
    assert _names(out) == [PRIVATE, MANIFEST, "x.txt"]


def test_nothing_arrives_when_the_block_fails(study: Study, tmp_path: Path):
    def add_half(folder: ResultsFolder) -> None:
        with folder.adding() as staging:
            (staging / "x.txt").write_text("half")
            raise KeyError

    with open_results_folder(tmp_path, study) as folder, pytest.raises(KeyError):
        add_half(folder)
    assert _names(tmp_path) == [PRIVATE]


def test_what_a_killed_run_left_is_swept_away(study: Study, tmp_path: Path):
    left = tmp_path / PRIVATE / "staging-left"
    left.mkdir(parents=True)
    _run(tmp_path, study)
    assert not left.exists()


def test_the_same_study_may_come_back_and_replace_its_files(study: Study, tmp_path: Path):
    _run(tmp_path, study, x_txt="old")
    with open_results_folder(tmp_path, study) as folder:
        assert folder.holds(["x.txt"])
        _add(folder, "x.txt", "new")
    assert (tmp_path / "x.txt").read_text() == "new"


def test_a_file_that_was_changed_or_removed_is_not_held(study: Study, tmp_path: Path):
    _run(tmp_path, study, x_txt="x", y_txt="y", z_txt="z")
    (tmp_path / "x.txt").write_text("half")
    (tmp_path / "y.txt").unlink()
    with open_results_folder(tmp_path, study) as folder:
        assert folder.holds(["z.txt"])
        for names in (["x.txt"], ["y.txt"], ["x.txt", "z.txt"], ["none.txt"]):
            assert not folder.holds(names)


def test_another_study_is_refused_and_nothing_changes(study: Study, other: Study, tmp_path: Path):
    _run(tmp_path, study, x_txt="x")
    before = (tmp_path / MANIFEST).read_bytes()
    with pytest.raises(InputError, match="results of another study"):
        _run(tmp_path, other)
    assert (tmp_path / MANIFEST).read_bytes() == before
    assert (tmp_path / "x.txt").read_text() == "x"


def test_replacing_takes_another_study_but_not_foreign_files(
    study: Study, other: Study, tmp_path: Path
):
    _run(tmp_path, study, x_txt="x")
    (tmp_path / "mine.txt").write_text("mine")
    with open_results_folder(tmp_path, other, replace=True) as folder:
        assert folder.files() == {}
    assert _names(tmp_path) == [PRIVATE, MANIFEST, "mine.txt"]
    _run(tmp_path, other, y_txt="y")
    with pytest.raises(InputError, match="results of another study"):
        _run(tmp_path, study)


def test_a_study_that_left_no_results_gives_way_to_its_corrected_version(
    study: Study, other: Study, tmp_path: Path
):
    """Nothing would be overwritten."""
    _run(tmp_path, study)
    _run(tmp_path, other, x_txt="x")
    assert (tmp_path / "x.txt").read_text() == "x"


def test_replacing_does_not_take_a_folder_that_was_never_ours(study: Study, tmp_path: Path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="with other files"):
        _run(tmp_path, study, replace=True)
    assert _names(tmp_path) == ["mine.txt"]


def test_a_foreign_file_of_the_same_name_is_kept(study: Study, tmp_path: Path):
    _run(tmp_path, study, x_txt="x")
    (tmp_path / "index.html").write_text("mine")
    with pytest.raises(InputError, match=r"must not hold a foreign file at .*index\.html"):
        _run(tmp_path, study, index_html="ours")
    assert (tmp_path / "index.html").read_text() == "mine"
    assert _names(tmp_path) == [PRIVATE, MANIFEST, "index.html", "x.txt"]


def test_a_place_below_a_file_is_refused(study: Study, tmp_path: Path):
    (tmp_path / "file").write_text("mine")
    for place in (tmp_path / "file", tmp_path / "file" / "out"):
        with pytest.raises(InputError, match=r"must be a folder that can be written; .*--out"):
            _run(place, study)
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize(
    "content",
    [
        "{",
        "[]",
        '{"format": "x"}',
        '{"format": "equimorph results folder", "version": 99}',
        '{"format": "equimorph results folder", "version": "1", "study": "", "files": {}}',
        '{"format": "equimorph results folder", "version": 2, "study": "", "files": 3}',
    ],
)
def test_a_manifest_that_is_not_understood_is_refused(content: str, study: Study, tmp_path: Path):
    (tmp_path / MANIFEST).write_text(content)
    with pytest.raises(InputError, match="damaged or newer"):
        _run(tmp_path, study, replace=True)
    assert (tmp_path / MANIFEST).read_text() == content


def test_a_manifest_never_reaches_out_of_the_folder(study: Study, other: Study, tmp_path: Path):
    (tmp_path / "mine.txt").write_text("mine")
    inner = tmp_path / "out"
    _run(inner, study, x_txt="x")
    manifest = json.loads((inner / MANIFEST).read_text())
    (inner / MANIFEST).write_text(json.dumps({**manifest, "files": {"../mine.txt": ""}}))
    with pytest.raises(InputError, match="damaged or newer"):
        _run(inner, other, replace=True)
    assert (tmp_path / "mine.txt").exists()


def test_a_folder_of_the_first_release_goes_on(study: Study, tmp_path: Path):
    """Version 1 listed names without checksums, and two fingerprints of 64 digits."""
    long = study_fingerprint(study).ljust(64, "0")
    words = {"format": "equimorph results folder", "version": 1, "files": ["x.txt"]}
    (tmp_path / MANIFEST).write_text(json.dumps({**words, "study": {"study": long, "set": long}}))
    (tmp_path / "x.txt").write_text("old")
    with open_results_folder(tmp_path, study) as folder:
        assert not folder.holds(["x.txt"])
        _add(folder, "x.txt", "new")
    assert (tmp_path / "x.txt").read_text() == "new"


def test_comments_and_title_do_not_make_another_study(spring_text: str):
    plain = parse_study(spring_text, "a.toml")
    titled = parse_study('title = "T" # why\n' + spring_text, "b.toml")
    assert study_fingerprint(plain) == study_fingerprint(titled)
