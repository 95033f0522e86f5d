"""Trusses against statics, beam formulas, and one another."""

from itertools import pairwise

import numpy as np
import pytest

import equimorph as em
from equimorph.structures import Bar, Truss
from oracles.specimens import arch_truss, tripod
from typecheck import unchecked

SHALLOW = {"A": (-1.0, 0.0), "B": (0.0, 0.1), "C": (1.0, 0.0)}


def mises(rise=0.1, **more):
    joints = {**SHALLOW, "B": (0.0, rise)}
    ends = [("A", "B"), ("B", "C")]
    bars = [Bar(pair, EI=more.pop("EI", None)) for pair in ends] if "EI" in more else ends
    return Truss(joints, bars, {"A": "xy", "C": "xy"}, {"F": {"B": (0, -1)}}, **more)


def test_small_loads_give_the_forces_of_statics():
    """Cantilever of three bays, F at its tip: chords carry ±F·lever/h, diagonals F √2.

    Statically determinate, so that the forces do not depend on stiffness. 1e-5: the load is 1e-6 of
    EA, and forces change with displacements of that order.
    """
    joints = {f"b{i}": (i, 0) for i in range(4)} | {f"t{i}": (i, 1) for i in range(4)}
    bars = [(f"b{i}", f"b{i + 1}") for i in range(3)] + [(f"t{i}", f"t{i + 1}") for i in range(3)]
    bars += [(f"t{i}", f"b{i}") for i in range(1, 4)] + [(f"t{i}", f"b{i + 1}") for i in range(3)]
    truss = Truss(joints, bars, {"b0": "xy", "t0": "xy"}, {"F": {"b3": (0, -1)}})
    load = 1e-6
    state = em.lift(truss.natural_state(), to={"F": load}).end.state
    for i in range(3):
        assert truss.force(f"b{i}-b{i + 1}")(state) / load == pytest.approx(
            i - 3, rel=1e-5, abs=1e-5
        )
        assert truss.force(f"t{i}-t{i + 1}")(state) / load == pytest.approx(
            2 - i, rel=1e-5, abs=1e-5
        )
        diagonal = truss.force(f"t{i}-b{i + 1}")(state) / load
        assert diagonal == pytest.approx(np.sqrt(2), rel=1e-5)


def test_a_tripod_shares_its_load_by_symmetry():
    """Three legs of height and radius 1: each bears F √2/3. 1e-5 as above."""
    angles = np.array([0.0, 2.0, 4.0]) * np.pi / 3.0
    feet = {f"A{i}": (np.cos(a), np.sin(a), 0.0) for i, a in enumerate(angles)}
    held = dict.fromkeys(feet, "xyz")
    bars = [(foot, "T") for foot in feet]
    truss = Truss({**feet, "T": (0, 0, 1)}, bars, held, {"F": {"T": (0, 0, -1)}})
    state = em.lift(truss.natural_state(), to={"F": 1e-6}).end.state
    for foot, place in feet.items():
        force = truss.force(f"{foot}-T")(state) / 1e-6
        assert force == pytest.approx(-np.sqrt(2) / 3, rel=1e-5)
        held = [truss.reaction(foot, axis)(state) / 1e-6 for axis in "xyz"]
        inward = -np.array(place) / 3.0
        assert held == pytest.approx([*inward[:2], 1.0 / 3.0], abs=1e-5)
    assert len(truss.support_reactions) == 9


@pytest.mark.parametrize("strain", ["engineering", "green"])
def test_both_strains_agree_where_they_are_small(strain):
    """Relative difference 3ε/2 of the forces, ε = 1e-4 here."""
    states = em.lift(mises(strain=strain).natural_state(), to={"F": 2e-5}).end.state
    truss = mises(strain=strain)
    elastic = 2e-5 / 2 / 0.1 * np.hypot(1, 0.1)  # sin of the bars is 0.1/l, nearly
    assert truss.force("A-B")(states) == pytest.approx(-elastic, rel=0.02)


