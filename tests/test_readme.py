"""The examples of the README and of the guide run as they are printed."""

import re
from pathlib import Path

import pytest

from typecheck import unchecked

ROOT = Path(__file__).parents[1]
ROOTS = ROOT, ROOT / "src", ROOT / "src" / "equimorph"
BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)
NUMBER = re.compile(r"\d+\.\d+")


def numbers(line: str) -> list[float]:
    return [float(number) for number in NUMBER.findall(line)]


def ran(page: Path, capsys) -> tuple[list[str], list[str]]:
    """What the code of a page prints, and what the page says that it prints."""
    code = "".join(BLOCK.findall(page.read_text(encoding="utf-8")))
    with unchecked():  # the tests of what it calls check shapes
        exec(compile(code, str(page), "exec"), {})  # our own text
    said = [line.split("  # ")[1] for line in code.splitlines() if line.startswith("print")]
    return capsys.readouterr().out.splitlines(), said


def test_the_example_prints_what_it_says(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (limit, route), said = ran(ROOT / "README.md", capsys)
    assert limit[:23] == said[0][:23]
    # way-points lie on vertices of the grid: lengths of routes are as good as its steps
    assert NUMBER.sub("", route) == NUMBER.sub("", said[1])
    assert numbers(route) == pytest.approx(numbers(said[1]), rel=1e-3)
    assert (tmp_path / "schedule.csv").exists()


def test_the_guide_prints_what_it_says(capsys):
    printed, said = ran(ROOT / "docs" / "extending.md", capsys)
    assert printed == said


def test_the_page_on_sets_prints_what_it_says(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    printed, said = ran(ROOT / "docs" / "sets.md", capsys)
    assert printed == said
    assert (tmp_path / "spring.ply").exists()


@pytest.mark.parametrize("name", ["README.md", "docs/extending.md", "docs/sets.md"])
def test_files_that_pages_name_exist(name):
    page = (ROOT / name).read_text(encoding="utf-8")
    named = re.findall(r"`((?:\w+/)+\w+\.(?:py|toml))`", page)
    assert [path for path in named if not any((root / path).exists() for root in ROOTS)] == []
