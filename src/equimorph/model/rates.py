"""Limits on how fast parameters may change."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from equimorph.errors import InputError
from equimorph.model.schedule import Schedule


@dataclass(frozen=True)
class Rates:
    """Largest rates of parameters, in their units per unit of time: ``Rates({"Theta": 0.1})``.

    Parameters without a limit change as fast as they like.

    Raises
    ------
    InputError
        For limits that are not positive, or none.
    """

    limits: Mapping[str, float]

    def __post_init__(self) -> None:
        """Check the limits."""
        if not self.limits:
            raise InputError("`limits` must name at least one parameter; got none.")
        for name, limit in self.limits.items():
            if not (np.isfinite(limit) and limit > 0.0):
                raise InputError(f"`limits` must be positive; got {name}: {limit!r}.")

    def durations(
        self, names: tuple[str, ...], values: Float[np.ndarray, "steps parameters"]
    ) -> Float[np.ndarray, " pieces"]:
        """Least time between each two successive settings: that of the slowest parameter."""
        unknown = [name for name in self.limits if name not in names]
        if unknown:
            raise InputError(
                f"`limits` must name parameters ({', '.join(names)}); got {unknown[0]!r}."
            )
        at = [names.index(name) for name in self.limits]
        bounds = np.array(list(self.limits.values()), dtype=float)
        return np.asarray((np.abs(np.diff(values[:, at], axis=0)) / bounds).max(axis=1))

    def times(self, schedule: Schedule) -> Float[np.ndarray, " steps"]:
        """Earliest time of each step of a schedule, from zero on."""
        spent = self.durations(schedule.names, schedule.values)
        return np.concatenate([[0.0], np.cumsum(spent)])
