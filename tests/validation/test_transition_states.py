"""Barriers of others: landscapes of topsearch 0.0.3, and buckled beams that are pushed through.

topsearch (Dicks and Pyzer-Knapp) maps landscapes of chemistry. Its numbers here are those that it
prints for its own six-hump camel function and for a chain of three wells. A buckled beam snaps over
its second buckling mode: so does a pinned one that may shorten, in closed form (Chakraborty, Bagchi
and Sebastian, cond-mat/0411253), and a clamped inextensible one, whose energies elliptic integrals
and a shooting method give.
"""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve
from scipy.special import ellipe, ellipk

import equimorph as em
from typecheck import unchecked

CAMEL = ([-1.03162845, -1.03162845, -0.21546382, -0.21546382, 2.10425031, 2.10425031],
         [0.0, 0.54371860, 0.54371860, 2.22935720, 2.22935720, 2.22947082, 2.22947082])  # fmt: skip
CHAIN = (
    [-0.80058353, -0.70061077, -0.6198546, -0.61500825, -0.52567522, -0.52035908, -0.45786315,
     -0.36751618],
    [-0.49780978, -0.45310500, -0.45125464, -0.44057306, -0.42934813, -0.39809746, -0.35827669,
     -0.33596906, -0.32461091, -0.28208575, -0.27280329, -0.23477048],
)  # fmt: skip


def wells(energy: str, names: str, natural: np.ndarray) -> em.EnergyStructure:
    load = em.Parameter("f", "1", 1.0, "load", 0.0)
    unknowns = [em.Unknown(each, float(at), guesses=(-3, 3)) for each, at in
                zip(names, natural, strict=True)]  # fmt: skip
    return em.EnergyStructure(f"{energy} - f*{names[0]}", unknowns, [load])


def camel() -> em.EnergyStructure:
    def slope(u: np.ndarray) -> tuple[float, float]:
        x, y = u
        return y + 8 * x - 8.4 * x**3 + 2 * x**5, x + 16 * y**3 - 8 * y

    natural = fsolve(slope, [0.09, -0.71], xtol=1e-12)
    energy = "(4 - 2.1*x**2 + x**4/3)*x**2 + x*y + (4*y**2 - 4)*y**2"
    return wells(energy, "xy", natural)


def chain() -> em.EnergyStructure:
    def slope(u: np.ndarray) -> np.ndarray:
        pull = 0.1 * np.diff(u)
        return u**3 - u - [0.05, 0, 0] - np.append(pull, 0) + np.insert(pull, 0, 0)

    alone = "+".join(f"{name}**4/4 - {name}**2/2" for name in "abc")
    joined = "+".join(f"0.05*({one} - {other})**2" for one, other in pairwise("abc"))
    return wells(f"{alone} - 0.05*a + {joined}", "abc", fsolve(slope, np.ones(3), xtol=1e-14))


@pytest.mark.parametrize(("make", "known"), [(camel, CAMEL), (chain, CHAIN)])
def test_minima_and_saddles_are_those_of_topsearch(make, known):
    """All digits that topsearch converges, 1e-8; it took 40 and 65 times as long."""
    network = em.transition_network(make(), {})
    assert network.energy[network.minima] == pytest.approx(known[0], abs=2e-8)
    assert network.energy[network.saddles] == pytest.approx(known[1], abs=2e-8)
    assert len({frozenset(row) for row in network.ends.tolist()}) > 1


@pytest.mark.parametrize(("shortening", "straight"), [(0.03, True), (0.06, False)])
def test_a_pinned_beam_snaps_straight_or_over_its_second_mode(shortening, straight):
    """E = EA/2 (2 ε εₙ − εₙ²) in mode n, EA ε²/2 straight: S-shaped saddles from ε = ε₂ on.

    Shallow beam of length 1, w = Σ aₙ sin nπx, with Euler strains εₙ = n² ε₁ = 0.01, 0.04, 0.09.
    """
    first = 0.01
    bending = "+".join(f"{first * n**4}*a{n}**2" for n in (1, 2, 3))
    mean = "+".join(f"{n**2}*a{n}**2" for n in (1, 2, 3))
    size = np.sqrt(0.06 - first)  # natural shape at ε = 0.06
    unknowns = [
        em.Unknown(f"a{n}", float(size) if n == 1 else 0.0, guesses=(-1, 1)) for n in (1, 2, 3)
    ]
    beam = em.EnergyStructure(
        f"{bending} - f*a1 + ({mean} - e)**2/2", unknowns,
        [em.Parameter("e", "1", 1.0, "actuator", 0.06), em.Parameter("f", "1", 1.0, "load", 0.0)],
    )  # fmt: skip
    network = em.transition_network(beam, {"e": shortening})
    assert len(network.minima) == 2
    lowest = shortening * first - first**2 / 2
    top = shortening**2 / 2 if straight else 0.04 * shortening - 0.04**2 / 2
    barrier = network.barrier(network.states[network.minima][0])
    assert barrier.energy == pytest.approx(top - lowest, abs=1e-9)
    assert (abs(barrier.saddle.z[1]) < 1e-6) == straight


