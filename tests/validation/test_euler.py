"""[TimoshenkoGere1961]_, chapter 2: Euler loads of the clamped–clamped rod: 1, 2.0457, 4 λ_cr."""

import numpy as np
import pytest
from scipy.linalg import eigh, null_space
from scipy.optimize import brentq

import equimorph as em


def test_euler_loads_are_eigenvalues_of_the_discretised_operator():
    """Straight rod: K η = λ M η on ∫η = 0 (both ends on the axis). tan x = x, λ = x²/π².

    Tolerance: elements of degree 8 represent the first modes to round-off.
    """
    rod = em.Rod()
    K = rod.mechanics.layout.assembled[1:-1, 1:-1]
    free = null_space(rod.mass[None])
    loads = eigh(free.T @ K @ free, free.T @ (rod.mass[:, None] * free), eigvals_only=True)[:4]
    x = brentq(lambda x: np.sin(x) - x * np.cos(x), 4.0, 4.7, xtol=1e-15)
    y = brentq(lambda x: np.sin(x) - x * np.cos(x), 7.0, 7.8, xtol=1e-15)
    assert loads == pytest.approx([1.0, (x / np.pi) ** 2, 4.0, (y / np.pi) ** 2], rel=1e-11)
    assert loads[:3] == pytest.approx([1.0, 2.0457, 4.0], abs=5e-5)


def test_first_euler_load_is_the_limit_of_shallow_arches():
    """λ/λ_cr = 1 + (1 − ν)/2 + O((1 − ν)²) for zero end angles, from 2E/K − 1 = ν."""
    rod = em.Rod()
    for shortening in (1e-2, 1e-3, 1e-4):
        rest = rod.natural_state(Theta=0.3 * np.sqrt(shortening), nu=1 - shortening)
        force = em.lift(rest, {"Theta": 0.0}).end.state.multipliers[0]
        assert force - 1 == pytest.approx(shortening / 2, rel=shortening)


def test_second_euler_load_is_reached_where_the_shallow_inverted_arch_loses_stability():
    """At the rotated-end pitchfork the antisymmetric mode of tan x = x is critical: λ → 2.0457."""
    rod = em.Rod()
    shortening = 1e-4
    rest = rod.natural_state(Theta=0.3 * np.sqrt(shortening), nu=1 - shortening)
    end = em.lift(rest, {"Theta": -3 * np.sqrt(shortening)}).end
    assert end.state.multipliers[0] == pytest.approx(2.0457, abs=3e-3)
