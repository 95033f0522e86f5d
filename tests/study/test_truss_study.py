"""A study of a truss."""

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

EXAMPLE = Path(__file__).parents[2] / "examples" / "truss.toml"


@pytest.mark.parametrize("drawn", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_the_example_runs_from_file_to_page(drawn, tmp_path, monkeypatch):
    """Stable ways over lead where both bars are shorter than half the span."""
    text = EXAMPLE.read_text(encoding="utf-8").replace("[25, 25]", "[9, 9]")
    (tmp_path / "truss.toml").write_text(text, encoding="utf-8")
    if drawn:
        monkeypatch.setattr(plotting, "film", partial(plotting.film, frames=6))
    else:
        draw_dots(monkeypatch)
    with unchecked():
        outcome = run_study(tmp_path / "truss.toml", tmp_path / "out")
        results = read_results(tmp_path / "out" / "results.h5")
    assert outcome.equilibrium_set.audit.clean
    np.testing.assert_array_equal(np.sort(outcome.points[0].index), [0, 0, 1])
    route = only_route(outcome)
    assert route.status == "arrived"
    assert route.path.states["a"].min() < 1.0 - np.hypot(1.0, 0.3)
    stored = results.equilibrium_set.structure
    assert stored.identity() == outcome.problem.structure.identity()
    assert (tmp_path / "out" / "index.html").is_file()


WRONG = {
    "a mechanism": (
        'C = "xy"',
        'C = "x"',
        r"in `structure`: `truss` must be no mechanism; joint C",
    ),
    "a joint that is none": ('["A", "B"]', '["A", "D"]', r"`ends` of bar A-D must be joints"),
    "no stiffness": ("EA = 1.0", "EA = 0.0", r"`structure\.bars\[0\]\.EA` must be greater than 0"),
    "a key of a bar": ("EI = 0.01", "El = 0.01", r"`structure\.bars\[0\]\.El` must be a key of"),
    "an unknown strain": (
        '"engineering"',
        '"true"',
        r"`structure\.strain` must be 'engineering' or",
    ),
    "an unknown bar": ("A-B = 1.0", "A-C = 1.0", r"`bar` must be one of A-B, B-C; got 'A-C'"),
    "a constraint on another bar": (
        "max_utilisation <=",
        "utilisation(A-C) <=",
        r"in `set\.within\[0\]`: `bar` must be one of A-B, B-C",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_truss_gets_one_line_with_its_key(case):
    old, new, line = WRONG[case]
    text = EXAMPLE.read_text(encoding="utf-8")
    assert old in text
    with pytest.raises(InputError, match=line) as found:
        prepare(parse_study(text.replace(old, new, 1), "truss.toml"))
    assert "\n" not in str(found.value)
