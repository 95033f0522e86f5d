"""Natural states of the rod: which exist, and what is said where none does."""

import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.structures import Rod, States
from equimorph.structures.rod import natural
from equimorph.structures.rod.natural import Outcome, natural_arch

SPAN = float(np.sin(1.0))


def settings(thetas, deltas, nu=SPAN):
    grid = np.stack(np.meshgrid(thetas, deltas, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.column_stack([grid, np.zeros(len(grid)), np.full(len(grid), nu)])


def test_natural_states_are_stable_unloaded_equilibria_over_the_box():
    """Θ from 0.2 to 2.5, Δ from −2 to 2: every state found; none only where the free rod folds."""
    rod, p = Rod(), settings(np.linspace(0.2, 2.5, 12), np.linspace(-2, 2, 9))
    found = natural_arch(rod.mechanics, p)
    assert set(found.outcome) == {Outcome.FOUND, Outcome.FREE_FOLD}
    there = found.outcome == Outcome.FOUND
    states = States(rod, found.z[there], p[there])
    assert states.residual.max() < 1e-12
    assert (states.index == 0).all()
    assert np.isnan(found.z[~there]).all()
    corner = np.abs(p[:, 1]) + p[:, 0] > 3.7
    assert (corner[~there]).all()


def test_which_states_exist_depends_neither_on_mesh_nor_on_steps(monkeypatch):
    """Finer elements and steps a third as long; fold scales within 1e-3, the smallest step's."""
    p = settings(np.linspace(1.6, 2.5, 7), np.linspace(1.2, 2.0, 5))
    coarse = natural_arch(Rod().mechanics, p)
    monkeypatch.setattr(natural, "BEND", 0.1)
    fine = natural_arch(Rod(elements=12, degree=8).mechanics, p)
    np.testing.assert_array_equal(coarse.outcome, fine.outcome)
    np.testing.assert_allclose(coarse.scale, fine.scale, atol=1e-3)
    there = coarse.outcome == Outcome.FOUND
    np.testing.assert_allclose(coarse.z[there, -2:], fine.z[there, -2:], atol=1e-3)


def test_the_free_rod_really_folds_where_it_is_said_to():
    """At Θ = Δ = 2: dν/dλ grows without bound as the scale nears the fold (λ = 0 all the way).

    Near a fold the square of its inverse falls linearly to zero; extrapolated from scales 0.90 to
    0.92 by a parabola, within 0.003.
    """
    rod = Rod(elements=12, degree=8)
    scale = natural_arch(rod.mechanics, settings([2.0], [2.0])).scale[0]
    row = np.zeros((1, rod.size))
    row[0, -2] = 1.0
    at = np.array([0.90, 0.91, 0.92])
    slopes = []
    for t in at:
        p = settings([2.0 * t], [2.0 * t])
        z = _free_state(rod, p)
        nu = np.array([np.cos(rod.nodal_angles(z, p)[0]) @ rod.mesh.weights])
        p[:, 3] = nu
        step = rod.advance(z, p, np.eye(4)[3:], row, np.zeros(1), z[:, -2].copy())
        assert np.abs(step.dz).max() < 1e-8
        slopes.append(step.tangent_t[0])
    square = 1.0 / np.array(slopes) ** 2
    line = np.polyfit(at, square, 2)
    roots = np.roots(line).real
    assert np.abs(roots - scale).min() < 3e-3


def _free_state(rod, p):
    """Free-span state at the end angles of p, by the package's own continuation."""
    part = natural.free_part(p)
    x = np.zeros((1, rod.size + 1))
    x[0, -1] = 1.0
    return np.ascontiguousarray(natural.follow(rod.mechanics, part, x)[1][:, :-1])


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"Theta": 2.0, "Delta": 2.0}, r"The free rod folds at 0\.93 of these angles"),
        ({"Theta": 1.0, "nu": 1 - 1e-8}, "at nu=0.99999999. Pulled straighter than nu=0.99"),
        ({"Theta": -1.0}, "Choose Theta > 0"),
    ],
)
def test_what_is_missing_is_named_with_its_reason(values, text):
    with pytest.raises(InputError, match=text):
        Rod().natural_state(**values)


def test_a_nearly_straight_rod_has_its_natural_state():
    """Small angles: θ = Θ(1 − 2s) has the free span 1 − Θ²/6; 1e-8: Θ⁴/120 at Θ = 0.02."""
    state = Rod().natural_state(Theta=0.02, nu=1 - 0.02**2 / 6)
    assert abs(state.multipliers[0]) < 1e-4
    assert state.stable


def test_states_of_a_batch_do_not_depend_on_the_batch(monkeypatch):
    """Settings continued alone and together agree to the accuracy of Newton's last step."""
    rod, p = Rod(), settings(np.linspace(0.3, 2.4, 9), np.linspace(-1.9, 1.9, 7))
    together = natural_arch(rod.mechanics, p)
    monkeypatch.setattr(natural, "BLOCK", 3)
    apart = natural_arch(rod.mechanics, p)
    np.testing.assert_array_equal(together.outcome, apart.outcome)
    np.testing.assert_allclose(together.z, apart.z, atol=1e-9)


@pytest.mark.parametrize("Theta", [1e-9, 1e-6, 1e-4, 0.001, 0.01, 0.05])
def test_a_rod_that_is_all_but_straight_buckles_upward(Theta):
    """As Θ → 0 the elastica with end angles zero: λ = 1.05299, rise 0.19492 at ν = 0.9.

    [Love1927]_, §§ 262-263; terms of order Θ and the last digit apart.
    """
    state = Rod().natural_state(Theta=Theta, nu=0.9)
    assert state.stable
    assert state.multipliers[0] == pytest.approx(1.05299, abs=1.2 * Theta + 5e-6)
    assert Rod().height(0.5)(state) == pytest.approx(0.19492, abs=1.2 * Theta + 5e-6)


def test_ever_smaller_end_angles_lead_to_one_buckled_state_whatever_their_ratio():
    """Natural states are smooth in (Θ, Δ) at the limit: differences shrink like the angles."""
    rod = Rod()
    for ratio in (-3.0, 0.0, 0.7):
        sizes = np.array([1e-3, 1e-5, 1e-7, 1e-9])
        p = settings(sizes, [0.0])
        p[:, 1] = ratio * sizes
        states, found = rod.natural_states(p)
        assert found.all()
        assert states.residual.max() < 1e-12
        assert (states.index == 0).all()
        gaps = np.abs(states.z[:-1] - states.z[-1]).max(axis=1)
        np.testing.assert_allclose(gaps / sizes[:-1], gaps[0] / sizes[0], rtol=0.05)


def test_natural_states_pulled_too_straight_are_refused_up_to_the_span_named():
    """The span in the message is resolved, with an error below 0.1 of a curvature near 50."""
    rod = Rod()
    with pytest.raises(InputError, match=r"Pulled straighter than nu=0\.99") as refusal:
        rod.natural_state(Theta=0.9, nu=0.998)
    span = float(str(refusal.value).split("straighter than nu=")[1].split()[0])
    state = rod.natural_state(Theta=0.9, nu=span - 1e-5)
    assert state.error_estimate < 0.1
    assert rod.max_curvature(state) == pytest.approx(50.0, rel=0.1)
