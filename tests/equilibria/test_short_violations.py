"""Constraints that are violated inside steps only, by less than these show at their ends."""

import numpy as np
import pytest

import equimorph as em

DEGREE = 7
NAMES = [f"c{k}" for k in range(DEGREE + 1)]


@pytest.fixture(scope="module")
def structure():
    """x = P, y = x²; the descriptor D(x) is any polynomial."""
    load = em.Parameter("P", "1", 1.0, "load", 0.0)
    return em.EnergyStructure(
        "x**2/2 - P*x + 3*(y - x**2)**2/2 + 1e-30*x*(" + " + ".join(NAMES) + ")",
        [em.Unknown("x", 0.0, (-4, 4)), em.Unknown("y", 0.0, (-16, 16))],
        [load, *(em.Parameter(name, "1", 1.0, "fixed", 1.0) for name in NAMES)],
        descriptors={"D": " + ".join(f"{name}*x**{k}" for k, name in enumerate(NAMES))},
    )


def violated_for_a_moment(structure, lanes, width, seed):
    """States at P = 0 that obey D <= 0, and where they violate it first.

    ``D = −(b − x) Π ((x − a)² ∓ d²/4)``: it exceeds zero over lengths d, or misses it by as little.
    """
    draw, first = np.random.default_rng(seed), np.zeros(lanes)
    p = np.zeros((lanes, DEGREE + 2))
    for lane in range(lanes):
        a = np.cumsum(draw.uniform(0.3, 1.0, draw.integers(1, 4)))
        signs, b = draw.choice([1.0, -1.0], len(a)), a[-1] + draw.uniform(0.2, 1.5)
        excess = np.poly1d([1.0, -b])
        for at, sign in zip(a, signs, strict=True):
            excess = excess * np.poly1d([1.0, -2.0 * at, at**2 - sign * width**2 / 4.0])
        excess = excess / -excess(0.0) * draw.uniform(0.3, 3.0)
        p[lane, 1 : 2 + excess.order] = excess.coeffs[::-1]
        first[lane] = min([*(a[signs > 0.0] - 0.5 * width), b])
    return em.States(structure, np.zeros((lanes, 2)), p), first


@pytest.mark.parametrize("width", [0.1, 0.03, 0.01, 0.003])
def test_the_first_violation_ends_a_path_however_short_it_is(structure, width):
    """Of 24 300 random limit loads 341 went past such a violation without a word."""
    states, first = violated_for_a_moment(structure, 300, width, 5)
    within = [structure.descriptor("D") <= 0.0]
    found = em.limit_load(states, "P", bound=4.0, within=within)
    assert set(found.kind) == {"constraint"}
    assert found.value == pytest.approx(first, abs=1e-6)
    # whichever lanes march beside them
    again = em.limit_load(states[np.arange(7, 40, 3)], "P", bound=4.0, within=within)
    assert np.array_equal(again.states.z, found.states.z[7:40:3])


def test_so_it_does_on_curves_whose_steps_are_not_compiled(structure):
    states, first = violated_for_a_moment(structure, 60, 0.02, 6)
    within = [structure.descriptor("D") <= 0.0]
    found = em.lift(states, lambda t: {"P": 4.0 * t}, within=within)
    assert set(found.kind) == {"constraint"}
    assert found.states["P"] == pytest.approx(first, abs=1e-6)


def test_the_first_of_two_constraints_that_hide_in_one_step_counts(structure):
    states, first = violated_for_a_moment(structure, 100, 0.01, 7)
    late = [structure.descriptor("D") <= 1e-5, structure.descriptor("D") <= 0.0]
    found = em.limit_load(states, "P", bound=4.0, within=late)
    assert found.value == pytest.approx(first, abs=1e-6)
