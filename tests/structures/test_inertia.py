"""The index from the pivots of the fused step against the eigenvalues of the full matrix."""

import numpy as np
import pytest

from equimorph.linalg.condensed import PIVOT_GUARD
from equimorph.structures import Rod

BLOCK = 2000
SURE = 1e-12
"""Smallest |eigenvalue|, relative to the largest, whose sign double precision tells."""


def random_states(rod, generator):
    """Unknowns and parameters all over: waves of the angle, forces up to some hundred."""
    p = generator.uniform((-1.0, -2.0, -8.0, 0.3), (2.5, 2.0, 8.0, 0.99), (BLOCK, 4))
    z = rod.sample(p, generator)
    z[:, -2:] *= generator.choice([0.3, 1.0, 4.0, 16.0], (BLOCK, 1))
    return z, p


def with_vanishing_pivot(rod, z, p, generator):
    """The states with λ such that the first pivot of a random element is as good as zero.

    The pivot is ``Kᵢᵢ − (μ mᵢ − q Rᵢ) sin θᵢ − λ mᵢ cos θᵢ`` at the element's first inner node i.
    """
    lanes = np.arange(len(z))
    element = generator.integers(0, rod.mesh.elements, len(z))
    node = rod.mesh.element_nodes[element, 1]
    theta, m = rod.nodal_angles(z, p)[lanes, node], rod.mesh.weights[node]
    transverse = z[:, -1] * m - p[:, 2] * rod.mechanics.loads[node]
    pivot = generator.choice([0.0, 1e-15, -1e-12, 1e-9, -1e-7], len(z))
    rest = rod.mechanics.layout.stiffness[element, 1, 1] - transverse * np.sin(theta) - pivot
    out = z.copy()
    out[:, -2] = rest / (m * np.cos(theta))
    return out


def index_of(rod, z, p):
    """Index from the fused Newton step."""
    row, one = np.zeros_like(z), np.ones(len(z))
    return rod.advance(z, p, np.zeros_like(p), row, one, np.zeros(len(z))).index


def guarded(rod, z, p):
    """How many lanes had a pivot that the guard distrusts, and how many were pivoted."""
    solution = rod.solve(z, p, np.ones((len(z), 1, rod.size)))
    return int((~(solution.pivot_ratio >= PIVOT_GUARD)).sum()), int(solution.pivoted.sum())


def assert_inertia(rod, z, p):
    """Index = negative eigenvalues − 2, wherever the signs of all of them are sure."""
    eigenvalues = np.linalg.eigvalsh(rod.mechanics.layout.dense(*rod.mechanics.kkt(z, p)))
    size = np.abs(eigenvalues)
    sure = size.min(axis=1) > SURE * size.max(axis=1)
    assert sure.mean() > 0.99
    expected = (eigenvalues < 0.0).sum(axis=1) - 2
    np.testing.assert_array_equal(index_of(rod, z, p)[sure], expected[sure])
    return np.unique(expected)


def check(blocks, seed):
    """Assert both for blocks of states; how often the guard acted, and the indices met."""
    rod, generator = Rod(), np.random.default_rng(seed)
    at_random, engineered, met = np.zeros(2, int), np.zeros(2, int), set()
    few = slice(0, BLOCK // 10)
    for _ in range(blocks):
        z, p = random_states(rod, generator)
        met |= set(assert_inertia(rod, z, p).tolist())
        at_random += guarded(rod, z, p)
        z, p = with_vanishing_pivot(rod, z, p, generator)[few], p[few]
        assert_inertia(rod, z, p)
        engineered += guarded(rod, z, p)
    assert engineered[0] == blocks * BLOCK // 10
    assert engineered[1] > 0.4 * engineered[0]
    return at_random[0], met


def test_index_is_that_of_the_eigenvalues_and_the_guard_acts():
    acted, indices = check(1, seed=1)
    assert acted > 0
    assert indices >= set(range(8))


@pytest.mark.slow
def test_index_is_that_of_the_eigenvalues_on_a_hundred_thousand_states():
    """The guard acts on about one random state in 1500, and on every one made for it."""
    acted, indices = check(50, seed=2)
    assert acted > 25
    assert indices >= set(range(20))