def test_an_actuated_bar_lifts_the_joint_as_geometry_says():
    """Both bars longer by a: no stress, and y = √((l + a)² − 1). 1e-12: round-off."""
    truss = mises(actuators={"a": {"A-B": 1.0, "C-B": 1.0}})
    state = truss.natural_state(a=0.05)
    height = np.sqrt((np.hypot(1.0, 0.1) + 0.05) ** 2 - 1.0)
    assert truss.displacement("B", "y")(state) == pytest.approx(height - 0.1, rel=1e-12)
    assert truss.force("A-B")(state) == pytest.approx(0.0, abs=1e-14)
    assert truss.descriptor("effort(a)")(state) == pytest.approx(0.0, abs=1e-14)


def test_a_bar_of_other_length_prestresses_the_truss():
    """Two bars between walls, one of them 1 % too long. 1e-12: round-off of the balance."""
    joints = {"A": (0.0, 0.0), "B": (1.0, 0.0), "C": (2.0, 0.0)}
    bars = [Bar(("A", "B"), 1.0, rest=1.01), Bar(("B", "C"), 3.0)]
    truss = Truss(joints, bars, {"A": "xy", "B": "y", "C": "xy"}, {"H": {"B": (1, 0)}})
    state = truss.natural_state()
    forces = [truss.force(name)(state) for name in ("A-B", "B-C")]
    # N = (1 + u)/1.01 − 1 = −3u with u the move of B
    shift = 0.01 / 1.01 / (1 / 1.01 + 3.0)
    assert forces == pytest.approx([-3.0 * shift] * 2, rel=1e-12)
    assert state.stable


def test_the_effort_of_an_actuator_is_the_force_in_its_bar():
    """∂E/∂l₀ = −N (l/l₀ + 1)/2 for engineering strain. 1e-12: round-off."""
    truss = mises(actuators={"a": {"A-B": 1.0}})
    state = em.lift(truss.natural_state(), to={"F": 2e-4}).end.state
    squared, rest = truss.lengths(state.z[None], state.p[None])
    force, stretch = truss.force("A-B")(state), np.sqrt(squared[0, 0]) / rest[0, 0]
    assert truss.descriptor("effort(a)")(state) == pytest.approx(
        -force * (stretch + 1) / 2, rel=1e-12
    )


def test_utilisation_is_compression_over_the_euler_load():
    """N l₀²/(π² EI); tension counts as negative; the largest is the largest."""
    truss = mises(EI=1e-5)
    state = em.lift(truss.natural_state(), to={"F": 2e-4}).end.state
    euler = np.pi**2 * 1e-5 / (1.0 + 0.01)
    expected = -truss.force("A-B")(state) / euler
    assert expected > 0.0
    assert truss.utilisation("A-B")(state) == pytest.approx(expected, rel=1e-13)
    assert truss.max_utilisation(state) == pytest.approx(expected, rel=1e-13)


def test_a_limit_on_the_utilisation_stops_a_load():
    """C2 before the snap: N = N_cr exactly at the end. 1e-10: constraints are located to that."""
    truss = mises(EI=1e-5)
    limit = em.limit_load(truss.natural_state(), "F", within=[truss.max_utilisation <= 0.5])
    assert limit.kind == "constraint"
    assert truss.max_utilisation(limit.state) == pytest.approx(0.5, rel=1e-10)


def test_descriptors_are_read_as_they_are_written():
    truss = arch_truss("engineering")
    state = em.lift(truss.natural_state(), to={"F": 0.02, "H": 0.01, "b": 0.02}).end.state
    for text in (
        "force(A-B)", "reaction(A,y)", "utilisation(B-C)", "max_utilisation", "displacement(B,y)",
        "travel(F)", "effort(a)", "energy",
    ):  # fmt: skip
        assert truss.descriptor(text).name == text
    assert truss.descriptor("force( B - A )")(state) == truss.force("A-B")(state)
    moved = truss.displacement("C", "y")(state)
    assert truss.travel("F")(state) == pytest.approx(-moved, rel=1e-14)
    assert truss.elevation == truss.travel("F")
    assert truss.descriptor("travel(F)") == arch_truss("engineering").descriptor("travel(F)")


