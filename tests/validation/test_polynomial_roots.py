"""Random quartic energies of one to six unknowns against all real roots of their gradients.

The roots come from a homotopy along all 3ⁿ complex paths, which shares nothing with the package.
"""

import numpy as np
import pytest

from equimorph.equilibria import search_points
from oracles.homotopy import real_roots
from oracles.quartics import Quartic, quartic_structure
from typecheck import unchecked


def compare(unknowns, count, seed):
    """Every equilibrium is found, with every argument in place, and nothing else.

    1e-6: far below the distance of roots, far above what Newton leaves.
    """
    generator = np.random.default_rng([unknowns, seed])
    compare_each(unknowns, [Quartic.random(unknowns, generator) for _ in range(count)])


def compare_each(unknowns, energies):
    with unchecked():
        structure = quartic_structure(unknowns)
        every = search_points(structure, np.array([each.values for each in energies]))
    for energy, found in zip(energies, every, strict=True):
        roots, lost = real_roots(energy, unknowns)
        assert lost == 0
        assert len(found) == len(roots)
        gap = np.linalg.norm(found.z[:, None] - roots[None], axis=2)
        assert gap.min(axis=0).max() < 1e-6
        curvature = np.linalg.eigvalsh(energy(found.z.astype(complex))[1].real)
        np.testing.assert_array_equal(found.index, (curvature < 0.0).sum(axis=1))
        assert {each.standing for each in found.arguments} == {"holds"}


@pytest.mark.parametrize("unknowns", [1, 2, 3, 4])
def test_no_root_is_missing(unknowns):
    compare(unknowns, 8, 0)


def test_states_that_random_guesses_hardly_meet_are_found_between_the_others():
    """Six unknowns: the guesses fill a box in which states lie near its middle.

    Of each of these five, of 400, two unstable states were missing, and no argument had a doubt.
    """
    compare_each(
        6, [Quartic.random(6, np.random.default_rng([6, 5, k])) for k in (22, 178, 216, 322, 337)]
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("unknowns", "count"), [(1, 300), (2, 250), (3, 200), (4, 150), (5, 80), (6, 20)]
)
def test_no_root_of_a_thousand_structures_is_missing(unknowns, count):
    compare(unknowns, count, 1)
