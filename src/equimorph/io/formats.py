"""Readers of drawings: DXF by ezdxf, VTK by pyvista, PLY, and JSON files of COMPAS.

The common readers of PLY leave edges out; COMPAS is not needed for its files.
See docs/decisions.md, "Lines of drawings are read by pyvista and ezdxf".

References
----------
Turk, The PLY polygon file format, 1994.
"""

import json
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from equimorph.arrays import Float, Int
from equimorph.errors import InputError, load_package

Polyline = Float[np.ndarray, "points 3"]


@dataclass(frozen=True)
class Drawing:
    """Polylines of a file.

    Parameters
    ----------
    polylines
        Points of each, two or more.
    unit
        Of length, if the file states one.
    content
        What the file has where it has no lines, for messages.
    """

    polylines: list[Polyline]
    unit: str = ""
    content: str = ""


def edges_of_faces(
    points: Float[np.ndarray, "vertices 3"], faces: Iterable[Int[np.ndarray, " corners"]]
) -> list[Polyline]:
    """Edges of faces, each face as a closed polyline."""
    return [points[np.append(face, face[0])] for face in faces]


def count_words(words: Iterable[str]) -> str:
    """How often each word occurs: "3 ARC, 1 TEXT"."""
    return ", ".join(f"{count} {word}" for word, count in Counter(words).items())


INSUNITS = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 7: "km"}
"""Units by the number in the header of a file; 0 states none."""
POLYLINES = ("LWPOLYLINE", "POLYLINE")


def read_dxf(path: Path) -> Drawing:
    """Read the lines of the model space.

    Refused if the file cannot be read, a polyline has arcs, or ezdxf is not installed.
    """
    ezdxf = load_package("ezdxf", "geometry", "read_lines")
    try:
        document = ezdxf.readfile(path)
    except (OSError, ezdxf.DXFError, UnicodeError) as error:
        raise InputError(f"`{path.name}` must be a DXF file; got: {error}.") from error
    found: list[Polyline] = []
    others = []
    for entity in document.modelspace():
        kind = entity.dxftype()
        if kind == "LINE":
            found.append(np.array([entity.dxf.start.xyz, entity.dxf.end.xyz]))
        elif kind in POLYLINES:
            found += _pieces(entity, path)
        else:
            others.append(kind)
    return Drawing(found, INSUNITS.get(document.units, ""), count_words(others))


def _pieces(entity: Any, path: Path) -> list[Polyline]:
    pieces = []
    for piece in entity.virtual_entities():
        if piece.dxftype() != "LINE":
            raise InputError(
                f"`{path.name}` must have straight lines; got {piece.dxftype()} in a "
                f"{entity.dxftype()} on layer {entity.dxf.layer}. Divide it into lines."
            )
        pieces.append(np.array([piece.dxf.start.xyz, piece.dxf.end.xyz]))
    return pieces


LINE, POLYLINE = 3, 4
"""Numbers of VTK for cells that are lines."""
POLYGONS = (5, 7, 9)
"""Numbers of triangles, polygons and quadrilaterals."""


def read_vtk(path: Path) -> Drawing:
    """Read lines and polylines; of meshes without lines the edges of their polygons.

    Refused if the file holds no polygonal data or unstructured grid, or pyvista is not installed.
    """
    pyvista = load_package("pyvista", "geometry", "read_lines")
    try:
        grid = pyvista.read(path).cast_to_unstructured_grid()
    except (OSError, ValueError, AttributeError, RuntimeError) as error:
        raise InputError(f"`{path.name}` must be a mesh of VTK; got: {error}.") from error
    points, kinds = np.asarray(grid.points, dtype=float), np.asarray(grid.celltypes)
    cells = _cells(grid.cells.tolist())
    found: list[Polyline] = [
        points[cell] for cell, kind in zip(cells, kinds, strict=True) if kind in (LINE, POLYLINE)
    ]
    if not found:
        polygons = [cell for cell, kind in zip(cells, kinds, strict=True) if kind in POLYGONS]
        found = edges_of_faces(points, polygons)
    return Drawing(found, content=count_words(f"cells of type {kind}" for kind in kinds.tolist()))


def _cells(flat: list[int]) -> list[Int[np.ndarray, " corners"]]:
    """Corners of each cell, of a list in which their number precedes them."""
    found: list[Int[np.ndarray, " corners"]] = []
    at = 0
    while at < len(flat):
        found.append(np.array(flat[at + 1 : at + 1 + flat[at]]))
        at += 1 + flat[at]
    return found


TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"), **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"), **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"), **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"), **dict.fromkeys(("double", "float64"), "f8"),
}  # fmt: skip
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
END = b"end_header\n"

Row = dict[str, Any]


@dataclass
class _Element:
    """A table of the file: name, type and, of lists, the type of the length of each property."""

    name: str
    count: int
    properties: list[tuple[str, str, str]]


