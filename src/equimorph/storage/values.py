"""Results of tasks as HDF5 groups: any of our records, field by field; see `schemas`.

Plain values and the shape of the record are one text, ``about``; arrays and states are datasets and
groups next to it under the names of their fields, for other programs to read. Descriptors and
constraints are kept by name: the structure knows the rest.
"""

from collections.abc import Callable, Mapping
from types import UnionType
from typing import Any, get_args

import h5py
import numpy as np

from equimorph.arrays import Shaped
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Box, Constraint, Descriptor, Grid
from equimorph.storage.hdf import get, get_json, put, put_json, put_parameters
from equimorph.storage.maps import read_map_group, write_map_group
from equimorph.storage.owner import Owner, words_of
from equimorph.storage.schemas import Schema, find_schema, schema_of
from equimorph.storage.sets import read_set, write_set
from equimorph.structures import State, States
from equimorph.tables import units_of
from equimorph.tasks.maps.curvature import CurvatureMap
from equimorph.tasks.maps.limit_load import LimitLoadMap

ABOUT = "about"
LONGEST = 1000
"""Characters of texts that are attributes of their record, too."""
Inner = Callable[[Any], Any]


def write_states(group: h5py.Group, states: States) -> None:
    """Write states with their parameters, energies, margins and shapes."""
    put(group, "z", states.z, ["state", "unknown"], "unknowns and multipliers")
    put_parameters(group, units_of(states.structure.parameters), {"p": states.p}, "state")
    put(group, "index", states.index, ["state"], "negative eigenvalues; 0 is stable")
    put(group, "margin", states.margin, ["state"], "stability margin")
    unit = states.structure.descriptor("energy").unit
    put(group, "energy", states.energy, ["state"], "potential energy", unit)


def read_states(group: h5py.Group, owner: Owner) -> States:
    """Read what `write_states` wrote."""
    return States(owner.structure, get(group, "z"), get(group, "p"))


def write_value(group: h5py.Group, value: Any) -> None:
    """Write a record, or a collection of records, into an empty group.

    Refused if it holds something that no file can hold, like a function.
    """
    put_json(group, ABOUT, _encode(group, value, ""))
    schema = schema_of(value)
    for key, each in ({} if schema is None else schema.values(value)).items():
        if isinstance(each, np.generic | float | int | str) and len(str(each)) < LONGEST:
            plain = each.item() if isinstance(each, np.generic) else each
            group.attrs[key] = str(plain) if isinstance(plain, str) else plain


def read_value(group: h5py.Group, owner: Owner) -> Any:
    """Read what `write_value` wrote.

    Raises `UnreadableError` if it holds a record that this release cannot read.
    """
    return _decode(group, owner, get_json(group, ABOUT))


def _encode(group: h5py.Group, value: Any, place: str) -> Any:
    """Plain data that stands for a value; what is large goes into the group at `place`."""
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if np.isfinite(value) else {"float": repr(value)}
    if isinstance(value, tuple | list):
        inner = [_encode(group, each, _inside(place, k)) for k, each in enumerate(value)]
        return {type(value).__name__: inner}
    if isinstance(value, Mapping):
        return {"mapping": _pairs(group, value, place)}
    schema = schema_of(value)
    if schema is not None:
        own = _encode_fields(group, schema, value, place)
        return {"record": [schema.name, own, schema.change.version]}
    return _put(group, value, place)


def _encode_fields(group: h5py.Group, schema: Schema, value: Any, place: str) -> dict[str, Any]:
    """Plain data that stands for the fields of a record."""
    own: dict[str, Any] = {}
    kinds = {each.name: each.type for each in schema.fields}
    for key, each in schema.values(value).items():
        inside = _inside(place, key)
        if isinstance(each, np.ndarray):
            own[key] = _put_array(group, each, inside, _axes(kinds, key, each.ndim))
        else:
            own[key] = _encode(group, each, inside)
    return own


def _inside(place: str, name: str | int) -> str:
    """Place below another one; in the group itself, which paths from the root would leave."""
    return f"{place}/{name}".lstrip("/")


