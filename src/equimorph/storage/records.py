"""The one way by which records get into HDF5 groups and back: by a schema and its version.

Records that other programs read (sets, states, maps, routes, charts) have special layouts; all
other results of tasks are written field by field, see `values`. Every group says which it is.

See docs/decisions.md, "Records carry a schema and a version".
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py

from equimorph.charts import Atlas, Chart
from equimorph.manifold import EquilibriumSet
from equimorph.model import Descriptor
from equimorph.storage.charts import read_chart, write_chart
from equimorph.storage.hdf import content, get_json, open_file, put_json
from equimorph.storage.maps import read_map_group, write_map_group
from equimorph.storage.owner import Owner
from equimorph.storage.schedule import read_route, write_route
from equimorph.storage.schemas import UnreadableError
from equimorph.storage.sets import read_set, write_set
from equimorph.storage.values import read_states, read_value, write_states, write_value
from equimorph.structures import State, States, Structure, from_identity
from equimorph.tasks.calibration.calibrate import Calibration
from equimorph.tasks.maps.actuator_map import ActuatorMap
from equimorph.tasks.route import Route

FORMAT = "an equimorph checkpoint"
VERSION = 2
"""Version of the layout that is written, the newest that can be read."""
SCHEMA, SCHEMA_VERSION, KIND = "schema", "schema_version", "kind"
RECORD, STRUCTURE, FOUND = "record", "structure", "found"


@dataclass(frozen=True)
class Layout:
    """How one kind of record is laid out in a group."""

    schema: str
    version: int
    """Name in files; the version rises with each change that older releases cannot read."""
    kinds: tuple[type, ...]
    """Classes that are written so."""
    write: Callable[[h5py.Group, Any], None]
    read: Callable[[h5py.Group, Owner], Any]
    """Into an empty group, and back."""


def _write_calibration(group: h5py.Group, found: Calibration) -> None:
    """Write a calibration: its states belong to a structure with the data that were found."""
    put_json(group, STRUCTURE, found.states.structure.identity())
    write_value(group.create_group(FOUND), found)


def _read_calibration(group: h5py.Group, _: Owner) -> Any:
    return read_value(group[FOUND], Owner(from_identity(get_json(group, STRUCTURE))))


_ANYTHING = Layout(RECORD, 1, (object,), write_value, read_value)
LAYOUTS = {
    each.schema: each
    for each in (
        Layout("set", 1, (EquilibriumSet,), write_set, read_set),
        Layout("states", 1, (States,), write_states, read_states),
        Layout(
            "state",
            1,
            (State,),
            lambda group, state: write_states(group, state.batch),
            lambda group, owner: read_states(group, owner)[0],
        ),
        Layout("map", 1, (ActuatorMap,), write_map_group, read_map_group),
        Layout("route", 1, (Route,), write_route, read_route),
        Layout("chart", 1, (Chart, Atlas), write_chart, read_chart),
        Layout("calibration", 1, (Calibration,), _write_calibration, _read_calibration),
        _ANYTHING,
    )
}


def write_record(group: h5py.Group, value: Any) -> None:
    """Write a result into an empty group, which then names its schema and version.

    Refused if it holds something that no file can hold, like a function.
    """
    layout = next(each for each in LAYOUTS.values() if isinstance(value, each.kinds))
    label(group, layout.schema)
    layout.write(group, value)


def label(group: h5py.Group, schema: str) -> None:
    """Write the schema and its version on a group."""
    group.attrs.update({SCHEMA: schema, SCHEMA_VERSION: LAYOUTS[schema].version})


def read_record(group: h5py.Group, owner: Owner, schema: str = RECORD) -> Any:
    """Read what `write_record` wrote for an owner.

    `schema` is that of groups that name none, as the first releases wrote them.

    Raises `UnreadableError` if this release cannot read this record.
    """
    name = group.attrs.get(SCHEMA, group.attrs.get(KIND, schema))
    version = int(group.attrs.get(SCHEMA_VERSION, 1))
    layout = LAYOUTS.get(name)
    if layout is None or version > layout.version:
        raise UnreadableError(
            f"`record` must be one that this release can read ({', '.join(LAYOUTS)}); got {name}, "
            f"version {version}. Read it with the release that wrote it."
        )
    return layout.read(group, owner)


def content_of(value: Any) -> bytes:
    """Return the content of a file that holds one result."""
    return content(FORMAT, VERSION, lambda file: write_record(file.create_group(RECORD), value))


def load_record(
    path: Path, structure: Structure, descriptors: Mapping[str, Descriptor] | None = None
) -> Any:
    """Read the result that a file holds.

    Refused if the file is missing or damaged, or holds something that this release cannot read.
    """
    with open_file(path, FORMAT, VERSION) as file:
        return read_record(file[RECORD], Owner(structure, descriptors or {}))
