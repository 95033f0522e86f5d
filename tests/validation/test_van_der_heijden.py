"""Clamped twisted rods: the localised buckle of a long one, and where a bent one leaves its plane.

A round rod of unit length between clamps on one axis, turned by R against each other and moved
together by d; moments M, m in B/L, forces T, t in B/L², γ = C/B.
"""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

import equimorph as em
from equimorph.structures.discrete import correct_at_parameters
from equimorph.structures.spatial.quaternions import exponential, product

UNIT = 4.0 * np.pi**2
"""Of forces in B/L²."""
GAMMA, TURNED, SLACK = 0.789 / 1.345, 27.0 * 2.0 * np.pi, 0.03
MOMENT, TENSION = 98.541496171190744, 2.900993205792131e3
"""Rod and solution of the example of [Gazzola2018]_."""


def buckle(s):
    """Axis of the localised buckle, s from −½ to ½ [HeijdenNeukirch2003]_, equations 27 and 52."""
    root = np.sqrt(4.0 * TENSION - MOMENT**2)
    aside = 0.5 * root / TENSION * 2.0 / np.cosh(0.5 * root * s)
    turn = 0.5 * MOMENT * s
    along = s - root / TENSION * np.tanh(0.5 * root * s)
    return np.stack([along, aside * np.sin(turn), -aside * np.cos(turn)], axis=-1)


def cross_sections(s):
    """Rotations between places on the buckle: carried along without turning, twisted evenly."""
    chords = np.diff(buckle(s), axis=0)
    chords /= np.linalg.norm(chords, axis=1, keepdims=True)
    bends = np.concatenate([1.0 + (chords[:-1] * chords[1:]).sum(axis=1)[:, None],
                            np.cross(chords[:-1], chords[1:])], axis=1)  # fmt: skip
    bends /= np.linalg.norm(bends, axis=1, keepdims=True)
    ahead = np.array([1.0, 0.0, 0.0])
    twist = MOMENT / GAMMA * (s[1] - s[0])
    found = [exponential((0.5 * twist - 0.5 * TURNED) * ahead)]
    for bend in bends:
        found.append(product(product(bend, found[-1]), exponential(twist * ahead)))
    return np.array(found)


@pytest.mark.slow
def test_a_buckle_of_27_turns_has_the_published_moment_and_tension():
    """d = √(16/T (1 − M²/4T)), R = M/γ + 4 arccos(M/2√T) [NeukirchHeijden2002]_, 14 and 15.

    The clamps are where exp(−½ √(4T − M²)) = 2e-5 of the buckle are left: M and T change by its
    square, shapes by itself.
    """
    share = MOMENT / (2.0 * np.sqrt(TENSION))
    assert np.sqrt(16.0 / TENSION * (1.0 - share**2)) == pytest.approx(SLACK, rel=1e-14)
    assert MOMENT / GAMMA + 4.0 * np.arccos(share) == pytest.approx(TURNED, rel=1e-14)
    span = 1.0 - SLACK
    rod = em.SpatialRod(
        torsion=GAMMA, lateral=1.0, loads={}, span=span, phase=True, elements=32, degree=8
    )
    own, given = rod.mechanics, rod.natural_parameters({"twist_A": np.pi, "twist_B": -np.pi})[None]
    fine = np.linspace(-0.5, 0.5, 10001)
    turns, inner = cross_sections(fine), own.mesh.nodes[own.model.unknown_nodes] - 0.5
    z = np.zeros((1, own.size))
    middle = 0.5 * (fine[1:] + fine[:-1])
    z[0, : own.unknowns] = np.stack(
        [np.interp(inner, middle, each) for each in turns.T], axis=1
    ).ravel()
    z[0, own.unknowns] = -TENSION / UNIT
    z, found = correct_at_parameters(rod, own.aligned(z), given)
    assert found[0]
    state = em.structures.State(rod, z[0], given[0])
    assert state.resolved
    assert state.index == 0
    assert abs(float(rod.end_couple(1, "x")(state))) * UNIT == pytest.approx(MOMENT, rel=1e-9)
    assert abs(float(rod.support_force("x")(state))) * UNIT == pytest.approx(TENSION, rel=1e-7)
    s = np.linspace(0.0, 1.0, 201)
    wanted, shape = buckle(s - 0.5) - buckle(np.array([-0.5])), state.shape(s)
    np.testing.assert_allclose(shape[:, 0], wanted[:, 0], atol=1e-6)
    aside, there = shape[:, 1] + 1j * shape[:, 2], wanted[:, 1] + 1j * wanted[:, 2]
    turn = np.vdot(aside, there)
    np.testing.assert_allclose(aside * turn / abs(turn), there, atol=5e-6)


def torsion_where_it_leaves(k):
    """C/B of the clamped elastica of modulus k that leaves its plane, in closed form.

    Its curvature is κ = 2k cn v, −2K < v < 2K, and its span 2E/K − 1. Displacements ψ out of the
    plane and a twisting moment c, which is even along a round rod, obey
    ``ψ'' + (3/2 κ² − 2k² + 1) ψ = μ − c κ``: ψ = α ∂κ/∂k + β (κ + v κ') + μ cos θ with
    c = −4kα − 2 (2k² − 1) β. At the clamps ψ = 0; ∫ψ dv = 0; and the twist ∫(κψ + c/C) dv = 0.
    """
    big, second = ellipk(k * k), ellipe(k * k)
    rest = 1.0 - k * k
    slope = (second - rest * big) / rest  # k dK/dk
    alpha, beta = 2.0 * k * (big - second), slope + 2.0 * second - big
    even = 2.0 * k * k - 1.0
    moment = big * (2.0 * k * alpha + even * beta)
    return moment / (alpha * k * (big - slope) + beta * (second + even * big))


@pytest.mark.parametrize("torsion", [GAMMA, 0.77, 1.0])
def test_a_bent_round_rod_leaves_its_plane_where_the_closed_form_says(torsion):
    """Secondary bifurcation of the untwisted rod [HeijdenNeukirch2003]_, out of the plane.

    The condition is derived here (`torsion_where_it_leaves`); with C = B the span is ⅓. Tolerance:
    1.5e-9 of eight elements of degree seven.
    """
    k = brentq(lambda k: torsion_where_it_leaves(k) - torsion, 0.3, 0.95, xtol=1e-15)
    span = 2.0 * ellipe(k * k) / ellipk(k * k) - 1.0
    if torsion == 1.0:
        assert span == pytest.approx(1.0 / 3.0, rel=1e-13)
    rod = em.SpatialRod(
        torsion=torsion, lateral=1.0, loads={}, span=0.9, phase=True, elements=8, degree=7
    )
    end = em.lift(rod.natural_state(), {"nu": 0.9 * span}).end
    assert (end.kind, end.criticality) == ("branch point", "supercritical")
    assert end.state["nu"] == pytest.approx(span, abs=1.5e-9)
