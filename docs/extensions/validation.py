"""The page of validation: what each test of a publication compares, source, printed value and ours.

``python docs/extensions/validation.py`` runs the tests in ``tests/validation`` (minutes) and writes
docs/validation.md. pytest tells every assertion that holds; those that compare with
``pytest.approx`` become the rows.
"""

import ast
import re
import sys
from pathlib import Path

import pytest
from public_names import with_links

ROOT = Path(__file__).parents[2]
TESTS = ROOT / "tests" / "validation"
PAGE = ROOT / "docs" / "validation.md"
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?"
COMPARED = re.compile(
    rf"^(?:np\.float64\()?({NUMBER})\)?\s+== (?:approx\()?({NUMBER}) ± ({NUMBER})"
)
ROWS = 4
"""Largest number of comparisons shown of one test."""
PLACE = "references.md"
TITLE = """\
# Validation

Every row is an assertion of a test that holds: the test's own words, the value from its source (a
publication, a closed form or an independent calculation) with the tolerance of the test, and ours.
Written by `python docs/extensions/validation.py`, which runs `tests/validation`;
comparisons of whole arrays stand in the tests only.
Slow tests are left out unless `-m ""` is added.
"""


class Recorder:
    """A plugin that keeps the comparisons of numbers that held."""

    def __init__(self) -> None:
        self.held: dict[str, list[tuple[str, str, str]]] = {}
        self.words: dict[str, str] = {}

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Keep what each test says about itself."""
        for item in items:
            self.words[item.nodeid] = (item.function.__doc__ or "").strip().split("\n\n")[0]

    def pytest_assertion_pass(self, item: pytest.Item, lineno: int, orig: str, expl: str) -> None:
        """Keep an assertion that compares two numbers."""
        found = COMPARED.match(expl)
        if found and "approx" in orig:
            self.held.setdefault(item.nodeid, []).append(found.groups())


def page(recorder: Recorder) -> str:
    """Return the page as Markdown: the files in the order of their names."""
    parts = [TITLE]
    for file in sorted(TESTS.glob("test_*.py")):
        tests = [each for each in recorder.held if f"/{file.name}::" in each]
        if tests:
            head = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
            parts.append(_section(head, file.name, tests, recorder))
    return "\n".join(parts)


def _section(head: str, name: str, tests: list[str], recorder: Recorder) -> str:
    title, _, rest = head.partition("\n")
    rows: dict[str, list[str]] = {}  # one test may have run with several values
    for test in tests:
        words = recorder.words[test].replace("\n", " ")
        fact = test.split("::")[1].split("[")[0].removeprefix("test_").replace("_", " ")
        for ours, source, tolerance in recorder.held[test]:
            rows.setdefault(f"**{fact}.** {words}", []).append(
                f"{_number(source)} ± {_number(tolerance)} | {_number(ours)} |"
            )
    table = ["| test | source | ours |", "| --- | --- | --- |"]
    for told, values in rows.items():
        cells = [_cell(told), *[""] * (ROWS - 1)]
        table += [
            f"| {cell} | {value}" for cell, value in zip(cells, dict.fromkeys(values), strict=False)
        ]
    links = with_links(f"## {title.rstrip('.')}\n\n{rest.strip().split(chr(10) * 2)[0]}", PLACE)
    return "\n".join([links, "", f"`tests/validation/{name}`", "", *table, ""])


def _cell(text: str) -> str:
    return with_links(text.replace("|", r"\|"), PLACE)


def _number(text: str) -> str:
    return f"{float(text):.10g}".replace("-", "−")


def main() -> int:
    """Run the tests and write the page."""
    recorder = Recorder()
    options = [
        "-q",
        "-p",
        "no:cacheprovider",
        "-p",
        "no:xdist",
        "-o",
        "enable_assertion_pass_hook=true",
    ]
    code = pytest.main([*options, "-m", "not slow", str(TESTS), *sys.argv[1:]], plugins=[recorder])
    PAGE.write_text(page(recorder), encoding="utf-8")
    return int(code)


if __name__ == "__main__":
    sys.exit(main())
