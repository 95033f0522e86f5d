"""A study whose structure is given by its energy."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.storage import read_results
from equimorph.study import run_study
from equimorph.study.prepare import prepare
from equimorph.study.problem import parse_study
from studies import draw_dots, only_route
from typecheck import unchecked

EXAMPLE = Path(__file__).parents[2] / "examples" / "column.toml"


@pytest.mark.parametrize("drawn", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_the_example_runs_from_file_to_page(drawn, tmp_path, monkeypatch):
    """Its leaning states are mirror images; stable ways lead around P = (3 − √5)/2."""
    text = EXAMPLE.read_text(encoding="utf-8").replace("[31, 31]", "[11, 11]")
    (tmp_path / "column.toml").write_text(text, encoding="utf-8")
    if drawn:
        monkeypatch.setattr(plotting, "film", partial(plotting.film, frames=6))
    else:
        draw_dots(monkeypatch)
    with unchecked():
        outcome = run_study(tmp_path / "column.toml", tmp_path / "out")
        results = read_results(tmp_path / "out" / "results.h5")
    assert outcome.equilibrium_set.audit.clean
    lean = outcome.problem.structure.descriptor("lean")(outcome.points[0])
    np.testing.assert_allclose(np.sort(lean), [-lean.max(), 0.0, lean.max()], atol=1e-12)
    route = only_route(outcome)
    assert route.status == "arrived"
    assert route.path.states["P"].min() < (3.0 - np.sqrt(5.0)) / 2.0
    stored = results.equilibrium_set.structure
    assert stored.identity() == outcome.problem.structure.identity()
    assert (tmp_path / "out" / "index.html").is_file()


WRONG = {
    "a formula that is none": (
        '"k*((phi1',
        '"k*(((phi1',
        r"in `structure`: `energy` must be a formula",
    ),
    "an unknown symbol": ("+ P*top", "+ P*tip", r"not in the unknown symbol tip"),
    "a wrong key of an unknown": (
        "guesses",
        "gueses",
        r"`structure\.unknowns\[0\]\.gueses` must be a key of .*Did you mean guesses\?",
    ),
    "a wrong range": (
        "[-2.0, 2.0]",
        "[2.0, -2.0]",
        r"`structure\.unknowns\[0\]\.guesses` must be \[lower, upper\]",
    ),
    "a wrong role": (
        '"load"',
        '"lode"',
        r"`structure\.parameters\[1\]\.role` must be 'actuator', 'load' or 'fixed'; got \"lode\"",
    ),
    "a formula without quotes": (
        'natural = "alpha"',
        "natural = true",
        r"`structure\.unknowns\[0\]\.natural` must be a formula in quotes, or a finite number",
    ),
    "a point of three coordinates": (
        "[0, 0],",
        "[0, 0, 0],",
        r"`structure\.draw\[0\]` must have at most 2 entries",
    ),
    "a misspelt key": (
        "parameters = [",
        "parametres = [",
        r"`structure\.parametres` must be a key",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_energy_gets_one_line_with_its_key(case):
    old, new, line = WRONG[case]
    text = EXAMPLE.read_text(encoding="utf-8")
    assert old in text
    with pytest.raises(InputError, match=line) as found:
        prepare(parse_study(text.replace(old, new, 1), "column.toml"))
    assert "\n" not in str(found.value)
