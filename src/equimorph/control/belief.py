"""What a controller believes."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from equimorph.arrays import Float
from equimorph.structures import State

Loads = Float[np.ndarray, " k"]
Covariance = Float[np.ndarray, "k k"]


class ControlStatus(StrEnum):
    """What a controller does, or why it does not go on."""

    FOLLOWING = "following"
    """It follows its route."""
    REPLANNED = "replanned"
    """The route was no longer safe under the estimated loads; another one is."""
    RETREATING = "retreating"
    """It leaves a place that is not safe under the estimated loads."""
    ARRIVED = "arrived"
    """The structure is in the state of the goal, or at the last values of a moving target."""
    NO_SAFE_WAY = "no safe way"
    """It stands: no route that was found is safe under the estimated loads."""
    NOT_EXPLAINED = "not explained"
    """It stands: no stable state of the set explains what was measured."""


@dataclass(frozen=True)
class Belief:
    """What a controller believes and commands; it changes by steps of the controller only.

    Parameters
    ----------
    state
        Estimated state at the commanded actuators and the estimated loads.
    covariance
        Covariance of the unknown loads, in the order of the controller's `unknown` (k, k).
    way_points
        Actuators that the rest of the route passes, the goal's last.
    checked
        Loads under which the whole rest of the route was found to be safe (k).
    status, why
        What the controller does, and the reason where it stands.
    surprise
        χ² of the last measurement under the belief before it, as a probability: small values are
        surprises.
    at
        Legs of a moving target that were followed.
    """

    state: State
    covariance: Covariance
    way_points: tuple[Mapping[str, float], ...]
    checked: Loads
    status: ControlStatus
    why: str = ""
    surprise: float = 1.0
    at: float = 0.0

    def __repr__(self) -> str:
        """Status and estimated state."""
        why = f": {self.why}" if self.why else ""
        return f"Belief({self.status}{why}; {self.state})"
