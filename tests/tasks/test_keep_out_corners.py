"""Keep-out boxes are open: routes may touch their sides and corners, but not cut them."""

import pytest

import equimorph as em
from typecheck import unchecked

BOX = em.Box(x_l=(0.8, 0.95), F=(-0.2, 0.0))
ROOM = em.Box(x_l=(0.3, 1.3), F=(-0.5, 0.5))


@pytest.fixture(scope="module")
def scene(spring_set):
    spring = spring_set.structure
    start = max(spring_set.at(x_l=0.6, F=0.0).stable, key=spring.angle)
    goal = max(spring_set.at(x_l=1.2, F=-0.2).stable, key=spring.angle)
    return start, goal, em.outside(spring, BOX) >= 0.0


def test_a_route_along_two_sides_and_three_corners_is_allowed(spring_set, scene):
    start, goal, away = scene
    via = [{"x_l": 0.8, "F": 0.0}, {"x_l": 0.95}, {"F": -0.2}]
    with unchecked():
        route = em.plan(spring_set, start, goal, via=via, within=[away])
        cut = em.plan(spring_set, start, goal, via=[{"x_l": 0.9, "F": -0.1}], within=[away])
    assert route.arrived
    assert away.excess(route.path.states.z, route.path.states.p).max() <= 1e-12
    assert cut.why.startswith("segment 1 of 2 meets the constraint outside(")


def test_free_routes_go_around_the_corner(spring_set, scene):
    """The shortest one is drawn to (0.8, −0.2), past which coarse lifts step unseen."""
    start, goal, away = scene
    with unchecked():
        route = em.plan(spring_set, start, goal, within=[away])
    assert route.arrived
    assert away.excess(route.path.states.z, route.path.states.p).max() <= 1e-8


def test_corners_are_ends_of_routes(spring_set, scene):
    start, goal, away = scene
    with unchecked():
        corner = em.lift(start, {"x_l": 0.8, "F": 0.0}).end.state
        assert em.plan(spring_set, start, corner, within=[away]).arrived
        assert em.plan(spring_set, corner, goal, within=[away]).arrived
        assert em.plan_sampled(start, corner, ROOM, within=[away]).arrived
