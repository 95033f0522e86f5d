"""Efforts with units and symbols, their absolute values, and bounds with units."""

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from equimorph.structures.quantities import find_descriptor
from equimorph.study.fields import parse_comparison


@pytest.fixture(scope="module")
def rod():
    """A steel strip of 0.5 m, numbers in N and mm."""
    units = {"force": "N", "length": "mm"}
    return em.Rod(EI="2 N m^2", length="500 mm", coordinates={}, units=units)


def test_efforts_have_the_units_of_couples_forces_and_displacements(rod):
    """Energy over the unit of the parameter."""
    found = {each.name: em.effort_of(rod, each.name) for each in rod.parameters}
    assert {name: each.unit for name, each in found.items()} == {
        "theta_A": "N mm", "theta_B": "N mm", "q": "mm²", "nu": "N", "rise": "N",
    }  # fmt: skip
    assert (found["theta_A"].symbol, found["nu"].symbol) == ("M(theta_A)", "F(nu)")
    assert em.effort_of(em.Rod(), "Theta").unit == "4π²B/L"
    bars = [em.Bar(ends, EA="1 kN") for ends in (("A", "B"), ("B", "C"))]
    truss = em.Truss(
        {"A": (-1, 0), "B": (0, 0.1), "C": (1, 0)}, bars, {"A": "xy", "C": "xy"},
        {"P": {"B": (0, -1)}}, {"a": {"A-B": 1.0}}, units={"force": "N", "length": "m"},
    )  # fmt: skip
    assert (em.effort_of(truss, "a").unit, em.effort_of(truss, "P").unit) == ("N", "m")


def test_couple_of_an_actuator_is_that_of_the_beam(rod):
    """A beam between clamps, one end turned by a small θ: M = 4 EI θ/L there (held at its length).

    2 %: θ = 0.02 with the span of the straight rod stretched into a shallow arch by 1e-4.
    """
    slack = em.Rod(EI=2.0, length=0.5, ends=("clamped", em.End(x="free")), coordinates={},
                   loads={"P": em.PointForce(0.5)})  # fmt: skip
    state = slack.natural_state(theta_A=0.02)
    assert em.effort_of(slack, "theta_A")(state) == pytest.approx(4.0 * 2.0 * 0.02 / 0.5, rel=1e-3)
    assert em.effort_of(slack, "theta_A").unit == "N m"
    del rod


def test_bounds_with_units_are_converted(rod):
    """0.5 N m are 500 N mm, 1 cm is 10 mm, 30 degrees are π/6."""
    effort = em.effort_of(rod, "theta_A")
    assert str(abs(effort) <= "0.5 N m") == "abs(effort(theta_A)) <= 500"
    assert (rod.height(0.5) >= "1 cm").bound == pytest.approx(10.0)
    assert (em.effort_of(rod, "nu") <= "1 lbf").bound == pytest.approx(4.4482216)
    for text in ("abs(effort(theta_A)) <= 0.5 N m", 'abs(effort(theta_A)) <= "0.5 N m"'):
        assert parse_comparison(text).on(rod) == (abs(effort) <= 500.0)
    turned = parse_comparison("theta_A <= 30 deg").on(rod)
    assert turned.bound == pytest.approx(np.pi / 6.0)
    assert parse_comparison("height(0.5) >= 10").on(rod).bound == 10.0


def test_absolute_values_bound_a_lift_on_both_sides(rod):
    """The lift ends where |M| reaches the bound, turning either way."""
    moment = abs(find_descriptor(rod, "effort(theta_A)"))
    assert moment == find_descriptor(rod, "abs(effort(theta_A))")
    start = rod.natural_state(theta_A=0.5, theta_B=-0.5)
    bound = moment(start) + 2e3
    ends = [em.lift(start, {"theta_A": to}, within=[moment <= bound]).end for to in (3.0, -3.0)]
    for end in ends:
        assert end.kind == "constraint"
        assert moment(end.state) == pytest.approx(bound, rel=1e-9)
    values = [em.effort_of(rod, "theta_A")(end.state) for end in ends]
    assert values[0] * values[1] < 0.0


def test_wrong_units_are_refused(rod):
    """One line each."""
    with pytest.raises(InputError, match="or a text in units of N mm; got '2 N'"):
        assert em.effort_of(rod, "theta_A") <= "2 N"
    with pytest.raises(InputError, match="must be compared with a number in 4π²B/L; got '1 N m'"):
        assert em.effort_of(em.Rod(), "Theta") <= "1 N m"
    with pytest.raises(InputError, match="must be compared with a finite number; got 'much'"):
        assert em.effort_of(rod, "theta_A") >= "much"


def test_the_larger_couple_of_two_motors_is_named_in_a_text(rod):
    """As it names itself; parts are separated outside their brackets only."""
    text = "largest(abs(end_moment(0)), abs(end_moment(1)))"
    larger, state = find_descriptor(rod, text), rod.natural_state(theta_A=0.3, theta_B=0.1)
    ends = [abs(float(rod.descriptor(f"end_moment({end})")(state))) for end in (0, 1)]
    assert (larger.name, larger.unit) == (text, "N mm")
    assert float(larger(state)) == max(ends)
    with pytest.raises(InputError, match=r"largest\(…, …\)"):
        find_descriptor(rod, "largest(couple)")
