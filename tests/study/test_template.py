from pathlib import Path

import pytest

from equimorph.cli.app import Kind
from equimorph.errors import InputError
from equimorph.study import parse_study, prepare, read_problem
from equimorph.study.kinds import KINDS as QUESTIONS
from equimorph.study.template import KINDS, template, write_template

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("kind", KINDS)
def test_a_template_is_a_sound_study(kind: str):
    problem = prepare(parse_study(template(kind), kind, EXAMPLES))
    assert problem.questions


@pytest.mark.parametrize("kind", KINDS)
def test_the_examples_are_the_templates(kind: str):
    assert (EXAMPLES / f"{kind}.toml").read_text() == template(kind)


def test_every_table_stands_in_a_template():
    """A new kind of question gets an example in `study/templates/tasks.toml`."""
    texts = "".join(template(kind) for kind in KINDS)
    assert [each.table for each in QUESTIONS if f"[[{each.table}]]" not in texts] == []


def test_every_template_can_be_asked_for():
    assert sorted(kind.value for kind in Kind) == sorted(KINDS)


def test_a_file_that_exists_is_kept(tmp_path: Path):
    (tmp_path / "a.toml").write_text("mine")
    with pytest.raises(InputError, match="must not exist yet"):
        write_template(tmp_path / "a.toml", "arch")
    assert (tmp_path / "a.toml").read_text() == "mine"


def test_the_data_of_a_template_come_with_it(tmp_path: Path):
    write_template(tmp_path / "mine.toml", "calibration")
    data = (EXAMPLES / "calibration.csv").read_text()
    assert (tmp_path / "calibration.csv").read_text() == data
    assert read_problem(tmp_path / "mine.toml")[2].questions


def test_another_ending_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match=r"must end in \.toml"):
        write_template(tmp_path / "a.txt", "arch")


def test_a_missing_folder_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match="No such file or directory"):
        write_template(tmp_path / "none" / "a.toml", "arch")


def test_an_unknown_kind_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match=r"must be one of arch, arm, beam, .*; got 'cantilever'"):
        write_template(tmp_path / "a.toml", "cantilever")
