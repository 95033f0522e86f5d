"""Discretisation errors of rods, by solving again with a higher degree."""

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Lanes, Parameters, Values
from equimorph.structures.rod.discretisation import error_by_refinement
from equimorph.structures.rod.mechanics import RodMechanics

SAMPLES = np.linspace(0.0, 1.0, 25)
"""Arclengths at which fields are compared."""

Rod = TypeVar("Rod", bound=RodMechanics)
Compared = Float[np.ndarray, "lanes compared"]


def discretisation_error(
    rod: Rod,
    finer: Rod,
    compared: Callable[[Rod, Lanes, Parameters], Compared],
    z: Lanes,
    p: Parameters,
) -> Values:
    """Twice the largest change of what is compared after Newton on a finer rod."""
    still, one, none = np.zeros((len(z), finer.size)), np.ones(len(z)), np.zeros(len(z))

    def correction(at: Lanes) -> Lanes:
        return finer.advance(at, p, np.zeros_like(p), still, one, none).dz

    def change(at: Lanes) -> Values:
        return np.asarray(np.abs(compared(finer, at, p) - compared(rod, z, p)).max(axis=1))

    return error_by_refinement(rod.guess_for(finer, z, p), correction, change)
