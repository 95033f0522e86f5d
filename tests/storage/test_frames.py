"""Results as tidy tables: pandas frames and files of comma-separated values, with units."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import equimorph as em
from equimorph.manifold import EquilibriumSet
from equimorph.tables import Table
from equimorph.tasks.route import Route, refusal


def test_a_set_is_a_frame_of_its_vertices(spring_set: EquilibriumSet):
    frame = spring_set.frame()
    assert list(frame) == ["x_l", "F", "k", "kind", "index", "energy", "angle"]
    assert frame.attrs["units"]["angle"] == "rad"
    np.testing.assert_array_equal(frame["F"], spring_set.points["F"])
    on_folds = frame[frame.kind == "fold"]
    assert len(on_folds) == (spring_set.kinds == em.manifold.VertexKind.FOLD).sum()
    np.testing.assert_allclose(np.cos(on_folds.angle) ** 3, on_folds.x_l, rtol=1e-9)


def test_states_and_paths_are_frames():
    """The fold of the spring at x_l = cos³δ."""
    rest = em.Spring().natural_state(x_l=0.8)
    path = em.lift(rest, {"F": 1.0})
    frame = path.frame()
    assert list(frame) == ["x_l", "F", "k", "at", "length", "index", "energy", "angle"]
    assert frame.attrs["units"]["energy"] == em.Spring().descriptor("energy").unit
    assert np.cos(frame["angle"].iloc[-1]) ** 3 == pytest.approx(0.8, rel=1e-9)
    found = em.find_equilibria(rest.structure, {"x_l": 0.8, "F": 0.0}).frame()
    assert list(found) == ["x_l", "F", "k", "index", "energy", "angle"]
    assert sorted(found["index"]) == [0, 0, 1]


def test_a_route_is_a_frame_of_its_steps(spring_route: Route):
    frame, schedule = spring_route.frame(), spring_route.schedule
    np.testing.assert_array_equal(frame["x_l"], schedule.values[:, 0])
    np.testing.assert_array_equal(frame["stability_margin"], schedule.margins)
    timed = schedule.in_time(duration=10.0).frame()
    assert timed["time"].iloc[-1] == 10.0
    assert timed.attrs["units"]["x_l"] == "natural length"


def test_a_refused_route_has_no_frame():
    with pytest.raises(em.InputError, match="`route` must have arrived; it was refused: too far"):
        refusal("too far").frame()


def test_pandas_reads_schedules_as_they_were(spring_route: Route, tmp_path: Path):
    """Identity: tables give every number back; the heads are names and units."""
    schedule = spring_route.schedule
    table, _ = em.storage.write_schedule(schedule, tmp_path / "a.csv")
    read = pd.read_csv(table)
    assert list(read)[:3] == ["progress", "x_l (natural length)", "F (k)"]
    np.testing.assert_array_equal(read.to_numpy(), schedule.frame().to_numpy())


def test_pandas_reads_maps_as_they_were(tmp_path: Path):
    spring = em.Spring()
    grid = em.Grid(x_l=(0.7, 1.2, 2), k=(0.5, 1.0, 1))
    limits = em.limit_load_map(spring, grid, "F", within=[spring.angle <= 0.3])
    values, curves = em.storage.write_map(limits, tmp_path / "map.csv")
    read = pd.read_csv(values)
    assert list(read)[2:] == ["value (k)", "status"]
    frame = limits.frame()
    assert list(frame) == ["x_l", "k", "value", "status"]
    np.testing.assert_array_equal(read.iloc[:, :3], frame.iloc[:, :3])
    assert list(read["status"]) == list(frame["status"])
    assert list(pd.read_csv(curves))[:3] == ["curve", "kind", "x_l (natural length)"]


def test_empty_cells_are_missing_numbers(tmp_path: Path):
    rows = Table({"a": [1.0, np.nan, None], "b": ["x", "y", 2]}, {"a": "N m"}).rows()
    assert rows == [["a (N m)", "b"], ["1.0", "x"], ["", "y"], ["", "2"]]


def test_without_pandas_the_message_says_what_to_install(spring_set, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(em.InputError, match=r'pandas; got none. Run: pip install "equimorph\[t'):
        spring_set.frame()


@pytest.mark.slow
def test_pyvista_opens_a_set_by_its_name(spring_set: EquilibriumSet, tmp_path: Path):
    """As ParaView does: by the ending of the name; vertices, cells and all numbers are there."""
    pyvista = pytest.importorskip("pyvista")
    height = spring_set.structure.descriptor("angle")
    path = em.storage.save_set(tmp_path / "set.vtkhdf", spring_set, height)
    grid = pyvista.read(path)
    assert (grid.n_points, grid.n_cells) == (len(spring_set.points), len(spring_set.cells))
    np.testing.assert_array_equal(grid.points[:, 2], height(spring_set.points))
    np.testing.assert_array_equal(grid.point_data["index"], spring_set.index)
    np.testing.assert_array_equal(grid.cell_data["stratum"], spring_set.stratum)
