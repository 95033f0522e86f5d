"""Schedules of actuators, and the rates at which they may move."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from equimorph.argument_checks import check_arguments
from equimorph.errors import InputError


@check_arguments
@dataclass(frozen=True)
class Schedule:
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

    def __repr__(self) -> str:
        """Parameters that change, number of steps and smallest margin."""
        moving = np.ptp(self.values, axis=0) > 0
        names = ", ".join(name for name, moves in zip(self.names, moving, strict=True) if moves)
        smallest = self.margins.min(initial=np.inf)
        return f"Schedule({names or 'at rest'}: {len(self.values)} steps; margin {smallest:.4g})"


@check_arguments
@dataclass(frozen=True)
class Rates:
    """Largest rates of parameters, in their units per unit of time: ``Rates({"Theta": 0.1})``.

    Parameters without a limit may change at any rate.

    Raises
    ------
    InputError
        If a limit is not positive, or there is none.
    """

    limits: Mapping[str, float]

    def __post_init__(self) -> None:
        """Check the limits."""
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

    @check_arguments
    def times(self, schedule: Schedule) -> Float[np.ndarray, " steps"]:
        """Earliest time of each step of a schedule, from zero on."""
        spent = self.durations(schedule.names, schedule.values)
        return np.concatenate([[0.0], np.cumsum(spent)])
