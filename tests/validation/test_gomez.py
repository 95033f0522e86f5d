"""[Gomez2017]_: a buckled strip snaps when one of its ends is rotated far enough."""

import numpy as np
import pytest

import equimorph as em


def snapping_angle(nu):
    """Rotation of one end, θ(0) = −α, θ(1) = 0, at which the upright arch folds."""
    rod, scale = em.Rod(), np.sqrt(1 - nu)
    rest = rod.natural_state(Theta=0.3 * scale, nu=nu)
    level = em.lift(rest, {"Theta": 0.0}).end.state
    end = em.lift(level, {"Theta": -1.5 * scale, "Delta": -1.5 * scale}).end
    assert end.kind == "fold"
    assert end.state["Theta"] == end.state["Delta"]
    return -2 * end.state["Theta"]


@pytest.mark.parametrize(("nu", "alpha"), [(0.9, 0.56485), (np.sin(1.0), 0.71174)])
def test_rotating_one_end_folds_the_arch(nu, alpha):
    """PHYSICS §5, five digits."""
    assert snapping_angle(nu) == pytest.approx(alpha, abs=5e-6)


def test_shallow_limit_of_the_snapping_angle():
    """α/√(1−ν) → 1.7818 as ν → 1. Tolerance: the printed digits, plus O(1 − ν)."""
    values = [snapping_angle(1 - d) / np.sqrt(d) for d in (1e-2, 1e-3, 1e-4)]
    assert values[-1] == pytest.approx(1.7818, abs=5e-5)
    gaps = np.diff(values)
    assert gaps[0] / gaps[1] == pytest.approx(10.0, rel=0.05)


def test_the_snapping_angle_as_an_actuator_of_its_own():
    """One end turned as the only coordinate of a general rod: the same fold."""
    strip = em.Rod(coordinates={"alpha": {"theta_A": 1.0}, "beta": {"theta_B": 1.0}})
    rest = strip.natural_state(alpha=0.1, beta=-0.1, nu=0.9)
    level = em.lift(rest, {"alpha": 0.0, "beta": 0.0}).end.state
    end = em.lift(level, {"alpha": -0.7}).end
    assert end.kind == "fold"
    assert -end.state["alpha"] == pytest.approx(0.56485, abs=5e-6)
