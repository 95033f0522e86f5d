"""Rods whose ends are held farther apart than the rod is long have no states, springs aside."""

import numpy as np
import pytest

import equimorph as em
from equimorph.model import parameter_vector

IN_SPACE = {"torsion": 0.8, "lateral": 1.0, "loads": {}, "coordinates": {}}


def reaches(rod, place):
    return rod.in_reach(parameter_vector(rod.parameters, place)[None])[0]


@pytest.mark.parametrize(
    ("rod", "place", "far"),
    [
        (em.Rod(), {"Theta": 0.3, "nu": 0.99}, 0.99),
        (em.Rod(rise=0.1), {"Theta": 0.3, "nu": 0.6, "rise": 0.7}, np.hypot(0.6, 0.7)),
        (em.Rod(span=150.0, EI=2.0, length=300.0, loads={}), {"Theta": 0.3, "nu": 299.0}, 0.997),
        (em.SpatialRod(**IN_SPACE), {"nu": 0.7, "rise": -0.5, "sideways": 0.4}, np.sqrt(0.9)),
        (em.SpatialRod(**IN_SPACE), {"nu": 0.7, "rise": -0.5, "sideways": 0.6}, np.sqrt(1.1)),
    ],
)  # fmt: skip
def test_ends_are_in_reach_up_to_the_length(rod, place, far):
    assert reaches(rod, place) == (far <= 1.0)


def test_stretching_and_springs_reach_farther():
    for rod in (
        em.SpatialRod(**IN_SPACE, axial=50.0),
        em.SpatialRod(**IN_SPACE, ends=("clamped", em.SpatialEnd(x=50.0))),
        em.Rod(ends=("clamped", em.End(x=50.0)), loads={}, coordinates={}),
    ):
        assert reaches(rod, {"nu": 1.3})


def test_a_straight_rod_is_pulled_by_a_spring_that_rests_beyond_its_reach():
    """Between a clamp and a spring of stiffness k that rests at x = 1.2 the pull is 0.2 k."""
    k, places = 50.0, {"span": 1.2, "loads": {}, "coordinates": {}}
    flat = em.Rod(ends=("clamped", em.End(x=k)), **places)
    aside = em.SpatialRod(**{**IN_SPACE, **places}, ends=("clamped", em.SpatialEnd(x=k)))
    for rod in (flat, aside):
        state = rod.natural_state()
        assert state.index == 0
        np.testing.assert_allclose(rod.support_force("x")(state), -0.2 * k, rtol=1e-9)


def test_beyond_reach_nothing_is_searched():
    """One second instead of 800: random guesses led nowhere, with forces that grew on and on."""
    rod = em.SpatialRod(**IN_SPACE, elements=37)
    held = {"nu": 0.8253, "rise": 0.44, "sideways": -0.4293}
    found = em.find_equilibria(rod, held)
    assert len(found) == found.completeness.starts == found.completeness.upper == 0
    box = em.Box(tilt_B=(-0.2843, -0.2125), theta_A=(0.1, 0.8))
    eset = em.equilibrium_set(rod, box, fixed=held, within=[rod.max_curvature <= 12.0])
    assert eset.audit.clean
    assert eset.audit.vertices == 0


def test_a_box_that_leaves_the_reach_holds_the_states_within():
    """Clamps that are turned bend the rod the more, the nearer it is to straight between them."""
    rod = em.Rod(rise=0.1, loads={})
    box, held = em.Box(nu=(0.8, 0.9995)), {"Theta": 0.6, "rise": 0.1}
    eset = em.equilibrium_set(rod, box, fixed=held, within=[rod.max_curvature <= 8.0])
    assert eset.audit.clean
    assert 0.9 < eset.coordinates[:, 0].max() < np.sqrt(0.99)
