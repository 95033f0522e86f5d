"""Frames against a twin without eliminations, statics, beam formulas, and one another."""

from itertools import pairwise

import numpy as np
import pytest

import equimorph as em
from equimorph.structures import Frame, Member
from equimorph.structures.frame.statics import Graph
from oracles.frames import Twin, full_lagrangian, full_state, gradients, loaded
from oracles.specimens import portal, toggle
from typecheck import unchecked


@pytest.mark.parametrize(
    ("frame", "values"),
    [
        (portal(50.0), {"k": 0.4, "d": 0.3, "P": 1.5, "q": -0.8}),
        (portal(None), {"k": -0.5, "d": -0.2, "P": -1.0, "q": 0.6}),
        (toggle(), {"a": 0.2, "P": 4.0}),
    ],
    ids=["portal", "inextensible", "toggle"],
)
def test_states_are_equilibria_of_the_frame_with_nothing_eliminated(frame, values):
    """Gradient by all turns, moves, forces and reactions, and the inertia of the whole matrix.

    1e-11: round-off of a hundred terms. The matrix by central differences of the gradient has as
    many negative eigenvalues as there are forces, and the index.
    """
    state = loaded(frame, **values)
    twin = Twin(frame)
    value, x = full_lagrangian(frame, twin, state.p), full_state(frame, state)
    here = gradients(value, x[None])[0]
    held = np.concatenate(
        [
            np.ones(x.size - 2 * len(twin.joints), bool),
            frame.model.network.supports[:, :2].ravel() > 0,
        ]
    )
    np.testing.assert_allclose(here[held], 0.0, atol=1e-11)
    step = 1e-4
    shifts = step * np.eye(x.size)
    matrix = (gradients(value, x + shifts) - gradients(value, x - shifts)) / (2.0 * step)
    matrix = matrix[np.ix_(held, held)]
    forces = 2 * len(twin.members) + int((frame.model.network.supports[:, :2] > 0).sum())
    negative = (np.linalg.eigvalsh(0.5 * (matrix + matrix.T)) < 0.0).sum()
    assert negative - forces == state.index


def test_forces_of_the_model_balance_at_every_joint():
    """Sum of what members, supports and loads exert on each joint, for each scalar."""
    frame = portal(None)
    model = frame.model
    for axis, forces in enumerate(model.forces):
        total = forces.supports.copy()
        total[model.own] += model.patterns.forces[:, :, axis]
        for m, (start, end) in enumerate(model.network.ends.tolist()):
            total[:, start] += forces.start[:, m]
            total[:, end] -= forces.start[:, m] - forces.drop[:, m] * model.lengths[m]
        np.testing.assert_allclose(total, 0.0, atol=1e-14)


def test_forces_around_cycles_are_local_in_a_ladder():
    """Ten squares, held at one end: each cycle has its four sides, not the way to the ground."""
    ends = [(2 * i, 2 * i + 2) for i in range(10)] + [(2 * i + 1, 2 * i + 3) for i in range(10)]
    ends += [(2 * i, 2 * i + 1) for i in range(1, 11)]
    supported = np.zeros(22, bool)
    supported[:2] = True
    around = Graph(22, np.array(ends), supported).circulations()
    lengths = np.abs(around.members).sum(axis=1) + np.abs(around.supports).sum(axis=1)
    assert sorted(lengths) == [4.0] * 9 + [5.0]
    joint = np.zeros((10, 22))
    for m, (start, end) in enumerate(ends):
        joint[:, start] += around.members[:, m]
        joint[:, end] -= around.members[:, m]
    np.testing.assert_array_equal(joint + around.supports, 0.0)


# --- small loads ---------------------------------------------------------------------------------


