"""Results of tasks as HDF5 groups: any of our frozen dataclasses, field by field.

Plain values and the shape of the record are one text, ``about``; arrays and states are datasets and
groups beside it under the names of their fields, for other programs to read. Descriptors and
constraints are kept by name: the structure knows the rest.
"""

from collections.abc import Callable, Mapping
from dataclasses import Field, fields, is_dataclass
from typing import Any

import h5py
import numpy as np

from equimorph import tasks
from equimorph.equilibria import Event, Landing, LimitLoad, Path, worst_named
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet, Snap, StabilityDistance
from equimorph.model import Box, Constraint, Descriptor, Grid, Schedule
from equimorph.storage import map_group, set_group, states_group
from equimorph.storage.hdf import get, get_json, put, put_json
from equimorph.structures import State, States, Structure
from equimorph.tasks import CurvatureMap, LimitLoadMap
from equimorph.tasks.reach import Answer, Region

ABOUT = "about"
Inner = Callable[[Any], Any]


def _known_records() -> dict[str, type]:
    """Dataclasses that are written field by field, by name."""
    ours = [getattr(tasks, name) for name in tasks.__all__]
    records = [each for each in ours if isinstance(each, type) and is_dataclass(each)]
    others = (Answer, Event, Landing, LimitLoad, Path, Region, Schedule, Snap, StabilityDistance)
    maps = (CurvatureMap, LimitLoadMap)
    return {each.__name__: each for each in (*others, *records) if each not in maps}


RECORDS = _known_records()


def write(group: h5py.Group, record: Any) -> None:
    """Write a record into an empty group.

    Raises
    ------
    InputError
        If it holds something that no file can hold, like a function.
    """
    put_json(group, ABOUT, _encoded(group, record, ""))


def read(group: h5py.Group, structure: Structure) -> Any:
    """Read what `write` wrote."""
    return _decoded(group, structure, get_json(group, ABOUT))


def _encoded(group: h5py.Group, value: Any, place: str) -> Any:
    """Plain data that stands for a value; what is large goes into the group at `place`."""
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if np.isfinite(value) else {"float": repr(value)}
    if isinstance(value, tuple | list):
        inner = [_encoded(group, each, _inside(place, k)) for k, each in enumerate(value)]
        return {type(value).__name__: inner}
    if isinstance(value, Mapping):
        return {"mapping": _pairs(group, value, place)}
    kind = type(value).__name__
    if kind in RECORDS:
        values = {each.name: getattr(value, each.name) for each in _kept(value)}
        named = values.items()
        own = {key: _encoded(group, each, _inside(place, key)) for key, each in named}
        return {"record": [kind, own]}
    return _put(group, value, place)


def _inside(place: str, name: str | int) -> str:
    """Place below another one; in the group itself, which paths from the root would leave."""
    return f"{place}/{name}".lstrip("/")


def _kept(record: Any) -> list[Field[Any]]:
    """Fields that are written."""
    return [each for each in fields(record) if each.metadata.get("kept", True)]


def _pairs(group: h5py.Group, value: Mapping[Any, Any], place: str) -> list[list[Any]]:
    return [
        [_encoded(group, key, ""), _encoded(group, each, _inside(place, k))]
        for k, (key, each) in enumerate(value.items())
    ]


def _put(group: h5py.Group, value: Any, place: str) -> Any:
    """Write what has a form of its own; return where it is, or its name."""
    match value:
        case np.ndarray():
            axes = [f"{place.replace('/', '.')}.{axis}" for axis in range(value.ndim)]
            put(group, place, value, axes)
        case State():
            states_group.write(group.create_group(place), value.batch)
        case States():
            states_group.write(group.create_group(place), value)
        case CurvatureMap() | LimitLoadMap():
            map_group.write(group.create_group(place), value)
        case EquilibriumSet():
            set_group.write(group.create_group(place), value, value.structure.elevation)
        case _:
            return _named(value, place)
    return {type(value).__name__: place}


def _named(value: Any, place: str) -> Any:
    """Plain data for what has names and numbers only."""
    match value:
        case Descriptor():
            return {"descriptor": value.name}
        case Box():
            return {"box": _sides(value)}
        case Grid():
            counted = zip(_sides(value.box).items(), value.intervals, strict=True)
            return {"grid": {name: [*side, count] for (name, side), count in counted}}
        case Constraint():
            return {"constraint": [value.descriptor.name, value.sense, value.bound]}
    raise InputError(f"`{place}` must be data that a file can hold; got {type(value).__name__}.")


def _sides(box: Box) -> dict[str, tuple[float, float]]:
    sides = zip(box.lower.tolist(), box.upper.tolist(), strict=True)
    return dict(zip(box.names, sides, strict=True))


def _decoded(group: h5py.Group, structure: Structure, plain: Any) -> Any:
    """Return the value that plain data stands for."""
    if not isinstance(plain, dict):
        return plain
    ((kind, content),) = plain.items()
    return _READERS[kind](lambda each: _decoded(group, structure, each), group, structure, content)


def _read_record(inner: Inner, group: h5py.Group, structure: Structure, content: Any) -> Any:
    name, values = content
    return RECORDS[name](**{key: inner(each) for key, each in values.items()})


def _read_constraint(inner: Inner, group: h5py.Group, structure: Structure, content: Any) -> Any:
    name, sense, bound = content
    return Constraint(worst_named(structure, name), sense, bound)


_READERS: dict[str, Callable[[Inner, h5py.Group, Structure, Any], Any]] = {
    "record": _read_record,
    "constraint": _read_constraint,
    "box": lambda _, __, ___, sides: Box(**sides),
    "grid": lambda _, __, ___, sides: Grid(**sides),
    "descriptor": lambda _, __, structure, name: worst_named(structure, name),
    "mapping": lambda inner, _, __, pairs: {inner(key): inner(each) for key, each in pairs},
    "tuple": lambda inner, _, __, entries: tuple(inner(each) for each in entries),
    "list": lambda inner, _, __, entries: [inner(each) for each in entries],
    "float": lambda _, __, ___, text: float(text),
    "ndarray": lambda _, group, __, place: get(group, place),
    "State": lambda _, group, structure, place: states_group.read(group[place], structure)[0],
    "States": lambda _, group, structure, place: states_group.read(group[place], structure),
    "CurvatureMap": lambda _, group, structure, place: map_group.read(group[place], structure),
    "LimitLoadMap": lambda _, group, structure, place: map_group.read(group[place], structure),
    "EquilibriumSet": lambda _, group, structure, place: set_group.read(group[place], structure),
}
"""How each kind of content is read, by the name that it was written under."""
