"""The example of the README runs as it is printed."""

from pathlib import Path

from typecheck import unchecked

README = Path(__file__).parents[1] / "README.md"


def test_the_example_prints_what_it_says(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = README.read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    with unchecked():  # the tests of sets check shapes
        exec(compile(code, str(README), "exec"), {})  # our own text
    said = [line.split("  # ")[1] for line in code.splitlines() if line.startswith("print")]
    printed = capsys.readouterr().out.splitlines()
    assert printed[0][:23] == said[0][:23]
    assert printed[1:] == said[1:]
    assert (tmp_path / "schedule.csv").exists()
