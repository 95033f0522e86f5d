"""Actuator schedules as files: a CSV table for people with a JSON sidecar for programs, or JSON.

The table has one row per step: time, share of the route, all parameters, stability margin,
descriptors, and rates and accelerations of what moves, with units in the header: ``time (s)``,
``theta_A (rad)``, ``theta_A rate (rad/s)``. A file of JSON alone has the same columns. The
parameters alone do not determine a state, so the sidecar carries the structure, the unknowns of
the first state and the loads. A checksum over the numbers and the sidecar finds damage; a
spreadsheet may save the table again as long as it keeps every digit.

Routes are HDF5 groups of path, events, snaps and schedule, or the reason of a refusal.
"""

import csv
import hashlib
import io
import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.equilibria import Event, Path as StatePath
from equimorph.errors import InputError
from equimorph.model import Schedule
from equimorph.model.schedule import DERIVATIVES, MARGIN, PROGRESS, TIME, columns_of
from equimorph.storage.files import read_text, write_csv, write_text
from equimorph.storage.hdf import get, get_json, put, put_coordinate, put_json, put_parameters
from equimorph.storage.owner import Owner
from equimorph.storage.values import read_value, write_value
from equimorph.structures import State, States, Structure
from equimorph.tables import heading, units_of
from equimorph.tasks.route import Route

FORMAT = "equimorph schedule"
VERSION = 3
"""Version of the layout of the sidecar file. 1, without times and units, and 2, without those of
descriptors, can be read."""
READABLE = (1, 2, VERSION)
"""Versions of sidecars that can be read."""
COLUMNS, DESCRIPTOR_UNITS = "columns", "descriptor_units"
"""Keys of the numbers in a file of JSON alone, and of the units of descriptors by name."""


Column = Float[np.ndarray, " steps"]


@check_arguments
def write_schedule(schedule: Schedule, path: str | Path) -> tuple[Path, ...]:
    """Write a schedule to `path` (CSV) and to its sidecar with the suffix ``.json``; or JSON alone.

    Parameters
    ----------
    schedule
        What to write.
    path
        Name of the table, ending in ``.csv``; or of one file with everything, in ``.json``.

    Returns
    -------
    The files written.

    Raises
    ------
    InputError
        If `path` has another ending or cannot be written.

    Examples
    --------
    ``em.storage.write_schedule(route.schedule, "schedule.csv")``
    """
    table_path, sidecar_path = _paths(path)
    head, *rows = schedule.table.rows()
    table = np.column_stack([np.asarray(each) for each in schedule.table.columns.values()])
    sidecar = _sidecar(schedule)
    sidecar["checksum"] = _checksum(sidecar, table)
    if table_path is None:
        lists = dict(zip(head, table.T.tolist(), strict=True))
        text = json.dumps({**sidecar, COLUMNS: lists}, indent=1, ensure_ascii=False)
        write_text(sidecar_path, text + "\n")
        return (sidecar_path,)
    write_csv(table_path, [head, *rows])
    write_text(sidecar_path, json.dumps(sidecar, indent=2, ensure_ascii=False) + "\n")
    return table_path, sidecar_path


@check_arguments
def read_schedule(path: str | Path) -> Schedule:
    """Read a schedule from its table and sidecar, or from JSON alone.

    Parameters
    ----------
    path
        Name of the table, ending in ``.csv``, with the sidecar in the same folder; or of the file
        that holds everything, ending in ``.json``.

    Raises
    ------
    InputError
        If either file is missing, damaged, of another kind, or of a newer version.
    """
    table_path, sidecar_path = _paths(path)
    sidecar = _read_sidecar(sidecar_path)
    lists = sidecar.pop(COLUMNS, None)
    if table_path is None:
        header, table = _numbers_of(lists, sidecar_path)
    else:
        header, table = _read_table(table_path)
    checksum = sidecar.pop("checksum", None)
    if checksum != _checksum(sidecar, table):
        raise InputError(
            f"`{table_path or sidecar_path}` must hold the numbers that were written with its "
            "sidecar; got other ones, or a changed sidecar. Write the schedule again."
        )
    return _schedule(sidecar, dict(zip(header, table.T, strict=True)))


