"""Straight round frames, whose states may be turned about their line for nothing."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

import equimorph as em
from equimorph.errors import InputError
from equimorph.model import parameter_vector
from equimorph.structures.added_load import dense_matrices

THRUST = {"P": {"B": (0.0, 0.0, -1.0)}}


def column(supports=None, loads=THRUST, actuators=None, elements=2, **options):
    """Two pieces of a member along z, clamped at its foot."""
    joints = {"A": (0.3, 0.1, 0.0), "M": (0.3, 0.1, 0.4), "B": (0.3, 0.1, 1.0)}
    member = em.SpatialMember(("A", "M", "B"), **{"EI": 1.0, "GJ": 0.77, **options})
    held = supports or {"A": "fixed"}
    return em.SpatialFrame(joints, [member], held, loads, actuators, elements=elements)


def have_orbits(frame, **values):
    """Whether states at parameters may be turned about the line."""
    return bool(frame.have_orbits(parameter_vector(frame.parameters, values)[None])[0])


SPRUNG = {"A": "fixed", "M": {"x": 30.0, "y": 30.0}}
MOVED = {"supports": {"A": "fixed", "B": "fixed"}, "loads": None, "EA": 50.0}
ACTING = (
    ({"move": {"B": (0.0, 0.0, -1.0)}}, True),
    ({"move": {"B": (0.0, 1.0, 0.0)}}, False),
    ({"turn": {"B": (0.0, 0.0, 1.0)}}, True),
    ({"turn": {"B": (1.0, 0.0, 0.0)}}, False),
)


@pytest.mark.parametrize(
    ("options", "values", "free"),
    [
        ({}, {"P": 3.0}, True),
        ({"EI_out": 1.01}, {"P": 3.0}, False),
        ({"EA": 50.0}, {"P": 3.0}, True),
        ({"strains": (0.5, 0.0, 0.0)}, {"P": 3.0}, True),
        ({"strains": (0.0, 0.1, 0.0)}, {"P": 3.0}, False),
        ({"loads": {**THRUST, "H": {"B": (1.0, 0.0, 0.0)}}}, {"P": 3.0, "H": 0.0}, True),
        ({"loads": {**THRUST, "H": {"B": (1.0, 0.0, 0.0)}}}, {"P": 3.0, "H": 1e-3}, False),
        ({"supports": {"A": "fixed", "B": "xy"}}, {"P": 3.0}, True),
        ({"supports": {"A": "fixed", "B": "x"}}, {"P": 3.0}, False),
        ({"supports": SPRUNG}, {"P": 3.0}, True),
        ({"supports": {"A": "fixed", "M": {"x": 30.0, "y": 20.0}}}, {"P": 3.0}, False),
        *((MOVED | {"actuators": {"a": way}}, {"a": 0.2}, free) for way, free in ACTING),
    ],
)
def test_what_tells_directions_across_the_line_apart_ends_its_orbits(options, values, free):
    assert have_orbits(column(**options), **values) == free


def test_a_frame_off_one_line_has_no_orbits():
    joints = {"A": (0, 0, 0), "B": (1, 0, 0), "C": (1, 1, 0)}
    loads = {"P": {"C": (0, 0, -1)}}
    frame = em.SpatialFrame(joints, [em.SpatialMember(("A", "B", "C"))], {"A": "fixed"}, loads)
    assert not have_orbits(frame, P=1.0)


SPUN = {"A": "fixed", "B": {"x": "held", "y": "held", "rotation": "held"}}
TILTED = {"H": {"M": (1.0, 1.0, 0.0)}}
STIFF = {"supports": {"A": "fixed", "B": "fixed"}, "EA": 500.0, "elements": 4}
SHORTER = {"d": {"move": {"B": (0.0, 0.0, -1.0)}}, "t": {"turn": {"B": (0.0, 0.0, 1.0)}}}
BUCKLED = (
    ({"loads": {**THRUST, "H": {"B": (1.0, 1.0, 0.0)}}}, ({"H": 0.2}, {"P": 3.0})),
    ({"loads": {**THRUST, **TILTED}, "supports": SPUN}, ({"H": 2.0}, {"P": 45.0})),
    ({"loads": {**THRUST, **TILTED}, "supports": SPRUNG}, ({"H": 2.0}, {"P": 8.0})),
    (STIFF | {"loads": TILTED, "actuators": SHORTER}, ({"H": 2.0}, {"d": 0.2}, {"t": 2.0})),
)
"""Frames, and legs to states off the line, from which H is taken away."""


def buckled(options, legs):
    """A frame, and a state of it on an orbit."""
    frame = column(**options)
    return frame, em.lift(frame.natural_state(), [*legs, {"H": 0.0}]).end.state


def matrix_of(frame, state):
    """F_z by differences of fourth order of F."""
    step = 1e-4 * np.eye(frame.size)
    p = state.p[None].repeat(frame.size, axis=0)
    f = [frame.residual(state.z + k * step, p) for k in (1, -1, 2, -2)]
    full = (8.0 * (f[0] - f[1]) - (f[2] - f[3])) / 12e-4
    return 0.5 * (full + full.T)


@pytest.mark.parametrize(("options", "legs"), BUCKLED)
def test_solves_and_margins_leave_out_the_orbit(options, legs):
    """Against dense algebra with a border that holds the component along the orbit."""
    check_across_orbit(*buckled(options, legs))


def test_unstable_orbits_have_margins_and_solves_across_them_too():
    """The second orbit of a column, of index 2."""
    frame = column(elements=3)
    found = em.find_equilibria(frame, {"P": 25.0}, within=[frame.max_curvature <= 40.0], starts=60)
    second = next(state for state in found if state.index == 2)
    assert frame.along_orbits(second.z[None], second.p[None]).any()
    assert second.margin < -1.0
    check_across_orbit(frame, second)


def check_across_orbit(frame, state):
    """Inertia and solves with some shifts, beside the margin, against dense ones."""
    n, z, p = frame.unknowns, state.z[None], state.p[None]
    full, way = matrix_of(frame, state), frame.along_orbits(z, p)[0]
    assert np.abs(full @ way).max() < 1e-7 * np.abs(full).max()
    border = np.append(frame.mass * way[:n], np.zeros(frame.constraints)) / np.abs(way).max()
    rhs = np.random.default_rng(1).normal(size=frame.size)

    def bordered(shift):
        wide = np.block([[full, border[:, None]], [border[None], np.zeros((1, 1))]])
        wide[range(n), range(n)] -= shift * frame.mass
        return wide

    for shift in (0.0, -3.0, 0.7 * state.margin, 1.3 * state.margin, 40.0):
        shifts = None if shift == 0.0 else np.array([shift])
        found = frame.solve(z, p, rhs[None, None], shift=shifts)
        below = (np.linalg.eigvalsh(bordered(shift)) < 0.0).sum() - 1
        assert found.negative[0] == below
        wanted = np.linalg.solve(bordered(shift), np.append(rhs, 0.0))[:-1]
        np.testing.assert_allclose(found.x[0, 0], wanted, atol=1e-6 * np.abs(wanted).max())
    whole = dense_matrices(frame, z, p)[0]
    np.testing.assert_allclose(whole, full, atol=1e-7 * np.abs(full).max())


@pytest.mark.parametrize(("options", "legs"), BUCKLED)
def test_states_turned_about_the_line_are_equilibria_of_the_same_energy(options, legs):
    """Multipliers turn, too, where there are some; the phase grows with the angle."""
    frame, state = buckled(options, legs)
    z, p = (each[None].repeat(3, axis=0) for each in (state.z, state.p))
    angles = np.array([0.3, -1.2, np.pi])
    turned = frame.turn(z, p, angles)
    assert np.abs(frame.residual(turned, p)).max() < 1e-9
    np.testing.assert_allclose(frame.energy(turned, p), frame.energy(z, p), rtol=1e-12)
    gap = frame.phase(turned)[0] - frame.phase(z)[0] - angles
    np.testing.assert_allclose(gap - np.pi * np.round(gap / np.pi), 0.0, atol=1e-12)
    _, gradient = frame.phase(turned)
    np.testing.assert_allclose((gradient * frame.turning(turned, p)).sum(axis=1), 1.0)
    step = 1e-6 * np.random.default_rng(0).normal(size=z.shape)
    slope = frame.phase(turned + step)[0] - frame.phase(turned - step)[0]
    np.testing.assert_allclose(slope, 2.0 * (gradient * step).sum(axis=1), rtol=1e-6)


@pytest.mark.parametrize("load", [1.01, 1.001, 1.0001, 3.0, 6.0])
def test_paths_along_orbits_arrive_and_stay_in_their_plane(load):
    """From P = 1.2 P_cr; four of these were lost, turned by up to 0.2, one arrived 1e-3 off."""
    frame, state = buckled(*BUCKLED[0])
    path = em.lift(state, {"P": load * np.pi**2 / 4.0})
    assert path.arrived
    assert (path.states.index == 0).all()
    assert np.abs(frame.phase(path.states.z[1:])[0]).max() < 1e-12
    assert path.end.state.margin > 0.0


def test_twist_turns_no_phase():
    """Twisting a buckled column by 4 rad and back leads to the state that it came from."""
    frame, state = buckled(*BUCKLED[3])
    path = em.lift(state, [{"t": -2.0}, {"t": 2.0}])
    assert path.arrived
    z, p = state.z[None], state.p[None]
    start = frame.pick_on_orbits(z, p, p)[0]
    np.testing.assert_allclose(path.end.state.z, start, atol=1e-8)


def elastica_height(load):
    """Height 2 E/K − 1 of a quarter wave of length 1 with K² = P."""
    m = brentq(lambda m: ellipk(m) ** 2 - load, 1e-9, 0.9999)
    return 2.0 * ellipe(m) / ellipk(m) - 1.0


def test_searches_find_all_orbits_of_a_column():
    """Below P₁ = π²/4 one state, beyond it an orbit, beyond 9 P₁ another one, of index 2.

    Of each orbit two opposite states; heights are those of the elastica with k of K(k) = √P/(2j−1).
    """
    frame = column(elements=4)
    for load, counts in ((1.0, [1]), (3.5, [2, 0, 1]), (25.0, [2, 0, 2, 0, 1])):
        found = em.find_equilibria(frame, {"P": load}, within=[frame.max_curvature <= 40.0])
        assert np.bincount(found.index).tolist() == counts
        heights = 1.0 + frame.displacement("B", "z").function(found.z, found.p)
        for mode, index in ((1, 0), (3, 2)):
            bent = heights[(found.index == index) & (heights < 0.999)]
            if len(bent):
                np.testing.assert_allclose(bent, elastica_height(load / mode**2), rtol=1e-5)


@pytest.mark.parametrize("elements", [2, 6])
def test_buckled_round_columns_are_stable_across_their_orbits(elements):
    """Elastica: P/P_cr = (2 K/π)², height 2 E/K − 1, sin α/2 = k; α = 60°, 90°. 1e-5: elements.

    Indices were 0 or 1 by round-off, and paths were lost among events that do not exist. The margin
    was 0, that along the orbit.
    """
    frame = column(loads={**THRUST, "H": {"B": (1.0, 1.0, 0.0)}}, elements=elements)
    state = frame.natural_state()
    for values in ({"H": 0.2}, {"P": 3.0}, {"H": 0.0}):
        state = em.lift(state, values).end.state
    assert state.margin == pytest.approx(0.2477, rel=1e-3)
    for angle in np.radians([60.0, 90.0]):
        m = np.sin(0.5 * angle) ** 2
        path = em.lift(state, {"P": ellipk(m) ** 2})
        assert path.arrived
        assert len(path.states) < 12
        assert (path.states.index == 0).all()
        end = path.end.state
        assert end.stable
        height = 1.0 + frame.displacement("B", "z")(end)
        assert height == pytest.approx(2.0 * ellipe(m) / ellipk(m) - 1.0, rel=1e-5)


def test_what_needs_isolated_states_refuses_round_columns():
    """Sheets of orbits meet at the straight one in a way that sets do not pair."""
    frame = column()
    with pytest.raises(InputError, match=r"`structure` must have isolated equilibria.*unequal"):
        em.equilibrium_set(frame, em.Box(P=(0.5, 4.0)))
    assert np.isfinite(em.lift(frame.natural_state(), {"P": 1.0}).end.state.z).all()
