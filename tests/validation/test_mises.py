"""R. von Mises: Über die Stabilitätsprobleme der Elastizitätstheorie (1923) [Mises1923]_.

Two bars of axial stiffness EA from supports 2L apart to a joint at height a, which a vertical force
F presses down. With y the height of the joint, l² = L² + y² and l₀² = L² + a²:
engineering strain F = 2 EA y (1/l − 1/l₀), largest 2 EA (l₀^⅔ − L^⅔)^(3/2)/l₀ at l³ = L² l₀;
Green strain F = EA (a² − y²) y/l₀³, largest 2 EA a³/(√27 l₀³) at y = a/√3. Both tend to
0.38490 EA a³/L³ for a ≪ L.
"""

import numpy as np
import pytest

import equimorph as em

SPAN = 1.7
"""L, to see that lengths count."""


def truss(rise, strain="engineering", guided=True):
    joints = {"A": (-SPAN, 0.0), "B": (0.0, rise), "C": (SPAN, 0.0)}
    supports = {"A": "xy", "C": "xy"} | ({"B": "x"} if guided else {})
    bars = [em.Bar(("A", "B"), 2.0), em.Bar(("B", "C"), 2.0)]
    return em.Truss(joints, bars, supports, {"F": {"B": (0.0, -1.0)}}, strain=strain)


def exact(rise, strain):
    """Limit load and height of the joint there, EA = 2."""
    rest = np.hypot(SPAN, rise)
    if strain == "green":
        return 4.0 * rise**3 / (np.sqrt(27.0) * rest**3), rise / np.sqrt(3.0)
    length = (SPAN**2 * rest) ** (1 / 3)
    load = 4.0 * (rest ** (2 / 3) - SPAN ** (2 / 3)) ** 1.5 / rest
    return load, np.sqrt(length**2 - SPAN**2)


@pytest.mark.parametrize("strain", ["engineering", "green"])
@pytest.mark.parametrize("rise", [0.001, 0.01, 0.3, 1.0, 4.0])
def test_limit_load_of_the_guided_truss(rise, strain):
    """Closed forms. 1e-10 and round-off over the small l − l₀; y to half of the digits."""
    made = truss(rise, strain)
    limit = em.limit_load(made.natural_state(), "F")
    load, height = exact(rise, strain)
    assert limit.kind == "fold"
    assert limit.value == pytest.approx(load, rel=1e-16 / (rise / SPAN) ** 2 + 1e-10)
    reached = rise + made.displacement("B", "y")(limit.state)
    assert reached == pytest.approx(height, rel=1e-6)


@pytest.mark.parametrize("strain", ["engineering", "green"])
@pytest.mark.parametrize("guided", [True, False])
def test_limit_load_of_the_shallow_truss(guided, strain):
    """0.38490 EA a³/L³, guided or not. 1e-4: the next term is of order (a/L)² = 3.5e-5."""
    rise = 0.01
    limit = em.limit_load(truss(rise, strain, guided).natural_state(), "F")
    assert limit.value * SPAN**3 / (2.0 * rise**3) == pytest.approx(0.38490, rel=1e-4)


def test_path_through_the_snap_follows_the_closed_form():
    """Equilibria at half the limit load: the three roots of F(y). 1e-9: relative to the rise."""
    rise, made = 0.3, truss(0.3)
    load = 0.5 * exact(rise, "engineering")[0]
    found = em.find_equilibria(made, {"F": load})
    height = rise + found.z[:, 0]
    force = 4.0 * height * (1 / np.hypot(SPAN, height) - 1 / np.hypot(SPAN, rise))
    np.testing.assert_allclose(force, load, rtol=1e-12)
    order = np.argsort(height)
    np.testing.assert_array_equal(found.index[order], [0, 1, 0])


@pytest.mark.parametrize("rise", [4.0, 5.0, 8.0])
def test_a_truss_steeper_than_the_root_of_seven_gives_way_sideways(rise):
    """Sideways stiffness 2 EA (1/l₀ − 1/l + L²/l³): zero where l³/l₀ − l² + L² = 0.

    At the fold, l³ = L² l₀, it is positive if l₀ < √8 L. 1e-9: numpy's roots of the cubic.
    """
    limit = em.limit_load(truss(rise, guided=False).natural_state(), "F")
    if rise < np.sqrt(7.0) * SPAN:
        assert limit.kind == "fold"
        return
    rest = np.hypot(SPAN, rise)
    roots = np.roots([1.0 / rest, -1.0, 0.0, SPAN**2])
    length = roots[(roots < rest) & (roots > SPAN)].max()
    height = np.sqrt(length**2 - SPAN**2)
    assert limit.kind == "branch point"
    assert limit.value == pytest.approx(4.0 * height * (1 / length - 1 / rest), rel=1e-9)
