"""Studies of structures that the file describes itself: energies, trusses, frames, frames in space.

Each runs from its text to what is read back; each mistake gets one line with its key.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest

import equimorph as em
from equimorph import plotting
from equimorph.storage import read_results
from equimorph.study import Outcome, run_study
from studies import EXAMPLES, draw_dots, only_route, refuse
from typecheck import unchecked

CROSS = """
[structure]
kind = "spatial frame"
elements = 1
degree = 6
loads = { P = { B = [0, 0, -1] }, w = { A-B = [0, 0.1, 0] } }
members = [
    { joints = ["A", "B", "C"], EA = 2000.0, strains = [0.0, 0.0, 0.01] },
    { joints = ["D", "B", "E"], EA = 2000.0, hinges = { B = [0, 0, 1] }, normal = [0, 0, 1] },
]

[structure.joints]
A = [0, 0, 0]
B = [1, 0, 0.12]
C = [2, 0, 0]
D = [1, -1, 0]
E = [1, 1, 0]

[structure.supports]
A = "pinned"
C = { line = [0, 1, 0] }
D = "pinned"
E = { x = "held", y = "held", z = 1000.0 }

[structure.actuators.a.move]
A = [0.1, 0, 0]

[set]
box = { P = [0.0, 3.0] }
intervals = [4]
"""


def example(name: str, *coarser: tuple[str, str]) -> str:
    """An example on a coarser grid."""
    text = (EXAMPLES / f"{name}.toml").read_text(encoding="utf-8")
    for old, new in coarser:
        assert old in text
        text = text.replace(old, new)
    return text


def check_column(outcome: Outcome) -> None:
    """Its leaning states are mirror images; stable ways lead around P = (3 − √5)/2."""
    lean = outcome.problem.structure.descriptor("lean")(outcome.points[0])
    np.testing.assert_allclose(np.sort(lean), [-lean.max(), 0.0, lean.max()], atol=1e-12)
    route = only_route(outcome)
    assert route.status == "arrived"
    assert route.path.states["P"].min() < (3.0 - np.sqrt(5.0)) / 2.0


def check_truss(outcome: Outcome) -> None:
    """Stable ways over lead where both bars are shorter than half the span."""
    np.testing.assert_array_equal(np.sort(outcome.points[0].index), [0, 0, 1])
    route = only_route(outcome)
    assert route.status == "arrived"
    assert route.path.states["a"].min() < 1.0 - np.hypot(1.0, 0.3)


def check_frame(outcome: Outcome) -> None:
    """A way around the snap of Lee's frame."""
    np.testing.assert_array_equal(np.sort(outcome.points[0].index), [0, 0, 1, 1, 2])
    assert only_route(outcome).status == "arrived"


def check_cross(outcome: Outcome) -> None:
    """A set over one load through the folds of a cross of two arches."""
    eset = outcome.equilibrium_set
    assert set(eset.points.index.tolist()) == {0, 1, 2}
    assert eset.audit.largest_residual < 1e-9


@dataclass(frozen=True)
class Case:
    """A study, and what its answers must be."""

    text: str
    check: Callable[[Outcome], None]


CASES = {
    "column": Case(example("column", ("[31, 31]", "[11, 11]")), check_column),
    "truss": Case(example("truss", ("[25, 25]", "[9, 9]")), check_truss),
    "lee": Case(example("lee", ("[25, 25]", "[7, 9]"), ("degree = 6", "degree = 4")), check_frame),
    "cross": Case(CROSS, check_cross),
}
FAST = ("column", "truss", "lee")