def test_small_loads_bend_a_propped_beam_as_beam_formulas_say():
    """Fixed left, roller right, load at midspan: reaction 5P/16, moment −3PL/16, w 7PL³/768EI.

    1e-6: the load is 1e-4 of EI/L², and changes are of second order.
    """
    stiff, length, load = 7.0, 3.0, 1e-4
    joints = {"A": (0, 0), "B": (length / 2, 0), "C": (length, 0)}
    members = [Member(ends, stiff) for ends in (("A", "B"), ("B", "C"))]
    frame = Frame(joints, members, {"A": "fixed", "C": "y"}, {"P": {"B": (0, -1)}})
    state = loaded(frame, P=load)
    assert frame.reaction("C", "y")(state) / load == pytest.approx(5 / 16, rel=1e-6)
    assert frame.moment("A-B", "A")(state) / load == pytest.approx(-3 * length / 16, rel=1e-6)
    assert frame.moment("A-B", "B")(state) / load == pytest.approx(5 * length / 32, rel=1e-6)
    assert frame.reaction("A", "angle")(state) / load == pytest.approx(3 * length / 16, rel=1e-6)
    sag = -7.0 * load * length**3 / (768.0 * stiff)
    assert frame.displacement("B", "y")(state) == pytest.approx(sag, rel=1e-6)
    assert frame.travel("P")(state) == pytest.approx(-sag, rel=1e-6)
    assert frame.shear("B-C", "C")(state) / load == pytest.approx(5 / 16, rel=1e-6)
    assert frame.axial("B-C", "C")(state) == pytest.approx(0.0, abs=1e-8)


def test_self_weight_on_a_fixed_beam_gives_its_moments():
    """wL²/12 at the ends, wL²/24 at midspan; EA makes both ends tolerable. 1e-6 as above."""
    joints = {"A": (0, 0), "B": (0.5, 0), "C": (1, 0)}
    members = [Member(("A", "B"), 1.0, 1e3, weight=2.0), Member(("C", "B"), 1.0, 1e3, weight=2.0)]
    frame = Frame(joints, members, {"A": "fixed", "C": "fixed"}, {"g": {"weight": (0, -1)}})
    state = loaded(frame, g=1e-3)
    assert frame.moment("A-B", "A")(state) == pytest.approx(-2e-3 / 12, rel=1e-5)
    assert frame.moment("A-B", "B")(state) == pytest.approx(2e-3 / 24, rel=1e-5)
    assert frame.moment("C-B", "B")(state) == pytest.approx(-2e-3 / 24, rel=1e-5)
    total = frame.reaction("A", "y")(state) + frame.reaction("C", "y")(state)
    assert total == pytest.approx(2e-3, rel=1e-12)


def test_springs_take_their_share():
    """A cantilever on a tip spring: the spring bears P/(1 + 3EI/kL³); its foot turns by M/c."""
    frame = Frame(
        {"A": (0, 0), "B": (1, 0)},
        [("A", "B")],
        {"A": {"x": "held", "y": "held", "angle": 50.0}, "B": {"y": 6.0}},
        {"P": {"B": (0, -1)}},
    )
    state = loaded(frame, P=1e-4)
    compliance = 1 / 3 + 1 / 50
    share = compliance / (compliance + 1 / 6)
    assert frame.reaction("B", "y")(state) / 1e-4 == pytest.approx(share, rel=1e-6)
    moment = frame.moment("A-B", "A")(state)
    assert frame.rotation("A")(state) == pytest.approx(moment / 50.0, rel=1e-9)
    assert frame.reaction("A", "angle")(state) == pytest.approx(-moment, rel=1e-9)
    assert frame.displacement("B", "y")(state) == pytest.approx(-share * 1e-4 / 6.0, rel=1e-6)


def test_a_hinge_bears_no_moment_and_lets_ends_turn_apart():
    frame = portal(None)
    state = loaded(frame, P=1.0, q=0.5)
    assert frame.moment("D-C", "C")(state) == pytest.approx(0.0, abs=1e-11)
    assert frame.moment("C-F", "F")(state) == pytest.approx(0.0, abs=1e-11)
    assert frame.rotation("C-D", "C")(state) != pytest.approx(frame.rotation("C")(state), rel=1e-3)


# --- actuators -----------------------------------------------------------------------------------


