"""Pressure on chains of members: against rods, twins with nothing eliminated, and differences."""

import numpy as np
import pytest

import equimorph as em
from equimorph.linalg.intervals import Interval
from equimorph.structures import Frame, Member
from equimorph.structures.frame.mechanics import FrameMechanics
from oracles.frames import Twin, full_lagrangian, full_state, gradients, loaded
from typecheck import unchecked

HALF = np.pi / 3.0
SPAN = 2.0 * np.sin(HALF)


def tent(**more):
    """Two cells side by side: one closed with a load outside, one open with a roller as its end."""
    joints = {
        "A": (0, 0),
        "B": (0.2, 1),
        "C": (1.1, 1.2),
        "D": (1, 0),
        "E": (2, 0.9),
        "F": (2.2, 0),
    }
    members = [
        Member(("A", "B"), EI=1.3), Member(("C", "B"), curvature=0.7), Member(("C", "D"), EI=0.6),
        Member(("D", "A"), curvature=-0.4, hinges=["A"]), ("C", "E"),
        Member(("F", "E"), hinges=["E"]), Member(("B", "E"), curvature=-0.3, EA=40.0),
    ]  # fmt: skip
    supports = {"A": {"x": "held", "y": "held", "angle": 2.0}, "D": "y", "F": "y"}
    loads = {
        "p": {"pressure": ["B", "A", "D", "C", "B"]},
        "o": {"pressure": ["A", "B", "C", "E", "F"]},
        "P": {"B": (0.3, -1.0), "B-E": (0.1, -0.4)},
    }
    actuators = {"a": {"curvature": {"A-B": 0.5}, "move": {"A": (0.1, 0.0)}}}
    given = {"elements": 2, "degree": 6} | more
    return Frame(joints, members, supports, loads, actuators, **given)


def ring(members=4, **more):
    """A ring of radius 1 that three components of supports hold, run through counterclockwise."""
    names = [chr(65 + k) for k in range(members)]
    places = np.exp(1j * (2.0 * np.pi * np.arange(members) / members - 0.5 * np.pi))
    joints = dict(zip(names, zip(places.real, places.imag, strict=True), strict=True))
    pairs = zip(names, [*names[1:], names[0]], strict=True)
    arcs = [Member(pair, curvature=1.0) for pair in pairs]
    half = members // 2
    loads = {
        "p": {"pressure": [*names, names[0]]},
        "F": {names[0]: (0, 1), names[half]: (0, -1)},
    }
    return Frame(joints, arcs, {names[0]: "xy", names[half]: "x"}, loads, **more)


ENDS = {
    "clamped": (("clamped", "clamped"), {"A": "fixed", "B": "fixed"}),
    "pinned": (("pinned", "pinned"), {"A": "pinned", "B": "pinned"}),
    "sliding": (
        ("clamped", em.End(x="free")), {"A": "fixed", "B": {"y": "held", "angle": "held"}},
    ),
    "sprung": (
        ("clamped", em.End(x=3.0)),
        {"A": "fixed", "B": {"y": "held", "angle": "held", "x": 3.0}},
    ),
}  # fmt: skip
ARCS = {
    "one": ({}, [Member(("A", "B"), curvature=-1.0)], ["A", "B"]),
    "backward": ({}, [Member(("B", "A"), curvature=1.0)], ["A", "B"]),
    "two": (
        {"M": (0.5 * SPAN, 1.0 - np.cos(HALF))},
        [Member(("A", "M"), curvature=-1.0), Member(("B", "M"), curvature=1.0)],
        ["A", "M", "B"],
    ),
}


