"""Stability margins against dense eigenvalues of the Hessian where constraints allow to move."""

import numpy as np
import pytest
from scipy.linalg import eigh, null_space

import equimorph as em
from equimorph.structures import States, margin, stability_margin


def dense_margin(structure, z, p):
    """Smallest eigenvalue of Nᵀ L_uu N with respect to Nᵀ M N, N spanning the kernel of c_u."""
    size, n = structure.size, structure.unknowns
    inverse = structure.solve(z[None], p[None], np.eye(size)[None]).x[0]
    matrix = np.linalg.inv(inverse)
    tangent = null_space(matrix[n:, :n]) if size > n else np.eye(n)
    hessian = tangent.T @ matrix[:n, :n] @ tangent
    mass = tangent.T @ np.diag(structure.mass) @ tangent
    return eigh(0.5 * (hessian + hessian.T), mass, eigvals_only=True)[0]


@pytest.fixture(scope="module")
def states():
    """Equilibria on a path through folds, of several indices."""
    rest = em.Rod().natural_state(Theta=1.0, Delta=0.3)
    path = em.lift(rest, {"q": 8.0}, through_folds=True)
    return path.states[:: max(1, len(path.states) // 40)]


def test_margins_are_the_smallest_eigenvalues_of_dense_matrices(states):
    """Tolerance: the inverse of F_z, whose condition number is about 1e6, loses six digits."""
    wanted = [dense_margin(states.structure, z, p) for z, p in zip(states.z, states.p, strict=True)]
    np.testing.assert_allclose(states.margin, wanted, rtol=1e-7, atol=1e-8)
    assert (states.margin > 0).any()
    assert (states.margin < 0).any()


def test_margin_of_a_lane_does_not_depend_on_the_others(states):
    alone = [States(states.structure, states.z[[k]], states.p[[k]]).margin[0] for k in range(4)]
    assert np.array_equal(alone, states.margin[:4])


def test_many_margins_on_threads_are_those_of_few(states):
    """More lanes than one thread takes."""
    at = np.arange(3000) % len(states)
    many = stability_margin(states.structure, states.z[at], states.p[at])
    np.testing.assert_allclose(many, states.margin[at], rtol=1e-9)


@pytest.mark.parametrize("error", [1e-2, 1e-4, 1e-6])
def test_a_larger_error_is_kept(states, error):
    rough = stability_margin(states.structure, states.z, states.p, error)
    scale = np.maximum(np.abs(states.margin), 1e-3)
    assert (np.abs(rough - states.margin) <= error * scale).all()


def test_modes_are_those_of_the_smallest_eigenvalues(states):
    """F_z (v, μ) = σ M v; margins are as exact as asked, modes as their root."""
    structure, error = states.structure, 1e-6
    some = states[np.flatnonzero(states.margin > 0.05)]
    floor, few = np.full(len(some), 0.05), len(some)
    found = margin.softest_modes(
        structure, some.z, some.p, floor, margin.first_pairs(structure, few), error
    )
    assert found.above.all()
    np.testing.assert_allclose(found.first, some.margin, rtol=error)
    rhs = np.zeros_like(found.pairs[:, :1])
    rhs[:, 0, : structure.unknowns] = found.pairs[:, 0, : structure.unknowns] * structure.mass
    back = structure.solve(some.z, some.p, rhs).x[:, 0] * found.first[:, None]
    scale = np.abs(found.pairs[:, 0]).max()
    np.testing.assert_allclose(back, found.pairs[:, 0], rtol=0, atol=3e-3 * scale)


def test_states_with_an_eigenvalue_below_the_floor_are_told(states):
    floor = np.full(len(states), 0.2)
    pairs = margin.first_pairs(states.structure, len(states))
    found = margin.softest_modes(states.structure, states.z, states.p, floor, pairs, 1e-6)
    np.testing.assert_array_equal(found.above, states.margin > 0.2)


def test_margin_of_structures_with_few_unknowns():
    """A truss of two bars: two unknowns, no constraint; vectors of a pair may be parallel."""
    spring = em.Spring()
    state = spring.natural_state(x_l=1.5)
    wanted = dense_margin(spring, state.z, state.p)
    assert state.margin == pytest.approx(wanted, rel=1e-10)


def test_margins_are_bisected_where_inverse_iteration_does_not_converge(states, monkeypatch):
    """After one step nothing has converged: the count of eigenvalues alone gives the margin."""
    monkeypatch.setattr(margin, "POLISHING", 1)
    z, p = states.z[:12], states.p[:12]
    found = margin._by_bisection(states.structure, z, p)
    np.testing.assert_allclose(found, states.margin[:12], rtol=1e-9, atol=1e-9)


def test_no_margin_is_told_where_there_is_none(states):
    """Points that are no states: no bounds of an eigenvalue hold."""
    with np.errstate(all="ignore"):
        found = stability_margin(states.structure, np.full_like(states.z[:2], np.nan), states.p[:2])
    assert np.isnan(found).all()
