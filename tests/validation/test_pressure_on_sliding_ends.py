"""Pressure where ends move along lines: against force balance, which knows no potential."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

import equimorph as em
from typecheck import unchecked

BENT, CLAMP, SLOPE, RISE = -1.5, 0.8, 0.3, 0.05


def shot(start, pressure):
    """Angle, moment, place and force at end B from those at A.

    Balance of a piece of rod with the force R and moment M on its far end, and the normal to the
    left n = (−sin θ, cos θ): R' = −p n, M' = R_x sin θ − R_y cos θ, θ' = κ₀ + M.
    """

    def rates(_, state):
        theta, moment, along, across = state[0], state[1], *state[4:]
        s, c = np.sin(theta), np.cos(theta)
        return [BENT + moment, along * s - across * c, c, s, pressure * s, -pressure * c]

    return solve_ivp(rates, (0.0, 1.0), start, rtol=1e-11, atol=1e-12, method="DOP853").y[:, -1]


def rolling(end, way):
    """No moment at B, B on its line, no force along the line."""
    _, moment, x, y, *force = end
    c, s = np.cos(way), np.sin(way)
    return [moment, c * y - s * x, c * force[0] + s * force[1]]


CASES = {
    "rolls along x": (em.End("free", x="free"), {}, lambda end: rolling(end, 0.0)),
    "rolls along x above A": (
        em.End("free", x="free"),
        {"rise": RISE},
        lambda end: [end[1], end[3] - RISE, end[4]],
    ),
    "rolls along y": (
        em.End("free", y="free"),
        {"span": 0.8},
        lambda end: [end[1], end[2] - 0.8, end[5]],
    ),
    "rolls along a slope": (
        em.End("free", slide=SLOPE),
        {"span": 0.0, "rise": 0.0},
        lambda end: rolling(end, SLOPE),
    ),
    "on a spring along x": (
        em.End("free", x=20.0),
        {"span": 0.9, "rise": RISE},
        lambda end: [end[1], end[3] - RISE, end[4] + 20.0 * (end[2] - 0.9)],
    ),
    "on a spring across a held height": (
        em.End("free", y=30.0),
        {"span": 0.85, "rise": RISE},
        lambda end: [end[1], end[2] - 0.85, end[5] + 30.0 * (end[3] - RISE)],
    ),
}


@pytest.mark.parametrize(("last", "options", "conditions"), CASES.values(), ids=CASES)
@pytest.mark.parametrize("pressure", [4.0, -6.0])
def test_states_under_pressure_solve_the_balance_of_forces(last, options, conditions, pressure):
    """Shooting from near the state meets it: moment and force at A, place and angle of B."""
    rod = em.Rod(
        ends=("clamped", last), curvature=BENT, loads={"p": em.Pressure()}, EI=1.0, length=1.0,
        **options,
    )  # fmt: skip
    with unchecked():
        found = em.lift(rod.natural_state(theta_A=CLAMP), {"p": pressure}).end
    assert found.kind == "arrived"
    state = found.state
    theta, kappa, x, y = rod.fields(state.z[None], state.p[None], np.array([0.0, 1.0]))[0].T
    force = [-rod.support_force(name)(state) for name in ("lambda", "mu")]
    exact = np.array([kappa[0] - BENT, *force])

    def miss(guess):
        return conditions(shot([CLAMP, guess[0], 0.0, 0.0, *guess[1:]], pressure))

    met, _, status, _ = fsolve(miss, 1.001 * exact + 1e-4, full_output=True, xtol=1e-13)
    assert status == 1
    np.testing.assert_allclose(met, exact, rtol=1e-7, atol=1e-7)
    end = shot([CLAMP, met[0], 0.0, 0.0, *met[1:]], pressure)
    np.testing.assert_allclose([theta[1], x[1] - x[0], y[1] - y[0]], end[[0, 2, 3]], atol=1e-8)


def test_both_ends_may_move_along_perpendicular_lines():
    """A along x and B along y: seen from B, with θ → θ(1 − s) + π, it is the same rod mirrored.

    The rod with A along y and B along x, turned by a quarter, must have the same energies.
    """
    free = {"curvature": BENT, "loads": {"p": em.Pressure()}, "EI": 1.0, "length": 1.0}
    one = em.Rod(ends=(em.End(x="free"), em.End("free", y="free")), **free)
    other = em.Rod(ends=(em.End(y="free"), em.End("free", x="free")), **free)
    with unchecked():
        here = em.lift(one.natural_state(theta_A=CLAMP), {"p": 3.0}).end.state
        there = em.lift(other.natural_state(theta_A=CLAMP + np.pi / 2), {"p": 3.0}).end.state
    assert one.max_curvature(here) == pytest.approx(other.max_curvature(there), rel=1e-9)
    np.testing.assert_allclose(here.margin, there.margin, rtol=1e-7)


@pytest.mark.parametrize(
    ("ends", "said"),
    [
        (("clamped", "free"), "one that moves in x and y, at which pressure is a follower load"),
        (("clamped", em.End(x=2.0, y=3.0)), "one that moves in x and y"),
        ((em.End(x=2.0), em.End(x=3.0)), "must not both move along x"),
    ],
)
def test_what_has_no_potential_is_refused_by_name(ends, said):
    with pytest.raises(em.InputError, match=said):
        em.Rod(ends=ends, loads={"p": em.Pressure()})
