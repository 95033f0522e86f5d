"""States at which tests vanish: cusps, branch points, bounds that are touched."""

from collections.abc import Callable, Sequence

import numpy as np

from equimorph.array_types import Int
from equimorph.arrays import Lanes, Parameters
from equimorph.equilibria.critical import Test
from equimorph.equilibria.point_conditions import Directions, Vanishing
from equimorph.equilibria.settle import Guards, Settled, settle
from equimorph.structures import Structure

TestsOf = Callable[[Int[np.ndarray, " some"]], Sequence[Test]]
"""Tests of some lanes, by their numbers: as many as parameters vary."""
NEARBY = Guards(iterations=10, longest=np.inf, too_long=0.5, converged=1e-9)
"""The guesses are close: longer corrections, in the metric, lead elsewhere."""
TEST_DIFFERENCE = 1e-6
"""Step of differences of tests, in the metric: it sets the rate of Newton, not the error."""


def correct_singular_states(
    structure: Structure, z: Lanes, p: Parameters, directions: Directions, tests: TestsOf
) -> Settled:
    """States near guesses at which as many tests vanish as parameters vary.

    Newton's method on F = 0 and the tests, in a basis of the kernel of [F_z F_p] that is regular at
    folds, branch points and cusps.

    Parameters
    ----------
    structure
        The structure.
    z, p
        Guesses.
    directions
        Changes of the parameters that vary, for each lane, orthonormal in their scales.
    tests
        Tests that vanish on the lanes with given numbers; see
        `equimorph.equilibria.critical_tests`.
    """
    vanishing = Vanishing(tests, np.arange(len(z)), TEST_DIFFERENCE, one_sided=True, at_null=True)
    return settle(structure, z, p, directions, [vanishing], NEARBY)