@pytest.mark.parametrize("span", [0.99, 0.9])
def test_a_clamped_beam_is_pushed_through_over_its_second_mode(span):
    """First mode: ν = 2 E/K − 1, U = (2 K/π)² (ν − 1 + 2 k²) in λ_cr L; second by shooting.

    Tolerance: of the discretisation. For small shortening the barrier is 1.0457 λ_cr (1 − ν).
    """
    m = brentq(lambda m: 2 * ellipe(m) / ellipk(m) - 1 - span, 1e-6, 0.9, xtol=1e-15)
    lowest = (2 * ellipk(m) / np.pi) ** 2 * (span - 1 + 2 * m)
    top = second_mode(span)
    with unchecked():
        network = em.transition_network(em.Rod(span=span), {"Theta": 0, "Delta": 0, "q": 0})
        states = network.states[network.minima]
        assert len(states) == 2
        barrier = network.barrier(states[0])
        path = network.path(states[0], states[1])
    assert states[0].energy == pytest.approx(lowest, rel=1e-6)
    assert barrier.energy == pytest.approx(top - lowest, rel=1e-6)
    assert barrier.energy == pytest.approx(1.0457 * (1 - span), rel=1.5 * (1 - span))
    middle = path.saddles.structure.height(0.5)(path.saddles)
    assert np.abs(middle).max() < 1e-8
    heights = path.states.structure.height(0.5)(path.states)
    assert heights[0] == pytest.approx(-heights[-1], abs=1e-8)


def second_mode(span: float) -> float:
    """Energy of the S-shaped elastica: half of it is clamped and pinned; units λ_cr L."""

    def shoot(unknown: np.ndarray) -> np.ndarray:
        turn, force, shear = unknown

        def rates(_: float, y: np.ndarray) -> list[float]:
            theta, kappa = y[0], y[1]
            return [kappa, -force * np.sin(theta) + shear * np.cos(theta), np.cos(theta),
                    np.sin(theta), 0.5 * kappa**2]  # fmt: skip

        return solve_ivp(rates, (0, 0.5), [0, turn, 0, 0, 0], rtol=1e-11, atol=1e-13).y[:, -1]

    load, root = 80.763, 8.9868  # of the straight beam, tan(ω/2) = ω/2
    slope = 4.0 * np.sqrt(1 - span) * root

    def miss(unknown: np.ndarray) -> list[float]:
        end = shoot(unknown)
        return [end[1], end[2] - span / 2, end[3]]

    found = fsolve(miss, [slope / 2, load, -slope], xtol=1e-13)
    return 2 * shoot(found)[4] / (4 * np.pi**2)


@pytest.mark.parametrize("span", [0.9, np.sin(1.0)])
def test_energy_released_where_an_inverted_strip_snaps(span):
    """Both ends turned alike, as by Cazzolli and Dal Corso (2019): energies of both elasticae.

    Neither is published as a number; both are computed by shooting at the angle of the pitchfork.
    """
    rod = em.Rod(span=span)
    with unchecked():
        network = em.transition_network(rod, {"Theta": 0, "Delta": 0, "q": 0}, starts=30)
        inverted = min(network.states[network.minima], key=rod.elevation)
        end = em.lift(inverted, {"Theta": 1.2}).end
        landings = em.snap_landing(end.state)
    angle = end.state["Theta"]
    known = symmetric(angle, span, [-12.0, 60.0]) - symmetric(angle, span, [-2 * angle, 0.0])
    assert end.kind == "branch point"
    assert [each.released for each in landings] == pytest.approx([known] * 2, rel=1e-9)


def symmetric(angle: float, span: float, guess: list[float]) -> float:
    """Energy of a symmetric elastica with given end angles, by shooting; units λ_cr L."""

    def shoot(unknown: np.ndarray) -> np.ndarray:
        turn, force = unknown

        def rates(_: float, y: np.ndarray) -> list[float]:
            return [y[1], -force * np.sin(y[0]), np.cos(y[0]), 0.5 * y[1] ** 2]

        return solve_ivp(rates, (0, 0.5), [angle, turn, 0, 0], rtol=1e-11, atol=1e-13).y[:, -1]

    found = fsolve(lambda u: (shoot(u)[0], shoot(u)[2] - span / 2), guess, xtol=1e-12)
    return 2 * shoot(found)[3] / (4 * np.pi**2)
