"""Schedules: parameters along a route, with what is needed to check and to execute it."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, Int


@dataclass(frozen=True)
class Schedule:
    """All parameters of a structure, step by step along a verified route.

    Parameters
    ----------
    names, roles, units
        Of the parameters, in the structure's order.
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
