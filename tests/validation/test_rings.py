"""[TadjbakhshOdeh1967], [FlahertyKellerRubinow1972]: closed rings under hydrostatic pressure.

A closed ring is a rod whose ends are clamped at one place, which takes up its rigid motions, or one
half of it: its ends are clamped on the line of symmetry, and one of them slides along the chord.
"""

import numpy as np
import pytest

import equimorph as em
from typecheck import unchecked

CONTACT = 5.247  # pressure at which opposite points touch, in B/R³: section 3 of the second paper


@pytest.fixture(scope="module")
def half():
    """Half a ring of radius 1, in units of its bending stiffness; B slides along x."""
    return em.Rod(
        ends=("clamped", em.End(x="free")), curvature=-1.0, loads={"p": em.Pressure()}, EI=1.0,
        length=np.pi,
    )  # fmt: skip


@pytest.fixture(scope="module")
def buckled(half):
    with unchecked():
        return em.lift(half.natural_state(Theta=np.pi / 2), {"p": -9.0})


def test_the_first_buckling_pressure_is_three(buckled):
    """p = 3 B/R³, supercritical. 1e-10: the default elements, before which the ring is a circle."""
    assert buckled.end.kind == "branch point"
    assert buckled.end.criticality == "supercritical"
    assert buckled.end.state["p"] == pytest.approx(-3.0, rel=1e-10)


def test_higher_buckling_pressures_are_squares_less_one(half):
    """p = n² − 1 of the waves n = 2, 3, 4, passed on the circle; 1e-8: the default elements."""
    with unchecked():
        path = em.lift(half.natural_state(Theta=np.pi / 2), {"p": -16.0}, through_folds=True)
    assert path.arrived
    found = [-each.state["p"] for each in path.events if each.kind == "branch point"]
    np.testing.assert_allclose(found, [3.0, 8.0, 15.0], rtol=1e-8)


def test_opposite_points_touch_at_the_published_pressure(half, buckled):
    """5.247 B/R³, four digits in print; the half that buckles towards the chord goes there."""
    x, _ = half.position(1.0)
    with unchecked():
        ways = em.branches(buckled.end.state, "p", path=buckled)
        inward = min(ways, key=lambda way: x(way.state))
        touch = em.lift(inward.state, {"p": -12.0}, within=[x >= 0.0]).end
    assert touch.kind == "constraint"
    assert -touch.state["p"] == pytest.approx(CONTACT, abs=5e-4)
    assert x(touch.state) == pytest.approx(0.0, abs=1e-10)
    assert touch.state.index == 0


def test_a_whole_ring_buckles_at_the_same_pressure_in_two_ways(half):
    """Clamped at one place it keeps both waves of n = 2, so two eigenvalues vanish at once."""
    ring = em.Rod(
        ends=("clamped", "clamped"), curvature=-1.0, loads={"p": em.Pressure()}, EI=1.0,
        length=2 * np.pi, span=0.0, elements=12,
    )  # fmt: skip
    with unchecked():
        end = em.lift(ring.natural_state(Theta=np.pi), {"p": -9.0}).end
    assert end.kind == "multiple point"
    assert end.state["p"] == pytest.approx(-3.0, rel=1e-6)
    assert "2 eigenvalues vanish at once" in end.detail


def test_a_ring_that_nothing_holds_is_refused_with_the_reason():
    """Its rigid motions would leave F_z singular."""
    with pytest.raises(em.InputError, match=r"`ends` must hold x at one end at least; .* drift"):
        em.Rod(ends=("free", "free"), curvature=-1.0, loads={"p": em.Pressure()})
