"""[TimoshenkoGere1961]_, sections 2.1–2.7: columns and the elastica, in closed form."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

import equimorph as em


def column(ends, **options):
    """Straight rod along x with an axial load P at B towards A, in units of B and L."""
    loads = {"P": em.PointForce(1.0, (-1.0, 0.0)), "M": em.Couple(1.0)}
    return em.Rod(ends=ends, loads=loads, EI=1.0, length=1.0, **options)


@pytest.mark.parametrize(
    ("ends", "root"),
    [
        (("clamped", "free"), np.pi / 2),
        (("pinned", em.End("free", "free", "held")), np.pi),
        (("clamped", em.End("free", "free", "held")), 4.493409457909064),
        (("clamped", "sliding"), 2 * np.pi),
        (("clamped", em.End("held", "free", "free")), np.pi),
    ],
    ids=["cantilever", "pinned", "clamped and pinned", "clamped", "clamped and guided"],
)
def test_euler_loads(ends, root):
    """P = root² B/L², tan root = root for clamped and pinned ends; a supercritical pitchfork."""
    path = em.lift(column(ends).natural_state(), {"P": 1.2 * root**2})
    assert path.end.kind == "branch point"
    assert path.end.criticality == "supercritical"
    assert path.end.state["P"] == pytest.approx(root**2, rel=1e-9)


def test_a_spring_at_the_foot_lowers_the_euler_load():
    """Rigid limit: k tan k L = c L/B with a rotation spring c at the foot of a free column."""
    c = 2.0
    root = 1.0768739863118039  # k tan k = 2
    assert root * np.tan(root) == pytest.approx(c, rel=1e-12)
    path = em.lift(column((em.End(angle=c), "free")).natural_state(), {"P": 2.0})
    assert path.end.kind == "branch point"
    assert path.end.state["P"] == pytest.approx(root**2, rel=1e-9)


@pytest.mark.parametrize(
    ("degrees", "printed"),
    [(60, (1.1517, 0.7410, 0.5932)), (160, (4.0301, -0.3403, 0.6246)), (20, None), (120, None)],
)
def test_cantilever_post_buckling(degrees, printed):
    """P/P_cr = (2K/π)², x = 2E/K − 1, y = 2k/K with k = sin α/2: led round by an end couple."""
    rod, alpha = column(("clamped", "free")), np.deg2rad(degrees)
    m = np.sin(alpha / 2) ** 2
    load = ellipk(m) ** 2
    side = em.lift(rod.natural_state(), {"M": 1.5}).end.state
    state = em.lift(em.lift(side, {"P": load}).end.state, {"M": 0.0}).end.state
    x, y = rod.position(1.0)
    found = state["P"] * 4 / np.pi**2, x(state), y(state)
    exact = 4 * load / np.pi**2, 2 * ellipe(m) / ellipk(m) - 1, 2 * np.sqrt(m) / ellipk(m)
    assert found == pytest.approx(exact, abs=1e-9)
    assert rod.angle(1.0)(state) == pytest.approx(alpha, abs=1e-9)
    if printed:
        assert found == pytest.approx(printed, abs=6e-5)
    assert state.stable


@pytest.mark.parametrize("nu", [0.9, 0.5, 0.1])
def test_pinned_elastica(nu):
    """ν = 2E/K − 1, P = 4K², rise k/K: pushed together from a bent shape that is straightened."""
    m = brentq(lambda m: 2 * ellipe(m) / ellipk(m) - 1 - nu, 1e-12, 0.999, xtol=1e-16)
    rod = em.Rod(
        ends=("pinned", "pinned"), actuators={"k": em.Curvature()}, loads={}, EI=1.0, length=1.0
    )
    bent = em.lift(rod.natural_state(k=-2.0, nu=0.95), {"nu": nu})
    state = em.lift(bent.end.state, {"k": 0.0}).end.state
    assert rod.support_force("lambda")(state) == pytest.approx(4 * ellipk(m) ** 2, rel=1e-9)
    assert rod.height(0.5)(state) == pytest.approx(np.sqrt(m) / ellipk(m), rel=1e-9)
    assert state.stable


@pytest.mark.parametrize("moment", [0.5, np.pi, 2 * np.pi, 4 * np.pi])
def test_an_end_couple_bends_into_a_circle(moment):
    """x = L sin t/t, y = L (1 − cos t)/t with t = M L/B, once and twice round. Round-off."""
    rod = column(("clamped", "free"))
    state = em.lift(rod.natural_state(), {"M": moment}).end.state
    x, y = rod.position(1.0)
    assert (x(state), y(state)) == pytest.approx(
        (np.sin(moment) / moment, (1 - np.cos(moment)) / moment), abs=1e-11
    )
    assert rod.max_curvature(state) == pytest.approx(moment, rel=1e-11)
    assert state.energy == pytest.approx(-0.5 * moment**2, rel=1e-11)
