"""[TadjbakhshOdeh1967]: rings of members under hydrostatic pressure, which close by themselves.

Three components of supports take up the rigid motions of a ring, and nothing else.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigvals
from scipy.optimize import fsolve

import equimorph as em
from equimorph.structures import Frame, Member
from oracles.frames import loaded
from typecheck import unchecked

CONTACT = 5.247  # pressure at which opposite points touch, in B/R³: section 3 of the paper


def ring(members, **resolution):
    """A ring of radius 1 with a pair of forces that squeezes it, run through counterclockwise."""
    names = [chr(65 + k) for k in range(members)]
    places = np.exp(1j * (2.0 * np.pi * np.arange(members) / members - 0.5 * np.pi))
    joints = dict(zip(names, zip(places.real, places.imag, strict=True), strict=True))
    pairs = zip(names, [*names[1:], names[0]], strict=True)
    arcs = [Member(pair, curvature=1.0) for pair in pairs]
    first, middle = names[0], names[members // 2]
    loads = {"p": {"pressure": [*names, first]}, "F": {first: (0, 1), middle: (0, -1)}}
    return Frame(joints, arcs, {first: "xy", middle: "x"}, loads, **resolution)


def buckling_pressures(frame):
    """Where stiffness vanishes that is linear in the pressure, as on the circle near p = 3."""
    stiff = []
    for p in (2.8, 2.9):
        state = loaded(frame, p=p)
        given = state.z[None], state.p[None], np.zeros((1, 2))
        stiff.append(frame.layout.dense(frame.linearised(*given)[2])[0])
    with np.errstate(all="ignore"):
        found = 2.8 + 0.1 * eigvals(stiff[0], stiff[0] - stiff[1])
    real = found[np.isfinite(found) & (np.abs(found.imag) < 1e-6)].real
    return np.sort(real[(real > 1.0) & (real < 20.0)])


@pytest.mark.parametrize("members", [3, 4])
def test_rings_buckle_in_n_waves_at_squares_less_one(members):
    """p = (n² − 1) B/R³ [TimoshenkoGere1961]_, in two ways each; 1e-8: the default elements."""
    found = buckling_pressures(ring(members))
    np.testing.assert_allclose(found, [3.0, 3.0, 8.0, 8.0, 15.0, 15.0], rtol=1e-8)


@pytest.mark.parametrize("degree", [3, 4])
def test_buckling_pressures_converge_with_twice_the_degree(degree):
    """Observed order of the error of p = 3 from halving elements: 2·degree within 0.3."""
    errors = [
        np.abs(buckling_pressures(ring(4, elements=elements, degree=degree))[0] - 3.0)
        for elements in (2, 4, 8)
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 2 * degree, atol=0.3)


def test_a_lift_ends_where_a_ring_buckles_in_two_ways():
    """p = 3 with two eigenvalues that vanish at once; 1e-6: half the digits of a double root."""
    with unchecked():
        end = em.lift(ring(4).natural_state(), {"p": 9.0}).end
    assert end.kind == "multiple point"
    assert end.state["p"] == pytest.approx(3.0, rel=1e-6)


def squeezed(pressure, force, guess):
    """Half the distance of the loads on a ring, and the moments under them and aside.

    A quarter from a load F, by shooting, with the force R on its far end and the normal n to the
    left: R' = −p n, M' = R_x sin θ − R_y cos θ, θ' = 1 + M; R_y = −F/2 at the load, R_x = 0 aside.
    """

    def end(start):
        def rates(_, state):
            theta, moment, along, across = state[0], state[1], *state[3:]
            s, c = np.sin(theta), np.cos(theta)
            return [1.0 + moment, along * s - across * c, s, pressure * s, -pressure * c]

        first = [0.0, start[0], 0.0, start[1], -0.5 * force]
        return solve_ivp(
            rates, (0.0, 0.5 * np.pi), first, rtol=1e-12, atol=1e-13, method="DOP853"
        ).y[:, -1]

    found = fsolve(lambda start: end(start)[[0, 3]] - [0.5 * np.pi, 0.0], guess, xtol=1e-11)
    last = end(found)
    assert np.abs(last[[0, 3]] - [0.5 * np.pi, 0.0]).max() < 1e-10
    return last[2], found[0], last[1]


@pytest.mark.parametrize("pressure", [2.0, 3.5, 4.5, -6.0])
def test_squeezed_rings_are_those_of_force_balance(pressure):
    """Before and after buckling, against shooting without a potential; 1e-8: its tolerance."""
    frame = ring(4)
    start = loaded(frame, F=0.1)
    with unchecked():
        state = em.lift(start, {"p": pressure}).end.state
    assert state["p"] == pressure
    assert state.index == 0
    under, aside = frame.moment("A-B", "A")(state), frame.moment("A-B", "B")(state)
    thrust = frame.axial("A-B", "A")(state)
    half, *moments = squeezed(pressure, 0.1, [under, thrust])
    rise = frame.displacement("C", "y")(state) - frame.displacement("A", "y")(state)
    assert 1.0 + 0.5 * rise == pytest.approx(half, abs=1e-8)
    np.testing.assert_allclose([under, aside], moments, atol=1e-8)


def test_opposite_points_touch_at_the_published_pressure():
    """5.247 B/R³, four digits in print: half a ring of two members, one end of which slides."""
    joints = {"A": (0, -1), "B": (1, 0), "C": (0, 1)}
    arcs = [Member(("A", "B"), curvature=1.0), Member(("C", "B"), curvature=-1.0)]
    supports = {"A": "fixed", "C": {"x": "held", "angle": "held"}}
    frame = Frame(joints, arcs, supports, {"p": {"pressure": ["A", "B", "C"]}})
    apart = frame.displacement("C", "y")
    with unchecked():
        path = em.lift(frame.natural_state(), {"p": 9.0})
        assert path.end.kind == "branch point"
        assert path.end.state["p"] == pytest.approx(3.0, rel=1e-9)
        ways = em.branches(path.end.state, "p", path=path)
        inward = min(ways, key=lambda way: apart(way.state))
        touch = em.lift(inward.state, {"p": 12.0}, within=[apart >= -2.0]).end
    assert touch.kind == "constraint"
    assert touch.state["p"] == pytest.approx(CONTACT, abs=5e-4)


@pytest.mark.parametrize("pressure", [1.5, -2.0])
def test_rings_vibrate_as_in_closed_form(pressure):
    """ω² = n² (n² − 1) (n² − 1 − p) / (n² + 1) of a free ring of EI, R and mass per length of 1.

    A quarter whose ends slide along two lines of symmetry has the even n. It is the form without
    pressure, and zero where the ring buckles, as stiffness is linear in p. 1e-7: the default
    elements.
    """
    joints = {"A": (0, -1), "B": (1, 0)}
    supports = {"A": {"x": "held", "angle": "held"}, "B": {"y": "held", "angle": "held"}}
    arc = Member(("A", "B"), curvature=1.0, mass=0.5 * np.pi)
    quarter = Frame(joints, [arc], supports, {"p": {"pressure": ["A", "B"]}}, elements=4)
    squares = np.array([2.0, 4.0, 6.0]) ** 2
    wanted = squares * (squares - 1.0) * (squares - 1.0 - pressure) / (squares + 1.0)
    found = loaded(quarter, p=pressure).natural_frequencies(3)
    np.testing.assert_allclose(found, np.sqrt(wanted), rtol=1e-7)
