"""Measured points of shapes, from the table that a study names."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from equimorph.errors import InputError
from equimorph.structures import Structure
from equimorph.study.lookup import at_key, check_value
from equimorph.tasks import MeasuredShape

POINT = ("s", "x", "y")
STATE, SIGMA = "state", "sigma"


@dataclass(frozen=True)
class Measured:
    """Measured shapes, and the nominal parameters of each."""

    shape: MeasuredShape
    parameters: tuple[Mapping[str, float], ...]
    count: int
    """Measured coordinates."""


def measured_shapes(structure: Structure, section: Any, key: str) -> Measured:
    """Shapes in the rows of a table: one row for each point, its columns s, x, y.

    Further columns are parameters, constant within a state; `state` distinguishes states with
    equal parameters; `sigma` is the standard deviation of a point.

    Raises
    ------
    InputError
        For columns without meaning or missing, and rows that contradict each other.
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
            raise InputError(f"`{key}.data` must have each s once in a state.")
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
