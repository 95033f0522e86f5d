"""Types, completion and the cost of an import, as users meet them in their editors."""

import json
import re
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

import jedi
import pytest

ROOT = Path(__file__).parents[1]
USES = ROOT / "tests" / "typing" / "uses.py"
WRONG = {
    number
    for number, line in enumerate(USES.read_text(encoding="utf-8").splitlines(), 1)
    if "# wrong" in line
}
"""Lines of the file that a type checker must refuse."""
STRICT = {
    "typeCheckingMode": "strict",
    "extraPaths": [str(ROOT / "src")],
    # The types of matplotlib leave keyword arguments open: each of its methods would be reported.
    "reportUnknownMemberType": False,
}


def _pyright(checked: Path, folder: Path) -> list[dict[str, Any]]:
    """Errors that pyright (the build that installs without a download) finds in strict mode."""
    settings = folder / "pyrightconfig.json"
    settings.write_text(json.dumps({"include": [str(checked)], **STRICT}))
    done = subprocess.run(
        [sys.executable, "-m", "basedpyright", "--outputjson", "-p", str(settings),
         "--pythonpath", sys.executable],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    found = json.loads(done.stdout)
    assert found["summary"]["filesAnalyzed"] > 0, done.stderr
    return [each for each in found["generalDiagnostics"] if each["severity"] == "error"]


def test_pyright_refuses_exactly_the_wrong_uses(tmp_path: Path):
    errors = _pyright(USES, tmp_path)
    assert {each["range"]["start"]["line"] + 1 for each in errors} == WRONG


@pytest.mark.slow
def test_mypy_refuses_exactly_the_wrong_uses():
    """Slow without the cache that `make lint` leaves."""
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", str(USES)],
        capture_output=True, text=True, check=False, cwd=ROOT,
    )  # fmt: skip
    assert set(map(int, re.findall(r"uses\.py:(\d+): error", done.stdout))) == WRONG


@pytest.mark.slow
def test_the_examples_have_no_errors_in_strict_mode(tmp_path: Path):
    errors = _pyright(ROOT / "examples", tmp_path)
    assert [f"{each['file']}: {each['message']}" for each in errors] == []


@pytest.mark.slow
def test_completion_lists_classes_methods_and_arguments():
    """By jedi, as notebooks and prompts use it: it reads the stub, it does not run the code."""
    project = jedi.Project(str(ROOT), added_sys_path=[str(ROOT / "src")])
    text = "import equimorph as em\nrod = em.Rod()\nrod.hei\nem.Rod(s\nem."
    script = jedi.Script(text, project=project)
    public = {each.name: each.type for each in script.complete(5, 3)}
    assert [public[name] for name in ("Rod", "EquilibriumSet")] == ["class", "class"]
    assert public["plan"] == "function"
    assert [each.name for each in script.complete(3, 7)] == ["height"]
    assert {"span=", "stiffness="} <= {each.name for each in script.complete(4, 8)}


def test_importing_costs_little():
    """At most 0.05 s of the processor; the least of three, without what Python itself takes."""

    def seconds(code: str) -> float:
        def once() -> float:
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run([sys.executable, "-c", code], check=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

        return min(once() for _ in range(3))

    assert seconds("import equimorph") - seconds("pass") <= 0.05
