"""[TimoshenkoGere1961]_, section 7.6: circular arches and rings under uniform normal pressure."""

import numpy as np
import pytest
from scipy.optimize import brentq

import equimorph as em
from typecheck import unchecked

CLAMPED_HALF_CIRCLE = 3.0  # k tan α cot kα = 1 at α = π/2: cot kα = 0 at k = 3


def arch(half_angle, ends, **resolution):
    """Arc of radius 1 and opening 2α, stress-free without pressure; in units of B and R."""
    return em.Rod(
        ends=ends,
        curvature=-1.0,
        loads={"p": em.Pressure()},
        span=2 * np.sin(half_angle),
        EI=1.0,
        length=2 * half_angle,
        **resolution,
    )


def buckled(half_angle, ends, k, **resolution):
    """First critical point as the pressure from outside grows."""
    angles = {"theta_A": half_angle, "theta_B": -half_angle}
    clamped = {"Theta": half_angle} if ends == ("clamped", "clamped") else {}
    if ends == ("clamped", "pinned"):
        clamped = {"theta_A": angles["theta_A"]}
    rod = arch(half_angle, ends, **resolution)
    return em.lift(rod.natural_state(**clamped), {"p": -1.2 * (k**2 - 1)}).end


@pytest.mark.parametrize("half_angle", np.deg2rad([30, 60, 90, 120]))
def test_buckling_pressure_of_two_hinged_arches(half_angle):
    """p R³/B = k² − 1 with k = π/α, sideways. 1e-8: the default elements."""
    k = np.pi / half_angle
    end = buckled(half_angle, ("pinned", "pinned"), k)
    assert end.kind == "branch point"
    assert -end.state["p"] == pytest.approx(k**2 - 1, rel=1e-8)


@pytest.mark.parametrize("half_angle", np.deg2rad([30, 60, 90, 120]))
def test_buckling_pressure_of_clamped_arches(half_angle):
    """k tan α cot kα = 1, sideways; 8 at the half circle. 1e-8: the default elements."""

    def condition(k):
        ka = k * half_angle
        return k * np.sin(half_angle) * np.cos(ka) - np.cos(half_angle) * np.sin(ka)

    low, high = 1.2 * np.pi / half_angle, 1.6 * np.pi / half_angle
    k = brentq(condition, low, high, xtol=1e-14)
    if half_angle == np.pi / 2:
        assert k == pytest.approx(CLAMPED_HALF_CIRCLE, rel=1e-12)
    end = buckled(half_angle, ("clamped", "clamped"), k)
    assert end.kind == "branch point"
    assert -end.state["p"] == pytest.approx(k**2 - 1, rel=1e-8)


def test_an_arch_carries_pressure_as_a_circle():
    """Before it buckles the arc stays what it is, with the thrust p R: both to round-off."""
    rod = arch(1.0, ("pinned", "pinned"))
    state = em.lift(rod.natural_state(), {"p": -5.0}).end.state
    s = np.linspace(0, 1, 21)
    assert np.abs(rod.fields(state.z[None], state.p[None], s)[0, :, 1] + 1).max() < 1e-10
    thrust = rod.support_force("lambda")(state), rod.support_force("mu")(state)
    assert thrust == pytest.approx((5.0 * np.cos(1.0), 5.0 * np.sin(1.0)), rel=1e-10)
    half_lens = 1.0 - np.sin(1.0) * np.cos(1.0)
    assert rod.total_energy(state) == pytest.approx(5.0 * half_lens, rel=1e-10)


def test_inflating_a_slack_strip_makes_it_a_circle():
    """High pressure outweighs bending: an arc of the rod's length over the span, c = 2 R sin(L/2R).

    Bending moves the crown by about B/(p R²), in layers at the pins as long as √(B/pR): 14 elements
    resolve those at p = 10⁴.
    """
    rod = em.Rod(
        ends=("pinned", "pinned"), actuators={"k": em.Curvature()}, loads={"p": em.Pressure()},
        span=0.7, EI=1.0, length=1.0, elements=14,
    )  # fmt: skip
    state = rod.natural_state(k=-3.0)
    radius = brentq(lambda r: 2 * r * np.sin(0.5 / r) - 0.7, 0.2, 2.0)
    crown = radius * (1 - np.cos(0.5 / radius))
    errors = []
    for pressure in (1e3, 1e4):
        with unchecked():
            state = em.lift(state, {"p": pressure}).end.state
            slack = em.lift(state, {"k": 0.0}).end.state
        errors.append(rod.height(0.5)(slack) - crown)
    assert errors[1] < 1 / (1e4 * radius**2)
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.3)


def test_elements_that_are_too_long_for_a_pressure_are_named():
    """Six elements at p = 10⁴, where layers at the pins are as long as a fiftieth of the rod.

    Angles look smooth; what is integrated inside the elements shows that they are not. Ten times
    less is resolved, and the error estimate agrees.
    """
    rod = em.Rod(
        ends=("pinned", "pinned"), actuators={"k": em.Curvature()}, loads={"p": em.Pressure()},
        span=0.7, EI=1.0, length=1.0,
    )  # fmt: skip
    with unchecked():
        fine = em.lift(rod.natural_state(k=-3.0), {"p": 1e3}).end
        coarse = em.lift(fine.state, {"p": 1e4}).end
    assert fine.state.resolved
    assert fine.detail == ""
    assert fine.state.error_estimate < 1e-6
    assert not coarse.state.resolved
    assert coarse.detail == "the discretisation does not resolve the state: refine it"
    assert coarse.state.error_estimate > 1.0


@pytest.mark.parametrize("degree", [3, 4])
def test_curvature_converges_with_twice_the_degree_under_pressure(degree):
    """Observed order of max |κ|, recovered from moments: 2·degree within 0.3, of a much finer one.

    Four and eight elements between a clamp and a pin.
    """

    def largest(**resolution):
        rod = em.Rod(
            ends=("clamped", "pinned"), curvature=-2.0, loads={"p": em.Pressure()},
            span=0.82, EI=1.0, length=1.0, **resolution,
        )  # fmt: skip
        state = em.lift(rod.natural_state(theta_A=1.1), {"p": -20.0}).end.state
        return rod.max_curvature(state)

    exact = largest(elements=12, degree=9)
    errors = [abs(largest(elements=n, degree=degree) - exact) for n in (4, 8)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * degree, abs=0.3)