@pytest.mark.parametrize("name", [*FAST, pytest.param("cross", marks=pytest.mark.slow)])
def test_a_study_runs_from_its_text_to_results(name, tmp_path, monkeypatch):
    draw_dots(monkeypatch)
    run_and_check(name, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", FAST)
def test_the_example_runs_from_file_to_page(name, tmp_path, monkeypatch):
    """With all its figures."""
    monkeypatch.setattr(plotting, "film", partial(plotting.film, frames=6))
    run_and_check(name, tmp_path)


def run_and_check(name, folder):
    (folder / "study.toml").write_text(CASES[name].text, encoding="utf-8")
    with unchecked():
        outcome = run_study(folder / "study.toml", folder / "out")
        results = read_results(folder / "out" / "results.h5")
    assert outcome.equilibrium_set.audit.clean
    CASES[name].check(outcome)
    stored = results.equilibrium_set.structure
    assert stored.identity() == outcome.problem.structure.identity()
    assert (folder / "out" / "index.html").is_file()


def test_shapes_and_solids_are_drawn(tmp_path):
    """Figures and surfaces of a lifted path."""
    joints = {"A": (0, 0, 0), "B": (1, 0, 0), "C": (1, 1, 0)}
    frame = em.SpatialFrame(joints, [("A", "B", "C")], {"A": "fixed"}, {"P": {"C": (0, 0, -1)}})
    with unchecked():
        path = em.lift(frame.natural_state(), {"P": 1.0})
        plotting.shapes(path, count=3).figure.savefig(tmp_path / "shapes.png")
        em.storage.write_shapes(tmp_path / "shapes.vtp", path.states[[0, -1]])
    assert (tmp_path / "shapes.png").stat().st_size > 5_000
    assert (tmp_path / "shapes.vtp").stat().st_size > 10_000


WRONG_ENERGY = {
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
WRONG_TRUSS = {
    "a mechanism": (
        'C = "xy"',
        'C = "x"',
        r"in `structure`: `truss` must not be a mechanism; joint C",
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
WRONG_FRAME = {
    "a mechanism": ('A = "pinned", D = "pinned"', 'A = "pinned"', r"must not be a mechanism"),
    "drift": ('A = "pinned", D = "pinned"', 'A = "x", D = "x"', r"nothing holds it in y"),
    "a joint that is none": ('["A", "B"]', '["A", "E"]', r"`ends` of member A-E must be joints"),
    "no stiffness": ("EI = 1.0", "EI = 0.0", r"`structure\.members\[0\]\.EI` must be greater"),
    "a key of a member": ("EI = 1.0", "E = 1.0", r"`structure\.members\[0\]\.E` must be a key of"),
    "a support": ('A = "pinned"', "A = 3.0", r'`structure\.supports\.A` must be "fixed", "pinned"'),
    "an unknown effect": ("curvature =", "bend =", r"`structure\.actuators\.\w+\.bend` must be a"),
    "an unknown member": ("A-B = 1.0", "A-C = 1.0", r"`member` must be one of A-B, B-C, C-D"),
    "a constraint elsewhere": ("max_curvature <=", "moment(A-C,A) <=", r"in `set\.within\[0\]`"),
}
WRONG_CROSS = {
    "a joint that is none": ('["A", "B", "C"]', '["A", "Q"]', r"must be joints \(A, B, C"),
    "a key of a member": ("EA = 2000.0, s", "E = 1.0, s", r"`structure\.members\[0\]\.E` must be"),
    "a support": ('D = "pinned"', "D = 3.0", r'`structure\.supports\.D` must be "fixed"'),
    "a plane move": ("[0.1, 0, 0]", "[0.1, 0]", r"`structure\.actuators\.a\.move\.A`"),
}
WRONG = [
    *((example("column"), *case) for case in WRONG_ENERGY.values()),
    *((example("truss"), *case) for case in WRONG_TRUSS.values()),
    *((example("lee"), *case) for case in WRONG_FRAME.values()),
    *((CROSS, *case) for case in WRONG_CROSS.values()),
]
IDS = [*WRONG_ENERGY, *WRONG_TRUSS, *WRONG_FRAME, *WRONG_CROSS]


@pytest.mark.parametrize(("text", "old", "new", "line"), WRONG, ids=IDS)
def test_a_wrong_structure_gets_one_line_with_its_key(text, old, new, line):
    refuse(text, old, new, line)
