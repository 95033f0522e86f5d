"""Geometry from other programs: an arch in all formats, merged ends, units, what is refused."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import load_package
from equimorph.io import read_lines

ARCH = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 0.5], [1.0, 0.0, 0.0]])
SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0]])

HEAD = """ply
format {order} 1.0
comment of another program
element vertex 3
property float x
property float y
property float z
element edge 2
property int vertex1
property int vertex2
end_header
"""


def write_ply(path: Path) -> None:
    rows = ["-1 0 0", "0 0 0.5", "1 0 0", "0 1", "1 2"]
    path.write_text(HEAD.format(order="ascii") + "\n".join(rows))


def write_binary_ply(path: Path) -> None:
    numbers = ARCH.astype(">f4").tobytes() + np.array([0, 1, 1, 2], ">i4").tobytes()
    path.write_bytes(HEAD.format(order="binary_big_endian").encode() + numbers)


def write_dxf(path: Path) -> None:
    ezdxf = pytest.importorskip("ezdxf")
    document = ezdxf.new(units=6)
    document.modelspace().add_line(ARCH[1], ARCH[0])
    document.modelspace().add_polyline3d(ARCH[1:])
    document.saveas(path)


def write_graph(path: Path) -> None:
    """Written as COMPAS 2.15 writes it; the default of y is left out."""
    places = [dict(zip("xz", place, strict=True)) for place in ARCH[:, [0, 2]].tolist()]
    data = {
        "default_node_attributes": {"x": 0.0, "y": 0.0, "z": 0.0},
        "node": {str(k): place for k, place in enumerate(places)},
        "edge": {"0": {"1": {}}, "1": {"2": {}}, "2": {}},
    }
    path.write_text(json.dumps({"dtype": "compas.datastructures/Graph", "data": data}))


def write_curves(path: Path) -> None:
    line = {"start": ARCH[0].tolist(), "end": ARCH[1].tolist()}
    polyline = {"points": ARCH[1:].tolist()}
    objects = [
        {"dtype": f"compas.geometry/{kind}", "data": data, "guid": "…"}
        for kind, data in (("Line", line), ("Polyline", polyline))
    ]
    path.write_text(json.dumps({"name": "arch", "lines": objects}))


def write_vtk(path: Path) -> None:
    pyvista = pytest.importorskip("pyvista")
    mesh = pyvista.PolyData(ARCH)
    mesh.verts = np.zeros(0, int)
    mesh.lines = np.array([3, 0, 1, 2])
    (mesh.cast_to_unstructured_grid() if path.suffix == ".vtu" else mesh).save(path)


WRITERS: dict[str, Callable[[Path], None]] = {
    "a.ply": write_ply,
    "b.ply": write_binary_ply,
    "a.dxf": write_dxf,
    "graph.json": write_graph,
    "curves.json": write_curves,
}


def check_arch(path: Path) -> None:
    lines = read_lines(path, plane="xz", unit="m")
    assert len(lines.edges) == 2
    truss = em.Truss(
        lines.joints,
        lines.edges,
        dict.fromkeys(lines.lowest("z"), "xy"),
        {"F": {lines.nearest((0.1, 0.4)): (0, -1)}},
        units={"force": "N", "length": "m"},
    )
    np.testing.assert_allclose(sorted(truss.network.lengths), [1.25**0.5, 1.25**0.5], rtol=1e-7)
    frame = em.Frame(lines.joints, lines.edges, {"J1": "fixed"}, {"F": {"J3": (0, -1)}},
                     units={"force": "N", "length": "m"})  # fmt: skip
    assert frame.natural_state().index == 0
    whole = read_lines(path, unit="m")
    em.SpatialFrame(whole.joints, whole.edges, {"J1": "fixed"}, {"F": {"J3": (0, 1, 0)}},
                    units={"force": "N", "length": "m"})  # fmt: skip


@pytest.mark.parametrize("name", WRITERS)
def test_an_arch_is_read_into_trusses_and_frames(name: str, tmp_path: Path):
    WRITERS[name](tmp_path / name)
    check_arch(tmp_path / name)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a.vtk", "a.vtp", "a.vtu"])
def test_an_arch_is_read_from_vtk(name: str, tmp_path: Path):
    write_vtk(tmp_path / name)
    check_arch(tmp_path / name)


@pytest.mark.slow
def test_edges_of_a_mesh_are_read_from_vtk(tmp_path: Path):
    pyvista = pytest.importorskip("pyvista")
    pyvista.PolyData(SQUARE, faces=[4, 0, 1, 2, 3]).save(tmp_path / "a.vtp")
    assert len(read_lines(tmp_path / "a.vtp").edges) == 4


def test_edges_of_meshes_are_read_where_there_are_no_lines(tmp_path: Path):
    data = {
        "vertex": {str(k): dict(zip("xyz", p, strict=True)) for k, p in enumerate(SQUARE.tolist())},
        "face": {"0": [0, 1, 2], "1": [0, 2, 3]},
    }
    mesh = {"dtype": "compas.datastructures/Mesh", "data": data}
    (tmp_path / "mesh.json").write_text(json.dumps([mesh]))
    assert len(read_lines(tmp_path / "mesh.json").edges) == 5
    rows = ["0 0 0", "1 0 0", "1 1 0.5", "0 1 0", "3 0 1 2", "3 0 2 3"]
    head = HEAD.format(order="ascii").replace("vertex 3", "vertex 4").replace("edge 2", "face 2")
    head = head.replace("property int vertex1\nproperty int vertex2",
                        "property list uchar int vertex_indices")  # fmt: skip
    (tmp_path / "mesh.ply").write_text(head + "\n".join(rows))
    assert len(read_lines(tmp_path / "mesh.ply").edges) == 5


def test_a_surface_of_ours_comes_back(tmp_path: Path):
    spring = em.Spring()
    box = em.Box(F=(-0.4, 0.4))
    eset = em.equilibrium_set(spring, box, fixed={"x_l": 0.7}, intervals=(8,), checks=0)
    path = em.storage.write_surface(tmp_path / "set.ply", eset)
    assert len(read_lines(path).edges) == len(eset.cells)


@pytest.mark.parametrize("seed", range(5))
def test_ends_within_the_tolerance_are_one_joint(seed: int, tmp_path: Path):
    """A grid of squares, its lines shuffled, turned, doubled, and their ends moved a little."""
    random, n = np.random.default_rng(seed), 4
    x, y = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    places = np.stack([x.ravel(), y.ravel(), np.zeros(n * n)], axis=1).astype(float)
    near = [(i, j) for i in range(n * n) for j in range(i) if
            np.isclose(np.linalg.norm(places[i] - places[j]), 1.0)]  # fmt: skip
    pairs = random.permutation([*near, *near[:5]])
    ends = places[random.permuted(pairs, axis=1)] + random.uniform(-1e-4, 1e-4, (len(pairs), 2, 3))
    lines = [
        {"dtype": "compas.geometry/Line", "data": {"start": a.tolist(), "end": b.tolist()}}
        for a, b in ends
    ]
    path = tmp_path / "grid.json"
    path.write_text(json.dumps(lines))
    read = read_lines(path, tolerance=1e-3)
    assert (len(read.places), len(read.edges)) == (16, 24)
    np.testing.assert_allclose(np.sort(read.places[:, 0]), np.sort(places[:, 0]), atol=1e-4)
    assert len(read_lines(path, tolerance=1e-9).places) == 2 * len(pairs)


def test_a_drawing_states_its_unit_unless_it_is_given(tmp_path: Path):
    write_dxf(tmp_path / "a.dxf")
    assert read_lines(tmp_path / "a.dxf").unit == "m"
    assert read_lines(tmp_path / "a.dxf", unit="cm").joints["J1"] == ("0.0 cm", "0.0 cm", "0.5 cm")
    write_ply(tmp_path / "a.ply")
    assert read_lines(tmp_path / "a.ply").joints["J1"] == (-1.0, 0.0, 0.0)


def dxf_with(path: Path, draw: Callable[..., object]) -> None:
    document = pytest.importorskip("ezdxf").new()
    draw(document.modelspace())
    document.saveas(path)


@pytest.mark.parametrize(
    ("name", "write", "options", "words"),
    [
        ("a.stl", Path.touch, {}, "`path` must end in .dxf, .json, .ply"),
        ("a.json", lambda path: None, {}, "`path` must be a file; got none"),
        ("a.json", lambda path: path.write_text("{"), {}, "must be JSON of COMPAS; got: Expecting"),
        ("a.json", lambda path: path.write_text("[1]"), {}, "must have lines; got a file without"),
        ("a.json", lambda path: path.write_text('{"dtype": "compas.geometry/Line", "data": {}}'),
         {}, "got an object without 'start'"),
        ("a.ply", lambda path: path.write_text("solid"), {}, "must be a whole PLY file; got: no"),
        ("a.ply", lambda path: path.write_text(HEAD.format(order="ascii") + "1 2 3"), {},
         "it ends early"),
        ("a.ply", write_ply, {"plane": "xy"}, "joints that differ by 0.5 along z"),
        ("a.ply", write_ply, {"tolerance": 1.2}, "a line at (-1, 0, 0) whose ends it makes one"),
        ("a.ply", write_ply, {"tolerance": -1.0}, "`tolerance` must be"),
        ("a.ply", write_ply, {"unit": "kg"}, "`unit` must be one of m, mm"),
        ("a.dxf", lambda path: path.write_text("0"), {}, "must be a DXF file"),
        ("a.dxf", lambda path: dxf_with(path, lambda m: m.add_circle((0, 0), 1.0)), {},
         "it has 1 CIRCLE"),
        ("a.dxf", lambda path: dxf_with(
            path, lambda m: m.add_lwpolyline([(0, 0, 0.5), (1, 0, 0)], format="xyb")), {},
         "got ARC in a LWPOLYLINE on layer 0"),
    ],
)  # fmt: skip
def test_what_is_no_drawing_of_lines_is_named(name, write, options, words, tmp_path):
    write(tmp_path / name)
    with pytest.raises(em.InputError) as error:
        read_lines(tmp_path / name, **options)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_package_is_named_with_its_extra():
    with pytest.raises(em.InputError, match=r'got none. Run: pip install "equimorph\[geometry\]"'):
        load_package("no_such_package", "geometry", "read_lines")


def test_joints_are_found_by_place():
    lines = em.io.Lines(ARCH, np.array([[0, 1], [1, 2]]), "", "xyz")
    assert lines.lowest("z") == ["J1", "J3"]
    assert lines.lowest("z", within=0.5) == ["J1", "J2", "J3"]
    assert lines.nearest((0.9, 0.0, 0.1)) == "J3"
    with pytest.raises(em.InputError, match="must have 3 coordinates; got 2"):
        lines.nearest((0.9, 0.0))
    with pytest.raises(em.InputError, match="`axis` must be x or y or z"):
        lines.lowest("w")
