"""Maps over actuator settings as tables for people: one of the grid, one of the curves."""

import csv
import io
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from equimorph.storage.files import write_text
from equimorph.tasks import ActuatorMap


def write_map(amap: ActuatorMap, path: str | Path) -> tuple[Path, Path]:
    """Write the values of a map, setting by setting, and its curves, point by point.

    Parameters
    ----------
    amap
        The map.
    path
        Name of the table of the grid, ending in ``.csv``; that of the curves ends in
        ``-curves.csv``. A value that does not exist is left empty; "error"
        bounds that of a place along its grid line.

    Raises
    ------
    InputError
        If the files cannot be written.
    """
    table = Path(path)
    first, second = amap.grid.axes()
    settings = ((x, y) for x in first.tolist() for y in second.tolist())
    known = zip(amap.value.ravel().tolist(), amap.status.ravel().tolist(), strict=True)
    rows = (
        [repr(x), repr(y), _number(value), amap.kinds[status]]
        for (x, y), (value, status) in zip(settings, known, strict=True)
    )
    write_text(table, _csv([*amap.grid.names, "value", "status"], rows))
    points = (
        [str(k), curve.kind, repr(x), repr(y), _number(low), _number(high), f"{error:.1e}"]
        for k, curve in enumerate(amap.curves)
        for (x, y), (low, high), error in zip(
            curve.points.tolist(), curve.values.tolist(), curve.errors.tolist(), strict=True
        )
    )
    curves = table.with_name(f"{table.stem}-curves.csv")
    write_text(
        curves, _csv(["curve", "kind", *amap.grid.names, "lower", "higher", "error"], points)
    )
    return table, curves


def _number(value: float) -> str:
    """Shortest decimal that gives the number back exactly; nothing for none."""
    return repr(value) if np.isfinite(value) else ""


def _csv(header: list[str], rows: Iterable[list[str]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()
