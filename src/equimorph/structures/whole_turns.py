"""Whole turns of a structure: those that nothing resists, and those that springs alone resist.

What nothing keeps from turning may turn over and over: a rod between pins, a member hinged at both
ends, a hinge in space. Every state has copies then, which are no states that a search lacks.

See docs/decisions.md, "States that differ by whole turns are one to a search".
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Bool, Float, Lanes
from equimorph.linalg.dense import multiply

ASIDE = 0.03
"""By how much more than half a turn back is taken, in turns: symmetric states have turned by whole
quarters, and round-off is not to choose between two copies of them."""


@dataclass(frozen=True, eq=False)
class WholeTurns:
    """Changes of z by whole turns.

    free: after which a state is the same. sprung: that springs alone resist, so that states may be
    near.
    """

    free: Float[np.ndarray, "free size"]
    sprung: Float[np.ndarray, "sprung size"]

    @classmethod
    def of_parts(
        cls,
        parts: Bool[np.ndarray, "parts unknowns"],
        sprung: Bool[np.ndarray, " parts"],
        size: int,
    ) -> "WholeTurns":
        """Turns by 2π of the angles of parts that no support holds, some of them by springs."""
        turns = np.zeros((len(parts), size))
        turns[:, : parts.shape[1]] = 2.0 * np.pi * parts
        return cls(turns[~sprung], turns[sprung])

    @classmethod
    def none(cls, size: int) -> "WholeTurns":
        """Nothing turns."""
        return cls(*np.zeros((2, 0, size)))

    def taken_back(self, z: Lanes) -> Lanes:
        """The same states, turned by about half a turn at most, on an average over what turns."""
        if len(self.free) == 0:
            return z
        turned = multiply(z, (self.free / (self.free**2).sum(axis=1, keepdims=True)).T)
        return np.asarray(z - multiply(np.floor(turned + 0.5 + ASIDE), self.free))