def test_a_curved_cantilever_is_an_arc():
    """κ = a along it, no stress: x = sin(aL)/a. 1e-11: what the rule leaves."""
    frame = Frame(
        {"A": (0, 0), "B": (1, 0)}, [("A", "B")], {"A": "fixed"}, {},
        {"a": {"curvature": {"A-B": 1.0}}},
    )  # fmt: skip
    state = frame.natural_state(a=2.0)
    assert frame.displacement("B", "x")(state) == pytest.approx(np.sin(2.0) / 2 - 1, rel=1e-11)
    assert frame.displacement("B", "y")(state) == pytest.approx((1 - np.cos(2.0)) / 2, rel=1e-11)
    assert frame.moment("A-B", "A")(state) == pytest.approx(0.0, abs=1e-12)
    assert frame.max_curvature(state) == pytest.approx(2.0, rel=1e-12)
    assert frame.total_energy(state) == pytest.approx(0.0, abs=1e-13)
    with pytest.raises(em.InputError, match="`axis` must be one of x, y"):
        frame.displacement("B", "angle")


def test_a_longer_column_raises_its_beam():
    """Both columns longer by a: no stress. 1e-12: round-off."""
    joints = {"A": (0, 0), "B": (0, 1), "C": (1, 1), "D": (1, 0)}
    frame = Frame(
        joints, [("A", "B"), ("B", "C"), ("C", "D")], {"A": "fixed", "D": "fixed"}, {},
        {"a": {"length": {"A-B": 1.0, "D-C": 1.0}}},
    )  # fmt: skip
    state = frame.natural_state(a=0.3)
    assert frame.displacement("B", "y")(state) == pytest.approx(0.3, rel=1e-12)
    assert frame.max_curvature(state) == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(em.InputError, match="`a` must be a finite number greater than -1"):
        frame.natural_state(a=-1.0)


def test_moved_and_turned_supports_bend_a_beam():
    """Fixed beam, right end up by d: 6EI d/L²; turned by t: 4EI t/L there, 2EI t/L beyond. 1e-6."""
    frame = Frame(
        {"A": (0, 0), "B": (2, 0)},
        [Member(("A", "B"), 3.0, 1e4)],
        {"A": "fixed", "B": "fixed"},
        {},
        {"d": {"move": {"B": (0, 1)}}, "t": {"turn": {"B": 1.0}}},
    )
    up, turned = frame.natural_state(d=1e-4), frame.natural_state(t=1e-4)
    assert frame.moment("A-B", "A")(up) == pytest.approx(6 * 3e-4 / 4, rel=1e-5)
    assert frame.displacement("B", "y")(up) == pytest.approx(1e-4, rel=1e-12)
    assert frame.moment("A-B", "B")(turned) == pytest.approx(4 * 3e-4 / 2, rel=1e-5)
    assert frame.moment("A-B", "A")(turned) == pytest.approx(-2 * 3e-4 / 2, rel=1e-5)
    assert frame.reaction("B", "angle")(turned) == pytest.approx(4 * 3e-4 / 2, rel=1e-5)
    couple = frame.descriptor("effort(t)")(turned)
    assert couple == pytest.approx(frame.reaction("B", "angle")(turned), rel=1e-9)


def test_an_arch_is_free_of_stress_as_drawn():
    """A circular arc of radius 2 between pins: |κ| = ½ everywhere."""
    frame = Frame(
        {"A": (-1, 0), "B": (1, 0)}, [Member(("A", "B"), curvature=-0.5)],
        {"A": "pinned", "B": "pinned"}, {"q": {"A-B": (0, -1)}},
    )  # fmt: skip
    state = frame.natural_state()
    assert state.stable
    assert frame.max_curvature(state) == pytest.approx(0.5, rel=1e-14)
    top = state.shape(np.array([0.5]))[0]
    np.testing.assert_allclose(top, [0.0, 2.0 - np.sqrt(3.0)], atol=1e-11)


# --- units, shapes, names ------------------------------------------------------------------------