def _schedule(sidecar: dict[str, Any], columns: dict[str, Column]) -> Schedule:
    """Schedule of the columns of a table, by their headers."""
    names, units = tuple(sidecar["names"]), tuple(sidecar["units"])
    unit, units_too = sidecar.get("time_unit", "T"), sidecar.get(DESCRIPTOR_UNITS, {})
    descriptors = {name: units_too.get(name, "") for name in sidecar["descriptors"]}
    named = columns_of(dict(zip(names, units, strict=True)), descriptors, unit)

    def column(kind: str, name: str) -> Column:
        own, unit = named[kind, name]
        # files of older releases give columns of one name the same head, or heads without units
        for head in (heading(own, unit), heading(name, unit), name):
            if head in columns:
                return columns[head]
        raise InputError(f"`path` must be a table with a column {own!r}; got none.")

    values = np.column_stack([column("parameter", name) for name in names])
    moments, still = {}, np.zeros(len(values))
    for key, *_ in DERIVATIVES:
        if key in sidecar.get("derivatives", ()):
            heads = [heading(*named[key, name]) for name in names]
            moments[key] = np.column_stack([columns.get(head, still) for head in heads])
    return Schedule(
        names=names,
        roles=tuple(sidecar["roles"]),
        units=units,
        values=values,
        progress=columns[PROGRESS],
        margins=columns[MARGIN],
        descriptors={name: column("descriptor", name) for name in descriptors},
        start=sidecar["start"],
        way_points=np.array(sidecar["way_points"], dtype=int),
        times=columns.get(heading(TIME, unit)),
        time_unit=unit,
        descriptor_units=units_too,
        **moments,
    )


def _paths(path: str | Path) -> tuple[Path | None, Path]:
    """Table, if there is one, and sidecar."""
    given = Path(path)
    if given.suffix not in (".csv", ".json"):
        raise InputError(f"`path` must end in .csv or .json; got {given.name!r}.")
    return (given if given.suffix == ".csv" else None), given.with_suffix(".json")


def _sidecar(schedule: Schedule) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "version": VERSION,
        "names": list(schedule.names),
        "roles": list(schedule.roles),
        "units": list(schedule.units),
        "time_unit": schedule.time_unit,
        "derivatives": [key for key, *_ in DERIVATIVES if getattr(schedule, key) is not None],
        "descriptors": list(schedule.descriptors),
        DESCRIPTOR_UNITS: dict(schedule.descriptor_units),
        "loads": _loads(schedule),
        "way_points": schedule.way_points.tolist(),
        "start": schedule.start,
    }


def _loads(schedule: Schedule) -> dict[str, float | str]:
    """Return loads by name: the value, or a pointer to the table where it varies."""
    loads: dict[str, float | str] = {}
    for name, role, values in zip(schedule.names, schedule.roles, schedule.values.T, strict=True):
        if role == "load":
            constant = bool((values == values[0]).all())
            loads[name] = float(values[0]) if constant else "varies: see the table"
    return loads


def _checksum(sidecar: dict[str, Any], table: Float[np.ndarray, "steps columns"]) -> str:
    words = json.dumps(sidecar, sort_keys=True).encode()
    return hashlib.sha256(words + np.ascontiguousarray(table, dtype="<f8").tobytes()).hexdigest()


def _read_sidecar(path: Path) -> dict[str, Any]:
    try:
        sidecar = json.loads(read_text(path))
    except json.JSONDecodeError as error:
        raise InputError(f"`{path}` must be JSON; got an error: {error}.") from error
    if not isinstance(sidecar, dict) or sidecar.get("format") != FORMAT:
        raise InputError(
            f"`{path}` must be the sidecar of an equimorph schedule; got another file."
        )
    if sidecar.get("version") not in READABLE:
        raise InputError(
            f"`{path}` must have version {VERSION} or less; got {sidecar.get('version')!r}. "
            "Read it with the equimorph that wrote it, or a newer one."
        )
    return sidecar


def _numbers_of(lists: Any, path: Path) -> tuple[list[str], Float[np.ndarray, "steps columns"]]:
    try:
        table = np.array([[float(each) for each in column] for column in lists.values()]).T
    except (AttributeError, TypeError, ValueError):
        table = np.zeros(0)
    if table.ndim != 2:
        raise InputError(
            f"`{path}` must hold columns of numbers; got damaged ones, or the sidecar of a table, "
            "whose name ends in .csv."
        )
    return list(lists), table


def _read_table(path: Path) -> tuple[list[str], Float[np.ndarray, "steps columns"]]:
    header, *rows = list(csv.reader(io.StringIO(read_text(path)))) or [[]]
    try:
        table = np.array([[float(entry) for entry in row] for row in rows])
    except ValueError:
        table = np.zeros((0,))
    if table.ndim != 2 or table.shape[1] != len(header):
        raise InputError(
            f"`{path}` must be a table of numbers with {len(header)} columns; got a damaged one. "
            "Write the schedule again."
        )
    return header, table


ABOUT, EVENTS, SCHEDULE, SNAPS, BOTTLENECK = "about", "events", "schedule", "snaps", "bottleneck"
SURVIVAL = "survival"


def write_route(group: h5py.Group, route: Route) -> None:
    """Write a route into an empty group."""
    words = {"status": route.status, "why": route.why, "way_points": route.way_points}
    words |= {"objective": route.objective}
    put_json(group, ABOUT, words)
    # Attributes, because a refused route has none of them and JSON knows no NaN.
    group.attrs.update(margin=route.margin, length=route.length, cost=route.cost)
    if route.path is not None:
        _write_path(group, route.path)
    if route.schedule is not None:
        _write_schedule(group.create_group(SCHEDULE), route.schedule)
    if route.snaps:
        write_value(group.create_group(SNAPS), route.snaps)
    if route.bottleneck is not None:
        write_value(group.create_group(BOTTLENECK), route.bottleneck)
    if route.survival is not None:
        write_value(group.create_group(SURVIVAL), route.survival)


