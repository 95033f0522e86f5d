"""Rates at which parameters may move, and schedules of actuators."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol, runtime_checkable

import numpy as np
from scipy.interpolate import BPoly

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, Float, Int
from equimorph.errors import InputError, MissingError
from equimorph.tables import Table, Tabular, heading


@runtime_checkable
class Steps(Protocol):
    """What the rates ask of a schedule."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""

    @property
    def values(self) -> Float[np.ndarray, "steps parameters"]:
        """Parameters at each step."""


@check_arguments
@dataclass(frozen=True)
class Rates:
    """Largest rates of parameters, in their units per unit of time: ``Rates({"Theta": 0.1})``.

    Parameters without a limit may change at any rate.

    Parameters
    ----------
    limits
        Largest rates by name.
    accelerations, jerks
        Largest changes of the rates per unit of time, and of these, by name; those of `limits` that
        are left out are not limited. They count in `retime`; jerks need accelerations.

    Raises
    ------
    InputError
        If a limit is not positive, there is none, or a parameter has an acceleration without a
        rate, or a jerk without an acceleration.
    """

    limits: Mapping[str, float]
    accelerations: Mapping[str, float] = field(default_factory=dict)
    jerks: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the limits."""
        pairs = (("accelerations", "limits"), ("jerks", "accelerations"))
        for upper, lower in pairs:
            for name in getattr(self, upper):
                if name not in getattr(self, lower):
                    raise InputError(
                        f"`{upper}` must be of parameters with {lower}, too; got {name} without."
                    )
        if not self.limits:
            raise InputError("`limits` must name at least one parameter; got none.")
        for name, limit in self.limits.items():
            if not (np.isfinite(limit) and limit > 0.0):
                raise InputError(f"`limits` must be positive; got {name}: {limit!r}.")

    @check_arguments
    def durations(
        self, names: tuple[str, ...], values: Float[np.ndarray, "steps parameters"]
    ) -> Float[np.ndarray, " pieces"]:
        """Shortest time between successive settings, as the slowest parameter determines it."""
        unknown = [name for name in self.limits if name not in names]
        if unknown:
            raise InputError(
                f"`limits` must name parameters ({', '.join(names)}); got {unknown[0]!r}."
            )
        at = [names.index(name) for name in self.limits]
        bounds = np.array(list(self.limits.values()), dtype=float)
        return np.asarray((np.abs(np.diff(values[:, at], axis=0)) / bounds).max(axis=1))

    def check_covers(self, moving: tuple[str, ...]) -> None:
        """Refuse parameters that move without a limit: they would jump.

        Raises
        ------
        InputError
            With its name.
        """
        for name in moving:
            if name not in self.limits:
                raise InputError(
                    f"`rates` must limit every parameter that moves; got none for {name}."
                )

    @check_arguments
    def times(self, schedule: Steps) -> Float[np.ndarray, " steps"]:
        """Earliest time of each step of a schedule, from zero on."""
        spent = self.durations(schedule.names, schedule.values)
        return np.concatenate([[0.0], np.cumsum(spent)])


PROGRESS, MARGIN, TIME = "progress", "stability_margin", "time"
"""Columns of tables beside parameters and descriptors."""
DERIVATIVES = (("velocities", "rate", ""), ("accelerations", "acceleration", "²"))
"""Fields of a schedule, how their columns are called, and the power of the time in their units."""


Shown = tuple[str, str]
"""What a column shows: "parameter", "descriptor" or a field of `DERIVATIVES`; and of what, by
name."""


def columns_of(
    parameters: Mapping[str, str], descriptors: Mapping[str, str], time_unit: str
) -> dict[Shown, tuple[str, str]]:
    """Names and units of the columns of a schedule's table by what they show.

    No two have the same name or head, whatever the parameters and descriptors, given with their
    units, are called: that of a descriptor F beside a parameter F is ``F (descriptor)``.
    """
    taken = {TIME, heading(TIME, time_unit), PROGRESS, MARGIN}
    columns: dict[Shown, tuple[str, str]] = {}

    def add(shown: Shown, name: str, unit: str, kind: str) -> None:
        while name in taken or heading(name, unit) in taken:
            name = f"{name} ({kind})"
        taken.update((name, heading(name, unit)))
        columns[shown] = name, unit

    for name, unit in parameters.items():
        add(("parameter", name), name, unit, "parameter")
    for key, word, power in DERIVATIVES:
        for name, unit in parameters.items():
            add((key, name), f"{name} {word}", f"{unit or '1'}/{time_unit}{power}", word)
    for name, unit in descriptors.items():
        add(("descriptor", name), name, unit, "descriptor")
    return columns


Instants = float | Float[np.ndarray, "*instants"]


@check_arguments
@dataclass(frozen=True)
class Schedule(Tabular):
    """All parameters of a structure, step by step along a verified route.

    Parameters
    ----------
    names, roles, units
        Names, roles and units of the parameters, in the structure's order.
    values
        Parameters at each step, in their units.
    progress
        Share of the route's length (metric of the structure and scaled parameters), 0 … 1.
    margins
        Stability margin at each step, in the structure's metric.
    descriptors
        Values of descriptors at each step, by name.
    start
        ``{"structure": identity, "unknowns": z}`` of the first state: the parameters alone do not
        determine it. The identity is None for a structure that no file can hold (a callable load).
    way_points
        Steps at the corners of the route.
    times
        Time of each step, from 0 on; None: a schedule without times says nothing of speed.
    velocities, accelerations
        Of all parameters at each step, for schedules that are smooth in time.
    time_unit
        "s" for structures with units; for rods without, T = √(m L/λ_cr) with their mass m, length
        L and λ_cr = 4π²B/L².
    descriptor_units
        Units of the descriptors, by name; those that are left out have none.
    """

    names: tuple[str, ...]
    roles: tuple[str, ...]
    units: tuple[str, ...]
    values: Float[np.ndarray, "steps parameters"]
    progress: Float[np.ndarray, " steps"]
    margins: Float[np.ndarray, " steps"]
    descriptors: dict[str, Float[np.ndarray, " steps"]]
    start: dict[str, Any]
    way_points: Int[np.ndarray, " corners"] = field(default_factory=lambda: np.zeros(0, int))
    times: Float[np.ndarray, " steps"] | None = None
    velocities: Float[np.ndarray, "steps parameters"] | None = None
    accelerations: Float[np.ndarray, "steps parameters"] | None = None
    time_unit: str = "T"
    descriptor_units: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the times."""
        if self.times is None:
            if self.velocities is not None or self.accelerations is not None:
                raise InputError("`times` must be given with velocities; got none.")
            return
        if self.velocities is None and self.accelerations is not None:
            raise InputError("`velocities` must be given with accelerations; got none.")
        if self.times[0] != 0.0 or not (np.diff(self.times) > 0.0).all():
            raise InputError(
                f"`times` must begin with 0 and increase; got {self.times[:3].tolist()} …."
            )

    @property
    def parameters(self) -> dict[str, Float[np.ndarray, " steps"]]:
        """Values of all parameters by name, one at each step."""
        return dict(zip(self.names, self.values.T, strict=True))

    @property
    def moving(self) -> tuple[str, ...]:
        """Names of the parameters that change."""
        moves = np.ptp(self.values, axis=0) > 0.0
        return tuple(name for name, moved in zip(self.names, moves, strict=True) if moved)

    @property
    def duration(self) -> float:
        """Time of the last step, in `time_unit`.

        Raises
        ------
        InputError
            If the schedule has no times.
        """
        return float(self._timed()[-1])

    @property
    def table(self) -> Table:
        """Time, progress, parameters, margin, descriptors, and rates of what moves, step by step.

        Rates and accelerations are there if the schedule has them.
        """
        named = columns_of(
            dict(zip(self.names, self.units, strict=True)),
            {name: self.descriptor_units.get(name, "") for name in self.descriptors},
            self.time_unit,
        )
        columns = {} if self.times is None else {TIME: self.times}
        columns[PROGRESS] = self.progress
        columns |= {named["parameter", name][0]: each for name, each in self.parameters.items()}
        columns[MARGIN] = self.margins
        columns |= {named["descriptor", name][0]: each for name, each in self.descriptors.items()}
        for key, *_ in DERIVATIVES:
            rates = getattr(self, key)
            for k, name in enumerate(self.names):
                if rates is not None and name in self.moving:
                    columns[named[key, name][0]] = rates[:, k]
        units = {TIME: self.time_unit, **dict(named.values())}
        return Table(columns, units)

    @check_arguments
    def in_time(self, rates: Rates | None = None, *, duration: float | None = None) -> "Schedule":
        """The same steps with times, between which the parameters change at constant rates.

        Parameters
        ----------
        rates
            Largest rates; at every instant one of the parameters moves at its own.
        duration
            Time of the whole schedule instead; the way in the scaled parameters of `progress` is
            then travelled at one speed.

        Raises
        ------
        InputError
            If neither or both are given, or `rates` does not limit a parameter that moves.
        """
        if (rates is None) == (duration is None):
            raise InputError("`rates` or `duration` must be given, one of them; got both or none.")
        if rates is None:
            times = self.progress * duration
        else:
            rates.check_covers(self.moving)
            times = rates.times(self)
        keep = np.concatenate([[True], np.diff(times) > 0.0])
        return replace(self._steps(keep), times=times[keep], velocities=None, accelerations=None)

    def _steps(self, keep: Bool[np.ndarray, " steps"]) -> "Schedule":
        """Some steps of the schedule."""
        number = np.cumsum(keep) - 1
        return replace(
            self,
            values=self.values[keep],
            progress=self.progress[keep],
            margins=self.margins[keep],
            descriptors={name: each[keep] for name, each in self.descriptors.items()},
            way_points=np.unique(number[self.way_points]),
        )

    def _timed(self) -> Float[np.ndarray, " steps"]:
        if self.times is None:
            raise MissingError(
                "`schedule` must have times; got one without. Give it a duration, like "
                "schedule.in_time(Rates({...})), schedule.in_time(duration=10.0) or "
                "speed_limit(schedule, tolerance=0.01).schedule."
            )
        return self.times

    @check_arguments
    def at(self, t: Instants) -> Float[np.ndarray, "*instants parameters"]:
        """All parameters at instants, in the order of `names`; at rest before 0 and after the end.

        Between the steps they change at constant rates or, if the schedule has velocities, as the
        cubic polynomials with these, or with accelerations the quintic ones: the interpolation that
        controllers of the ROS 2 message JointTrajectory do.

        Parameters
        ----------
        t
            One instant or many, in `time_unit`.

        Raises
        ------
        InputError
            If the schedule has no times.
        """
        return np.asarray(self._curve(np.clip(t, 0.0, self.duration)))

    @check_arguments
    def velocity(self, t: Instants) -> Float[np.ndarray, "*instants parameters"]:
        """Rates of all parameters at instants, as for `at`; after a corner those that follow it.

        Raises
        ------
        InputError
            If the schedule has no times.
        """
        moving = (np.asarray(t) >= 0.0) & (np.asarray(t) < self.duration)
        return np.asarray(self._velocity(np.clip(t, 0.0, self.duration)) * moving[..., None])

    @cached_property
    def _curve(self) -> BPoly:
        """Parameters as a piecewise polynomial of time."""
        orders = (self.values, self.velocities, self.accelerations)
        given = np.stack([each for each in orders if each is not None], axis=1)
        times = self._timed()
        if len(times) == 1:  # a schedule at rest
            times, given = np.array([0.0, 1.0]), np.concatenate([given, given])
        return BPoly.from_derivatives(times, given)

    @cached_property
    def _velocity(self) -> BPoly:
        return self._curve.derivative()

    def __repr__(self) -> str:
        """Parameters that change, number of steps and smallest margin."""
        smallest = self.margins.min(initial=np.inf)
        time = "" if self.times is None else f" in {self.duration:.4g} {self.time_unit}"
        return (
            f"Schedule({', '.join(self.moving) or 'at rest'}: {len(self.values)} steps{time}; "
            f"margin {smallest:.4g})"
        )
