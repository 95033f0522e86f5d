"""Shapes: ``[[shape]]`` of descriptors; ``[[estimate]]``, ``[[calibration]]`` of measurements."""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import partial
from html import escape
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from equimorph import plotting
from equimorph.equilibria import lift
from equimorph.errors import InputError
from equimorph.model import parameter_vector
from equimorph.structures import States, Structure, from_identity
from equimorph.study import html
from equimorph.study.answers import (
    count_of,
    figures_of_states,
    free_columns,
    place_of,
    table_of_states,
)
from equimorph.study.data_files import DataFile, Measured, measured_shapes
from equimorph.study.fields import Point, Positive
from equimorph.study.lookup import at_key
from equimorph.study.question import Arguments, DataTable, Figure, Kind, Question, still
from equimorph.tables import Column, Table
from equimorph.tasks.calibration.calibrate import Calibration, calibrate
from equimorph.tasks.calibration.measurements import MeasuredShape
from equimorph.tasks.calibration.unknowns import Family, Kind as UnknownKind
from equimorph.tasks.estimation import StateEstimate, estimate_state
from equimorph.tasks.shapes.solutions import Shapes, solve_shape


class ShapeKind(Kind[Shapes]):
    """All settings at which the structure takes a shape."""

    table = "shape"
    tasks = (solve_shape,)

    def figures(self, question: Question, answer: Shapes) -> list[Figure]:
        """Where they lie."""
        return figures_of_states(question, answer.states)

    def words(self, question: Question, answer: Shapes) -> str:
        """How many there are."""
        stable, fitted = len(answer.stable), "" if answer.solved else f" {answer.why}"
        states = f"{len(answer)} states, {stable} of them stable"
        if len(answer) == 1:
            states = f"1 {'stable' if stable else 'unstable'} state"
        return f"**{answer.status}** by {states}{answer.left_out}.{fitted}"

    def details(self, question: Question, answer: Shapes) -> list[str]:
        """A table of them, with the way to each."""
        if not len(answer):
            return []
        shown = list(question["targets"])
        more = free_columns(answer.states, question.free, shown)
        if answer.routes:
            more["route"] = [
                f"length {html.number(route.length)}" if route.arrived else route.why
                for route in answer.routes
            ]
        return table_of_states(answer.states, shown, more)

    def refusal(self, question: Question, answer: Shapes) -> str:
        """Reason why there is none."""
        return "" if len(answer) else answer.why


class EstimateKind(Kind[StateEstimate]):
    """On which branch, and under which load, a measured structure is."""

    table = "estimate"
    tasks = (estimate_state,)

    def look_up_more(self, question: Question) -> None:
        """Every measured value needs its error."""
        section = question.section
        if set(section.measured) != set(section.errors):
            raise InputError(
                f"`{question.key}.errors` must give the standard error of each value of `measured` "
                f"({', '.join(section.measured)}); got {', '.join(section.errors)}."
            )

    def figures(self, question: Question, answer: StateEstimate) -> list[Figure]:
        """Where the candidates lie."""
        return figures_of_states(question, answer.states)

    def words(self, question: Question, answer: StateEstimate) -> str:
        """Name the best candidate."""
        where, weight = place_of(answer.state, question.free), html.number(answer.weight[0])
        return f"**{answer.status}**: {where} with weight {weight}. {answer.why}".rstrip()

    def details(self, question: Question, answer: StateEstimate) -> list[str]:
        """A table of the candidates."""
        shown = list(question["measured"])
        more = free_columns(answer.states, question.free, shown)
        for free, error in answer.standard_errors.items():
            more[f"± {free}"] = [html.number(value, 2) for value in error]
        more["χ²"] = [html.number(value) for value in answer.chi2]
        more["weight"] = [html.number(value) for value in answer.weight]
        return table_of_states(answer.states, shown, more) if len(answer.states) else []


@dataclass(frozen=True)
class Data:
    """What was measured, and what is unknown."""

    measured: Measured
    unknown: Mapping[str | tuple[str, ...], UnknownKind]
    family: Family | None


