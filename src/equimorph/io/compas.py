"""Graphs, meshes, lines and polylines in JSON files of COMPAS; the package is not needed."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from equimorph.errors import InputError
from equimorph.io.drawing import Drawing, Polyline, count_words, edges_of_faces


def read_compas(path: Path) -> Drawing:
    """Read all graphs, meshes, lines and polylines, at any depth of the file.

    Raises
    ------
    InputError
        If it is no JSON, or an object of COMPAS lacks what its kind has.
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
