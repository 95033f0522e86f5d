"""[Love1927]_, §§ 262–263: the elastica, in elliptic integrals."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

import equimorph as em


def clamped_elastica(nu):
    """(λ/λ_cr, rise) of the buckled clamped–clamped rod with zero end angles and span ν.

    Four equal quarters: ν = 2E/K − 1, λ/λ_cr = (2K/π)², rise = k/K.
    """
    m = brentq(lambda m: 2 * ellipe(m) / ellipk(m) - 1 - nu, 1e-12, 0.999, xtol=1e-16)
    return (2 * ellipk(m) / np.pi) ** 2, np.sqrt(m) / ellipk(m)


@pytest.fixture(scope="module")
def rod():
    return em.Rod()


@pytest.mark.parametrize("nu", [0.999, 0.9, 0.7, 0.5, 0.2, -0.0 + 0.05])
def test_clamped_elastica_has_the_load_and_rise_of_elliptic_integrals(rod, nu):
    """Lifted from the natural state at a small Θ to zero end angles. Tolerance: default 1e-8."""
    rest = rod.natural_state(Theta=0.3 * np.sqrt(1 - nu), nu=nu)
    path = em.lift(rest, {"Theta": 0.0})
    assert path.arrived
    force, rise = clamped_elastica(nu)
    assert path.end.state.multipliers == pytest.approx([force, 0.0], rel=1e-10, abs=1e-10)
    assert rod.height(0.5)(path.end.state) == pytest.approx(rise, rel=1e-10)


@pytest.mark.parametrize(
    ("nu", "force", "rise"), [(0.9, 1.05299, 0.19492), (0.5, 1.34945, 0.37331)]
)
def test_printed_heights_of_the_clamped_elastica(rod, nu, force, rise):
    """PHYSICS §5, five digits; also by lowering the span with the end angles held at zero."""
    assert clamped_elastica(nu) == pytest.approx((force, rise), abs=5e-6)
    flat = em.lift(rod.natural_state(Theta=0.05, nu=0.98), {"Theta": 0.0}).end.state
    state = em.lift(flat, {"nu": nu}).end.state
    assert state.multipliers[0] == pytest.approx(force, abs=5e-6)
    assert rod.height(0.5)(state) == pytest.approx(rise, abs=5e-6)


@pytest.mark.parametrize("Theta", [0.3, 1.0, 2.0, 2.8])
def test_free_natural_arch_is_a_circular_arc(rod, Theta):
    """ν = sin Θ/Θ is the chord of an arc with κ ≡ −2Θ and λ = μ = 0. Tolerance: round-off."""
    state = rod.natural_state(Theta=Theta, nu=np.sin(Theta) / Theta)
    s = np.linspace(0.0, 1.0, 41)
    kappa = np.array([rod.curvature(at)(state) for at in s])
    assert np.abs(kappa + 2 * Theta).max() < 1e-11 * (1 + 2 * Theta)
    assert np.abs(state.multipliers).max() < 1e-12
    radius = 0.5 / Theta
    x = radius * (np.sin(Theta) - np.sin(Theta - s / radius))
    y = radius * (np.cos(Theta - s / radius) - np.cos(Theta))
    assert np.abs(state.shape(s) - np.stack([x, y], 1)).max() < 1e-12
    assert state.energy == pytest.approx(Theta**2 / (2 * np.pi**2), rel=1e-12)
    assert state.stable


def test_natural_arch_at_the_default_span_and_unit_angle_is_exactly_circular(rod):
    """PHYSICS §3: Θ = 1, Δ = 0 at ν = sin 1 is the arc κ ≡ −2, to 1e-12."""
    state = rod.natural_state(Theta=1.0)
    assert (
        np.abs(rod.nodal_angles(state.z[None], state.p[None])[0] - (1 - 2 * rod.mesh.nodes)).max()
        < 1e-12
    )
    assert rod.max_curvature(state) == pytest.approx(2.0, abs=1e-12)
