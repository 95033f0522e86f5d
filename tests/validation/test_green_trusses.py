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


def compare(unknowns, first, end):
    """No stable state of trusses `first` to `end` is missing. 1e-6: far below gaps of roots."""
    generator = np.random.default_rng(unknowns)
    trusses = [random_green_truss(unknowns, generator) for _ in range(end)]
    for forces in trusses[first:]:
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
    compare(4, 0, 5)


@pytest.mark.parametrize("seed", range(3))
def test_random_forces_find_what_lines_of_the_load_do_not_reach(seed):
    """Without them a stable state is missing together with all saddles beside it."""
    generator = np.random.default_rng(6)
    truss = [random_green_truss(6, generator) for _ in range(40)][39].truss
    with unchecked():
        found = em.find_equilibria(truss, {"F": 1.0}, seed=seed)
    assert (len(found), len(found.stable)) == (27, 8)


def test_many_states_over_a_point_are_pushed_too():
    """73 real roots (below); where more than 60 states were not pushed one was missing."""
    generator = np.random.default_rng(7)
    truss = [random_green_truss(7, generator) for _ in range(5)][4].truss
    with unchecked():
        found = em.find_equilibria(truss, {"F": 1.0})
    assert (len(found), len(found.stable)) == (73, 14)
    assert {each.standing for each in found.arguments} == {"holds"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("unknowns", "first", "end"),
    [
        (4, 0, 50),
        (4, 50, 100),
        (5, 0, 25),
        (5, 25, 50),
        (6, 0, 10),
        (6, 10, 20),
        (6, 20, 30),
        (6, 30, 40),
        (7, 0, 2),
        (7, 2, 4),
        (7, 4, 6),
        (7, 6, 8),
        (8, 0, 1),
        (8, 1, 2),
    ],
)
def test_no_stable_state_of_two_hundred_trusses_is_missing(unknowns, first, end):
    compare(unknowns, first, end)
