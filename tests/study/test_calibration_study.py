"""``[[calibration]]``: parameters and data of a structure fitted to points of a table."""

import csv
from pathlib import Path

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from equimorph.model import Silent
from equimorph.storage import read_results
from equimorph.study import Outcome, parse_study, prepare, run_study
from equimorph.study.data_files import _shape
from typecheck import unchecked

EXAMPLES = Path(__file__).parents[2] / "examples"
TRUTH = {"EI": 0.0226, "curl": 0.8, "offset of theta_A": 0.035}
"""From which the points of the example were made, with errors of 0.5 mm."""
STUDY = """\
[structure]
kind = "rod"
ends = ["clamped", "free"]
EI = 0.02
length = 0.5
elements = 3
loads = { P = { term = "point force", s = 1.0 } }

[[calibration]]
name = "strip"
data = "points.csv"
at = { theta_A = 0.0 }
unknown = { EI = "data", P = "offset" }
"""
TABLE = """\
P,s,x,y
0.1,0.5,0.24,-0.05
0.1,1.0,0.46,-0.16
0.2,1.0,0.40,-0.25
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> tuple[Outcome, Path]:
    out = tmp_path_factory.mktemp("calibration") / "out"
    with unchecked():
        return run_study(EXAMPLES / "calibration.toml", out), out


def prepared(folder: Path, study: str = STUDY, table: str = TABLE):
    (folder / "points.csv").write_text(table)
    return prepare(parse_study(study, "strip.toml", folder))


def test_the_example_finds_what_its_points_were_made_from(run):
    """Within four standard deviations; χ² of 75 degrees of freedom within five of its own."""
    found = run[0].of("calibration")["strip"]
    assert found.fitted
    for name, value in TRUTH.items():
        at = found.names.index(name)
        assert abs(found.values[at] - value) < 4.0 * found.deviations[at]
        assert 0.0 < found.deviations[at] < 0.05 * abs(value)
    assert found.freedom == 75
    assert abs(found.chi_squared - 75.0) < 5.0 * np.sqrt(2.0 * 75.0)


def test_the_folder_holds_covariances_points_figure_and_page(run):
    outcome, out = run
    found = outcome.of("calibration")["strip"]
    with (out / "strip-calibration.csv").open(encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    assert head[:3] == ["unknown", "value", "deviation"]
    table = np.array([[float(cell) for cell in row[1:]] for row in rows])
    np.testing.assert_array_equal(table[:, 0], found.values)
    np.testing.assert_array_equal(table[:, 2:], found.covariance)
    with (out / "strip-calibration-points.csv").open(encoding="utf-8") as file:
        assert len(file.readlines()) == 1 + 39
    assert (out / "strip-calibration.svg").exists()
    page = (out / "index.html").read_text(encoding="utf-8")
    assert "Calibration strip" in page
    assert "75 degrees of freedom" in page


def test_the_answer_is_in_the_results_though_there_is_no_set(run):
    results = read_results(run[1] / "results.h5")
    assert results.equilibrium_set is None
    stored, found = results.answers["calibration"]["strip"], run[0].of("calibration")["strip"]
    np.testing.assert_array_equal(stored.values, found.values)
    assert stored.states.structure.signature == found.states.structure.signature


@pytest.mark.usefixtures("plain_figures")
def test_the_answer_is_read_with_the_fitted_structure(run, monkeypatch):
    def fail(*_, **__):
        raise AssertionError

    monkeypatch.setattr("equimorph.study.question.Question.answer", fail)
    again = run_study(EXAMPLES / "calibration.toml", run[1]).of("calibration")["strip"]
    first = run[0].of("calibration")["strip"]
    np.testing.assert_array_equal(again.states.z, first.states.z)
    assert again.states.structure.signature == first.states.structure.signature
    np.testing.assert_allclose(again.states.residual, 0.0, atol=1e-9)


def test_other_data_are_another_study(run, tmp_path):
    study = (EXAMPLES / "calibration.toml").read_text(encoding="utf-8")
    data = (EXAMPLES / "calibration.csv").read_text(encoding="utf-8")
    (tmp_path / "calibration.toml").write_text(study, encoding="utf-8")
    (tmp_path / "calibration.csv").write_text(data.replace("0.0491", "0.0492"), encoding="utf-8")
    with pytest.raises(InputError, match="results of another study"):
        run_study(tmp_path / "calibration.toml", run[1])


def test_every_point_keeps_its_deviation():
    """Rows in any order of s; a state without a point has the deviation 1, which counts nowhere."""
    column = {
        "s": np.array([1.0, 0.5, 1.0]),
        "x": np.array([4.0, 2.0, 5.0]),
        "y": np.array([0.4, 0.2, 0.5]),
        "sigma": np.array([0.01, 0.02, 0.03]),
    }
    shape = _shape(column, [[0, 1], [2]], None, "calibration[0]")
    np.testing.assert_array_equal(shape.s, [0.5, 1.0])
    np.testing.assert_array_equal(shape.points, [[[2, 0.2], [4, 0.4]], [[np.nan] * 2, [5, 0.5]]])
    np.testing.assert_array_equal(np.asarray(shape.sigma)[:, :, 0], [[0.02, 0.01], [1.0, 0.03]])


def test_exact_points_give_the_exact_unknowns(tmp_path):
    """1e-7: round-off of the states times how strongly the unknowns depend on them."""
    rod = em.Rod(
        ends=("clamped", "free"), EI=0.023, length=0.5, elements=3,
        loads={"P": em.PointForce(1.0)},
    )  # fmt: skip
    rows = ["state,P,s,x,y"]
    for state, load in enumerate((0.1, 0.2)):
        bent = em.lift(rod.natural_state(), {"P": load + 0.01}).end.state
        for s, (x, y) in zip((0.5, 1.0), bent.shape(np.array([0.5, 1.0])), strict=True):
            rows.append(f"{state},{load},{s},{float(x)!r},{float(y)!r}")
    problem = prepared(tmp_path, table="\n".join(rows))
    asked = problem.questions[0]
    with unchecked():
        found = asked.answer(Silent())
    assert found.names == ("EI", "offset of P")
    np.testing.assert_allclose(found.values, [0.023, 0.01], rtol=1e-7)


def test_loads_that_the_natural_state_does_not_carry_are_refused(tmp_path):
    """A straight column buckles at P = π²/4 EI/L² = 0.197 N: the lift ends there."""
    study = STUDY.replace("theta_A = 0.0", "theta_A = 1.5707963267948966")
    problem = prepared(tmp_path, study, TABLE.replace("0.2,1.0", "0.3,1.0"))
    asked = problem.questions[0]
    with unchecked(), pytest.raises(InputError, match=r"natural state carries; got state 2.*0\.19"):
        asked.answer(Silent())


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"points.csv"', '"other.csv"', r"`calibration\[0\]\.data` must be a readable file"),
        ('"points.csv"', '"../points.csv"', "a CSV file in the folder of the study file"),
        ('"points.csv"', "3", "a CSV file in the folder of the study file"),
        ('P = "offset"', 'P = "shift"', "must be 'value', 'offset', 'gain' or 'data'"),
        ('P = "offset"', 'Q = "offset"', r"`calibration\[0\]\.unknown` must name parameters"),
        ('EI = "data"', 'EA = "data"', r"must be a number that the study gives.*EI.*got EA"),
        ("theta_A = 0.0", "P = 0.1, theta_A = 0", r"must give P once; got it in the table"),
        ("{ theta_A = 0.0 }", "{ angle = 0.0 }", r"`calibration\[0\]\.at` must name parameters"),
        ("theta_A = 0.0", "theta_A = 90.0", "angle in radians"),
        ('"offset" }', '"offset" }\nsigma = 0.0', "must be greater than 0"),
        ('unknown = { EI = "data", P = "offset" }', "unknown = {}", "at least 1 entries"),
    ],
)
def test_a_calibration_that_means_nothing(tmp_path, old, new, message):
    assert old in STUDY
    with pytest.raises(InputError, match=message):
        prepared(tmp_path, STUDY.replace(old, new))


def test_a_parameter_without_a_value_is_named(tmp_path):
    arch = '[structure]\nkind = "rod"\n\n' + STUDY[STUDY.index("[[calibration]]") :]
    arch = arch.replace('EI = "data", P', "q").replace("theta_A", "Delta")
    with pytest.raises(InputError, match=r"`calibration\[0\]\.at` must give .*Theta lacks"):
        prepared(tmp_path, arch, "q,s,x,y\n1,0.5,0.4,0.2\n")


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("s,x,y\n", "a line of column names, and from 1"),
        (TABLE.replace("P,s", "P,t"), "must have the columns s, x, y"),
        (TABLE.replace("P,s", "Q,s"), "must have the columns s, x, y"),
        (TABLE.replace("P,s", "s,s"), "every column a different name"),
        (TABLE.replace("0.24", "left"), "line 2: 'left'"),
        (TABLE.replace("0.24", "1e99"), "hold numbers up to"),
        (TABLE.replace("0.24,", ""), "4 entries in each line"),
        (TABLE.replace("0.1,0.5", "0.1,1.5"), "s from 0 to 1"),
        (TABLE.replace("0.1,0.5", "0.1,"), "a number in every row of s"),
        (TABLE.replace("0.1,0.5", "0.1,1.0"), "each s once in a state"),
        ("P,s,x,y\n0.1,1.0,0.4,\n", "at least as many coordinates as there are unknowns, 2; got 1"),
        ("P,s,x,y,sigma\n0.1,1.0,0.4,0.1,-1\n", "a positive sigma in every row"),
        ("state,P,s,x,y\n1,0.1,0.5,0.2,0\n1,0.2,1.0,0.4,0\n", "one value of each parameter"),
    ],
)
def test_a_table_that_means_nothing(tmp_path, table, message):
    with pytest.raises(InputError, match=message):
        prepared(tmp_path, table=table)
