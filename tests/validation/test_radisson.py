"""[RadissonKanso2023]_: both ends of a buckled strip rotated symmetrically: a pitchfork."""

import numpy as np
import pytest

import equimorph as em
from oracles import shooting


def pitchfork(nu):
    """Where the upright arch loses stability as both ends rotate against it: Θ = −α."""
    scale = np.sqrt(1 - nu)
    rest = em.Rod().natural_state(Theta=0.3 * scale, nu=nu)
    return em.lift(rest, {"Theta": -2.3 * scale}).end


@pytest.mark.parametrize(("nu", "alpha"), [(0.9, 0.63852), (np.sin(1.0), 0.80846), (0.5, 1.47746)])
def test_rotating_both_ends_meets_a_pitchfork(nu, alpha):
    """PHYSICS §5, five digits."""
    end = pitchfork(nu)
    assert (end.kind, end.criticality) == ("branch point", "subcritical")
    assert -end.state["Theta"] == pytest.approx(alpha, abs=5e-6)


def test_the_shooting_jacobian_is_singular_at_the_pitchfork():
    """The critical state of the package is one of the oracle, and its index is still 0."""
    exact = shooting.from_package(pitchfork(0.9).state)
    assert np.abs(exact.residual).max() < 1e-9
    singular = np.linalg.svd(exact.jacobian[:, :3], compute_uv=False)
    assert singular[-1] < 1e-9 * singular[0]


@pytest.mark.parametrize("shortening", [1e-2, 1e-3, 1e-4])
def test_shallow_limit_of_the_pitchfork(shortening):
    """α → 2√(1−ν): small slopes, θ ∝ sin τ(s−½) with ∫θ²/2 = 1−ν and tan(τ/2) = τ/2.

    Tolerance: the correction is O(1 − ν).
    """
    alpha = -pitchfork(1 - shortening).state["Theta"]
    assert alpha == pytest.approx(2 * np.sqrt(shortening), rel=shortening)
