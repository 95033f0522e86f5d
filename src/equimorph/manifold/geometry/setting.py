"""What is lifted: the structure, its free parameters, and the constraints that bound the set."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from equimorph.model import Constraint
from equimorph.structures import Structure


@dataclass(frozen=True)
class Setting:
    """The structure and how points of the box become its parameters."""

    structure: Structure
    base: Float[np.ndarray, " parameters"]
    free: Int[np.ndarray, " d"]
    constraints: tuple[Constraint, ...]

    def parameters(self, points: Float[np.ndarray, "some d"]) -> Float[np.ndarray, "some P"]:
        """All parameters over points of the box."""
        p = np.tile(self.base, (len(points), 1))
        p[:, self.free] = points
        return p

    @property
    def scales(self) -> Float[np.ndarray, " d"]:
        """Scales of the free parameters."""
        return np.asarray(self.structure.scales[self.free])

    @property
    def limits(self) -> Float[np.ndarray, "2 d"]:
        """Open limits of the meaning of the free parameters."""
        chosen = [self.structure.parameters[k] for k in self.free]
        return np.array([[each.lower for each in chosen], [each.upper for each in chosen]])
