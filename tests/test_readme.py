"""The example of the README runs as it is printed."""

import re
from pathlib import Path

import pytest

from typecheck import unchecked

README = Path(__file__).parents[1] / "README.md"
NUMBER = re.compile(r"\d+\.\d+")


def numbers(line: str) -> list[float]:
    return [float(number) for number in NUMBER.findall(line)]


def test_the_example_prints_what_it_says(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = README.read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    with unchecked():  # the tests of sets check shapes
        exec(compile(code, str(README), "exec"), {})  # our own text
    said = [line.split("  # ")[1] for line in code.splitlines() if line.startswith("print")]
    (limit, route) = capsys.readouterr().out.splitlines()
    assert limit[:23] == said[0][:23]
    # way-points lie on vertices of the grid: lengths of routes are as good as its steps
    assert NUMBER.sub("", route) == NUMBER.sub("", said[1])
    assert numbers(route) == pytest.approx(numbers(said[1]), rel=1e-3)
    assert (tmp_path / "schedule.csv").exists()
