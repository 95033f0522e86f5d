"""Calibration: ``[[calibration]]``."""

import csv
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape as plain

from equimorph import plotting
from equimorph.equilibria import lift
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Progress, parameter_vector
from equimorph.structures import States, Structure, from_identity
from equimorph.study import html
from equimorph.study.kinds.found import heading
from equimorph.study.kinds.kind import Figure, Kind, still
from equimorph.study.kinds.shape_data import Measured, measured_shapes
from equimorph.study.lookup import Ground, at_key
from equimorph.study.names import task_files
from equimorph.study.sections.tasks import CalibrationSection
from equimorph.tasks import Calibration, Family, MeasuredShape, calibrate
from equimorph.tasks.calibration.unknowns import Kind as UnknownKind


@dataclass(frozen=True)
class CalibrationTask:
    """What was measured and what is unknown, with the names looked up."""

    key: str
    section: CalibrationSection
    measured: Measured
    unknown: Mapping[str | tuple[str, ...], UnknownKind]
    family: Family | None

    @property
    def shape(self) -> MeasuredShape:
        """The measured points."""
        return self.measured.shape


class CalibrationKind(Kind[CalibrationSection, CalibrationTask, Calibration]):
    """Parameters or data of the structure, fitted to measured shapes."""

    table = "calibration"

    def prepared(self, ground: Ground, section: CalibrationSection, key: str) -> CalibrationTask:
        """Look up columns, parameters and data."""
        structure = ground.structure
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
        return CalibrationTask(key, section, measured, unknown, family)

    def answer(
        self, ground: Ground, eset: EquilibriumSet | None, task: CalibrationTask, sink: Progress
    ) -> Calibration:
        """Load the natural states as the measured ones, and fit from there."""
        with at_key(task.key):
            start = _loaded(ground.structure, task.measured)
            return calibrate(start, task.unknown, [task.shape], family=task.family)

    def write_tables(self, task: CalibrationTask, answer: Calibration, folder: Path) -> None:
        """Write the unknowns with their covariances; measured and fitted points side by side."""
        head = ["unknown", "value", "deviation", *[f"covariance with {x}" for x in answer.names]]
        columns = zip(
            answer.names, answer.values, answer.deviations, answer.covariance, strict=True
        )
        rows = [[name, *map(_entry, [x, error, *row])] for name, x, error, row in columns]
        _write(folder / f"{_files(task)}.csv", [head, *rows])
        points = np.asarray(task.shape.points, dtype=float)
        fitted = answer.states.shape(np.asarray(task.shape.s, dtype=float))
        rows = [["state", "s", "x", "y", "fitted x", "fitted y"]]
        for state, (given, found) in enumerate(zip(points, fitted, strict=True), 1):
            for s, here, there in zip(task.shape.s or (), given, found, strict=True):
                if np.isfinite(here).any():
                    rows.append([str(state), *map(_entry, [s, *here, *there])])
        _write(folder / f"{_files(task)}-points.csv", rows)

    def figures(
        self,
        ground: Ground,
        eset: EquilibriumSet | None,
        task: CalibrationTask,
        answer: Calibration,
    ) -> Sequence[Figure]:
        """Measured points over the fitted shapes, and what is left over."""
        return [still(_files(task), partial(plotting.calibration, answer, task.shape))]

    def report(self, task: CalibrationTask, answer: Calibration, folder: Path) -> list[str]:
        """Values with deviations and correlations."""
        files, data = _files(task), task.section.data.file
        states = len(task.measured.parameters)
        words = (
            html.refused(f"{answer.status}: {answer.why}.")
            if not answer.fitted
            else f'<p class="verdict"><strong>Fitted</strong> to {task.measured.count} coordinates '
            f"of {states} measured {'state' if states == 1 else 'states'} ({escape(data)}). "
            f"{_scatter(task, answer)}</p>"
        )
        caption = "Measured points over the fitted shapes; below, fitted less measured coordinates."
        return [
            heading(self.table, task.section.name),
            words,
            _table(answer),
            f'<div class="figures">{html.still(folder, files, caption)}</div>',
            f'<p>Tables: <a href="{files}.csv">{files}.csv</a> (unknowns and covariances) and '
            f'<a href="{files}-points.csv">{files}-points.csv</a> (measured and fitted).</p>',
        ]

    def verdict(self, task: CalibrationTask, answer: Calibration) -> str:
        """Values with their deviations, or why there are none."""
        head = f"Calibration {task.section.name}"
        if not answer.fitted:
            return f"{head}: [bold red]{answer.status}[/]. {plain(answer.why)}"
        triples = zip(answer.names, answer.values, answer.deviations, strict=True)
        values = ", ".join(
            f"{plain(name)} = {html.number(x, 6)} ± {html.number(error, 2)}"
            for name, x, error in triples
        )
        return f"{head}: [bold green]fitted[/], {values}."


def _files(task: CalibrationTask) -> str:
    return task_files(CalibrationKind.table, task.section.name)


def _entry(value: float) -> str:
    return repr(float(value)) if np.isfinite(value) else ""


def _write(path: Path, rows: Sequence[Sequence[str]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


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


def _loaded(structure: Structure, measured: Measured) -> States:
    """Natural states under the loads of the measured ones."""
    unloaded = structure.unloaded()
    names = structure.parameters
    p = np.array([parameter_vector(names, {**x, **unloaded}) for x in measured.parameters])
    z, found = structure.natural(p)
    if not found.all():
        raise InputError(
            f"`at` must have a natural state; got state {np.flatnonzero(~found)[0] + 1} without."
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


def _scatter(task: CalibrationTask, answer: Calibration) -> str:
    """How far the points are from the fit."""
    if task.shape.sigma is not None:
        return f"χ² = {html.number(answer.chi_squared)} at {answer.freedom} degrees of freedom."
    spread = float(np.sqrt(np.mean(answer.residuals**2)))
    unit = answer.states.structure.length_unit
    return f"Root mean square left over: {html.number(spread)} {escape(unit)}."


def _table(answer: Calibration) -> str:
    """Unknowns with their deviations and the covariances between them."""
    names = [escape(name) for name in answer.names]
    head = ["", "value", "±", *[f"cov. with {name}" for name in names]]
    rows = [
        [name, html.number(value, 7), html.number(error, 3), *[html.number(c, 3) for c in row]]
        for name, value, error, row in zip(
            names, answer.values, answer.deviations, answer.covariance, strict=True
        )
    ]
    return html.table(head, rows)
