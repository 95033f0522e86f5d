"""The rates at which parameters may move."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from equimorph.argument_checks import check_arguments
from equimorph.errors import InputError


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
