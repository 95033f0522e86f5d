"""Bounds on segments: true where the curve is known, and none where there is no such curve."""

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria import settle
from equimorph.structures import Rod, Spring, States
from equimorph.tasks.planning.planner import plan
from equimorph.tasks.verification.newton_kantorovich import segment_bounds
from equimorph.tasks.verification.proof import prove
from equimorph.tasks.verification.schedule_check import verify
from oracles.polynomial import bead_on_a_circle, fold_form
from oracles.specimens import toggle
from typecheck import unchecked

VIA = [{"Theta": 1.3}, {"Delta": 1.3}, {"Theta": 1.0}, {"Delta": 0.0}]


@pytest.fixture(scope="module")
def proved(ends):
    return verify(VIA, ends[0], proof=True)


def test_spring_s_curve_lies_within_the_proved_distance():
    """δ over F at x_l = 0.8 by F/k = (1 − x_l/cos δ) sin δ."""
    delta = np.linspace(0.62, 0.9, 9)
    force = (1 - 0.8 / np.cos(delta)) * np.sin(delta)
    p = np.stack([np.full(9, 0.8), force, np.ones(9)], axis=1)
    proof = prove(States(Spring(), delta[:, None], p))
    assert proof.status == "proved"
    states, error = proof.states, proof.error
    exact = np.linspace(0.62, 0.9, 2001)
    load = (1 - 0.8 / np.cos(exact)) * np.sin(exact)
    segment = np.clip(np.searchsorted(-states.p[:, 1], -load) - 1, 0, len(error) - 1)
    chord = np.interp(-load, -states.p[:, 1], states.z[:, 0])
    assert (np.abs(chord - exact) <= error[segment] + 1e-12).all()
    # margin: E'' = k x (x − cos³ δ)/cos⁴ δ
    stiffness = 0.8 * (0.8 - np.cos(exact) ** 3) / np.cos(exact) ** 4
    assert 0.0 < proof.margin <= stiffness.min()


def test_arch_is_proved_all_the_way_with_most_of_its_margin(proved):
    assert proved.verified
    assert proved.proof.status == "proved"
    assert proved.proof.bounds == "enclosed"
    assert 0.75 * proved.margin < proved.proof.margin <= proved.margin
    assert proved.proof.error.max() < 1e-2


def test_equilibria_between_the_states_lie_within_the_proved_distance(proved):
    states = proved.proof.states[::7]
    bounds = segment_bounds(states[:-1], states[1:])
    for share in (0.15, 0.5, 0.8):
        z, p = ((1 - share) * column[:-1] + share * column[1:] for column in (states.z, states.p))
        near = settle(states.structure, z, p)
        assert near.found.all()
        distance = np.abs(near.z - z).max(axis=1)
        far = bounds.error * bounds.weights.max(axis=1)
        assert (distance[bounds.proved] <= far[bounds.proved]).all()
        assert (States(states.structure, near.z, p).margin >= bounds.margin)[bounds.proved].all()


def test_demanded_margin_is_proved_or_the_reason_given(ends):
    kept = verify(VIA, ends[0], margin=0.4, proof=True)
    assert kept.proof.status == "proved"
    assert kept.proof.margin > 0.4


def test_states_of_two_branches_are_not_joined(arch_set, ends):
    """Upright and inverted over the same point, then over neighbouring ones."""
    down = em.lift(ends[1], {"Theta": 1.0001}).end.state
    both = States(arch_set.structure, np.stack([ends[0].z, down.z]), np.stack([ends[0].p, down.p]))
    proof = prove(both)
    assert proof.status == "unproved"
    assert proof.failed is not None


def test_nothing_is_proved_across_a_fold():
    """x² = a: from (a, x) = (0.04, 0.2) to (0.04, −0.2) the branches meet at the fold only."""
    structure = fold_form()
    x, a = np.array([[0.2], [-0.2]]), np.array([[0.04], [0.0401]])
    x[1] = -np.sqrt(0.0401)
    proof = prove(States(structure, x, a))
    assert proof.status == "unproved"
    assert proof.why == "states of the route lie on different sheets"


def hanging_arm():
    return Rod(ends=("clamped", "free"), loads={"w": em.LineLoad()}, elements=2, degree=6)


def stretchable_arc():
    return Rod(axial=1000.0, ends=("pinned", "pinned"), span=0.98, curvature=0.5, elements=3)