def test_units_change_numbers_and_nothing_else():
    """The same frame in other units of length and force. 1e-9: both are corrected to 1e-10."""
    a, b = 1000.0, 0.25  # mm for m, and another force
    scale = {"length": a, "force": b, "moment": a * b, "angle": 1.0}

    def made(length, force):
        return Frame(
            {"A": (0, 0), "B": (0, length), "C": (1.5 * length, length)},
            [
                Member(("A", "B"), 2.0 * force * length**2, 300.0 * force),
                Member(("B", "C"), force * length**2, 300.0 * force),
            ],
            {"A": "fixed", "C": {"x": 40.0 * force / length, "y": "held"}},
            {"P": {"B": (1, -1)}},
        )

    one, two = made(1.0, 1.0), made(a, b)
    here, there = loaded(one, P=2.0), loaded(two, P=2.0 * b)
    for text, kind in (
        ("displacement(B,x)", "length"),
        ("rotation(B)", "angle"),
        ("moment(A-B,A)", "moment"),
        ("axial(A-B,A)", "force"),
        ("reaction(C,x)", "force"),
        ("energy", "moment"),
        ("travel(P)", "length"),
    ):
        value = one.descriptor(text)(here) * scale[kind]
        assert two.descriptor(text)(there) == pytest.approx(value, rel=1e-9)
    assert two.parameters[0].scale == pytest.approx(b * one.parameters[0].scale, rel=1e-9)
    np.testing.assert_allclose(there.shape(), a * here.shape(), rtol=1e-9, atol=1e-9 * a)


