"""The example of the README runs as it is printed."""

from pathlib import Path

from typecheck import unchecked

README = Path(__file__).parents[1] / "README.md"


def test_the_example_prints_what_it_says(capsys):
    code = README.read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    with unchecked():  # the tests of sets check shapes
        exec(compile(code, str(README), "exec"), {})  # noqa: S102  # our own text
    first, second = capsys.readouterr().out.splitlines()[:2]
    assert first.startswith("branch point 4.2439977")
    assert second.startswith("arrived")