class CalibrationKind(Kind[Calibration]):
    """Parameters or data of the structure, fitted to measured shapes."""

    table = "calibration"
    tasks = (calibrate,)
    left_out = ("start", "unknown", "measured", "family")
    own = MappingProxyType(
        {
            "data": (DataFile, Field(description="CSV file with a row for each measured point.")),
            "unknown": (
                Annotated[dict[str, UnknownKind], Field(min_length=1)],
                Field(
                    description="Unknowns: `value`, `offset` or `gain` of a parameter, or `data`."
                ),
            ),
            "at": (
                Point,
                Field(default_factory=dict, description="Parameters that no column gives."),
            ),
            "sigma": (
                Positive | None,
                Field(default=None, description="Standard deviation of a coordinate."),
            ),
        }
    )

    def look_up_more(self, question: Question) -> Data:
        """Look up columns, parameters and data."""
        structure, section, key = question.structure, question.section, question.key
        measured = measured_shapes(structure, section, key)
        names = {each.name for each in structure.parameters}
        unknown: dict[str | tuple[str, ...], UnknownKind] = {}
        for text, kind in section.unknown.items():
            group = tuple(part.strip() for part in text.split(","))
            if kind != "data" and not set(group) <= names:
                raise InputError(
                    f"`{key}.unknown` must name parameters ({', '.join(sorted(names))}), or data "
                    f'of the structure as "data"; got {text}.'
                )
            unknown[text if len(group) == 1 else group] = kind
        if measured.count < len(unknown):
            raise InputError(
                f"`{key}.data` must hold at least as many coordinates as there are unknowns, "
                f"{len(unknown)}; got {measured.count}."
            )
        with at_key(f"{key}.unknown"):
            family = _family(structure, [text for text, kind in unknown.items() if kind == "data"])
        return Data(measured, unknown, family)

    def answer(self, question: Question, arguments: Arguments) -> Calibration:
        """Load the natural states as the measured ones, and fit from there."""
        data: Data = question.extra
        start = _natural_states(question.structure, data.measured)
        return calibrate(start, data.unknown, [data.measured.shape], family=data.family)

    def tables(self, question: Question, answer: Calibration) -> list[DataTable]:
        """Return the unknowns with their covariances; measured and fitted points side by side."""
        unknowns: dict[str, Column] = {"unknown": answer.names, "value": answer.values}
        unknowns["deviation"] = answer.deviations
        unknowns |= {
            f"covariance with {name}": column
            for name, column in zip(answer.names, answer.covariance.T, strict=True)
        }
        shape: MeasuredShape = question.extra.measured.shape
        points, s = (np.asarray(each, dtype=float) for each in (shape.points, shape.s))
        state, place = np.nonzero(np.isfinite(points).any(axis=2))
        compared: dict[str, Column] = {"state": state + 1, "s": s[place]}
        pairs = (("", points), ("fitted ", answer.states.shape(s)))
        axes = [f"{word}{axis}" for word, _ in pairs for axis in "xy"]
        compared |= dict(zip(axes, np.concatenate(
            [each[state, place] for _, each in pairs], axis=1).T, strict=True))  # fmt: skip
        units, files = dict.fromkeys(axes, answer.states.structure.length_unit), question.files
        return [
            DataTable(f"{files}.csv", "unknowns and covariances", Table(unknowns)),
            DataTable(f"{files}-points.csv", "measured and fitted", Table(compared, units)),
        ]

    def figures(self, question: Question, answer: Calibration) -> list[Figure]:
        """Measured points over the fitted shapes, and the residuals."""
        draw = partial(plotting.calibration, answer, question.extra.measured.shape)
        caption = "Measured points over the fitted shapes; below, fitted less measured coordinates."
        return [still(question.files, draw, caption)]

    def words(self, question: Question, answer: Calibration) -> str:
        """Values with their deviations, and how far the points are from the fit."""
        triples = zip(answer.names, answer.values, answer.deviations, strict=True)
        values = ", ".join(
            f"{name} = {html.number(x, 6)} ± {html.number(error, 2)}" for name, x, error in triples
        )
        data: Data = question.extra
        states = count_of(len(data.measured.parameters), "measured state")
        return (
            f"**fitted** to {data.measured.count} coordinates of {states} "
            f"({question.section.data.file}): {values}. {_scatter(data, answer)}"
        )

    def details(self, question: Question, answer: Calibration) -> list[str]:
        """Unknowns with their deviations and the covariances between them."""
        names = [escape(name) for name in answer.names]
        head = ["", "value", "±", *[f"cov. with {name}" for name in names]]
        columns = zip(names, answer.values, answer.deviations, answer.covariance, strict=True)
        rows = [
            [name, html.number(value, 7), html.number(error, 3), *[html.number(c, 3) for c in row]]
            for name, value, error, row in columns
        ]
        return [html.table(head, rows)]

    def refusal(self, question: Question, answer: Calibration) -> str:
        """Reason why no fit exists."""
        return "" if answer.fitted else f"{answer.status}: {answer.why}."


