"""Files that a study names: measured data, points of shapes in them, and schedules."""

import csv
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, PlainSerializer, PlainValidator, WithJsonSchema

from equimorph.arrays import Float
from equimorph.errors import InputError
from equimorph.model import Schedule
from equimorph.storage import read_schedule
from equimorph.storage.files import fingerprint
from equimorph.structures import Structure
from equimorph.study.fields import LARGEST, Section, requirement
from equimorph.study.lookup import at_key, check_value
from equimorph.tasks.calibration.measurements import MeasuredShape

FOLDER = "folder"
"""In the context of validation: the folder from which names of files count."""
MOST_ROWS = 100_000
"""Of a table."""
POINT = ("s", "x", "y")
STATE, SIGMA = "state", "sigma"


class DataTable(Section):
    """Content of a CSV file: the answers of a study depend on it as on the study itself."""

    file: str
    columns: list[str]
    rows: list[list[float | None]]
    """Numbers; None where an entry is empty."""


def _read_data(given: Any, info: Any) -> Any:
    """Read the file of a name; `FOLDER` of the context is where the study file lies."""
    if not isinstance(given, str) or Path(given).name != given or not given.endswith(".csv"):
        raise requirement("be the name of a CSV file in the folder of the study file")
    folder = Path((info.context or {}).get(FOLDER, "."))
    try:
        text = (folder / given).read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        needed = f"be a readable file in the folder of the study file ({reason})"
        raise requirement(needed) from error
    lines = [(k, line) for k, line in enumerate(text.splitlines(), 1) if line.strip(" ,;\t")]
    lines = [(k, line) for k, line in lines if not line.startswith("#")]
    if not 2 <= len(lines) <= MOST_ROWS:
        raise requirement(f"hold a line of column names, and from 1 to {MOST_ROWS} of numbers")
    columns, *rows = ([cell.strip() for cell in cells] for cells in csv.reader(x for _, x in lines))
    if len(set(columns)) < len(columns) or "" in columns:
        raise requirement("give every column a different name in its first line")
    numbers = [_numbers(k, row, columns) for (k, _), row in zip(lines[1:], rows, strict=True)]
    return {"file": given, "columns": columns, "rows": numbers}


def _numbers(line: int, row: list[str], columns: list[str]) -> list[float | None]:
    if len(row) != len(columns):
        raise requirement(f"have {len(columns)} entries in each line (line {line} has {len(row)})")
    return [None if cell == "" else _number(cell, line) for cell in row]


def _number(cell: str, line: int) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = float("nan")
    if not abs(value) <= LARGEST:
        raise requirement(f"hold numbers up to {LARGEST:g} with a point (line {line}: {cell!r})")
    return value


DataFile = Annotated[
    DataTable,
    BeforeValidator(_read_data),
    WithJsonSchema({"type": "string", "pattern": r"\.csv$"}),
]
"""Name of a CSV file in a study, with its content."""


@dataclass(frozen=True, eq=False)
class ScheduleFile:
    """A schedule that was read from its files."""

    name: str
    """Of the table, as the study gives it."""
    schedule: Schedule
    """What it holds."""

    @property
    def fingerprint(self) -> str:
        """Of all that the file says: an edited file is another question."""
        mine = self.schedule
        return fingerprint(
            {
                "names": mine.names,
                "values": mine.values.tolist(),
                "way_points": mine.way_points.tolist(),
                "start": mine.start,
            }
        )


def _read_schedule_file(value: Any, info: Any) -> ScheduleFile:
    if not isinstance(value, str):
        raise requirement("be the name of a schedule's .csv file, in quotes")
    folder = Path((info.context or {}).get(FOLDER, "."))
    try:
        return ScheduleFile(value, read_schedule(folder / value))
    except (InputError, ValueError) as error:
        raise requirement(f"be the table of a schedule that can be read: {error}") from error


ScheduleName = Annotated[
    ScheduleFile,
    PlainValidator(_read_schedule_file),
    PlainSerializer(lambda file: {"schedule": file.fingerprint}),
    WithJsonSchema({"type": "string", "pattern": r"\.csv$"}),
]


@dataclass(frozen=True)
class Measured:
    """Measured shapes, and the nominal parameters of each."""

    shape: MeasuredShape
    parameters: tuple[Mapping[str, float], ...]
    count: int
    """Measured coordinates."""


