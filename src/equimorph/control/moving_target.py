"""Values of descriptors that move: where the actuators meet them under the estimated loads."""

from dataclasses import dataclass

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Values
from equimorph.control.likely import Places
from equimorph.model import Descriptor
from equimorph.structures import State
from equimorph.tasks.motion.course import correct_onto_targets
from equimorph.tasks.motion.tracking import Tracking


@dataclass(frozen=True)
class MovingTarget:
    """Targets by the legs of a motion, as `track` followed them at nominal loads.

    Parameters
    ----------
    descriptors
        What has targets.
    at
        Legs that are done.
    values
        Targets there.
    actuators
        Places of the actuators.
    """

    descriptors: tuple[Descriptor, ...]
    at: Values
    values: Float[np.ndarray, "n m"]
    actuators: Places

    @classmethod
    def of(cls, followed: Tracking, actuators: Places) -> "MovingTarget":
        """The targets of a motion."""
        values = np.stack([each(followed.states) for each in followed.targets], axis=1)
        return cls(followed.targets, followed.path.at, values, actuators)

    @property
    def duration(self) -> float:
        """Number of legs."""
        return float(self.at[-1])

    def place(self, state: State, at: float) -> Float[np.ndarray, " d"] | None:
        """Actuators nearest to those of a state that meet the targets; None if none are found."""
        wanted = np.array([np.interp(at, self.at, column) for column in self.values.T])
        found = correct_onto_targets(
            state.structure, state.z[None], state.p[None], self.actuators, self.descriptors,
            wanted[None],
        )  # fmt: skip
        return found.p[0, self.actuators] if found.found[0] else None
