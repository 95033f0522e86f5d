"""One file for xarray and ParaView; damage is found."""

from dataclasses import asdict
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray

from equimorph.equilibria import limit_load
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.storage import Results, read_results, write_results
from equimorph.tasks.route import Route


@pytest.fixture
def written(spring_set: EquilibriumSet, spring_route: Route, tmp_path: Path) -> Path:
    angle = spring_set.structure.descriptor("angle")
    return write_results(tmp_path / "results.h5", spring_set, angle, {"over": spring_route})


@pytest.fixture
def back(written: Path) -> Results:
    return read_results(written)


def test_a_set_comes_back_bit_for_bit(spring_set: EquilibriumSet, back: Results):
    """Identity. Tolerance: none, nothing is rounded."""
    for name in ("kinds", "index", "cells", "cell_index", "component", "stratum", "grid_vertex"):
        np.testing.assert_array_equal(
            getattr(back.equilibrium_set, name), getattr(spring_set, name), err_msg=name
        )
    for name in ("vertices", "edges", "triangles", "sides"):
        np.testing.assert_array_equal(
            getattr(back.equilibrium_set.mesh, name), getattr(spring_set.mesh, name), err_msg=name
        )
    np.testing.assert_array_equal(back.equilibrium_set.points.z, spring_set.points.z)
    np.testing.assert_array_equal(back.equilibrium_set.points.p, spring_set.points.p)


def test_what_describes_a_set_comes_back(spring_set: EquilibriumSet, back: Results):
    eset = back.equilibrium_set
    assert repr(eset.box) == repr(spring_set.box)
    assert [str(c) for c in eset.constraints] == [str(c) for c in spring_set.constraints]
    assert (eset.fixed, eset.intervals) == (spring_set.fixed, spring_set.intervals)
    assert (eset.components, eset.strata) == (spring_set.components, spring_set.strata)
    assert asdict(eset.audit) == asdict(spring_set.audit)
    assert len(eset.folds) == len(spring_set.folds)
    for one, other in zip(eset.folds, spring_set.folds, strict=True):
        np.testing.assert_array_equal(one, other)
    for one, other in zip(eset.boundaries, spring_set.boundaries, strict=True):
        np.testing.assert_array_equal(one.vertices, other.vertices)
        assert one.kind == other.kind


def test_a_read_set_answers_like_the_one_that_was_written(
    spring_set: EquilibriumSet, back: Results
):
    """Tolerance: both polish to round-off."""
    there, here = spring_set.at(x_l=0.8, F=0.01), back.equilibrium_set.at(x_l=0.8, F=0.01)
    np.testing.assert_allclose(np.sort(here.z[:, 0]), np.sort(there.z[:, 0]), atol=1e-12)


def test_a_route_comes_back(spring_route: Route, back: Results):
    route = back.routes["over"]
    assert (route.status, route.margin, route.way_points) == (
        spring_route.status,
        spring_route.margin,
        spring_route.way_points,
    )
    np.testing.assert_array_equal(route.path.states.z, spring_route.path.states.z)
    np.testing.assert_array_equal(route.schedule.values, spring_route.schedule.values)
    assert [e.kind for e in route.path.events] == [e.kind for e in spring_route.path.events]
    assert route.schedule.start == spring_route.schedule.start
    assert list(route.schedule.descriptors) == list(spring_route.schedule.descriptors)


def test_a_refused_route_comes_back_with_its_reason(spring_set: EquilibriumSet, tmp_path: Path):
    route = Route("refused", "no way around the fold", [{"x_l": 1.2}])
    angle = spring_set.structure.descriptor("angle")
    path = write_results(tmp_path / "results.h5", spring_set, angle, {"over": route})
    back = read_results(path).routes["over"]
    assert (back.status, back.why, back.way_points) == (route.status, route.why, route.way_points)
    assert back.path is None
    assert back.schedule is None
    assert np.isnan(back.margin)


def test_xarray_opens_every_group_with_named_dimensions(spring_set: EquilibriumSet, written: Path):
    with xarray.open_datatree(written, engine="h5netcdf") as tree:
        assert dict(tree["set"].sizes)["vertex"] == len(spring_set.points)
        assert tree["set"]["z"].dims == ("vertex", "unknown")
        assert list(tree["set"]["parameter"].values) == ["x_l", "F", "k"]
        assert tree["routes/over/schedule"]["values"].dims == ("step", "parameter")
        structure = spring_set.structure
        energy = tree["set"]["energy"]
        assert energy.attrs["units"] == structure.descriptor("energy").unit
        forces = tree["set"]["p"].sel(parameter="F")
        assert str(forces["parameter_unit"].values) == structure.parameters[1].unit
        np.testing.assert_array_equal(forces, spring_set.points["F"])


def test_xarray_sees_the_numbers_of_any_answer(spring_set: EquilibriumSet, tmp_path: Path):
    """Plain fields are attributes; arrays have the dimensions that their annotations name."""
    angle = spring_set.structure.descriptor("angle")
    here = spring_set.at(x_l=0.8, F=0.0).stable
    limit = limit_load(here[int(angle(here).argmax())], "F")
    answers = {"limit": {"one": limit}}
    path = write_results(tmp_path / "r.h5", spring_set, angle, answers=answers)
    with xarray.open_datatree(path) as tree:
        found = tree["answers/limit/one"]
        assert found.attrs["value"] == limit.value
        assert found.attrs["kind"] == "fold"
        assert found["path"]["length"].dims == ("point",)
    assert read_results(path).answers["limit"]["one"].value == limit.value


