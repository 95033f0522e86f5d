"""Newton's method as one compiled loop against the same step by step."""

from dataclasses import replace

import numpy as np
import pytest

import equimorph as em
from equimorph.linalg.condensed import PIVOT_GUARD
from equimorph.structures.newton import Limits, Through, newton
from equimorph.structures.rod.clamped_kernels import advance_lanes

LIMITS = Limits(12, 0.7, 2.0, 1e-14, following=1e-14, contraction=0.9, free=2)


@pytest.fixture
def guesses():
    rod = em.Rod(load="uniform")
    p = np.tile([1.0, 0.1, 2.5, np.sin(1.0)], (23, 1))
    return rod, rod.sample(p, np.random.default_rng(2)), p


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("lanes", [0, 1, 8, 23])
@pytest.mark.parametrize("guard", [1e-3, np.inf])
def test_the_compiled_loop_takes_the_steps_of_the_structure(guesses, lanes, guard, moving):
    """Bit by bit, whether no, some or all steps (an infinite guard) are taken by `advance`."""
    rod, z, p = (each if k == 0 else each[:lanes] for k, each in enumerate(guesses))
    through = plane(z, p) if moving else None
    found = newton(rod, z, p, LIMITS, through)
    rod.mechanics.compiled_newton = replace(rod.compiled_newton, guards=(guard, guard))
    plain = newton(rod, z, p, LIMITS, through)
    if moving or guard == np.inf:
        for one, other in zip(vars(found).values(), vars(plain).values(), strict=True):
            np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(found.status, plain.status)
    if lanes == 23:
        assert 0 < found.found.sum() < lanes


def plane(z, p):
    """Planes in which the load moves with the states."""
    dp = np.tile([0.0, 0.0, 1.0, 0.0], (len(p), 1))
    return Through(dp, 0.01 * np.cos(z), np.linspace(0.5, 1.5, len(p)))


@pytest.mark.parametrize("moving", [False, True])
def test_threads_that_share_lanes_take_the_same_steps(moving):
    """Bit by bit; lanes that need not contract and lengths of their own go along with them."""
    rod, generator, lanes = em.Rod(load="uniform"), np.random.default_rng(3), 1700
    p = np.tile([1.0, 0.1, 2.5, np.sin(1.0)], (lanes, 1))
    z = rod.sample(p, generator)
    limits = replace(
        LIMITS, too_long=generator.uniform(1.0, 5.0, lanes), exempt=np.arange(lanes) % 3
    )
    through = plane(z, p) if moving else None
    em.set_threads(1)
    alone = newton(rod, z, p, limits, through)
    try:
        em.set_threads(3)
        shared = newton(rod, z, p, limits, through)
    finally:
        em.set_threads()
    for one, other in zip(vars(alone).values(), vars(shared).values(), strict=True):
        np.testing.assert_array_equal(one, other)
    assert len(np.unique(alone.status)) > 2


def test_corrections_with_small_pivots_lead_to_exact_states():
    """A refined step from where Newton's method ended is at round-off, as from other states.

    Two of 3700 states, from random guesses, have a pivot that is not trusted by `advance`.
    """
    rod, generator, lanes = em.Rod(load="uniform"), np.random.default_rng(0), 6000
    p = np.full((lanes, 4), 2.5)
    p[:, 0], p[:, 1] = generator.uniform(0.2, 2.5, lanes), generator.uniform(-2.0, 2.0, lanes)
    p[:, 3] = np.sin(p[:, 0]) / p[:, 0]
    found = newton(rod, rod.sample(p, generator), p, Limits(converged=1e-14, following=1e-14))
    z, p = found.z[found.found], p[found.found]
    still = np.zeros_like(p), np.zeros_like(z), np.ones(len(z)), np.zeros(len(z))
    mechanics = rod.mechanics
    _, ratio = mechanics.fused_step(advance_lanes, mechanics._step_data, z, p, *still)
    small = ratio < PIVOT_GUARD
    assert small.any()
    left = np.sqrt(rod.advance(z, p, *still).dz[:, : rod.unknowns] ** 2 @ rod.mass)
    assert left[small].max() <= 1e-12


def test_states_of_another_width_are_refused_by_name(guesses):
    """The loop does not check what it reads: `advance` refuses."""
    rod, z, p = guesses
    with pytest.raises(em.InputError, match="`z` must have shape"):
        newton(rod, z[:, :-1], p, LIMITS)


def test_energy_and_highest_coefficients_are_those_of_matrices(guesses):
    """½ θᵀKθ − q R·sin θ, and the largest product with the rows of `highest`, by numpy."""
    rod, z, p = guesses
    mechanics = rod.mechanics
    theta = mechanics.nodal_angles(z, p)
    bending = 0.5 * np.einsum("li,ij,lj->l", theta, mechanics.layout.assembled, theta)
    energy = bending - p[:, 2] * (np.sin(theta) @ mechanics.loads)
    np.testing.assert_allclose(mechanics.energy(z, p), energy, rtol=1e-13)
    largest = np.abs(theta @ mechanics.mesh.highest.T).max(axis=1)
    # sums of angles near one, which cancel
    np.testing.assert_allclose(mechanics.tail(z, p), largest, rtol=1e-12, atol=1e-14)
