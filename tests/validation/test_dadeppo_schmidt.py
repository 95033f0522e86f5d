"""[DaDeppoSchmidt1975]_: deep circular arch of 215°, clamped and hinged, loaded at the crown."""

import numpy as np
import pytest

import equimorph as em

ANGLE = np.deg2rad(215.0)


def deep_arch(**resolution):
    """Arc of radius 1 = L/ANGLE, drawn upright: clamped at A, hinged at B, in units of B and R."""
    half = ANGLE / 2
    return em.Rod(
        ends=("clamped", "pinned"),
        curvature=-1.0,
        loads={"P": em.PointForce(0.5)},
        span=2 * np.sin(half),
        EI=1.0,
        length=ANGLE,
        **resolution,
    )


def test_limit_load_of_the_deep_arch_and_its_displacements():
    """P R²/B = 8.97309; w/R = 1.13732, u/R = 0.61141 at the crown: the digits printed."""
    rod = deep_arch()
    rest = rod.natural_state(theta_A=ANGLE / 2)
    assert rod.max_curvature(rest) == pytest.approx(1.0, rel=1e-10)
    limit = em.limit_load(rest, "P")
    assert limit.kind == "fold"
    assert limit.value == pytest.approx(8.97309, abs=6e-6)
    x, y = rod.position(0.5)
    w, u = (f(rest) - f(limit.state) for f in (y, x))
    assert w == pytest.approx(1.13732, abs=3e-5)  # at a fold displacements move with √ΔP
    assert abs(u) == pytest.approx(0.61141, abs=3e-5)


def test_the_limit_load_converges():
    """Six and ten elements differ by less than 1e-7."""
    values = [
        em.limit_load(deep_arch(elements=n).natural_state(theta_A=ANGLE / 2), "P").value
        for n in (6, 10)
    ]
    assert values[0] == pytest.approx(values[1], rel=1e-7)
