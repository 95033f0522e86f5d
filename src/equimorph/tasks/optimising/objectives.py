"""Objectives: scalars of states, or the largest of several smooth ones."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.model import Descriptor

Branches = tuple[Float[np.ndarray, "lanes m"], Float[np.ndarray, "lanes m"]]


@dataclass(frozen=True)
class Objective:
    """What is made small: a descriptor, or its negative.

    A maximum of smooth functions, like max |κ|, that is made small counts by its `branches`.
    """

    descriptor: Descriptor
    sign: float

    @property
    def kinked(self) -> bool:
        """Whether it may have kinks at its minima."""
        return self.sign > 0.0 and self.descriptor.branches is not None

    def values(self, z: Lanes, p: Parameters) -> Values:
        """Values to be made small."""
        return np.asarray(self.sign * self.descriptor.function(z, p))

    def branches(self, z: Lanes, p: Parameters) -> Branches:
        """Smooth functions whose largest it is, −∞ where there are fewer, and their places."""
        if self.kinked and self.descriptor.branches is not None:
            return self.descriptor.branches(z, p)
        value = self.values(z, p)[:, None]
        return value, np.zeros_like(value)


def matched(base: Branches, other: Branches) -> Float[np.ndarray, "lanes m"]:
    """Values of the other branches in the order of the first ones, by nearest places."""
    values, places = other
    there = np.where(np.isfinite(values), places, np.inf)
    gap = np.abs(np.where(np.isfinite(base[0]), base[1], 0.0)[:, :, None] - there[:, None])
    nearest = gap.argmin(axis=2)
    found = np.take_along_axis(values, nearest, axis=1)
    return np.where(np.isfinite(base[0]), found, -np.inf)
