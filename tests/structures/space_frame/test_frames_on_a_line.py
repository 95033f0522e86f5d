"""Straight round frames, whose states may be turned about their line for nothing."""

import numpy as np
import pytest
from scipy.special import ellipe, ellipk

import equimorph as em
from equimorph.errors import InputError
from equimorph.model import parameter_vector

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


@pytest.mark.parametrize("elements", [2, 6])
def test_buckled_round_columns_are_stable_across_their_orbits(elements):
    """Elastica: P/P_cr = (2 K/π)², height 2 E/K − 1, sin α/2 = k; α = 60°, 90°. 1e-5: elements.

    Indices were 0 or 1 by round-off, and paths were lost among events that do not exist. Along the
    orbit the margin is 0.
    """
    frame = column(loads={**THRUST, "H": {"B": (1.0, 1.0, 0.0)}}, elements=elements)
    state = frame.natural_state()
    for values in ({"H": 0.2}, {"P": 3.0}, {"H": 0.0}):
        state = em.lift(state, values).end.state
    assert abs(state.margin) < 1e-9
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
    """A search would find no end of states, the sign of whose eigenvalue is one of round-off."""
    frame = column()
    with pytest.raises(InputError, match=r"`structure` must have isolated equilibria.*unequal"):
        em.equilibrium_set(frame, em.Box(P=(0.5, 4.0)))
    with pytest.raises(InputError, match="`structure` must have isolated equilibria"):
        em.find_equilibria(frame, {"P": 3.5})
    assert np.isfinite(em.lift(frame.natural_state(), {"P": 1.0}).end.state.z).all()