def _pairs(group: h5py.Group, value: Mapping[Any, Any], place: str) -> list[list[Any]]:
    return [
        [_encode(group, key, ""), _encode(group, each, _inside(place, k))]
        for k, (key, each) in enumerate(value.items())
    ]


def _put(group: h5py.Group, value: Any, place: str) -> Any:
    """Write a value with a special form; return its place or its name."""
    match value:
        case np.ndarray():
            return _put_array(group, value, place, _axes({}, place.rpartition("/")[2], value.ndim))
        case State():
            write_states(group.create_group(place), value.batch)
        case States():
            write_states(group.create_group(place), value)
        case CurvatureMap() | LimitLoadMap():
            write_map_group(group.create_group(place), value)
        case EquilibriumSet():
            write_set(group.create_group(place), value)
        case _:
            return _encode_named(value, place)
    return {type(value).__name__: place}


def _put_array(
    group: h5py.Group, value: Shaped[np.ndarray, "..."], place: str, axes: list[str]
) -> dict[str, str]:
    """Write an array, and return its place; its dimensions are those of its own record."""
    inner, _, name = place.rpartition("/")
    put(group.require_group(inner) if inner else group, name, value, axes)
    return {"ndarray": place}


def _axes(kinds: Mapping[str, Any], key: str, rank: int) -> list[str]:
    """Names of the dimensions of an array: in the singular what its annotation calls them.

    Names of fields are taken: a variable called like a dimension holds the places along it.
    """
    found = [getattr(each, "dim_str", "").split() for each in _alternatives(kinds.get(key))]
    words = next((each for each in found if len(each) == rank), [""] * rank)
    names = [word.removesuffix("s") for word in words]
    return [
        name if name.isidentifier() and name not in kinds else f"{key}_{axis}"
        for axis, name in enumerate(names)
    ]


def _alternatives(annotation: Any) -> tuple[Any, ...]:
    return get_args(annotation) if isinstance(annotation, UnionType) else (annotation,)


def _encode_named(value: Any, place: str) -> Any:
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
            return {"constraint": words_of(value)}
    raise InputError(f"`{place}` must be data that a file can hold; got {type(value).__name__}.")


def _sides(box: Box) -> dict[str, tuple[float, float]]:
    sides = zip(box.lower.tolist(), box.upper.tolist(), strict=True)
    return dict(zip(box.names, sides, strict=True))


def _decode(group: h5py.Group, owner: Owner, plain: Any) -> Any:
    """Return the value that plain data stands for."""
    if not isinstance(plain, dict):
        return plain
    ((kind, content),) = plain.items()
    return _READERS[kind](lambda each: _decode(group, owner, each), group, owner, content)


def _read_record(inner: Inner, group: h5py.Group, owner: Owner, content: Any) -> Any:
    name, values, *version = content  # the first releases wrote no version
    built = {key: inner(each) for key, each in values.items()}
    return find_schema(name).build(version[0] if version else 1, built)


_READERS: dict[str, Callable[[Inner, h5py.Group, Owner, Any], Any]] = {
    "record": _read_record,
    "constraint": lambda _, __, owner, words: owner.constraint(words),
    "box": lambda _, __, ___, sides: Box(**sides),
    "grid": lambda _, __, ___, sides: Grid(**sides),
    "descriptor": lambda _, __, owner, name: owner.descriptor(name),
    "mapping": lambda inner, _, __, pairs: {inner(key): inner(each) for key, each in pairs},
    "tuple": lambda inner, _, __, entries: tuple(inner(each) for each in entries),
    "list": lambda inner, _, __, entries: [inner(each) for each in entries],
    "float": lambda _, __, ___, text: float(text),
    "ndarray": lambda _, group, __, place: get(group, place),
    "State": lambda _, group, owner, place: read_states(group[place], owner)[0],
    "States": lambda _, group, owner, place: read_states(group[place], owner),
    "CurvatureMap": lambda _, group, owner, place: read_map_group(group[place], owner),
    "LimitLoadMap": lambda _, group, owner, place: read_map_group(group[place], owner),
    "EquilibriumSet": lambda _, group, owner, place: read_set(group[place], owner),
}
"""How each kind of content is read, by the name that it was written under."""