def test_the_grid_follows_the_vtkhdf_specification(spring_set: EquilibriumSet, written: Path):
    """VTKHDF 1.0, unstructured grid: fixed-length type, counts, offsets one longer than cells."""
    with h5py.File(written) as file:
        grid = file["VTKHDF"]
        assert grid.attrs["Type"] == b"UnstructuredGrid"
        assert h5py.check_string_dtype(grid.attrs.get_id("Type").dtype).length == 16
        assert list(grid.attrs["Version"]) == [1, 0]
        cells = len(spring_set.cells)
        assert grid["NumberOfCells"][...] == [cells]
        assert grid["NumberOfConnectivityIds"][...] == [3 * cells]
        np.testing.assert_array_equal(grid["Offsets"], np.arange(cells + 1) * 3)
        assert grid["Types"].dtype == np.uint8
        assert set(grid["Types"][...]) == {5}
        angle = spring_set.structure.descriptor("angle")(spring_set.points)
        np.testing.assert_array_equal(
            grid["Points"], np.column_stack([spring_set.coordinates, angle])
        )
        assert {"index", "angle", "energy"} <= set(grid["PointData"])
        assert {"cell_index", "component", "stratum"} <= set(grid["CellData"])


def test_the_grid_is_made_of_hard_links(written: Path):
    with h5py.File(written) as file:
        assert file["VTKHDF/Points"] == file["set/embedding"]
        assert file["VTKHDF/Connectivity"] == file["set/connectivity"]
        assert file["VTKHDF/PointData/index"] == file["set/index"]


def test_a_truncated_file_is_refused(written: Path):
    written.write_bytes(written.read_bytes()[:-2000])
    with pytest.raises(InputError, match="damaged or truncated"):
        read_results(written)


def test_a_file_to_which_something_was_appended_is_refused(written: Path):
    """HDF5 itself does not look beyond what it wrote."""
    written.write_bytes(written.read_bytes() + b"0123")
    with pytest.raises(InputError, match="damaged or truncated"):
        read_results(written)


def test_damaged_numbers_are_found_by_their_checksum(written: Path):
    with h5py.File(written) as file:
        chunk = file["set/z"].id.get_chunk_info(0)
    content = bytearray(written.read_bytes())
    content[chunk.byte_offset + chunk.size // 2] ^= 0xFF
    written.write_bytes(content)
    with pytest.raises(InputError, match="damaged"):
        read_results(written)


def test_a_missing_array_is_damage(written: Path):
    with h5py.File(written, "r+") as file:
        del file["set/cell_index"]
    with pytest.raises(InputError, match="damaged"):
        read_results(written)


def test_a_newer_file_is_refused(written: Path):
    with h5py.File(written, "r+") as file:
        file.attrs["version"] = 99
    with pytest.raises(InputError, match="got 99"):
        read_results(written)


def test_another_hdf5_file_is_refused(tmp_path: Path):
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["a"] = 1
    with pytest.raises(InputError, match="another HDF5 file"):
        read_results(tmp_path / "other.h5")


def test_a_text_file_is_refused(tmp_path: Path):
    (tmp_path / "notes.h5").write_text("not HDF5")
    with pytest.raises(InputError, match="HDF5"):
        read_results(tmp_path / "notes.h5")


def test_a_missing_file_is_named(tmp_path: Path):
    with pytest.raises(InputError, match=r"none\.h5"):
        read_results(tmp_path / "none.h5")


def test_a_failed_write_leaves_the_old_file(
    written: Path, spring_set: EquilibriumSet, monkeypatch: pytest.MonkeyPatch
):
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    before = written.read_bytes()
    monkeypatch.setattr(Path, "write_bytes", fail)
    with pytest.raises(InputError, match="No space left"):
        write_results(written, spring_set, spring_set.structure.descriptor("angle"))
    assert written.read_bytes() == before
    assert list(written.parent.iterdir()) == [written]


def test_equilibria_over_points_come_back(spring_set: EquilibriumSet, tmp_path: Path):
    points = [spring_set.at(x_l=0.8, F=0.0), spring_set.at(x_l=1.2, F=0.1)]
    angle = spring_set.structure.descriptor("angle")
    path = write_results(tmp_path / "results.h5", spring_set, angle, equilibria=points)
    back = read_results(path).equilibria
    assert [len(states) for states in back] == [3, 1]
    for one, other in zip(back, points, strict=True):
        np.testing.assert_array_equal(one.z, other.z)
        np.testing.assert_array_equal(one.p, other.p)
    with xarray.open_datatree(path, engine="h5netcdf") as tree:
        assert tree["equilibria/0"]["margin"].dims == ("state",)


def test_the_same_results_give_the_same_file(spring_set: EquilibriumSet, tmp_path: Path):
    """Identity, byte by byte: no time of day, no addresses."""
    angle = spring_set.structure.descriptor("angle")
    files = [write_results(tmp_path / name, spring_set, angle) for name in ("a.h5", "b.h5")]
    assert files[0].read_bytes() == files[1].read_bytes()


def test_a_file_needs_a_set_or_a_map(spring_set: EquilibriumSet, tmp_path: Path):
    angle = spring_set.structure.descriptor("angle")
    with pytest.raises(InputError, match="`structure` must be given where there is no set"):
        write_results(tmp_path / "results.h5", None, angle)
