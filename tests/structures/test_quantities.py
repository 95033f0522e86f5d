"""The vocabulary of constraints: closed forms, dense sampling, refusals."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import equimorph as em
from equimorph.errors import InputError
from oracles.specimens import SPECIMENS

ARCH = em.Rod()
DRAWN = settings(max_examples=15, deadline=None, derandomize=True, database=None)


@pytest.fixture(scope="module")
def bent():
    """An arch without symmetry under load."""
    return em.lift(ARCH.natural_state(Theta=1.0, Delta=0.2), {"q": 1.0}).end.state


@given(x=st.floats(-0.2, 1.1), y=st.floats(-0.2, 0.5), inside=st.booleans())
@DRAWN
def test_distance_to_a_disc_is_that_of_a_million_points(bent, x, y, inside):
    """Fourth-order arcs of length 1/128: 1e-9; samples 2e-5 apart: their square over the gap."""
    away = em.distance_to(ARCH, em.Disc((x, y), 0.05, inside=inside))
    s = np.linspace(0, 1, 50001)
    gap = np.hypot(*(bent.shape(s) - (x, y)).T) - 0.05
    sampled = -gap.max() if inside else gap.min()
    assert away(bent) == pytest.approx(sampled, abs=1e-9 + 1e-10 / max(abs(gap).min(), 1e-5))
    assert away.place is not None
    place = away.place(bent.z[None], bent.p[None])[0]
    at = np.hypot(*(bent.shape(np.array([place]))[0] - (x, y))) - 0.05
    assert (-at if inside else at) == pytest.approx(away(bent), abs=1e-9)


@given(angle=st.floats(0, 6.28), offset=st.floats(-0.3, 0.3))
@DRAWN
def test_distance_to_a_half_plane_is_that_of_a_million_points(bent, angle, offset):
    normal = np.array([np.cos(angle), np.sin(angle)])
    wall = em.HalfPlane(tuple((0.4, 0.0) + offset * normal), tuple(3 * normal))
    s = np.linspace(0, 1, 50001)
    gaps = (bent.shape(s) - wall.point) @ normal
    assert em.distance_to(ARCH, wall)(bent) == pytest.approx(gaps.min(), abs=1e-8)


def test_a_ceiling_stops_a_rising_arch_where_its_crown_touches():
    """The crown is a smooth function of Θ: the lift ends on the wall to round-off."""
    ceiling = em.distance_to(ARCH, em.HalfPlane((0.0, 0.235), (0.0, -1.0))) >= 0.0
    path = em.lift(ARCH.natural_state(Theta=1.0), {"Theta": 0.5}, within=[ceiling])
    assert path.end.kind == "constraint"
    assert path.end.state["Theta"] < 1.0
    assert ARCH.height(0.5)(path.end.state) == pytest.approx(0.235, abs=1e-9)


def test_spring_keeps_its_distance_from_a_disc_in_closed_form():
    """Straight from (x_l, 0) to (0, x_l tan δ): |0.5 sin δ + 0.2 cos δ − x_l sin δ| − r."""
    spring = em.Spring()
    state = em.lift(spring.natural_state(x_l=0.8), {"F": 0.02}).end.state
    delta = spring.descriptor("angle")(state)
    line = abs((0.5 - 0.8) * np.sin(delta) + 0.2 * np.cos(delta))
    away = em.distance_to(spring, em.Disc((0.5, 0.2), 0.1))
    assert away(state) == pytest.approx(line - 0.1, abs=1e-12)


@pytest.mark.parametrize("specimen", SPECIMENS, ids=lambda each: each.name)
def test_every_structure_has_the_vocabulary(specimen):
    """Distances of shapes from far away lie between those of their corners and their hull."""
    structure = specimen.structure
    z, p, _, _ = specimen.states(seed=3)
    far = em.distance_to(structure, em.HalfPlane((0.0, -100.0), (0.0, 1.0))).function(z, p)
    lowest = structure.shape(z, p)[:, :, 1].min(axis=1)
    np.testing.assert_allclose(far, lowest + 100.0, atol=2e-3 * (1 + np.abs(lowest).max()))
    first = structure.parameters[0].name
    assert np.array_equal(em.value_of(structure, first).function(z, p), p[:, 0])
    np.testing.assert_allclose(
        em.effort_of(structure, first).function(z, p),
        structure.effort(z, p)[:, 0] * structure.energy_scale,
    )


def test_effort_is_the_slope_of_the_energy(bent):
    """∂E/∂Θ along equilibria: central differences of energies."""
    h = 1e-4
    up, down = (em.lift(bent, {"Theta": 1.0 + s * h}).end.state for s in (1, -1))
    slope = (up.energy - down.energy) / (2 * h)
    assert em.effort_of(ARCH, "Theta")(bent) == pytest.approx(slope, rel=1e-6)


def test_outside_measures_the_way_out_of_a_box(bent):
    box = em.Box(Theta=(0.9, 1.3), Delta=(0.15, 0.3))
    assert em.outside(ARCH, box)(bent) == pytest.approx(-0.05)
    assert em.outside(ARCH, em.Box(Theta=(1.2, 1.3), Delta=(0.15, 0.3)))(bent) == pytest.approx(0.2)
    path = em.lift(bent, {"Theta": 1.5}, within=[em.outside(ARCH, em.Box(Theta=(1.2, 1.3))) >= 0])
    assert path.end.kind == "constraint"
    assert path.end.state["Theta"] == pytest.approx(1.2, abs=1e-9)


def test_the_margin_as_a_constraint_ends_a_lift_where_it_falls_below(bent):
    path = em.lift(bent, {"q": 6.0}, within=[em.margin_of(ARCH) >= 1.0])
    assert path.end.kind == "constraint"
    assert path.end.state.margin == pytest.approx(1.0, abs=1e-6)


def test_a_constraint_over_a_range_of_loads_is_the_limit_load_read_backwards():
    """(0.9, 0.02) under a uniform load has its fold at q = 3.9485039281."""
    rest = ARCH.natural_state(Theta=0.9, Delta=0.02)
    assert em.stable_over(ARCH, "q", (0.0, 3.948)).holds(rest.batch)[0]
    assert not em.stable_over(ARCH, "q", (0.0, 3.949)).holds(rest.batch)[0]
    kappa = ARCH.max_curvature
    path = em.lift(rest, {"q": 3.0})
    worst = kappa(path.states).max()
    held = em.stable_over(ARCH, "q", (0.0, 3.0), [kappa <= 10])
    assert held.descriptor(rest) == pytest.approx((worst - 10) / 10, abs=2e-3)
    # the same from any state on the path
    assert held.descriptor(path.end.state) == pytest.approx(held.descriptor(rest), abs=1e-9)


def test_rates_tell_when_a_schedule_can_be_there():
    values = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, -3.0]])
    schedule = em.Schedule(
        ("a", "b"), ("actuator",) * 2, ("1", "1"), values, np.linspace(0, 1, 3), np.ones(3), {}, {}
    )
    assert em.Rates({"a": 0.5, "b": 1.0}).times(schedule) == pytest.approx([0.0, 2.0, 5.0])
    with pytest.raises(InputError, match="name parameters"):
        em.Rates({"c": 1.0}).times(schedule)


def test_meaningless_obstacles_are_refused():
    with pytest.raises(InputError, match="`normal` must be two finite numbers"):
        em.HalfPlane((0, 0), (0, 0))
    with pytest.raises(InputError, match="`radius` must be a finite number"):
        em.Disc((0, 0), -1.0)
    with pytest.raises(InputError, match="`centre` must be two finite numbers"):
        em.Disc((0, np.nan), 1.0)
    with pytest.raises(InputError, match="must be a parameter"):
        em.effort_of(ARCH, "theta")
    with pytest.raises(InputError, match="`ends` must be finite and in order"):
        em.stable_over(ARCH, "q", (1.0, 0.0))
    with pytest.raises(InputError, match="`limits` must be positive"):
        em.Rates({"a": 0.0})


def test_equal_words_are_equal_descriptors():
    again = em.Rod()
    disc = em.Disc((0.5, 0.2), 0.1)
    assert em.distance_to(ARCH, disc) == em.distance_to(again, disc)
    assert em.margin_of(ARCH) == em.margin_of(again)
    assert em.stable_over(ARCH, "q", (0, 1)) == em.stable_over(again, "q", (0.0, 1.0))