def measured_shapes(structure: Structure, section: Any, key: str) -> Measured:
    """Shapes in the rows of a table: one row for each point, its columns s, x, y.

    Further columns are parameters, constant within a state; `state` distinguishes states with equal
    parameters; `sigma` is the standard deviation of a point. Refused for columns without meaning or
    missing, and rows that contradict each other.
    """
    columns = section.data.columns
    varied = _check_columns(structure, section, key)
    table = np.array(
        [[np.nan if x is None else x for x in row] for row in section.data.rows], dtype=float
    )
    column = dict(zip(columns, table.T, strict=True))
    _check_numbers(column, key)
    own = [name for name in (STATE, *varied) if name in column]
    groups = _groups(np.column_stack([np.zeros(len(table)), *(column[name] for name in own)]))
    if STATE in column and len(groups) > len(set(column[STATE].tolist())):
        raise InputError(f"`{key}.data` must have one value of each parameter in a state.")
    parameters = tuple(
        section.at | {n: x for n, x in zip(own, label[1:], strict=True) if n != STATE}
        for label in groups
    )
    _check_parameters(structure, parameters, key)
    shape = _shape(column, groups.values(), section.sigma, key)
    return Measured(shape, parameters, int(np.isfinite(np.asarray(shape.points)).sum()))


def _shape(
    column: Mapping[str, Float[np.ndarray, " rows"]],
    states: Collection[list[int]],
    sigma: float | None,
    key: str,
) -> MeasuredShape:
    """Points of all states at the same places, NaN where a state has no measurement."""
    places = np.unique(column["s"])
    points = np.full((len(states), len(places), 2), np.nan)
    deviations = np.ones(points.shape)
    for state, rows in enumerate(states):
        at = np.searchsorted(places, column["s"][rows])
        if len(set(at.tolist())) < len(at):
            raise InputError(f"`{key}.data` must give each s once in a state.")
        points[state, at] = np.stack([column["x"][rows], column["y"][rows]], axis=1)
        if SIGMA in column:
            deviations[state, at] = column[SIGMA][rows][:, None]
    return MeasuredShape(points, places.tolist(), deviations if SIGMA in column else sigma)


def _groups(labels: Float[np.ndarray, "rows some"]) -> dict[tuple[float, ...], list[int]]:
    """Rows of each state, in the order of the table."""
    groups: dict[tuple[float, ...], list[int]] = {}
    for row, label in enumerate(labels.tolist()):
        groups.setdefault(tuple(label), []).append(row)
    return groups


def _check_numbers(column: Mapping[str, Float[np.ndarray, " rows"]], key: str) -> None:
    """Refuse empty entries but of coordinates, and places and deviations without meaning."""
    for name, values in column.items():
        if name not in ("x", "y") and not np.isfinite(values).all():
            raise InputError(f"`{key}.data` must have a number in every row of {name}.")
    if not ((column["s"] >= 0.0) & (column["s"] <= 1.0)).all():
        raise InputError(f"`{key}.data` must have s from 0 to 1 along the structure.")
    if SIGMA in column and not (column[SIGMA] > 0.0).all():
        raise InputError(f"`{key}.data` must have a positive sigma in every row.")


def _check_columns(structure: Structure, section: Any, key: str) -> list[str]:
    """Columns that are parameters; refuse columns that are missing or mean nothing."""
    columns, names = section.data.columns, [each.name for each in structure.parameters]
    missing = [name for name in POINT if name not in columns]
    strange = [name for name in columns if name not in (*POINT, STATE, SIGMA, *names)]
    if missing or strange:
        raise InputError(
            f"`{key}.data` must have the columns s, x, y, and may have state, sigma and parameters "
            f"({', '.join(names)}); got {', '.join(columns)}."
        )
    twice = [name for name in columns if name in section.at]
    if twice or (SIGMA in columns and section.sigma is not None):
        both = ", ".join(twice) or SIGMA
        raise InputError(f"`{key}` must give {both} once; got it in the table, too.")
    return [name for name in columns if name in names]


def _check_parameters(
    structure: Structure, parameters: tuple[Mapping[str, float], ...], key: str
) -> None:
    given = set(parameters[0])
    known = {each.name for each in structure.parameters}
    needed = {each.name for each in structure.parameters if each.default is None}
    lacking, strange = sorted(needed - given), sorted(given - known)
    if strange:
        raise InputError(
            f"`{key}.at` must name parameters ({', '.join(sorted(known))}); got "
            f"{', '.join(strange)}."
        )
    if lacking:
        raise InputError(
            f"`{key}.at` must give every parameter that no column gives; {', '.join(lacking)} "
            "lacks a value."
        )
    with at_key(f"{key}.at"):
        for values in parameters:
            for name, value in values.items():
                check_value(structure, name, value)
