"""A study of a frame."""

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

EXAMPLE = Path(__file__).parents[2] / "examples" / "lee.toml"


@pytest.mark.parametrize("drawn", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_the_example_runs_from_file_to_page(drawn, tmp_path, monkeypatch):
    """A way around the snap of Lee's frame, on a coarse grid."""
    text = EXAMPLE.read_text(encoding="utf-8").replace("[25, 25]", "[7, 9]")
    text = text.replace("degree = 6", "degree = 4")
    (tmp_path / "lee.toml").write_text(text, encoding="utf-8")
    if drawn:
        monkeypatch.setattr(plotting, "film", partial(plotting.film, frames=6))
    else:
        draw_dots(monkeypatch)
    with unchecked():
        outcome = run_study(tmp_path / "lee.toml", tmp_path / "out")
        results = read_results(tmp_path / "out" / "results.h5")
    assert outcome.equilibrium_set.audit.clean
    np.testing.assert_array_equal(np.sort(outcome.points[0].index), [0, 0, 1, 1, 2])
    assert only_route(outcome).status == "arrived"
    stored = results.equilibrium_set.structure
    assert stored.identity() == outcome.problem.structure.identity()
    assert (tmp_path / "out" / "index.html").is_file()


WRONG = {
    "a mechanism": ('A = "pinned", D = "pinned"', 'A = "pinned"', r"`frame` must be no mechanism"),
    "drift": ('A = "pinned", D = "pinned"', 'A = "x", D = "x"', r"nothing holds it in y"),
    "a joint that is none": ('["A", "B"]', '["A", "E"]', r"`ends` of member A-E must be joints"),
    "no stiffness": ("EI = 1.0", "EI = 0.0", r"`structure\.members\[0\]\.EI` must be greater"),
    "a key of a member": ("EI = 1.0", "E = 1.0", r"`structure\.members\[0\]\.E` must be a key of"),
    "a support": ('A = "pinned"', "A = 3.0", r'`structure\.supports\.A` must be "fixed", "pinned"'),
    "an unknown effect": ("curvature =", "bend =", r"`structure\.actuators\.\w+\.bend` must be a"),
    "an unknown member": ("A-B = 1.0", "A-C = 1.0", r"`member` must be one of A-B, B-C, C-D"),
    "a constraint elsewhere": ("max_curvature <=", "moment(A-C,A) <=", r"in `set\.within\[0\]`"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_frame_gets_one_line_with_its_key(case):
    old, new, line = WRONG[case]
    text = EXAMPLE.read_text(encoding="utf-8")
    assert old in text
    with pytest.raises(InputError, match=line) as found:
        prepare(parse_study(text.replace(old, new, 1), "lee.toml"))
    assert "\n" not in str(found.value)
