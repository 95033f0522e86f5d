"""Sets over one, two and three parameters in files: round trips, appending, damage, surfaces."""

import base64
from dataclasses import fields, is_dataclass
from pathlib import Path
from xml.etree import ElementTree

import h5py
import numpy as np
import pytest
import xarray

from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.model import Box, Descriptor
from equimorph.storage import append_results, load_set, read_results, save_set, write_surface
from equimorph.structures import Spring
from equimorph.tasks.route import Route
from typecheck import unchecked

BOXES = {
    1: (Box(F=(-0.4, 0.4)), {"x_l": 0.7}, (8,)),
    2: (Box(x_l=(0.5, 1.2), F=(-0.3, 0.3)), {"k": 1.5}, (6, 7)),
    3: (Box(x_l=(0.5, 1.2), F=(-0.3, 0.3), k=(0.5, 2.0)), {}, (4, 5, 2)),
}
CELL_TYPES = {1: 3, 2: 5, 3: 10}


@pytest.fixture(scope="module", params=[1, 2, 3], ids="d={}".format)
def any_set(request) -> EquilibriumSet:
    box, fixed, intervals = BOXES[request.param]
    spring = Spring()
    with unchecked():
        return equilibrium_set(
            spring, box, fixed=fixed, within=[spring.angle <= 1.2], intervals=intervals, checks=0
        )


@pytest.fixture(scope="module")
def saved(any_set: EquilibriumSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_set(tmp_path_factory.mktemp("sets") / "set.h5", any_set)


def assert_same(one: object, other: object, name: str) -> None:
    """Equal bit by bit, all the way down."""
    if isinstance(one, np.ndarray):
        np.testing.assert_array_equal(one, other, err_msg=name)
        assert one.dtype.kind == other.dtype.kind, name
    elif isinstance(one, tuple | list):
        assert len(one) == len(other), name
        for k, (a, b) in enumerate(zip(one, other, strict=True)):
            assert_same(a, b, f"{name}[{k}]")
    elif is_dataclass(one) and not isinstance(one, Descriptor):
        for field in fields(one):
            a, b = (getattr(each, field.name) for each in (one, other))
            assert_same(a, b, f"{name}.{field.name}")
    elif isinstance(one, Box):
        assert repr(one) == repr(other)
    elif isinstance(one, Spring):
        assert one.identity() == other.identity()
    else:
        assert one == other, name


def test_every_field_of_a_set_comes_back(any_set: EquilibriumSet, saved: Path):
    """Whatever fields a set has: one that is not stored fails here."""
    assert_same(any_set, load_set(saved), "set")


def test_a_loaded_set_rebuilds_every_state(any_set: EquilibriumSet, saved: Path):
    back = load_set(saved)
    np.testing.assert_array_equal(back.points.index, any_set.points.index)
    middle = dict(zip(any_set.names, 0.5 * (any_set.box.lower + any_set.box.upper), strict=True))
    there, here = any_set.at(**middle), back.at(**middle)
    np.testing.assert_array_equal(here.z, there.z)


def test_saving_twice_gives_the_same_bytes(any_set: EquilibriumSet, saved: Path, tmp_path: Path):
    again = save_set(tmp_path / "again.h5", load_set(saved))
    assert again.read_bytes() == saved.read_bytes()


def test_paraview_and_xarray_open_sets_of_any_dimension(any_set: EquilibriumSet, saved: Path):
    """VTKHDF 2.0 unstructured grid: lines, triangles or tetrahedra."""
    d = len(any_set.names)
    with h5py.File(saved) as file:
        grid = file["VTKHDF"]
        assert set(grid["Types"][...]) == {CELL_TYPES[d]}
        np.testing.assert_array_equal(np.diff(grid["Offsets"][...]), d + 1)
        assert grid["Connectivity"].shape == (any_set.cells.size,)
        assert grid["Points"].shape == (len(any_set.points), 3)
        np.testing.assert_array_equal(grid["Points"][:, :d], any_set.coordinates)
        assert grid["NumberOfCells"][0] == len(any_set.cells)
        assert grid["CellData/cell_index"] == file["set/cell_index"]
    with xarray.open_datatree(saved, engine="h5netcdf") as tree:
        assert tree["set"]["z"].dims == ("vertex", "unknown")


def test_results_are_appended_in_one_step(any_set: EquilibriumSet, saved: Path, tmp_path: Path):
    path = tmp_path / "more.h5"
    path.write_bytes(saved.read_bytes())
    append_results(path, routes={"one": Route("refused", "no way", [])})
    corner = dict(zip(any_set.names, any_set.box.lower.tolist(), strict=True))
    here = any_set.at(**corner)
    append_results(path, equilibria=[here], routes={"two": Route("refused", "none", [])})
    append_results(path, equilibria=[here])
    back = read_results(path)
    assert list(back.routes) == ["one", "two"]
    assert [states.z.tolist() for states in back.equilibria] == 2 * [here.z.tolist()]
    assert_same(any_set, back.equilibrium_set, "set")
    with pytest.raises(InputError, match="`routes` must have new names; got two"):
        append_results(path, routes={"two": Route("refused", "none", [])})
    other = Spring(stiffness=2.0).natural_state(x_l=0.8).batch
    with pytest.raises(InputError, match="same structure"):
        append_results(path, equilibria=[other])


def test_appending_to_nothing_or_to_something_else_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match=r"none\.h5"):
        append_results(tmp_path / "none.h5")
    (tmp_path / "notes.h5").write_text("notes")
    with pytest.raises(InputError, match="damaged"):
        append_results(tmp_path / "notes.h5")


