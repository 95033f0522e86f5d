"""Maps in study files: what may be asked for, what is stored, and that it is taken up again."""

import csv
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from equimorph.errors import InputError
from equimorph.storage import read_results
from equimorph.study import run_study
from equimorph.study.prepare import prepare
from equimorph.study.problem import parse_study
from studies import SPRING
from typecheck import unchecked

STRUCTURE = SPRING[: SPRING.index("[set]")]
SET = SPRING[: SPRING.index("[[route]]")]
"""Without the route, whose film takes longer than all the rest."""
LIMIT = """
[[map]]
name = "limits"
kind = "limit_load_map"
box = { x_l = [0.5, 1.3], k = [0.5, 2.0] }
intervals = [4, 3]
load = "F"
bound = 5.0
"""
ANGLES = """
[[map]]
name = "angles"
kind = "curvature_map"
box = { x_l = [1.1, 1.3], k = [1.0, 2.0] }
intervals = [2, 2]
load = "F"
at = 0.1
descriptor = "angle"
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A study of the spring with both maps: its outcome, its file and its folder."""
    base = tmp_path_factory.mktemp("maps")
    (base / "spring.toml").write_text(SET + LIMIT + ANGLES)
    with unchecked():  # the layers below check themselves
        outcome = run_study(base / "spring.toml", base / "out")
    return outcome, base / "spring.toml", base / "out"


def test_a_study_has_the_maps_that_it_asks_for(run):
    """PHYSICS §2: F = k (1 − x_l^⅔)^{3/2} where x_l < 1."""
    limits, angles = run[0].of("map").values()
    x_l, k = np.meshgrid(*limits.grid.axes(), indexing="ij")
    folds = k * np.maximum(1.0 - x_l ** (2 / 3), 0.0) ** 1.5
    np.testing.assert_allclose(limits.value[x_l < 1], folds[x_l < 1], rtol=1e-9)
    assert angles.where("stable").all()


def test_the_folder_holds_figures_and_tables_of_maps(run):
    names = {file.name for file in run[2].iterdir()}
    for name in ("limits", "angles"):
        ends = (".png", ".svg", ".csv", "-curves.csv")
        assert {f"{name}-map{end}" for end in ends} <= names
    page = (run[2] / "index.html").read_text(encoding="utf-8")
    assert "Map limits" in page
    assert 'href="limits-map-curves.csv"' in page


