"""A shallow clamped arch under a point load at its crown: closed form of small slopes.

Inextensible and circular, θ₀ = α (1 − 2s), α small; units of B and L. With the thrust λ = k² and
half of the load at each foot, ``θ'' + k² θ = P/2`` on the left half, θ(0) = α, θ(½) = 0. With
u = P/(2 α k²) the solution is ``θ = α (a(s) + u b(s))``; the rod keeps its span where
``∫ θ² = ∫ θ₀² = α²/6`` over the half, a quadratic equation for u at each k. The load P/α has its
first maximum, 59.3234 at k = 8.5, before the arch can lean: that takes tan(k/2) = k/2, k = 8.987.
"""

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

import equimorph as em

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(40)
LEANING = 8.986818915818128  # 2 × 4.493409…


def load(k):
    """P/α of the symmetric arch at thrust k², on the branch beyond k = 2π."""
    s, c, n = (POINTS + 1) / 4, np.cos(k / 2), np.sin(k / 2)
    a = np.cos(k * s) - c / n * np.sin(k * s)
    b = 1 - np.cos(k * s) - (1 - c) / n * np.sin(k * s)
    aa, ab, bb = ((WEIGHTS / 4 * f).sum() for f in (a * a, a * b, b * b))
    root = np.sqrt(ab**2 - bb * (aa - 1 / 6))
    return 2 * k**2 * (root - ab) / bb


def limit_load(angle):
    """P/α at the fold of the rod, and the thrust there."""
    arch = em.Rod(
        curvature=-2 * angle, span=np.sin(angle) / angle, loads={"P": em.PointForce(0.5)},
        EI=1.0, length=1.0,
    )  # fmt: skip
    limit = em.limit_load(arch.natural_state(Theta=angle), "P")
    assert limit.kind == "fold"
    return limit.value / angle, arch.support_force("lambda")(limit.state)


def test_limit_load_of_the_shallow_arch_is_that_of_small_slopes():
    """Error ∝ α²: falls by four as α halves; 1e-5 once the leading error is taken off."""
    top = minimize_scalar(lambda k: -load(k), (8.3, 8.5, 8.7), tol=1e-12)
    assert -top.fun == pytest.approx(59.3234, abs=1e-4)
    assert top.x < LEANING == pytest.approx(2 * brentq(lambda x: np.tan(x) - x, 4.4, 4.6))
    loads, thrusts = np.transpose([limit_load(angle) for angle in (0.08, 0.04)])
    errors = loads + top.fun
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)
    assert loads[1] + (loads[1] - loads[0]) / 3 == pytest.approx(-top.fun, rel=1e-5)
    assert thrusts[1] == pytest.approx(top.x**2, rel=5e-3)