def outcome(path: Path, content: bytes, eset: EquilibriumSet) -> str:
    """What reading makes of a content: refused, or right; anything else fails."""
    path.write_bytes(content)
    try:
        back = load_set(path)
    except InputError as error:
        return "refused" if "\n" not in str(error) else "more than one line"
    assert_same(eset, back, "set")
    return "right"


def test_a_file_cut_anywhere_is_refused_or_right(any_set, saved, tmp_path):
    """At the ends of all arrays, around powers of two, and at random places."""
    content = saved.read_bytes()
    places = {0, 1, 7, 8, 9, *(len(content) - k for k in (1, 2, 31, 32, 33, 47, 48, 49))}
    places |= {min(2**k + s, len(content) - 1) for k in range(3, 20) for s in (-1, 0, 1)}
    with h5py.File(saved) as file:
        file.visititems(lambda _, each: places.update(ends_of(each)))
    places |= set(np.random.default_rng(3).integers(len(content), size=50).tolist())
    with unchecked():
        for place in sorted(place for place in places if place < len(content)):
            result = outcome(tmp_path / "cut.h5", content[:place], any_set)
            # only the checksum at the end may go
            assert result == "refused" or place >= len(content) - 48, place


def ends_of(each: h5py.Dataset | h5py.Group) -> set[int]:
    """Where the chunks or the content of a dataset begin and end in the file."""
    if not isinstance(each, h5py.Dataset):
        return set()
    if each.chunks is None:
        start = each.id.get_offset()
        return set() if start is None else {start, start + each.id.get_storage_size()}
    chunks = [each.id.get_chunk_info(k) for k in range(each.id.get_num_chunks())]
    return {c.byte_offset + s for c in chunks for s in (0, c.size)}


def test_a_file_with_any_flipped_bits_is_refused_or_right(any_set, saved, tmp_path):
    """Single bits, bytes and runs of bytes, everywhere."""
    content, random = saved.read_bytes(), np.random.default_rng(4)
    with unchecked():
        for _ in range(150):
            changed = bytearray(content)
            at, run = int(random.integers(len(content))), int(random.choice([1, 1, 1, 4, 600]))
            for place in range(at, min(at + run, len(content))):
                changed[place] ^= int(random.integers(1, 256))
            result = outcome(tmp_path / "flipped.h5", bytes(changed), any_set)
            assert result == "refused" or at >= len(content) - 48


