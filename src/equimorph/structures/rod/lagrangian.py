"""What the Lagrangians of rods in the plane and in space have in common."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from equimorph.array_types import Float
from equimorph.structures.rod.discretisation import Mesh


@dataclass(frozen=True, eq=False)
class RodLagrangian(ABC):
    """Lagrangian of a rod in its unknowns and its *scalars* y = (multipliers, parameters, 1).

    Attributes
    ----------
    names
        Parameters.
    multipliers
        Number of supports that act against each other along an axis.
    held
        Whether the rotations of the ends are prescribed.
    quadratic
        Q of the part ½ yᵀ Q y.
    reaction
        Force of the support at A.
    origin
        Coordinates of end A, or of end B where `from_start` is False. Like all rows, they combine
        the scalars.
    """

    mesh: Mesh
    names: tuple[str, ...]
    multipliers: int
    held: tuple[bool, bool]
    quadratic: Float[np.ndarray, "scalars scalars"]
    reaction: Float[np.ndarray, "axes scalars"]
    origin: Float[np.ndarray, "axes scalars"]
    from_start: tuple[bool, ...]

    @property
    def scalars(self) -> int:
        """Number of multipliers and parameters, and 1 for the constant."""
        return self.multipliers + len(self.names) + 1

    @abstractmethod
    def map_scalars(
        self, names: Sequence[str], matrix: Float[np.ndarray, "scalars others"]
    ) -> Self:
        """The same rod in new parameters ``y``, of which its scalars are ``matrix @ y``."""
