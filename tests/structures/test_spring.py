"""The constrained spring: closed forms of PHYSICS §2."""

import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.structures import Spring, States


def equilibria(delta, x, k=1.0):
    """States (δ, x_l) with the force of the closed form F = k (1 − x_l/cos δ) sin δ."""
    delta, x = np.broadcast_arrays(np.asarray(delta, float), np.asarray(x, float))
    force = k * (1 - x / np.cos(delta)) * np.sin(delta)
    p = np.column_stack([x.ravel(), force.ravel(), np.full(x.size, k)])
    return States(Spring(k), delta.ravel()[:, None].copy(), p)


def test_the_closed_form_force_is_in_balance():
    """1e-15: round-off."""
    states = equilibria(np.linspace(-1.2, 1.2, 25), 0.83, 1.7)
    np.testing.assert_allclose(states.residual, 0.0, atol=1e-14)


def test_stability_ends_at_the_cube_of_the_cosine():
    """x_l = cos³ δ: stable above, unstable below, by 1e-9."""
    delta = np.linspace(-1.1, 1.1, 23)
    assert (equilibria(delta, np.cos(delta) ** 3 + 1e-9).index == 0).all()
    assert (equilibria(delta, np.cos(delta) ** 3 - 1e-9).index == 1).all()


def test_margin_is_the_closed_form_curvature_of_the_energy():
    """E'' = k x_l (x_l − cos³ δ)/cos⁴ δ. 1e-8: of the eigenvalue search."""
    delta = np.array([-0.7, 0.2, 0.62, 1.0])
    states = equilibria(delta, 0.8, 1.3)
    exact = 1.3 * 0.8 * (0.8 - np.cos(delta) ** 3) / np.cos(delta) ** 4
    np.testing.assert_allclose(states.margin, exact, rtol=1e-8)


def test_the_papers_start_carries_its_corrected_force():
    """PHYSICS §2: C_s = (0.62, 0.80) has F/k = +0.009908, mirrored −0.009908; six digits."""
    forces = equilibria([0.62, -0.62, 0.40], [0.80, 0.80, 0.90]).p[:, 1]
    np.testing.assert_allclose(forces, [0.009908, -0.009908, 0.008904], atol=5e-7)


def test_unloaded_spring_has_its_natural_length():
    """δ = arccos x_l for x_l < 1, else 0. 1e-15: round-off."""
    spring = Spring()
    state = spring.natural_state(x_l=0.6)
    assert spring.angle(state) == pytest.approx(np.arccos(0.6), rel=1e-15)
    assert state.energy == pytest.approx(0.0, abs=1e-30)
    assert spring.height(state) == pytest.approx(0.8, rel=1e-14)
    assert spring.angle(spring.natural_state(x_l=1.2)) == 0.0


def test_shape_runs_from_the_actuator_to_the_line():
    spring = Spring()
    state = spring.natural_state(x_l=0.6)
    np.testing.assert_allclose(state.shape(), [[0.6, 0.0], [0.0, 0.8]], atol=1e-14)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: Spring(0.0), "`k` must be a finite number greater than 0"),
        (lambda: Spring(np.nan), "`stiffness` must be a finite number"),
        (lambda: Spring().natural_state(F=0.1), "`F` must be 0 in the natural state"),
        (lambda: Spring().natural_state(x_l=-1.0), "`x_l` must be a finite number greater"),
        (lambda: Spring().descriptor("length"), "`descriptor` must be one of angle, height"),
    ],
)
def test_bad_input_is_refused(call, text):
    with pytest.raises(InputError, match=text):
        call()


@pytest.mark.parametrize("x_l", [0.5, 0.8, 1.0])
def test_margin_at_the_boundary_of_stability_is_zero(x_l):
    """x_l = cos³δ: the Hessian itself is singular there."""
    delta = np.arccos(x_l ** (1 / 3))
    fold = States(Spring(), np.array([[delta]]), np.array([[x_l, np.sin(delta) ** 3, 1.0]]))
    assert fold.margin[0] == pytest.approx(0.0, abs=1e-11)


def test_the_force_of_inertia_is_that_of_a_mass_that_moves_along_a_line():
    """T = ½ m x_l² sec⁴δ δ̇², so that Γ = ½ M' δ̇² = 2 m x_l² sec⁴δ tan δ δ̇²."""
    spring, x, delta = Spring(mass=3.0), 0.8, np.array([[0.4], [-0.7]])
    p, rate = np.tile([x, 0.1, 1.0], (2, 1)), np.array([[1.3], [0.5]])
    expected = 2.0 * 3.0 * x**2 * np.tan(delta) / np.cos(delta) ** 4 * rate**2
    np.testing.assert_allclose(spring.inertial_force(delta, p, rate), expected, rtol=1e-7)
