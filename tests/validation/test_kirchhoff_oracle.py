"""The oracle of rods in space meets closed forms and published values of its own."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

import equimorph as em
from oracles.kirchhoff import (
    End,
    Rod,
    about,
    clamp,
    clamped_buckling_moment,
    composed,
    double_zero,
    free,
    straight,
)

STIFFNESS = np.array([0.77, 1.0, 1.0])
"""Of a round rod with ν = 0.3, by EI."""
TENSIONS = (0.0, 20.0, 80.0)


def twisted(moment: float, tension: float = 0.0) -> Rod:
    """A straight clamped rod, free to slide along its axis, under a twisting moment."""
    twist = moment / STIFFNESS[0]
    end = End((None, 0.0, 0.0), tuple(about((1, 0, 0), twist)), force=(tension, 0.0, 0.0))
    return straight(6, clamp(), end, STIFFNESS, (tension, 0, 0), twist, steps=5)


@pytest.mark.parametrize("tension", TENSIONS)
def test_a_clamped_rod_buckles_under_twist_where_greenhill_says(tension):
    """[Greenhill1883]_; without tension M L/B = 2 × 4.493409, tan x = x. Tolerance: 1e-9."""
    moment = clamped_buckling_moment(tension)
    if tension == 0.0:
        assert moment == pytest.approx(8.986818915818, rel=1e-12)
    found = double_zero(lambda m: twisted(m, tension).stretches[-1], moment - 0.01, moment + 0.012)
    assert found == pytest.approx(moment, rel=1e-9)


def ring(twist: float, torsion: float) -> Rod:
    """A closed ring of a straight rod, twisted by an angle, clamped where it closes."""
    count, stiffness = 6, np.array([torsion, 1.0, 1.0])
    s, up = np.arange(count) / count, np.array([0.0, 0.0, 1.0])
    a, y = 2.0 * np.pi * s, np.zeros((count, 13))
    y[:, 0], y[:, 1] = np.sin(a) / (2.0 * np.pi), (1.0 - np.cos(a)) / (2.0 * np.pi)
    y[:, 3:7] = [
        composed(about(up, b), about((1, 0, 0), twist * t)) for b, t in zip(a, s, strict=True)
    ]
    y[:, 9] = 2.0 * np.pi * torsion * twist
    y[:, 10], y[:, 11] = torsion * twist * np.cos(a), torsion * twist * np.sin(a)
    y[:, 12] = 2.0 * np.pi
    last = composed(about(up, 2.0 * np.pi), about((1, 0, 0), twist))
    return Rod(y, clamp(), clamp(turn=last), stiffness, steps=6)


@pytest.mark.parametrize(("mode", "torsion"), [(2, 0.77), (2, 1.5), (3, 0.77)])
def test_a_twisted_ring_buckles_where_michell_and_zajac_say(mode, torsion):
    """C φ/(2πB) = √(n² − 1) [Michell1889]_, [Zajac1962]_; mode n [GorielyTabor1997]_.

    A ring of a round section may turn about its clamp's tangent: one singular value is always zero.
    """

    def test(ratio):
        found = ring(2.0 * np.pi * ratio / torsion, torsion)
        assert found.residual < 1e-9
        assert found.stretches[-1] < 1e-9
        return found.stretches[-2]

    wanted = np.sqrt(mode**2 - 1.0)
    assert double_zero(test, wanted - 0.02, wanted + 0.025) == pytest.approx(wanted, rel=1e-9)


def test_rods_under_a_wrench_are_the_helices_of_kirchhoff():
    """A helix of curvature k and torsion t needs a wrench along its axis [Love1927]_, §270.

    With h = √(k² + t²), inner twist u, pitch angle sin α = t/h and cylinder radius k/h²: the force
    along the axis is n = h (C u − B t), the moment about it C u sin α + B k cos α. No tolerance
    beyond round-off of 1e-11.
    """
    torsion, bending, (k, t, u) = 0.77, 1.0, (5.0, 3.0, 4.0)
    h = np.hypot(k, t)
    radius, sine, cosine = k / h**2, t / h, k / h
    start = composed(about((0, 0, 1), 0.5 * np.pi), about((0, 1, 0), -np.arcsin(sine)))
    y = np.zeros((1, 13))
    y[0, 0], y[0, 3:7] = radius, start
    tangent, binormal = np.array([0.0, cosine, sine]), np.array([0.0, -sine, cosine])
    y[0, 9] = h * (torsion * u - bending * t)
    y[0, 10:13] = torsion * u * tangent + bending * k * binormal
    rod = Rod(
        y,
        clamp((radius, 0, 0), tuple(start)),
        free(),
        np.array([torsion, bending, bending]),
        steps=12,
    )
    s = np.linspace(0.0, 1.0, 13)
    wanted = np.stack([radius * np.cos(h * s), radius * np.sin(h * s), sine * s], axis=1)
    found = np.array([rod.place(each) for each in s])
    np.testing.assert_allclose(found, wanted, atol=1e-11)
    np.testing.assert_allclose(rod.strains()[:, 0], u, atol=1e-11)


@pytest.mark.parametrize(
    ("load", "down", "back"),
    [(1.0, 0.30172, 0.05643), (5.0, 0.71379, 0.38763), (10.0, 0.81061, 0.55500)],
)
def test_a_cantilever_bends_as_in_mattiasson(load, down, back):
    """In a plane turned about the axis, against four and five printed digits [Mattiasson1981]_."""
    across = np.array([0.0, np.cos(0.7), np.sin(0.7)])
    rod = straight(4, clamp(), free(tuple(load * across)), STIFFNESS).solved()
    tip = rod.place(1.0)
    assert tip @ across == pytest.approx(down, abs=6e-6)
    assert 1.0 - tip[0] == pytest.approx(back, abs=6e-6)


def test_stretch_and_shear_of_a_cantilever_meet_timoshenkos_beam():
    """w = P L³/(3B) + P L S for small P; a pull T stretches by S T. Tolerance: O(P²) = 1e-7."""
    load, give = 1e-4, np.array([2e-3, 5e-2, 3e-2])
    rod = straight(3, clamp(), free((0.0, load, load)), STIFFNESS, give=give).solved()
    np.testing.assert_allclose(rod.place(1.0)[1:] / load, 1.0 / 3.0 + give[1:], rtol=1e-7)
    pulled = straight(3, clamp(), free((2.0, 0.0, 0.0)), STIFFNESS, give=give).solved()
    assert pulled.place(1.0)[0] == pytest.approx(1.004, rel=1e-12)


def test_the_arch_leaves_its_plane_where_its_lateral_margin_says():
    """Two codes without a common line: 1.601471549 for Θ = 0.9 [Antman2005]_. Tolerance: 1e-9.

    The planar state of the package is a guess only; the index changes from 0 to 1.
    """
    flat = em.Rod(torsion=1.0 / 1.3, lateral=1.0)
    start = flat.natural_state(Theta=0.9)
    limit = em.limit_load(start, "q", within=[flat.stable_in_space]).value
    guess = from_planar(em.lift(start, {"q": 1.5}).end.state, 1.0 / 1.3, 1.0)

    def solved(load):
        return replace(guess, load=np.array([0.0, -load, 0.0])).solved()

    found = brentq(lambda load: solved(load).determinant, 1.5, 1.7, xtol=1e-10)
    assert found == pytest.approx(limit, rel=1e-9)
    assert [solved(load).index() for load in (1.55, 1.65)] == [0, 1]


def from_planar(state: em.State, torsion: float, lateral: float, pieces: int = 6) -> Rod:
    """A state of the planar arch as a guess in space."""
    arch, s, unit = state.structure, np.arange(pieces) / pieces, 4.0 * np.pi**2
    turn = np.array([float(arch.angle(each)(state)) for each in s])
    bend = np.array([float(arch.curvature(each)(state)) for each in s])
    along, across = state.multipliers
    y = np.zeros((pieces, 13))
    y[:, :2], y[:, 3], y[:, 6] = state.shape(s), np.cos(0.5 * turn), np.sin(0.5 * turn)
    y[:, 7], y[:, 8], y[:, 12] = -along, state["q"] * s - across, bend / unit
    first, last = state["Delta"] + state["Theta"], state["Delta"] - state["Theta"]
    ends = clamp(turn=about((0, 0, 1), first)), clamp((state["nu"], 0, 0), about((0, 0, 1), last))
    stiffness = np.array([torsion, lateral, 1.0]) / unit
    return Rod(y, *ends, stiffness, load=np.array([0.0, -state["q"], 0.0]))