def test_the_table_of_a_map_gives_every_number_back(run):
    limits = run[0].of("map")["limits"]
    with (run[2] / "limits-map.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    shown = f"value ({limits.unit})"
    assert len(rows) == limits.value.size
    values = np.array([float(row[shown] or "nan") for row in rows])
    np.testing.assert_array_equal(values, limits.value.ravel())
    assert [row["status"] for row in rows] == [limits.kinds[k] for k in limits.status.ravel()]


def test_the_results_file_gives_maps_back(run):
    """Bit for bit, except natural states, which are computed again."""
    stored = read_results(run[2] / "results.h5").maps
    assert list(stored) == ["angles", "limits"]
    for name, amap in run[0].of("map").items():
        back = stored[name]
        np.testing.assert_array_equal(back.value, amap.value)
        np.testing.assert_array_equal(back.status, amap.status)
        np.testing.assert_array_equal(back.states.z, amap.states.z)
        assert [curve.kind for curve in back.curves] == [curve.kind for curve in amap.curves]
        for one, other in zip(back.curves, amap.curves, strict=True):
            np.testing.assert_array_equal(one.points, other.points)
            np.testing.assert_array_equal(one.errors, other.errors)
            np.testing.assert_array_equal(one.states.z, other.states.z)
    assert stored["limits"].at(x_l=0.8, k=1.0).kind == "fold"


def test_xarray_opens_a_map_with_its_grid_lines(run):
    limits = run[0].of("map")["limits"]
    with xr.open_dataset(run[2] / "results.h5", engine="h5netcdf", group="maps/limits") as data:
        assert data["value"].dims == ("x_l", "k")
        np.testing.assert_array_equal(data["k"], limits.grid.axes()[1])


def test_a_second_run_takes_maps_from_the_folder(run, monkeypatch):
    def fail(*_, **__):
        raise AssertionError("computed again")

    monkeypatch.setattr("equimorph.study.question.Question.answer", fail)
    again = run_study(run[1], run[2])
    np.testing.assert_array_equal(again.of("map")["limits"].value, run[0].of("map")["limits"].value)


def test_the_example_asks_for_maps_alone():
    path = Path(__file__).parents[2] / "examples" / "maps.toml"
    problem = prepare(parse_study(path.read_text(encoding="utf-8"), path.name))
    assert [task.section.kind for task in problem.questions] == ["limit_load_map", "curvature_map"]
    assert problem.ground.extent is None


@pytest.fixture(scope="module")
def maps_alone(tmp_path_factory):
    """A study of one map, without a set: its outcome and its folder."""
    base = tmp_path_factory.mktemp("alone")
    (base / "limits.toml").write_text(STRUCTURE + LIMIT)
    with unchecked():
        return run_study(base / "limits.toml", base / "out"), base / "out"


def test_maps_need_no_set(maps_alone, run):
    """The same map as in a study with a set."""
    outcome, out = maps_alone
    assert outcome.equilibrium_set is None
    names = {file.name for file in out.iterdir()}
    ends = (".png", ".svg", ".csv", "-curves.csv")
    ours = {"study.toml", "results.h5", "index.html", "equimorph.json", ".equimorph"}
    assert names == ours | {f"limits-map{end}" for end in ends}
    np.testing.assert_array_equal(
        outcome.of("map")["limits"].value, run[0].of("map")["limits"].value
    )


def test_a_results_file_without_a_set_gives_its_maps_back(maps_alone):
    outcome, out = maps_alone
    stored = read_results(out / "results.h5")
    assert stored.equilibrium_set is None
    np.testing.assert_array_equal(stored.maps["limits"].value, outcome.of("map")["limits"].value)


def test_the_page_without_a_set_says_what_was_asked(maps_alone):
    page = (maps_alone[1] / "index.html").read_text(encoding="utf-8")
    assert "x_l ∈ [0.5, 1.3] · k ∈ [0.5, 2]" in page
    assert "Audit" not in page


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"must ask for something: a \[set\], or one of the tables that need none"),
        (LIMIT + "[[equilibria]]\nat = { x_l = 1.0 }\n", r"must have a \[set\] to which its"),
    ],
)
def test_what_needs_a_set_is_not_asked_for_without_one(text, message):
    with pytest.raises(InputError, match=message):
        parse_study(STRUCTURE + text, "spring.toml")


@pytest.mark.parametrize(
    ("text", "old", "new", "message"),
    [
        (LIMIT, '"limit_load_map"', '"map"', "`map[0].kind` must be 'limit_load_map' or"),
        (LIMIT, "bound = 5.0", "at = 0.1", "must give the load `at` in a curvature_map, and only"),
        (ANGLES, "at = 0.1", "", "must give the load `at` in a curvature_map, and only there"),
        (ANGLES, "at = 0.1", "at = -0.1", "in `map[0]`: `at` must lie between F = 0 and `bound`"),
        (LIMIT, 'load = "F"', 'load = "k"', "`load` must be neither in `grid` nor in `fixed`"),
        (LIMIT, 'load = "F"', 'load = "G"', "in `map[0]`: `G` must be a parameter"),
        (LIMIT, "[4, 3]", "[4]", "`map[0].intervals` must have at least 2 entries"),
        (LIMIT + LIMIT, "", "", "must give every map a different name"),
        (ANGLES, '"angle"', '"depth"', "in `map[0]`: "),
    ],
)
def test_wrong_maps_are_named(text, old, new, message):
    with pytest.raises(InputError) as error:
        prepare(parse_study(SPRING + text.replace(old, new, 1), "spring.toml"))
    assert message in str(error.value)


def test_maps_have_groups_of_their_own(run):
    with h5py.File(run[2] / "results.h5") as file:
        assert set(file["maps"]) == {"limits", "angles"}
        assert file["maps/angles/value"].attrs["long_name"] == "angle"
        assert file["maps/angles/value"].attrs["units"] == "rad"
