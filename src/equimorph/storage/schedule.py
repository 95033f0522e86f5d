"""Actuator schedules as files: a CSV table for people and a JSON sidecar for programs.

The table has one row per step: share of the route, all parameters, stability margin, descriptors.
The parameters alone do not determine a state, so the sidecar carries the structure, the unknowns of
the first state and the loads. A checksum over the numbers and the sidecar finds damage; a
spreadsheet may save the table again as long as it keeps every digit.
"""

import csv
import hashlib
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from equimorph.argument_checks import check_arguments
from equimorph.errors import InputError
from equimorph.model import Schedule
from equimorph.storage.files import read_text, write_text

FORMAT = "equimorph schedule"
VERSION = 1
"""Version of the layout of the sidecar file; other versions are refused."""
PROGRESS, MARGIN = "progress", "stability_margin"


@check_arguments
def write_schedule(schedule: Schedule, path: str | Path) -> tuple[Path, Path]:
    """Write a schedule to `path` (CSV) and to its sidecar with the suffix ``.json``.

    Parameters
    ----------
    schedule
        What to write.
    path
        Name of the table, ending in ``.csv``.

    Returns
    -------
    Both files written.

    Raises
    ------
    InputError
        If `path` has another ending or cannot be written.

    Examples
    --------
    ``em.storage.write_schedule(route.schedule, "schedule.csv")``
    """
    table_path, sidecar_path = _paths(path)
    table = _table(schedule)
    sidecar = _sidecar(schedule)
    sidecar["checksum"] = _checksum(sidecar, table)
    write_text(table_path, _csv(_header(schedule), table))
    write_text(sidecar_path, json.dumps(sidecar, indent=2, ensure_ascii=False) + "\n")
    return table_path, sidecar_path


@check_arguments
def read_schedule(path: str | Path) -> Schedule:
    """Read a schedule from its table and sidecar.

    Parameters
    ----------
    path
        Name of the table, ending in ``.csv``; the sidecar stands in the same folder.

    Raises
    ------
    InputError
        If either file is missing, damaged, of another kind, or of a newer version.
    """
    table_path, sidecar_path = _paths(path)
    sidecar = _read_sidecar(sidecar_path)
    header, table = _read_table(table_path)
    checksum = sidecar.pop("checksum", None)
    if checksum != _checksum(sidecar, table):
        raise InputError(
            f"`{table_path}` must hold the numbers that were written with its sidecar; got other "
            "ones, or a changed sidecar. Write the schedule again."
        )
    count = len(sidecar["names"])
    return Schedule(
        names=tuple(sidecar["names"]),
        roles=tuple(sidecar["roles"]),
        units=tuple(sidecar["units"]),
        values=table[:, 1 : 1 + count],
        progress=table[:, 0],
        margins=table[:, 1 + count],
        descriptors={name: table[:, header.index(name)] for name in sidecar["descriptors"]},
        start=sidecar["start"],
        way_points=np.array(sidecar["way_points"], dtype=int),
    )


def _paths(path: str | Path) -> tuple[Path, Path]:
    table = Path(path)
    if table.suffix != ".csv":
        raise InputError(f"`path` must end in .csv; got {table.name!r}.")
    return table, table.with_suffix(".json")


def _header(schedule: Schedule) -> list[str]:
    return [PROGRESS, *schedule.names, MARGIN, *schedule.descriptors]


def _table(schedule: Schedule) -> Float[np.ndarray, "steps columns"]:
    columns = [schedule.progress, *schedule.values.T, schedule.margins]
    return np.column_stack([*columns, *schedule.descriptors.values()])


def _sidecar(schedule: Schedule) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "version": VERSION,
        "names": list(schedule.names),
        "roles": list(schedule.roles),
        "units": list(schedule.units),
        "descriptors": list(schedule.descriptors),
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


def _csv(header: list[str], table: Float[np.ndarray, "steps columns"]) -> str:
    """Shortest decimals that give every number back exactly."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([[repr(value) for value in row] for row in table.tolist()])
    return text.getvalue()


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
    if sidecar.get("version") != VERSION:
        raise InputError(
            f"`{path}` must have version {VERSION}; got {sidecar.get('version')!r}. "
            "Read it with the equimorph that wrote it, or a newer one."
        )
    return sidecar


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
