"""A study of a frame in space."""

import pytest

import equimorph as em
from equimorph import plotting
from equimorph.errors import InputError
from equimorph.storage import read_results
from equimorph.study import run_study
from equimorph.study.prepare import prepare
from equimorph.study.problem import parse_study
from studies import draw_dots
from typecheck import unchecked

TEXT = """
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


@pytest.mark.slow
def test_a_study_runs_from_its_text_to_results(tmp_path, monkeypatch):
    """A set over one load through the fold of a cross of two arches, and what is read back."""
    (tmp_path / "cross.toml").write_text(TEXT, encoding="utf-8")
    draw_dots(monkeypatch)
    with unchecked():
        outcome = run_study(tmp_path / "cross.toml", tmp_path / "out")
        results = read_results(tmp_path / "out" / "results.h5")
    assert outcome.equilibrium_set.audit.clean
    assert set(outcome.equilibrium_set.points.index.tolist()) >= {0, 1}
    stored = results.equilibrium_set.structure
    assert stored.identity() == outcome.problem.structure.identity()


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


WRONG = {
    "a joint that is none": ('["A", "B", "C"]', '["A", "Q"]', r"must be joints \(A, B, C"),
    "a key of a member": ("EA = 2000.0, s", "E = 1.0, s", r"`structure\.members\[0\]\.E` must be"),
    "a support": ('D = "pinned"', "D = 3.0", r'`structure\.supports\.D` must be "fixed"'),
    "a plane move": ("[0.1, 0, 0]", "[0.1, 0]", r"`structure\.actuators\.a\.move\.A`"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_frame_gets_one_line_with_its_key(case):
    old, new, line = WRONG[case]
    assert old in TEXT
    with pytest.raises(InputError, match=line) as found:
        prepare(parse_study(TEXT.replace(old, new, 1), "cross.toml"))
    assert "\n" not in str(found.value)
