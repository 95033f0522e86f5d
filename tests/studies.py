"""Small studies, one finished run, and dots for figures, for the tests of the outer layers."""

import csv
import re
import shutil
from functools import partial
from pathlib import Path

import pytest
from PIL import Image

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.study import Outcome, parse_study, prepare, report, run_study
from equimorph.study.folder import PRIVATE
from equimorph.tasks.route import Route
from typecheck import unchecked

SPRING = """\
[structure]
kind = "spring"

[set]
box = { x_l = [0.5, 1.3], F = [-0.2, 0.2] }
within = ["angle <= 1.4"]
intervals = [11, 11]

[[equilibria]]
at = { x_l = 0.8, F = 0.0 }

[[route]]
name = "over"
start = { at = { x_l = 0.8, F = 0.0 }, highest = "angle" }
goal = { at = { x_l = 0.8, F = 0.0 }, lowest = "angle" }
"""

ARCH = """\
[structure]
kind = "rod"
load = "uniform"

[set]
box = { Theta = [0.2, 2.5], Delta = [-2.0, 2.0] }
fixed = { q = 2.5 }
within = ["max_curvature <= 20"]
intervals = [5, 9]

[[equilibria]]
at = { Theta = 1.0, Delta = 0.0 }

[[route]]
name = "inside-out"
start = { at = { Theta = 1.0, Delta = 0.0 }, highest = "height(0.5)" }
goal = { at = { Theta = 1.0, Delta = 0.0 }, lowest = "height(0.5)" }
via = [{ Theta = 1.3 }, { Delta = 1.3 }]
within = ["max_curvature <= 20"]
margin = 0.1
"""


SPRING_SET = """\
[structure]
kind = "spring"

[set]
box = { x_l = [0.5, 1.3], F = [-0.2, 0.2] }
within = ["angle <= 1.4", "angle >= -1.4"]
intervals = [9, 9]

"""
"""F = (1 − x_l/cos δ) sin δ with folds at x_l = cos³δ, F = sin³δ (PHYSICS section 2)."""

EXAMPLES = Path(__file__).parents[1] / "examples"


def coarse_examples() -> list[str]:
    """Examples whose structures or maps are described in the file itself, on coarse grids."""
    texts = [(EXAMPLES / f"{name}.toml").read_text() for name in ("column", "truss", "maps")]
    return [re.sub(r"intervals = .*", "intervals = [5, 5]", text) for text in texts]


def finished_run(base: Path) -> tuple[Outcome, Path]:
    """Outcome of the spring study, run in a folder, and its results folder."""
    (base / "spring.toml").write_text(SPRING)
    with pytest.MonkeyPatch.context() as patch, unchecked():  # the layers below check themselves
        patch.setattr(plotting, "film", partial(plotting.film, frames=12))
        return run_study(base / "spring.toml", base / "out"), base / "out"


_SETS: list[Path] = []
"""Results folders with the answer to `SPRING_SET`, from which later studies take it."""


def answered(folder: Path, text: str, *, dots: bool = True) -> tuple[Outcome, Path]:
    """Run a study in a folder; the set of `SPRING_SET` is computed once for all of them."""
    study, out = folder / "spring.toml", folder / "out"
    study.write_text(text)
    if text.startswith(SPRING_SET) and _SETS:
        with_answers_of(_SETS[0], out)
    with pytest.MonkeyPatch.context() as patch, unchecked():
        empty_pages(patch)
        if dots:
            draw_dots(patch)
        outcome = run_study(study, out)
    if text.startswith(SPRING_SET):
        _SETS.append(out)
    return outcome, out


def _unanswered(*_: object) -> None:
    raise AssertionError("the answer must come from the folder")


def answered_again(study: Path, out: Path) -> Outcome:
    """Run a study that was run before; whatever is not read from the folder fails."""
    with pytest.MonkeyPatch.context() as patch, unchecked():
        draw_dots(patch)
        patch.setattr("equimorph.study.question.Question.answer", _unanswered)
        return run_study(study, out)


def page(out: Path) -> str:
    """Page of a results folder."""
    return (out / "index.html").read_text(encoding="utf-8")


def rows_of(file: Path) -> list[list[str]]:
    """Rows of a table in a results folder."""
    with file.open(encoding="utf-8", newline="") as table:
        return list(csv.reader(table))


def refuse(text: str, old: str, new: str, message: str, name: str = "study.toml") -> None:
    """A study with something replaced is refused in one line."""
    assert old in text
    with pytest.raises(InputError, match=message) as found:
        prepare(parse_study(text.replace(old, new, 1), name))
    assert "\n" not in str(found.value)


def only_route(outcome: Outcome) -> Route:
    """Route of a study that asks for one."""
    ((route, *_),) = outcome.of("route").values()
    assert isinstance(route, Route)
    return route


def with_answers_of(finished: Path, out: Path) -> Path:
    """Put the answers of a finished run where a new one will find them."""
    shutil.copytree(finished / PRIVATE, out / PRIVATE)
    return out


def draw_dots(monkeypatch: pytest.MonkeyPatch) -> None:
    """Put dots in place of figures and pages, which take seconds; `finished_run` draws them."""
    for name in ("surface", "parameter_plane", "shapes", "margins"):
        monkeypatch.setattr(plotting, name, lambda *_, **__: None)
    monkeypatch.setattr(plotting, "save", lambda _, folder, name: _dot(folder / f"{name}.png"))
    monkeypatch.setattr(plotting, "film", lambda _, path, **__: _dot(path))
    empty_pages(monkeypatch)


def empty_pages(monkeypatch: pytest.MonkeyPatch) -> None:
    """Put an empty page in place of the explorer's."""
    monkeypatch.setattr(report, "explore", lambda *given, **_: given[2].write_text("<html></html>"))


def _dot(path: Path) -> None:
    Image.new("L", (1, 1)).save(path)
