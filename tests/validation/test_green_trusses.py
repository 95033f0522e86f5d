"""Random Green-strain trusses with dead loads against all real roots of their forces.

Forces are cubic in the displacements; the roots come from a homotopy along all 3ⁿ complex paths.
"""

import numpy as np
import pytest

import equimorph as em
from oracles.green_trusses import random_green_truss
from oracles.homotopy import real_roots
from typecheck import unchecked

FAR = 100.0
"""Displacement that no equilibrium of these trusses of a size of 10 comes near."""


def compare(unknowns, count):
    """No stable state is missing. 1e-6: far below the distance of roots."""
    generator = np.random.default_rng(unknowns)
    for _ in range(count):
        forces = random_green_truss(unknowns, generator)
        roots, lost = real_roots(forces, unknowns, FAR)
        assert lost == 0
        stiffness = np.linalg.eigvalsh(forces(roots.astype(complex))[1].real)
        stable = roots[stiffness[:, 0] > 0.0]
        with unchecked():
            found = em.find_equilibria(forces.truss, {"F": 1.0})
        gap = np.linalg.norm(found.z[None] - roots[:, None], axis=2)
        assert gap.min(axis=0).max() < 1e-6
        assert len(found.stable) == len(stable)
        if len(found) == len(roots):
            assert {each.standing for each in found.arguments} == {"holds"}


def test_forces_of_trusses_are_those_of_the_oracle():
    """Relative round-off."""
    generator = np.random.default_rng(0)
    for unknowns in (4, 5, 8):
        forces = random_green_truss(unknowns, generator)
        u = 0.3 * generator.normal(size=(3, unknowns))
        residual = forces.truss.residual(u, np.ones((3, 1)))
        np.testing.assert_allclose(residual, forces(u)[0], atol=1e-12)


def test_no_stable_state_of_a_truss_is_missing():
    compare(4, 5)


@pytest.mark.slow
@pytest.mark.parametrize(("unknowns", "count"), [(4, 100), (5, 50), (6, 40), (7, 8), (8, 2)])
def test_no_stable_state_of_two_hundred_trusses_is_missing(unknowns, count):
    compare(unknowns, count)