def test_shapes_walk_along_every_member_and_meet_the_joints():
    frame = portal(50.0)
    state = loaded(frame, P=1.0, d=0.2)
    walk = frame.model.network.walk
    steps = {frozenset(pair) for pair in pairwise(walk.tolist())}
    assert steps == {frozenset(pair) for pair in frame.model.network.ends.tolist()}
    outline = state.shape()[:: (len(state.shape()) - 1) // (len(walk) - 1)]
    for place, joint in zip(outline, walk, strict=True):
        name = frame.model.network.joints[joint]
        moved = [frame.displacement(name, axis)(state) for axis in "xy"]
        np.testing.assert_allclose(place, frame.model.network.places[joint] + moved, atol=1e-12)


def test_descriptors_are_read_as_they_are_written():
    frame = portal(50.0)
    state = loaded(frame, P=0.5, k=0.2)
    for text in (
        "displacement(B,y)", "rotation(C)", "rotation(D-C,C)", "axial(A-B,A)", "shear(A-B,B)",
        "moment(C-F,C)", "max_curvature(B-C)", "max_curvature", "reaction(E,x)", "travel(P)",
        "effort(k)", "energy",
    ):  # fmt: skip
        assert frame.descriptor(text).name == text
    assert frame.descriptor("moment( B - A, A )")(state) == frame.moment("A-B", "A")(state)
    assert frame.elevation == frame.travel("P")
    assert [each.unit for each in frame.parameters] == ["1", "length", "1", "1"]
    assert frame.descriptor("travel(q)").unit == "force·length"
    assert frame.descriptor("travel(P)") == portal(50.0).descriptor("travel(P)")


@pytest.mark.parametrize("frame", [portal(50.0), portal(None)], ids=["extensible", "not"])
def test_no_states_have_no_values(frame):
    nothing = frame.natural_state().batch[:0]
    assert frame.travel("P")(nothing).shape == (0,)
    for text in ("displacement(B,y)", "moment(C-F,C)", "max_curvature", "reaction(E,x)", "energy"):
        assert frame.descriptor(text)(nothing).shape == (0,)
    assert nothing.shape().shape[0] == len(nothing.error_estimate) == 0


def test_the_largest_curvature_is_that_of_a_fine_frame():
    """Against 16 elements. 1e-6: interpolated between nodes of two elements of degree 8."""
    coarse, fine = (
        Frame(
            {"A": (0, 0), "B": (0, 1), "C": (1, 1)}, [("A", "B"), ("B", "C")],
            {"A": "fixed", "C": "pinned"}, {"q": {"B-C": (0, -1)}}, elements=n,
        )
        for n in (2, 16)
    )  # fmt: skip
    one, two = loaded(coarse, q=20.0), loaded(fine, q=20.0)
    assert coarse.max_curvature(one) == pytest.approx(fine.max_curvature(two), rel=1e-6)
    assert coarse.moment("A-B", "B")(one) == pytest.approx(fine.moment("A-B", "B")(two), rel=1e-8)


@pytest.mark.parametrize("degree", [4, 6, 8])
def test_the_error_estimate_bounds_the_error(degree):
    """Against elements of degree 14. Not more than a hundred times too large."""
    frame, exact = (
        Frame(
            {"A": (0, 0), "B": (0, 1), "C": (1.3, 1)}, [("A", "B"), ("B", "C")],
            {"A": "fixed", "C": "pinned"}, {"q": {"B-C": (0.2, -1)}}, degree=n,
        )
        for n in (degree, 14)
    )  # fmt: skip
    one, two = loaded(frame, q=12.0), loaded(exact, q=12.0)
    unit = frame.model.length
    errors = [
        abs(frame.descriptor(text)(one) - exact.descriptor(text)(two)) / unit
        for text in ("displacement(B,x)", "displacement(B,y)")
    ]
    errors.append(abs(frame.max_curvature(one) - exact.max_curvature(two)) * unit)
    errors.append(abs(frame.rotation("A-B", "B")(one) - exact.rotation("A-B", "B")(two)))
    assert max(errors) <= one.error_estimate <= max(100.0 * max(errors), 1e-11)


# --- against a rod --------------------------------------------------------------------------------


@pytest.mark.parametrize(("end", "axial"), [("free", None), ("free", 40.0), ("pinned", 40.0)])
def test_two_members_joined_rigidly_are_one_rod(axial, end):
    """The same mechanics through two formulations. 1e-9: what elements of degree 9 and 11 leave."""
    stiffness, length, joint = 3.0, 2.0, 0.8
    rod = em.Rod(
        span=length if end == "pinned" else None,
        ends=("clamped", end), axial=axial, EI=stiffness, length=length,
        loads={
            "P": [em.PointForce(joint / length, (0.3, -1.0)), em.PointForce(1.0, (0.0, -0.2))],
            "q": em.LineLoad(),
        },
        actuators={"k": em.Curvature(1.0, 0.0, joint / length)},
    )  # fmt: skip
    frame = Frame(
        {"A": (0, 0), "B": (joint, 0), "C": (length, 0)},
        [Member(ends, stiffness, axial) for ends in (("A", "B"), ("B", "C"))],
        {"A": "fixed"} | ({"C": "pinned"} if end == "pinned" else {}),
        {
            "P": {"B": (0.3, -1.0), "C": (0.0, -0.2)},
            "q": {"A-B": (0, -1), "B-C": (0, -1)},
        },
        {"k": {"curvature": {"A-B": 1.0}}},
        elements=4, degree=11,
    )  # fmt: skip
    values = {"P": 2.0, "q": 1.5, "k": 0.6}
    start = rod.natural_state()
    with unchecked():
        one, two = em.lift(start, to=values).end.state, loaded(frame, **values)
    share = joint / length
    for name, descriptor in (
        ("displacement(B,y)", rod.height(share)),
        ("displacement(B,x)", rod.position(share)[0]),
        ("rotation(B)", rod.angle(share)),
        ("rotation(C)", rod.angle(1.0)),
        ("reaction(A,y)", rod.support_force("mu")),
        ("reaction(A,angle)", rod.end_moment(0)),
        ("energy", rod.total_energy),
    ):
        # a rod counts places and work from its end A
        origin = {"displacement(B,x)": joint, "energy": -values["P"] * 0.3 * joint}
        found = frame.descriptor(name)(two) + origin.get(name, 0.0)
        assert found == pytest.approx(descriptor(one), rel=1e-9, abs=1e-10), name
    assert one.index == two.index == 0
