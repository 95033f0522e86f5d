"""Sets as PLY and VTP files, for programs that draw, and shapes in space as VTP files.

References
----------
Turk, The PLY polygon file format, 1994; VTK XML formats, https://docs.vtk.org/en/latest/.
"""

import base64
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Int, Shaped
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor, names_of
from equimorph.storage.files import write_bytes
from equimorph.storage.sets import embedding
from equimorph.structures import States
from equimorph.structures.solids import RADIUS, solids


class SurfaceKind(IntEnum):
    """What the surfaces of a set over three parameters lie on, as files number it."""

    FOLD = 0
    BOX = 1
    CAP = 2
    """A constraint that bounds the set."""
    MIXED = 3
    """Several of these."""
    CROSSING = 4


PLY_TYPES = {"f": "double", "i": "int"}
VTK_TYPES = {"f": "Float64", "i": "Int64"}
SIMPLEX = {2: ("Lines", "edge"), 3: ("Polys", "face")}
"""What VTP and PLY call segments and triangles."""


@dataclass(frozen=True)
class _Surface:
    """Points in space, segments or triangles between them, and numbers on both."""

    points: Float[np.ndarray, "V 3"]
    cells: Int[np.ndarray, "C corners"]
    on_points: dict[str, Shaped[np.ndarray, " V"]]
    on_cells: dict[str, Int[np.ndarray, " C"]]


@check_arguments
def write_surface(path: str | Path, eset: EquilibriumSet, height: Descriptor | None = None) -> Path:
    """Write what a set looks like: its curve, its surface, or the surfaces that bound its strata.

    Points are the free parameters, then the height. Sets over one or two parameters give segments
    or triangles with their index, component and stratum; sets over three the fold surfaces and
    the boundary, with ``kind`` 0 on folds, 1 on the box, 2 on constraints, 3 on several of them and
    4 on crossings.

    Parameters
    ----------
    path
        Name of the file, ending in ``.ply`` or ``.vtp``.
    eset
        The set.
    height
        Coordinate after the free parameters, by default the descriptor that distinguishes states;
        in three parameters a number on the points.

    Raises
    ------
    InputError
        If `path` has another ending or cannot be written.
    """
    path = Path(path)
    writers = {".ply": _ply, ".vtp": _vtp}
    if path.suffix.lower() not in writers:
        raise InputError(f"`path` must end in .ply or .vtp; got {path.name!r}.")
    surface = _surface(eset, height or eset.structure.elevation)
    return write_bytes(path, writers[path.suffix.lower()](surface))


def _surface(eset: EquilibriumSet, height: Descriptor) -> _Surface:
    on_cells = {
        "index": eset.cell_index,
        "component": eset.component,
        "stratum": eset.stratum,
    }
    cells = eset.cells
    if len(eset.names) == 3:
        pieces = [(SurfaceKind.FOLD, piece) for piece in eset.folds]
        pieces += [(SurfaceKind[each.kind.upper()], each.vertices) for each in eset.boundaries]
        cells = np.concatenate([np.zeros((0, 3), int), *(piece for _, piece in pieces)])
        on_cells = {"kind": np.repeat([k for k, _ in pieces], [len(p) for _, p in pieces])}
    used, corners = np.unique(cells, return_inverse=True)
    points = eset.points[used]
    on_points = {"index": eset.index[used], "energy": points.energy, height.name: height(points)}
    return _Surface(
        embedding(eset, height)[used],
        corners.reshape(cells.shape),
        on_points,
        {name: np.asarray(values, dtype=int) for name, values in on_cells.items()},
    )


def _ply(surface: _Surface) -> bytes:
    """Binary, least significant byte first."""
    _, simplex = SIMPLEX[surface.cells.shape[1]]
    vertices = {**dict(zip("xyz", surface.points.T, strict=True)), **surface.on_points}
    corners = {f"vertex{k + 1}": column for k, column in enumerate(surface.cells.T)}
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(surface.points)}"]
    lines += [f"property {PLY_TYPES[v.dtype.kind]} {_word(name)}" for name, v in vertices.items()]
    lines.append(f"element {simplex} {len(surface.cells)}")
    fields = [_Column(name, "<i4", column) for name, column in corners.items()]
    if simplex == "face":
        lines.append("property list uchar int vertex_indices")
        fields.insert(0, _Column("count", "u1", np.full(len(surface.cells), 3)))
    else:
        lines += [f"property int {name}" for name in corners]
    lines += [f"property int {_word(name)}" for name in surface.on_cells]
    fields += [_Column(f"cell {name}", "<i4", values) for name, values in surface.on_cells.items()]
    header = "\n".join([*lines, "end_header\n"]).encode("ascii")
    columns = [
        _Column(name, f"<{v.dtype.kind}{8 if v.dtype.kind == 'f' else 4}", v)
        for name, v in vertices.items()
    ]
    return header + _rows(columns) + _rows(fields)


class _Column(NamedTuple):
    """One number of each row of a binary table, in numpy's notation of its type."""

    name: str
    kind: str
    values: Shaped[np.ndarray, " n"]


def _rows(columns: list[_Column]) -> bytes:
    layout = [(f"{k} {each.name}", each.kind) for k, each in enumerate(columns)]
    rows = np.zeros(len(columns[0].values), layout)
    for field, each in zip(rows.dtype.names or (), columns, strict=True):
        rows[field] = each.values
    return rows.tobytes()


