"""[Mattiasson1981]_: cantilever under a dead transverse tip load, by elliptic integrals."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

import equimorph as em

TABLE = {
    1: (0.30172, 0.05643),
    2: (0.49346, 0.16064),
    5: (0.71379, 0.38763),
    10: (0.81061, 0.55500),
}


def exact(load):
    """(w/L, u/L) at P L²/B = `load`: k from F(π/2, k) − F(φ₀, k) = √load, sin φ₀ = 1/(k√2)."""
    root = np.sqrt(load)

    def arc(m):
        start = np.arcsin(1 / np.sqrt(2 * m))
        return ellipk(m) - ellipkinc(start, m)

    m = brentq(lambda m: arc(m) - root, 0.5 + 1e-14, 1 - 1e-14, xtol=1e-16)
    start = np.arcsin(1 / np.sqrt(2 * m))
    w = 1 - 2 * (ellipe(m) - ellipeinc(start, m)) / root
    u = 1 - np.sqrt(2 * (2 * m - 1)) / root
    return w, u


@pytest.fixture(scope="module")
def cantilever():
    loads = {"P": em.PointForce(1.0)}
    return em.Rod(ends=("clamped", "free"), loads=loads, EI=1.0, length=1.0)


@pytest.mark.parametrize("load", [0.2, 1, 2, 5, 10])
def test_tip_displacements_of_the_cantilever(cantilever, load):
    """Elliptic integrals, 1e-10 of superconvergent tips; the table to its five digits."""
    state = em.lift(cantilever.natural_state(), {"P": float(load)}).end.state
    x, y = cantilever.position(1.0)
    assert (-y(state), 1 - x(state)) == pytest.approx(exact(load), abs=1e-10)
    if load in TABLE:
        assert (-y(state), 1 - x(state)) == pytest.approx(TABLE[load], abs=6e-6)
    assert state.stable
    # equilibrium of moments about the clamp
    assert cantilever.end_moment(0)(state) == pytest.approx(load * x(state), rel=1e-10)


@pytest.mark.parametrize(("degree", "coarse"), [(3, 12), (4, 6)])
def test_tips_converge_with_twice_the_degree(degree, coarse):
    """Observed order of the tip: 2·degree within 0.3, as the coarser mesh is not yet fine."""
    errors = []
    for elements in (coarse, 2 * coarse):
        rod = em.Rod(
            ends=("clamped", "free"),
            loads={"P": em.PointForce(1.0)},
            elements=elements,
            degree=degree,
            EI=1.0,
            length=1.0,
        )
        state = em.lift(rod.natural_state(), {"P": 5.0}).end.state
        errors.append(abs(-rod.height(1.0)(state) - exact(5)[0]))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * degree, abs=0.3)