def _family(structure: Structure, paths: Sequence[str | tuple[str, ...]]) -> Family | None:
    """Structures that differ in data of the study, like ``EI`` or ``members.0.EI``."""
    if not paths:
        return None
    identity = structure.identity()

    def make(**data: float) -> Structure:
        changed = deepcopy(identity)
        for path, value in data.items():
            *way, last = _steps(path)
            inner: Any = changed
            for step in way:
                inner = inner[step]
            inner[last] = value
        return from_identity(changed)

    nominal = {str(path): _datum(identity, str(path)) for path in paths}
    return Family(make, nominal)


def _steps(path: str) -> list[Any]:
    return [int(part) if part.isdigit() else part for part in path.split(".")]


def _datum(identity: Mapping[str, Any], path: str) -> float:
    """Number at a place of the data of a structure."""
    inner: Any = identity
    try:
        for step in _steps(path):
            inner = inner[step]
    except (KeyError, IndexError, TypeError):
        inner = None
    if isinstance(inner, bool) or not isinstance(inner, int | float):
        numbers = [key for key, value in identity.items() if isinstance(value, float)]
        raise InputError(
            f"`data` must be a number that the study gives for the structure "
            f"({', '.join(numbers) or 'none'}); got {path}."
        )
    return float(inner)


def _natural_states(structure: Structure, measured: Measured) -> States:
    """Natural states under the loads of the measured ones."""
    unloaded = structure.unloaded()
    names = structure.parameters
    p = np.array([parameter_vector(names, {**x, **unloaded}) for x in measured.parameters])
    z, found = structure.natural(p)
    if not found.all():
        raise InputError(
            f"`at` must have a natural state; got none for state {np.flatnonzero(~found)[0] + 1}."
        )
    start = States(structure, z, p)
    to = {name: np.array([values[name] for values in measured.parameters]) for name in unloaded}
    to = {name: wanted for name, wanted in to.items() if (wanted != start[name]).any()}
    if not to:
        return start
    lifts = lift(start, to)
    short = np.flatnonzero(~lifts.arrived)
    if len(short):
        lane = int(short[0])
        reached = ", ".join(f"{name} = {html.number(lifts.states[name][lane])}" for name in to)
        raise InputError(
            f"`at` must be loads that the natural state carries; got state {lane + 1}, which ends "
            f"at {reached} ({lifts.kind[lane]})."
        )
    return lifts.states


def _scatter(data: Data, answer: Calibration) -> str:
    """How far the points are from the fit."""
    if data.measured.shape.sigma is not None:
        return f"χ² = {html.number(answer.chi_squared)} at {answer.freedom} degrees of freedom."
    spread = float(np.sqrt(np.mean(answer.residuals**2)))
    unit = answer.states.structure.length_unit
    return f"Root mean square residual: {html.number(spread)} {unit}."
