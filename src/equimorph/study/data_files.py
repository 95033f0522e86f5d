"""Files that a study names: measured data and schedules, read together with the study."""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, PlainSerializer, PlainValidator

from equimorph.errors import InputError
from equimorph.model import Schedule
from equimorph.storage import read_schedule
from equimorph.storage.files import fingerprint
from equimorph.study.fields import LARGEST, Section, requirement

FOLDER = "folder"
"""In the context of validation: the folder from which names of files count."""
MOST_ROWS = 100_000
"""Of a table."""


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


DataFile = Annotated[DataTable, BeforeValidator(_read_data)]
"""Name of a CSV file in a study, with its content."""


@dataclass(frozen=True, eq=False)
class ScheduleFile:
    """A schedule that was read from its files.

    Parameters
    ----------
    name
        Of the table, as the study gives it.
    schedule
        What it holds.
    """

    name: str
    schedule: Schedule

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
]