def test_the_stiffness_of_a_space_truss_is_sparse_and_symmetric():
    truss = tripod()
    state = truss.natural_state()
    full = truss.layout.dense(truss.entries(state.z[None], state.p[None]))[0]
    np.testing.assert_array_equal(full, full.T)
    assert (np.linalg.eigvalsh(full) > 0.0).all()
    assert state.index == 0


def test_shapes_walk_along_every_bar():
    outline = mises().natural_state().shape()
    np.testing.assert_array_equal(outline, [[-1, 0], [0, 0.1], [1, 0]])
    quarter = mises().shape(np.zeros((1, 2)), np.zeros((1, 1)), np.array([0.25, 1.0]))
    np.testing.assert_allclose(quarter[0], [[-0.5, 0.05], [1.0, 0.0]], rtol=1e-15)
    for truss in (tripod(), arch_truss("green")):
        steps = {frozenset(pair) for pair in pairwise(truss.network.walk.tolist())}
        assert steps == {frozenset(pair) for pair in truss.network.ends.tolist()}
    assert tripod().natural_state().shape().shape == (len(tripod().network.walk), 3)


def test_the_set_and_a_route_around_the_snap_of_an_actuated_truss():
    """Over (a, F): the truss is turned over by shortening its bars, loading it, and lengthening.

    With bars shorter than half the span the middle state is the only one, PHYSICS section 2.
    """
    truss = Truss(
        {**SHALLOW, "B": (0.0, 0.3)},
        [("A", "B"), ("B", "C")],
        {"A": "xy", "B": "x", "C": "xy"},
        {"F": {"B": (0, -1)}},
        {"a": {"A-B": 1.0, "B-C": 1.0}},
    )
    height = truss.displacement("B", "y")
    box = em.Box(a=(-0.1, 0.02), F=(-0.02, 0.02))
    with unchecked():
        found = em.equilibrium_set(truss, box, intervals=(9, 9))
        there = found.at(a=0.0, F=0.001)
        up, down = max(there.stable, key=height), min(there.stable, key=height)
        route = em.plan(found, up, down)
    assert found.audit.clean
    assert len(there) == 3
    assert route.status == "arrived"
    assert truss.rest_lengths(route.path.states.p).min() < 1.0


def test_parameters_end_where_a_bar_would_vanish():
    """1 + 2a > 0 and 1 − a > 0."""
    joints = {"A": (0, 0), "B": (1, 0), "C": (2, 0)}
    truss = Truss(
        joints,
        [("A", "B"), ("B", "C")],
        {"A": "xy", "B": "y", "C": "xy"},
        None,
        {"a": {"A-B": 2.0, "B-C": -1.0}},
    )
    with pytest.raises(em.InputError, match=r"`a` must be .* between -0.5 and 1"):
        truss.natural_state(a=-0.5)
    assert truss.elevation.name == "displacement(B,x)"


def test_states_of_a_shallow_dome_are_found_close_to_it():
    """Star dome of 24 bars, unloaded: as built it is an equilibrium, among many others.

    Guesses as large as the dome tangle its bars, and lead nowhere.
    """
    joints, bars = {"C": (0.0, 0.0, 0.08)}, []
    for k in range(6):
        inner, outer = np.pi / 3 * k, np.pi / 3 * (k + 0.5)
        joints[f"I{k}"] = (0.25 * np.cos(inner), 0.25 * np.sin(inner), 0.06)
        joints[f"O{k}"] = (0.43 * np.cos(outer), 0.43 * np.sin(outer), 0.0)
        bars += [("C", f"I{k}"), (f"I{k}", f"I{(k + 1) % 6}")]
        bars += [(f"I{k}", f"O{k}"), (f"I{k}", f"O{(k - 1) % 6}")]
    supports = {f"O{k}": "xyz" for k in range(6)}
    dome = Truss(joints, bars, supports, {"F": {"C": (0.0, 0.0, -1.0)}})
    with unchecked():
        found = em.find_equilibria(dome, {"F": 0.0}, starts=60, runs=1)
    assert len(found) > 20
    assert np.abs(found.z).max(axis=1).min() < 1e-12
    assert found.residual.max() < 1e-12