def test_states_of_another_formula_are_refused(saved, tmp_path):
    """As after a release that computes otherwise: the numbers are whole, but no equilibria."""
    path = tmp_path / "other.h5"
    path.write_bytes(saved.read_bytes())
    with h5py.File(path, "r+") as file:
        file["set/z"][...] += 0.1
    with pytest.raises(InputError, match="must hold equilibria"):
        load_set(path)


def test_arrays_that_do_not_fit_are_refused(saved, tmp_path):
    path = tmp_path / "wrong.h5"
    path.write_bytes(saved.read_bytes())
    with h5py.File(path, "r+") as file:
        file["set/connectivity"][0] = 10**6
    with pytest.raises(InputError, match="damaged"):
        load_set(path)


def expected_surface(eset: EquilibriumSet) -> tuple[int, int]:
    """Number of simplices, and of their corners."""
    if len(eset.names) < 3:
        return len(eset.cells), len(np.unique(eset.cells))
    pieces = [*eset.folds, *(each.vertices for each in eset.boundaries)]
    every = np.concatenate(pieces)
    return len(every), len(np.unique(every))


def assert_on_the_spring(eset: EquilibriumSet, points: np.ndarray) -> None:
    """F/k = (1 − x_l/cos δ) sin δ at points (F, δ), (x_l, F, δ) or (x_l, F, k)."""
    if len(eset.names) == 3:
        assert eset.box.contains(points, slack=1e-9).all()
        return
    x = points[:, 0] if len(eset.names) == 2 else np.full(len(points), 0.7)
    force, delta = points[:, -2:].T if len(eset.names) == 2 else points[:, :2].T
    k = eset.points["k"][0]
    np.testing.assert_allclose(force / k, (1 - x / np.cos(delta)) * np.sin(delta), atol=1e-10)


def test_ply_holds_the_surface(any_set: EquilibriumSet, tmp_path: Path):
    content = write_surface(tmp_path / "set.ply", any_set).read_bytes()
    header, _, rest = content.partition(b"end_header\n")
    lines = header.decode("ascii").splitlines()
    cells, points = expected_surface(any_set)
    assert f"element vertex {points}" in lines
    simplex = "edge" if len(any_set.names) == 1 else "face"
    assert f"element {simplex} {cells}" in lines
    start = lines.index(f"element {simplex} {cells}")
    kinds = [line.split()[1] for line in lines[:start] if line.startswith("property")]
    row = np.dtype(
        [(f"f{k}", {"double": "<f8", "int": "<i4"}[kind]) for k, kind in enumerate(kinds)]
    )
    table = np.frombuffer(rest, row, points)
    assert_on_the_spring(any_set, np.stack([table["f0"], table["f1"], table["f2"]], axis=1))
    numbers = len([line for line in lines[start + 1 :] if line.startswith("property int")])
    each = 4 * numbers + (13 if simplex == "face" else 0)
    assert len(rest) == points * row.itemsize + cells * each


def test_vtp_holds_the_surface(any_set: EquilibriumSet, tmp_path: Path):
    tree = ElementTree.parse(write_surface(tmp_path / "set.vtp", any_set))
    arrays = {}
    for each in tree.iter("DataArray"):
        content = base64.b64decode(each.text)
        assert int.from_bytes(content[:8], "little") == len(content) - 8
        kind = {"Float64": "<f8", "Int64": "<i8"}[each.get("type")]
        arrays[each.get("Name")] = np.frombuffer(content[8:], kind)
    cells, points = expected_surface(any_set)
    piece = next(tree.iter("Piece"))
    assert piece.get("NumberOfPoints") == str(points)
    assert piece.get("NumberOfLines" if len(any_set.names) == 1 else "NumberOfPolys") == str(cells)
    assert_on_the_spring(any_set, arrays["Points"].reshape(-1, 3))
    corners = max(2, min(3, len(any_set.names) + 1))
    np.testing.assert_array_equal(arrays["offsets"], corners * np.arange(1, cells + 1))
    assert arrays["connectivity"].max() == points - 1


def test_another_ending_is_refused(any_set: EquilibriumSet, tmp_path: Path):
    with pytest.raises(InputError, match=r"must end in \.ply or \.vtp"):
        write_surface(tmp_path / "set.stl", any_set)