def pressed_arch():
    ends = ("clamped", "clamped")
    return Rod(ends=ends, loads={"p": em.Pressure()}, elements=4, degree=5)


@pytest.mark.parametrize(
    ("make", "to"),
    [
        (hanging_arm, {"w": 0.05}),
        (stretchable_arc, {"nu": 0.975}),
        (pressed_arch, {"p": 0.1}),
        (toggle, {"P": 0.5}),
    ],
    ids=["cantilever", "stretchable arc", "pressed arch", "frame"],
)
def test_rods_with_other_ends_and_frames_are_proved(make, to):
    with unchecked():
        start = make().natural_state(**({"Theta": 1.0} if make is pressed_arch else {}))
        found = verify([to], start, proof=True)
    assert found.proof.status == "proved", found.proof.why
    assert 0.5 * found.margin < found.proof.margin <= found.margin


@pytest.mark.parametrize("strain", ["green", "engineering"])
def test_a_truss_is_proved_up_to_its_fold(strain):
    """Shallow truss of two bars: with Green strain P = EA h (a² − h²)/l³ at height h."""
    truss = em.Truss(
        {"A": (-1.0, 0.0), "B": (0.0, 0.2), "C": (1.0, 0.0)}, [("A", "B"), ("B", "C")],
        supports={"A": "xy", "C": "xy"}, loads={"P": {"B": (0.0, -1.0)}}, strain=strain,
    )  # fmt: skip
    fold = em.limit_load(truss.natural_state(), "P").value
    near = verify([{"P": 0.99 * fold}], truss.natural_state(), proof=True)
    assert near.proof.status == "proved", near.proof.why
    assert near.proof.bounds == "enclosed"
    assert 0.0 < near.proof.margin <= near.margin
    states, height = near.proof.states, 0.2 + near.proof.states.z[:, 1]
    if strain == "green":
        force = height * (0.04 - height**2) / 1.04**1.5
        np.testing.assert_allclose(force, states["P"], atol=1e-12)


def test_constrained_formulas_are_supported():
    structure = bead_on_a_circle()
    start = em.lift(structure.state(0.0, 1.0, 1.0, g=1.0), {"h": 0.2}).end.state
    supported(verify([{"h": -0.2}], start, proof=True))


def supported(found):
    assert found.proof.bounds == "sampled"
    assert found.proof.status is em.ProofStatus.SUPPORTED, found.proof.why
    assert repr(found.proof).startswith("Proof(supported: sampled bounds on ")
    assert repr(found).endswith(", supported)")


def test_structures_with_too_many_unknowns_have_no_proof(monkeypatch):
    monkeypatch.setattr("equimorph.tasks.verification.error_box.MOST_ENTRIES", 2)
    structure = bead_on_a_circle()
    start = structure.state(0.0, 1.0, 1.0, g=1.0)
    found = verify([{"h": 0.2}], start, proof=True)
    assert found.verified
    assert "knows no bounds" in found.proof.why


def test_a_route_is_proved_to_keep_the_margin_it_was_planned_for(arch_set, ends):
    """It runs 1 % above the margin in places; half that is not left by the next larger margin."""
    with unchecked():
        route = plan(arch_set, *ends, margin=0.3)
        found = verify(route.schedule, ends[0], margin=0.3, proof=True)
        more = verify(route.schedule, ends[0], margin=1.02 * route.margin, proof=True)
    assert found.proof.status == "proved", found.proof.why
    assert 0.3 <= found.proof.margin <= route.margin
    assert not more.verified


@pytest.mark.slow
def test_fifty_routes_of_the_arch_are_proved(arch_set):
    """Random stable states over the box, joined by routes of margin 0.05, proved to keep it.

    Routes are planned with a reserve of 1 %, which leaves room for a bound at the margin itself.
    """
    generator = np.random.default_rng(3)
    stable = arch_set.points[np.flatnonzero((arch_set.index == 0) & (arch_set.kinds == 0))]
    stable = stable[stable.margin > 0.1]
    proved = 0
    with unchecked():
        while proved < 50:
            start, goal = (stable[int(k)] for k in generator.integers(len(stable), size=2))
            route = plan(arch_set, start, goal, margin=0.05)
            if not route.arrived:
                continue
            found = verify(route.schedule, start, margin=0.05, proof=True)
            assert found.verified
            assert found.margin >= 0.05
            assert found.proof.margin >= 0.05
            assert found.proof.status == "proved", found.proof.why
            proved += 1