def read_ply(path: Path) -> Drawing:
    """Read edges; of meshes without edges those of their faces.

    Refused if it is no PLY file, or damaged.
    """
    content = path.read_bytes().replace(b"end_header\r\n", END)
    head, found, body = content.partition(END)
    try:
        if not (head.startswith(b"ply") and found):
            raise ValueError("no header")
        lines = [line.split() for line in head.decode("ascii").splitlines()]
        order = next(ORDERS[line[1]] for line in lines if line[0] == "format")
        tables = _tables(_elements(lines), body, order)
        points = np.array([[row[axis] for axis in "xyz"] for row in tables["vertex"]], dtype=float)
        edges = [[row["vertex1"], row["vertex2"]] for row in tables.get("edge", [])]
        faces = [np.array(_corners(row), dtype=int) for row in tables.get("face", [])]
        return _drawing(points.reshape(-1, 3), edges, faces)
    except (ValueError, KeyError, IndexError, StopIteration, UnicodeError) as error:
        raise InputError(f"`{path.name}` must be a whole PLY file; got: {error}.") from error


def _drawing(
    points: Float[np.ndarray, "points 3"], edges: list[list[int]], faces: list[Any]
) -> Drawing:
    lines = [points[pair] for pair in edges] or edges_of_faces(points, faces)
    return Drawing(lines, content=f"{len(points)} vertices")


def _corners(row: Row) -> Any:
    return row["vertex_indices"] if "vertex_indices" in row else row["vertex_index"]


def _elements(lines: list[list[str]]) -> list[_Element]:
    found: list[_Element] = []
    for line in lines:
        if line[:1] == ["element"]:
            found.append(_Element(line[1], int(line[2]), []))
        elif line[:2] == ["property", "list"]:
            found[-1].properties.append((line[4], TYPES[line[3]], TYPES[line[2]]))
        elif line[:1] == ["property"]:
            found[-1].properties.append((line[2], TYPES[line[1]], ""))
    return found


def _tables(elements: list[_Element], body: bytes, order: str) -> dict[str, list[Row]]:
    take = _words(body) if not order else _numbers(body, order)
    return {
        each.name: [
            {
                name: take(kind, int(take(length, 1)[0])) if length else take(kind, 1)[0]
                for name, kind, length in each.properties
            }
            for _ in range(each.count)
        ]
        for each in elements
    }


def _words(body: bytes) -> Any:
    """Give the next numbers of a text."""
    words = iter(body.split())

    def take(kind: str, count: int) -> list[float]:
        read = float if kind.startswith("f") else int
        found = [read(word) for _, word in zip(range(count), words, strict=False)]
        if len(found) < count:
            raise ValueError("it ends early")
        return found

    return take


def _numbers(body: bytes, order: str) -> Any:
    """Give the next numbers of binary data."""
    at = 0

    def take(kind: str, count: int) -> Any:
        nonlocal at
        start, at = at, at + int(kind[1]) * count
        return np.frombuffer(body, order + kind, count, start).tolist()

    return take


def read_compas(path: Path) -> Drawing:
    """Read all graphs, meshes, lines and polylines, at any depth of the file.

    Refused if it is no JSON, or an object of COMPAS lacks what its kind has.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"`{path.name}` must be JSON of COMPAS; got: {error}.") from error
    lines: list[Polyline] = []
    others: list[str] = []
    try:
        _collect(content, lines, others)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InputError(
            f"`{path.name}` must be JSON of COMPAS; got an object without {error}."
        ) from error
    return Drawing(lines, content=count_words(others))


def _collect(content: Any, lines: list[Polyline], others: list[str]) -> None:
    if isinstance(content, list):
        for each in content:
            _collect(each, lines, others)
        return
    if not isinstance(content, dict):
        return
    kind = str(content.get("dtype", "")).rpartition("/")[2]
    reader = _READERS.get(kind)
    if reader is not None:
        lines += reader(content["data"])
        return
    if kind:
        others.append(kind)
    for each in content.values():
        _collect(each, lines, others)


def _graph(data: dict[str, Any]) -> list[Polyline]:
    places = _places(data, "node")
    pairs = [(a, b) for a, others in data["edge"].items() for b in others]
    return [np.array([places[a], places[b]]) for a, b in pairs]


def _mesh(data: dict[str, Any]) -> list[Polyline]:
    places = _places(data, "vertex")
    numbers = {key: k for k, key in enumerate(places)}
    faces = [np.array([numbers[str(each)] for each in face]) for face in data["face"].values()]
    return edges_of_faces(np.array(list(places.values())), faces)


def _places(data: dict[str, Any], kind: str) -> dict[str, list[float]]:
    """Places by key; coordinates that are left out have the default of the data structure."""
    usual = data.get(f"default_{kind}_attributes", {})
    return {
        str(key): [float((usual | own)[axis]) for axis in "xyz"] for key, own in data[kind].items()
    }


def _points(*points: Any) -> list[Polyline]:
    return [np.array([[float(x) for x in point] for point in points])]


_READERS: dict[str, Callable[[dict[str, Any]], list[Polyline]]] = {
    "Graph": _graph,
    "Network": _graph,
    "Mesh": _mesh,
    "Line": lambda data: _points(data["start"], data["end"]),
    "Polyline": lambda data: _points(*data["points"]),
}
