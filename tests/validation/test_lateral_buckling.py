"""Cantilever strips that buckle sideways: Prandtl's problem and its family.

A bending moment M = c sᵐ at the distance s from the free end leaves the plane where
A C φ'' + M² φ = 0 with φ'(0) = 0, φ(1) = 0 has a solution: J₋ₐ(c/((m + 1) √(AC))) = 0 with
a = 1/(2m + 2). m = 1 is a force at the tip, m = 2 a uniform load: P = 4.0126 √(AC)/L²
[Prandtl1899]_ and q = 12.85 √(AC)/L³ [TimoshenkoGere1961]_. This neglects the bending before; rods
with lateral and torsional stiffnesses ε times smaller approach it like 1 + O(ε).
"""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import jv

import equimorph as em

PUBLISHED = {1: 4.0126, 2: 12.85}
LOADS = {1: {"P": em.PointForce(1.0)}, 2: {"P": em.LineLoad("uniform")}}


def linear_load(m: int) -> float:
    """Closed form of the critical load by √(AC), which the moment divides by m."""
    a = 1.0 / (2.0 * m + 2.0)
    root = brentq(lambda x: jv(-a, x), 1.5, 2.9, xtol=1e-14)
    return (m + 1.0) * m * root


def critical_load(m: int, lateral: float, torsion: float) -> em.LimitLoad:
    """First critical load of a cantilever of unit length and stiffness, by √(AC)."""
    rod = em.SpatialRod(
        torsion=torsion, lateral=lateral, ends=("clamped", "free"), loads=LOADS[m], EI=1.0,
        length=1.0,
    )  # fmt: skip
    return em.limit_load(rod.natural_state(), "P")


@pytest.mark.parametrize("m", [1, 2])
def test_the_closed_form_has_the_published_digits(m):
    assert linear_load(m) == pytest.approx(PUBLISHED[m], abs=0.5 * 10.0 ** (m - 5) * 10)


@pytest.mark.parametrize("m", [1, 2])
def test_soft_strips_approach_the_closed_form(m):
    """The differences are proportional to ε, with a rest of 3.1 ε² for ε = 1e-3."""
    gaps = [critical_load(m, e, e).value / e / linear_load(m) - 1.0 for e in (2e-3, 1e-3)]
    assert gaps[0] / gaps[1] == pytest.approx(2.0, rel=0.01)
    assert 2.0 * gaps[1] - gaps[0] == pytest.approx(0.0, abs=1e-5)


def test_a_strip_under_a_force_at_its_tip():
    """4.01719 at A = C = 1e-3, a value that does not depend on their proportion to O(ε)."""
    limit = critical_load(1, 1e-3, 1e-3)
    assert limit.kind == "branch point"
    assert limit.value / 1e-3 == pytest.approx(4.01719, abs=5e-6)
    other = critical_load(1, 2e-3, 5e-4).value / 1e-3
    assert other == pytest.approx(4.0126, rel=3e-3)
    assert np.sign(limit.state.z).any()