def _word(name: str) -> str:
    """Name without what the format takes for the end of a word, or cannot hold."""
    plain = name.replace("|", "").replace(" ", "_").replace("/", "_over_")
    return plain.encode("ascii", "ignore").decode() or "value"


def _vtp(surface: _Surface) -> bytes:
    group, _ = SIMPLEX[surface.cells.shape[1]]
    ends = surface.cells.shape[1] * np.arange(1, len(surface.cells) + 1)
    corners = surface.cells.ravel()
    return vtp_file(surface.points, group, corners, ends, surface.on_points, surface.on_cells)


def vtp_file(
    points: Float[np.ndarray, "points 3"],
    group: str,
    corners: Int[np.ndarray, " corners"],
    ends: Int[np.ndarray, " cells"],
    on_points: dict[str, Shaped[np.ndarray, "..."]],
    on_cells: dict[str, Shaped[np.ndarray, "..."]],
) -> bytes:
    """XML of VTK with its numbers in base64.

    `group` is "Lines" or "Polys"; corners are those of all cells one after the other, `ends` where
    each cell ends. Numbers or vectors on points and cells have names.
    """
    number = dict.fromkeys(("Verts", "Lines", "Strips", "Polys"), 0)
    number[group] = len(ends)
    counts = " ".join(f'NumberOf{name}="{count}"' for name, count in number.items())
    parts = [
        '<?xml version="1.0"?>',
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">',
        f'<PolyData><Piece NumberOfPoints="{len(points)}" {counts}>',
        _data("Points", {"Points": points}),
        _data(group, {"connectivity": corners, "offsets": ends}),
        _data("PointData", on_points),
        _data("CellData", on_cells),
        "</Piece></PolyData></VTKFile>\n",
    ]
    return "\n".join(parts).encode("utf-8")


def _data(group: str, arrays: dict[str, Shaped[np.ndarray, "..."]]) -> str:
    lines = [f"<{group}>"]
    for name, values in arrays.items():
        content = np.ascontiguousarray(values, dtype=f"<{values.dtype.kind}8").tobytes()
        text = base64.b64encode(np.array([len(content)], "<u8").tobytes() + content).decode()
        several = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
        kind = VTK_TYPES[values.dtype.kind]
        lines.append(
            f'<DataArray type="{kind}" Name={quoteattr(name)}{several} format="binary">{text}'
            "</DataArray>"
        )
    return "\n".join([*lines, f"</{group}>"])


Columns = dict[str, Shaped[np.ndarray, "..."]]


@check_arguments
def write_shapes(path: str | Path, states: States, *, lines: bool = False) -> Path:
    """Write what states of a structure in space look like, for ParaView.

    By default the surfaces of tubes and ribbons as figures show them, with normals and `white` that
    is positive on the stripe of a tube and on the back of a ribbon; with `lines` the centre lines,
    with `tangent`, `normal`, `binormal` of rods and a `radius` for the Tube filter. Every point has
    the number of its `state` and all parameters.

    Parameters
    ----------
    path
        Name of the file, ending in ``.vtp``.
    states
        At least one, of a structure in space.
    lines
        Whether to write lines instead of surfaces.

    Raises
    ------
    InputError
        For another ending, a planar structure, no states, or if `path` cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".vtp":
        raise InputError(f"`path` must end in .vtp; got {path.name!r}.")
    if not len(states) or states[:1].shape().shape[2] != 3:
        raise InputError(
            f"`states` must be states of a structure in space, one at least; got {states!r}."
        )
    return write_bytes(path, _centre_lines(states) if lines else _surfaces(states))


def _size(states: States) -> float:
    return float(np.ptp(states.shape().reshape(-1, 3), axis=0).max()) or 1.0


def _by_state(states: States, owner: Int[np.ndarray, " points"]) -> Columns:
    """Number and parameters of the state that each point belongs to."""
    names = names_of(states.structure.parameters)
    return {"state": owner, **{name: states[name][owner] for name in names}}


def _surfaces(states: States) -> bytes:
    meshes = solids(states, _size(states))
    counts = [3 * len(mesh.corners) for mesh in meshes]
    columns = _by_state(states, np.repeat(np.arange(len(states)), counts))
    columns["normals"] = np.concatenate([mesh.normals.reshape(-1, 3) for mesh in meshes])
    columns["white"] = np.repeat(np.concatenate([mesh.white for mesh in meshes]), 3)
    points = np.concatenate([mesh.corners.reshape(-1, 3) for mesh in meshes])
    ends = 3 * np.arange(1, len(points) // 3 + 1)
    return vtp_file(points, "Polys", np.arange(len(points)), ends, columns, {})


def _centre_lines(states: States) -> bytes:
    shapes = states.shape()
    count, each = shapes.shape[:2]
    columns = _by_state(states, np.repeat(np.arange(count), each))
    frames = states.frames()
    if frames is not None:
        for k, name in enumerate(("tangent", "normal", "binormal")):
            columns[name] = frames[..., k].reshape(-1, 3)
    columns["radius"] = np.full(count * each, RADIUS * _size(states))
    ends = each * np.arange(1, count + 1)
    points = shapes.reshape(-1, 3)
    return vtp_file(points, "Lines", np.arange(len(points)), ends, columns, {})