@pytest.mark.parametrize("pressure", [-2.5, 4.0])
@pytest.mark.parametrize("ends", ENDS)
@pytest.mark.parametrize("arcs", ARCS)
def test_an_arch_of_members_is_a_rod_under_pressure(arcs, ends, pressure):
    """Energy, largest curvature, reactions; 1e-11: the same elements, and round-off."""
    joints, members, chain = ARCS[arcs]
    of_rod, supports = ENDS[ends]
    rod = em.Rod(
        ends=of_rod, curvature=-1.0, loads={"p": em.Pressure()}, span=SPAN, EI=1.0,
        length=2.0 * HALF, elements=8,
    )  # fmt: skip
    places = {"A": (0, 0), **joints, "B": (SPAN, 0)}
    loads = {"p": {"pressure": chain}}
    frame = Frame(places, members, supports, loads, elements=8 // len(members))
    clamps = {} if ends == "pinned" else {"Theta": HALF}
    with unchecked():
        theirs = em.lift(rod.natural_state(**clamps), {"p": pressure}).end.state
    ours = loaded(frame, p=pressure)
    pairs = [
        (frame.total_energy, rod.total_energy),
        (frame.max_curvature, rod.max_curvature),
        (frame.reaction("A", "x"), rod.support_force("x")),
        (frame.reaction("A", "y"), rod.support_force("y")),
    ]
    for one, other in pairs:
        assert one(ours) == pytest.approx(other(theirs), rel=1e-11, abs=1e-11)
    assert ours.index == theirs.index


@pytest.mark.parametrize(
    ("frame", "values"),
    [(tent(), {"a": 0.3, "p": 1.2, "o": 0.7, "P": 0.4}), (ring(3), {"p": 1.5, "F": 0.2})],
    ids=["tent", "ring"],
)
def test_states_are_equilibria_of_the_frame_with_nothing_eliminated(frame, values):
    """Gradient by all turns, moves, forces and reactions; 1e-10: round-off of a hundred terms."""
    state = loaded(frame, **values)
    twin = Twin(frame)
    value, x = full_lagrangian(frame, twin, state.p), full_state(frame, state)
    here = gradients(value, x[None])[0]
    forces = np.ones(x.size - 2 * len(twin.joints), bool)
    held = np.concatenate([forces, frame.model.network.supports[:, :2].ravel() > 0])
    np.testing.assert_allclose(here[held], 0.0, atol=1e-10)


def test_derivatives_are_those_of_energy_and_forces():
    """Central differences with steps of 1e-5: 1e-7 of curvatures and round-off of 1e-11/1e-5."""
    frame, h = tent(), 1e-5
    rng = np.random.default_rng(4)
    z, dz = rng.normal(size=(2, 6, frame.size)) * 0.4
    p, dp = rng.normal(size=(2, 6, 4))
    residual, column, entries = frame.linearised(z, p, dp)

    def lagrangian(z, p):
        forces = z[:, frame.unknowns :]
        gaps = frame.residual(z, p)[:, frame.unknowns :]
        return frame.energy(z, p) + (forces * gaps).sum(axis=1)

    def change(z, p):
        _, column, entries = frame.linearised(z, p, dp)
        return np.einsum("lij,lj->li", frame.layout.dense(entries), dz) + column

    def rate(function, dz, dp):
        return (function(z + h * dz, p + h * dp) - function(z - h * dz, p - h * dp)) / (2.0 * h)

    moved = np.einsum("lij,lj->li", frame.layout.dense(entries), dz)
    np.testing.assert_allclose((residual * dz).sum(axis=1), rate(lagrangian, dz, 0.0), atol=1e-6)
    np.testing.assert_allclose(
        (frame.effort(z, p) * dp).sum(axis=1), rate(lagrangian, 0.0, dp), atol=1e-6
    )
    np.testing.assert_allclose(moved + column, rate(frame.residual, dz, dp), atol=1e-6)
    w, q = rng.normal(size=z.shape), rng.normal(size=p.shape)
    np.testing.assert_allclose(
        frame.second_derivative(z, p, (dz, dp), (w, q)), rate(change, w, q), atol=1e-6
    )


def test_bounds_of_a_point_are_its_values():
    """Enclosures of F, F_z and F_p at points hold the values, within 1e-11 of round-off."""
    frame = tent()
    rng = np.random.default_rng(5)
    z, p = rng.normal(size=(2, frame.size)) * 0.4, rng.normal(size=(2, 4))
    found = frame.enclosure(Interval.at(z), Interval.at(p))
    matrix = frame.layout.dense(frame.linearised(z, p, p)[2])
    columns = np.stack(
        [frame.linearised(z, p, np.tile(row, (2, 1)))[1] for row in np.eye(4)], axis=2
    )
    pairs = (
        (found.residual, frame.residual(z, p)),
        (found.matrix, matrix),
        (found.columns, columns),
    )
    for bounds, values in pairs:
        assert (np.abs(bounds.middle - values) <= bounds.radius + 1e-11).all()
        assert bounds.radius.max() < 1e-11


def test_lanes_do_not_depend_on_their_batch():
    """Bit for bit the same alone and among 130, more than are assembled at once."""
    frame = tent()
    rng = np.random.default_rng(6)
    z, p = rng.normal(size=(130, frame.size)) * 0.4, rng.normal(size=(130, 4))
    whole = frame.linearised(z, p, p)
    for some in (slice(0, 1), slice(127, 130)):
        for part, here in zip(whole, frame.linearised(z[some], p[some], p[some]), strict=True):
            np.testing.assert_array_equal(part[some], here)


def test_energy_balances_the_work_of_pressure():
    """dE/dp = ∂L/∂p along equilibria; 1e-8: central differences with steps of 1e-4."""
    frame, h = tent(), 1e-4
    low, here, high = (loaded(frame, p=1.0 + step, o=0.5, P=0.3) for step in (-h, 0.0, h))
    rate = (frame.total_energy(high) - frame.total_energy(low)) / (2.0 * h)
    assert frame.effort_of("p")(here) == pytest.approx(rate, rel=1e-8)


def test_a_ring_has_the_images_of_its_supports_under_pressure():
    """A mirror for the ring held at two opposite joints, whatever joint its chain begins at."""
    assert [each.name for each in ring(4).symmetries()] == ["mirror"]
    state = loaded(ring(4), p=2.0, F=0.5)
    image = ring(4).symmetries()[0]
    z, p = image.apply(state.z[None], state.p[None])
    np.testing.assert_allclose(ring(4).residual(z, p), 0.0, atol=1e-12)


def test_a_circle_bears_pressure_by_its_thrust_alone():
    """Thrust p R everywhere, no moments; 1e-12: round-off."""
    frame = ring(3)
    state = loaded(frame, p=2.0)
    for member in frame.model.network.edge_names:
        joint = member.split("-")[0]
        assert frame.axial(member, joint)(state) == pytest.approx(-2.0, abs=1e-12)
        assert frame.shear(member, joint)(state) == pytest.approx(0.0, abs=1e-12)
        assert frame.moment(member, joint)(state) == pytest.approx(0.0, abs=1e-12)


def test_a_frame_under_pressure_is_written_and_read():
    """Its data make the same frame, with units too."""
    frame = tent()
    data = {name: value for name, value in frame.identity().items() if name != "kind"}
    assert Frame(**data).signature == frame.signature
    measured = ring(units={"force": "N", "length": "mm"})
    assert measured.parameters[0].unit == "N/mm"


def test_pressure_is_drawn_normal_to_its_members():
    """On a ring of radius 1 it points to the centre with its own size."""
    frame = ring(3)
    state = loaded(frame, p=1.5)
    drawn = [
        each for each in frame.drawing(state.z[None], state.p[None]).forces if each.distributed
    ]
    assert len(drawn) == 3
    for each in drawn:
        np.testing.assert_allclose(each.vectors, -1.5 * each.places, atol=1e-12)


def test_states_that_elements_do_not_resolve_are_said_to_be_none():
    """At p = 1000 two elements of degree 8 are smooth, and say 1.0108 for max |κ| = 1.0106."""
    member, supports = Member(("A", "B"), curvature=-1.0), {"A": "fixed", "B": "fixed"}
    loads = {"p": {"pressure": ["A", "B"]}, "P": {"A-B": (0.3, -1)}}
    for elements, enough in ((2, False), (4, True)):
        joints = {"A": (0, 0), "B": (SPAN, 0)}
        frame = Frame(joints, [member], supports, loads, elements=elements)
        with unchecked():
            state = em.lift(loaded(frame, P=5.0), {"p": 1000.0}).end.state
        given = state.z[None], state.p[None]
        assert FrameMechanics.resolved(frame, *given).all()
        assert bool(frame.resolved(*given)[0]) is enough


@pytest.mark.slow
def test_the_set_of_an_arch_under_pressure_and_a_load_is_clean():
    """Four components where the largest curvature is 6 at most; nothing random is missing."""
    half = 0.5
    joints = {"A": (-np.sin(half), 0), "M": (0, 1 - np.cos(half)), "B": (np.sin(half), 0)}
    arcs = [Member(pair, curvature=-1.0) for pair in (("A", "M"), ("M", "B"))]
    loads = {"p": {"pressure": ["A", "M", "B"]}, "P": {"M": (0, -1)}}
    arch = Frame(joints, arcs, {"A": "pinned", "B": "pinned"}, loads)
    box = em.Box(p=(-50.0, 10.0), P=(-8.0, 16.0))
    found = em.equilibrium_set(arch, box, intervals=[12, 12], within=[arch.max_curvature <= 6.0])
    assert found.audit.clean
    assert found.audit.components == 4
