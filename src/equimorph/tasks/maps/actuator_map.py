"""Maps over a grid of actuator settings: what they have in common, and how they are computed."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, Float, Int
from equimorph.equilibria.natural_sheet import NaturalSheet, natural_sheet
from equimorph.errors import InputError
from equimorph.model import (
    Constraint,
    Grid,
    Progress,
    Silent,
    Workers,
    cut_rows,
    map_rows,
    parameter_vector,
    position,
)
from equimorph.structures import State, States, Structure
from equimorph.tables import Table, Tabular, html_table, units_of
from equimorph.tasks.maps.causes import Paths
from equimorph.tasks.maps.curves import MapCurve, curves_through, edge_of_definition, places_on
from equimorph.tolerances import IN_BOX


@dataclass(frozen=True, eq=False)
class ActuatorMap(Tabular):
    """Values at the vertices of a grid of settings, and the curves on which they jump or bend."""

    kinds: ClassVar[tuple[str, ...]]

    structure: Structure
    grid: Grid
    load: str
    within: tuple[Constraint, ...]
    fixed: Mapping[str, float]
    """The arguments of the map."""
    value: Float[np.ndarray, "rows columns"]
    """Value at every vertex of the grid; NaN where the map is not defined."""
    status: Int[np.ndarray, "rows columns"]
    """Number in `kinds` of what happened on the path."""
    states: States
    """States at the ends of the paths, row by row; NaN where no path exists."""
    curves: tuple[MapCurve, ...]
    """Where the map is not smooth."""
    sheet: NaturalSheet
    """Unloaded states."""
    bound: float
    """Largest load, up to which paths are followed."""

    def __repr__(self) -> str:
        """Size, how many of each status, and the curves."""
        shape = " × ".join(map(str, self.value.shape))
        counts = ", ".join(f"{n} {kind}" for kind, n in self.counts.items() if n)
        name = type(self).__name__
        return f"{name}({shape} settings: {counts}; curves: {len(self.curves)})"

    def _repr_html_(self) -> str:
        """Table of grid, values and statuses, for notebooks."""
        box, units = self.grid.box, units_of(self.structure.parameters)
        sides = zip(box.names, box.lower, box.upper, strict=True)
        rows = [[name, f"{low:g} to {high:g} {units[name]}"] for name, low, high in sides]
        rows.append(["load", f"{self.load} ({units[self.load]})"])
        known = self.value[np.isfinite(self.value)]
        if known.size:
            rows.append(["values", f"{known.min():.6g} to {known.max():.6g}"])
        rows += [[kind, f"{count} settings"] for kind, count in self.counts.items() if count]
        rows.append(["curves", f"{len(self.curves)}"])
        shape = " × ".join(map(str, self.value.shape))
        return html_table(f"{type(self).__name__} of {shape} settings", [], rows)

    @property
    @abstractmethod
    def unit(self) -> str:
        """Unit of the values."""

    @property
    def table(self) -> Table:
        """Values with their statuses, setting by setting."""
        settings, _ = settings_of(self.grid)
        columns = dict(zip(self.grid.names, settings.T, strict=True))
        kinds = np.array(self.kinds)[self.status.ravel()]
        return Table({**columns, "value": self.value.ravel(), "status": kinds}, self._units)

    @property
    def curve_table(self) -> Table:
        """Points of the curves with the values on both sides.

        "error" bounds that of the place along its grid line.
        """
        counts = [len(each.points) for each in self.curves]
        numbers = np.repeat(np.arange(len(counts)), counts)
        names = np.array([each.kind for each in self.curves], dtype=object)
        points = np.concatenate([np.zeros((0, 2)), *(each.points for each in self.curves)])
        values = np.concatenate([np.zeros((0, 2)), *(each.values for each in self.curves)])
        errors = np.concatenate([np.zeros(0), *(each.errors for each in self.curves)])
        columns = dict(zip(self.grid.names, points.T, strict=True))
        sides = dict(zip(("lower", "higher"), values.T, strict=True))
        numbered = {"curve": numbers, "kind": names[numbers]}
        return Table({**numbered, **columns, **sides, "error": errors}, self._units)

    @property
    def _units(self) -> dict[str, str]:
        units = units_of(self.structure.parameters)
        values = dict.fromkeys(("value", "lower", "higher"), self.unit)
        return {**{name: units[name] for name in self.grid.names}, **values}

    @property
    def counts(self) -> dict[str, int]:
        """Settings of each status."""
        return {kind: int((self.status == k).sum()) for k, kind in enumerate(self.kinds)}

    @check_arguments
    def where(self, kind: str) -> Bool[np.ndarray, "rows columns"]:
        """Whether settings have a status, by its name."""
        return np.asarray(self.status == self.kinds.index(kind))

    @check_arguments
    def rest(self, setting: Mapping[str, float]) -> State:
        """Natural state at one setting of the grid's box.

        Raises
        ------
        InputError
            If names are not those of the grid, or the setting lies outside or has no natural state.
        """
        point = _point(self.grid, setting)[None]
        z, found = self.sheet.states(point)
        if not found[0]:
            raise InputError(
                f"`setting` must have a natural state; got {dict(setting)}, which has none."
            )
        return State(self.structure, z[0], self.sheet.parameters(point)[0])


@dataclass(frozen=True)
class Survey:
    """What a map knows of its grid: values, statuses and states at the vertices, and curves."""

    value: Float[np.ndarray, "rows columns"]
    status: Int[np.ndarray, "rows columns"]
    states: States
    curves: tuple[MapCurve, ...]


def survey(
    paths: Paths,
    grid: Grid,
    stage: str,
    progress: Progress | None,
    workers: Workers | None,
    near_curves: Paths | None = None,
) -> Survey:
    """Compute a map over a grid, and the curves on which it is not smooth.

    Paths are followed from the natural states at all vertices, by workers if there are any: all the
    rest is computed here, once. On edges over which the map jumps or bends the exact places are
    found, there by paths `near_curves` if they need other step control, and places of one kind are
    connected across the cells. `stage` is the name of the computation in progress reports.
    """
    sink = progress or Silent()
    settings, shape = settings_of(grid)
    cuts = cut_rows(len(settings), workers)
    steps = len(cuts) + 1
    sink.report(stage, 0, steps)
    follow = replace(paths, sheet=paths.sheet.without_states()).follow
    vertices = map_rows(
        follow, paths.natural_samples(settings), cuts, workers,
        lambda done: sink.report(stage, done, steps),
    )  # fmt: skip
    explained, unexplained = places_on(near_curves or paths, vertices, shape)
    edge = edge_of_definition(paths, settings, shape)
    curves = curves_through(paths.sheet, (explained, unexplained, edge), shape)
    sink.report(stage, steps, steps)
    states = States(paths.sheet.structure, vertices.z, vertices.p)
    return Survey(vertices.value.reshape(shape), vertices.kind.reshape(shape), states, curves)


def unloaded_base(
    structure: Structure, grid: Grid, load: str, fixed: Mapping[str, float]
) -> Float[np.ndarray, " parameters"]:
    """All parameters of the unloaded structure at the lower corner of a grid.

    Refused if the grid does not have two parameters, the load is one of them or fixed, or a name is
    unknown.
    """
    if len(grid.names) != 2:
        raise InputError(f"`grid` must have two parameters; got {', '.join(grid.names)}.")
    if load in grid.names or load in fixed:
        raise InputError(f"`load` must be neither in `grid` nor in `fixed`; got {load!r}.")
    position(structure.parameters, load)
    corner = dict(zip(grid.names, map(float, grid.box.lower), strict=True))
    return parameter_vector(structure.parameters, {**structure.unloaded(), **fixed, **corner})


def natural_states_over(
    structure: Structure, grid: Grid, load: str, fixed: Mapping[str, float] | None = None
) -> NaturalSheet:
    """Unloaded states over a grid; refused as by `unloaded_base`."""
    return natural_sheet(structure, grid, unloaded_base(structure, grid, load, fixed or {}))


def settings_of(grid: Grid) -> tuple[Float[np.ndarray, "settings 2"], tuple[int, int]]:
    """All vertices of a grid, row by row, and how many there are each way."""
    axes = grid.axes()
    settings = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    return settings, (len(axes[0]), len(axes[1]))


def _point(grid: Grid, setting: Mapping[str, float]) -> Float[np.ndarray, " 2"]:
    if set(setting) != set(grid.names):
        names = ", ".join(setting) or "nothing"
        raise InputError(f"`setting` must give {' and '.join(grid.names)}; got {names}.")
    point = np.array([float(setting[name]) for name in grid.names])
    if not grid.box.holds(point, slack=IN_BOX):
        raise InputError(f"`setting` must lie in {grid.box}; got {dict(setting)}.")
    return point