def read_route(group: h5py.Group, owner: Owner) -> Route:
    """Read what `write_route` wrote."""
    about = get_json(group, ABOUT)
    return Route(
        status=about["status"],
        why=about["why"],
        way_points=about["way_points"],
        objective=about.get("objective", "length"),  # older files have neither this
        cost=float(group.attrs.get("cost", np.nan)),  # nor this
        margin=float(group.attrs["margin"]),
        length=float(group.attrs["length"]),
        path=_read_path(group, owner.structure) if "z" in group else None,
        schedule=_read_schedule(group[SCHEDULE]) if SCHEDULE in group else None,
        snaps=read_value(group[SNAPS], owner) if SNAPS in group else (),
        bottleneck=read_value(group[BOTTLENECK], owner) if BOTTLENECK in group else None,
        survival=read_value(group[SURVIVAL], owner) if SURVIVAL in group else None,
    )


def _write_path(group: h5py.Group, path: StatePath) -> None:
    put(group, "z", path.states.z, ["point", "unknown"], "unknowns and multipliers")
    units = units_of(path.states.structure.parameters)
    put_parameters(group, units, {"p": path.states.p}, "point")
    put(group, "at", path.at, ["point"], "segment + share of it")
    put(group, "length", path.length, ["point"], "length from the start")
    put(group, "index", path.index, ["point"], "negative eigenvalues; 0 is stable")
    states = [event.state for event in path.events]
    put(group, "event_z", np.array([s.z for s in states]), ["event", "unknown"])
    put_parameters(group, units, {"event_p": np.array([s.p for s in states])}, "event")
    words = [[e.kind, e.at, e.criticality, e.detail] for e in path.events]
    put_json(group, EVENTS, words)


def _read_path(group: h5py.Group, structure: Structure) -> StatePath:
    states = zip(get(group, "event_z"), get(group, "event_p"), strict=True)
    events = [
        Event(kind, State(structure, z, p), at, criticality, detail)
        for (z, p), (kind, at, criticality, detail) in zip(
            states, get_json(group, EVENTS), strict=True
        )
    ]
    return StatePath(
        states=States(structure, get(group, "z"), get(group, "p")),
        at=get(group, "at"),
        length=get(group, "length"),
        index=get(group, "index"),
        events=tuple(events),
    )


IN_TIME = ("times", "velocities", "accelerations")
"""Fields of schedules that have times; files of older releases have none."""


def _write_schedule(group: h5py.Group, schedule: Schedule) -> None:
    moments = {name: getattr(schedule, name) for name in ("velocities", "accelerations")}
    arrays = {name: each for name, each in moments.items() if each is not None}
    units = dict(zip(schedule.names, schedule.units, strict=True))
    put_parameters(group, units, {"values": schedule.values, **arrays}, "step")
    if schedule.times is not None:
        put(group, "times", schedule.times, ["step"], "time", schedule.time_unit)
    put(group, "progress", schedule.progress, ["step"], "share of the length")
    put(group, "margins", schedule.margins, ["step"], "stability margin")
    put(group, "way_points", schedule.way_points, ["corner"], "steps at the corners")
    table = list(schedule.descriptors.values())
    table_array = np.array(table).reshape(len(table), len(schedule.progress))
    if "descriptor" not in group:
        put_coordinate(group, "descriptor", np.array([*schedule.descriptors], object), "name")
    put(group, "descriptors", table_array, ["descriptor", "step"], "descriptors")
    about = {
        "names": schedule.names,
        "roles": schedule.roles,
        "units": schedule.units,
        "descriptors": list(schedule.descriptors),
        DESCRIPTOR_UNITS: dict(schedule.descriptor_units),
        "start": schedule.start,
        "time_unit": schedule.time_unit,
    }
    put_json(group, ABOUT, about)


def _read_schedule(group: h5py.Group) -> Schedule:
    about = get_json(group, ABOUT)
    return Schedule(
        names=tuple(about["names"]),
        roles=tuple(about["roles"]),
        units=tuple(about["units"]),
        values=get(group, "values"),
        progress=get(group, "progress"),
        margins=get(group, "margins"),
        descriptors=dict(zip(about["descriptors"], get(group, "descriptors"), strict=True)),
        start=about["start"],
        way_points=get(group, "way_points"),
        time_unit=about.get("time_unit", "T"),
        descriptor_units=about.get(DESCRIPTOR_UNITS, {}),
        **{name: get(group, name) for name in IN_TIME if name in group},
    )
