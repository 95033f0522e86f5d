"""PLY files with edges or faces; the common readers leave edges out.

References
----------
Turk, The PLY polygon file format, 1994.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from equimorph.array_types import Float
from equimorph.errors import InputError
from equimorph.io.drawing import Drawing, edges_of_faces

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

    Raises
    ------
    InputError
        If it is no PLY file, or damaged.
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
