"""Ways over saddles: from which stable states to which others, and where none is met.

See docs/barriers.md.
"""

from enum import IntEnum

import numpy as np

from equimorph.array_types import Int
from equimorph.arrays import Values
from equimorph.equilibria.energy_barriers import Status
from equimorph.equilibria.gradient_flow import Ending


class Nowhere(IntEnum):
    """Instead of the number of a state: how a descent ended that met none that is known."""

    UNRESOLVED = -1
    """Where the discretisation does not represent states."""
    ESCAPED = -2
    """It left for infinity: no state stops it."""
    LOST = -3
    """A numerical failure."""
    BEYOND = -4
    """At a state that a set lacks, as one beyond its constraints."""

    @classmethod
    def of(cls, ending: Ending) -> "Nowhere":
        """Where a descent is that met no resolved state."""
        if ending in (Ending.LANDED, Ending.SADDLE):
            return cls.UNRESOLVED
        return cls.ESCAPED if ending == Ending.ESCAPED else cls.LOST

    @property
    def status(self) -> Status:
        """In words."""
        return STATUS[self]


STATUS: dict[Nowhere, Status] = {
    Nowhere.UNRESOLVED: "unresolved",
    Nowhere.ESCAPED: "escaped",
    Nowhere.LOST: "lost",
    Nowhere.BEYOND: "beyond the set",
}


def ways_over(
    saddles: Int[np.ndarray, " saddles"],
    ends: Int[np.ndarray, "saddles 2"],
    energy: Values,
) -> Int[np.ndarray, "ways 3"]:
    """Saddle, a minimum below it, and where it leads beyond, by the energy of the saddle.

    A descent that ends at another saddle, always a lower one, leads to all states below that one.
    Saddles that lead to the same state on both sides have no way over them.

    Parameters
    ----------
    saddles
        Numbers of states.
    ends
        Numbers of the states where the descents from each end, or a `Nowhere`.
    energy
        Of all states.
    """
    row = np.full(len(energy), -1)
    row[saddles] = np.arange(len(saddles))
    ways = np.column_stack([saddles, ends]).reshape(-1, 3)
    for column in (1, 2):
        while (inner := (ways[:, column] >= 0) & (row[ways[:, column]] >= 0)).any():
            below = np.repeat(ways[inner], 2, axis=0)
            below[:, column] = ends[row[ways[inner, column]]].ravel()
            ways = np.concatenate([ways[~inner], below])
    both = np.concatenate([ways, ways[:, [0, 2, 1]]])
    both = np.unique(both[(both[:, 1] >= 0) & (both[:, 1] != both[:, 2])], axis=0)
    # of several ways over a saddle those to states come first, the lowest of them at the front
    last = np.where(both[:, 2] >= 0, energy[both[:, 2]], np.inf)
    return np.asarray(both[np.lexsort((last, both[:, 1], both[:, 0], energy[both[:, 0]]))])
