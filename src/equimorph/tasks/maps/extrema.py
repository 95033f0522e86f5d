"""Where the extremum of a descriptor along the structure goes over to another place."""

import numpy as np
from jaxtyping import Bool, Int

from equimorph.arrays import Values
from equimorph.equilibria.critical import Critical
from equimorph.equilibria.locus import Test
from equimorph.model import Descriptor
from equimorph.tasks.maps.brackets import Brackets
from equimorph.tasks.maps.causes import Cause

ELSEWHERE = 0.02
"""Distance along a structure of two extrema that are not one that moves."""


def at_two_places(
    descriptor: Descriptor, pairs: Brackets, where: Bool[np.ndarray, " pairs"], second: Test
) -> list[Cause]:
    """Causes that the local extrema at the places of both ends are equal, and another test."""
    branches = descriptor.branches
    if branches is None:
        return []
    # the part after a whole number is the arclength
    places = np.stack([pairs.a.place, pairs.b.place], axis=1) % 2.0
    moved = where & (np.abs(places[:, 0] - places[:, 1]) > ELSEWHERE)

    def difference(lanes: Int[np.ndarray, " some"]) -> Test:
        def test(at: Critical) -> Values:
            values, found = branches(at.z, at.p)
            near = np.tile(here[lanes], (len(at.z) // len(lanes), 1))
            away = np.abs(found[:, None] - near[:, :, None])
            away = np.where(np.isfinite(values)[:, None], away, np.inf)
            one, other = np.take_along_axis(values, away.argmin(axis=2), 1).T
            return np.asarray((one - other) / np.maximum(np.abs(one) + np.abs(other), 1.0))

        return test

    here = places[moved]
    return [
        Cause.of("place", lambda lanes: (difference(lanes), second), moved, side)
        for side in (pairs.a, pairs.b)
    ]
