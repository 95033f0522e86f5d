"""From the upright to the inverted arch at q = 2.5: the way-point route of [Feher2025]_.

Smallest margin 0.462, max |κ| 16.4 on the way and 10.55 at the goal were computed independently;
so was the fold near |Δ| = 0.42 that the route meets the other way round.
"""

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria import lift
from equimorph.model import Descriptor
from equimorph.tasks.planning.planner import plan
from typecheck import unchecked

VIA = [{"Theta": 1.3}, {"Delta": 1.3}, {"Theta": 1.0}, {"Delta": 0.0}]
OTHER_WAY = [{"Delta": 1.3}, {"Theta": 1.3}, {"Delta": 0.0}, {"Theta": 1.0}]


@pytest.fixture(scope="module")
def by_way_points(arch_set, ends):
    arch = arch_set.structure
    return plan(arch_set, *ends, via=VIA, monitor=[arch.height(0.5)])


@pytest.fixture(scope="module")
def free(arch_set, ends):
    return plan(arch_set, *ends)


def test_way_point_route_turns_the_arch_inside_out_without_a_snap(arch_set, ends, by_way_points):
    assert by_way_points.arrived
    assert by_way_points.margin == pytest.approx(0.462, abs=5e-4)
    path = by_way_points.path
    assert (path.states.index == 0).all()
    rise = arch_set.structure.height(0.5)(path.states)
    assert rise[0] == pytest.approx(0.2258, abs=5e-5)
    assert rise[-1] == pytest.approx(-0.1496, abs=5e-5)
    np.testing.assert_allclose(path.states.z[-1], ends[1].z, rtol=0, atol=1e-7)


def test_curvature_on_the_way_point_route(by_way_points):
    kappa = by_way_points.schedule.descriptors["max_curvature"]
    assert kappa.max() == pytest.approx(16.4, abs=0.05)
    assert kappa[-1] == pytest.approx(10.55, abs=5e-3)


def test_way_point_route_keeps_its_corners(by_way_points):
    schedule = by_way_points.schedule
    corners = schedule.values[schedule.way_points, :2]
    wanted = [[1, 0], [1.3, 0], [1.3, 1.3], [1, 1.3], [1, 0]]
    np.testing.assert_allclose(corners, wanted, rtol=0, atol=1e-12)
    assert by_way_points.way_points == VIA


def test_schedule_starts_at_the_start_and_ends_at_the_goal(ends, by_way_points):
    schedule, (start, goal) = by_way_points.schedule, ends
    assert np.array_equal(schedule.values[0], start.p)
    np.testing.assert_allclose(schedule.values[-1], goal.p, rtol=0, atol=1e-12)
    assert schedule.progress[0] == 0.0
    assert schedule.progress[-1] == 1.0
    assert (np.diff(schedule.progress) > 0).all()
    # steps are short: between them the margin falls by their squares
    assert 0.0 < schedule.margins.min() - by_way_points.margin < 1e-4
    assert schedule.margins[0] == pytest.approx(start.margin, rel=1e-9)
    assert set(schedule.descriptors) == {"max_curvature", "height(0.5)"}
    assert schedule.start["unknowns"] == start.z.tolist()


def test_schedule_lifted_again_reproduces_the_goal(ends, by_way_points):
    schedule, (start, goal) = by_way_points.schedule, ends
    steps = [dict(zip(schedule.names, row.tolist(), strict=True)) for row in schedule.values[1:]]
    path = lift(start, steps[4::5] + steps[-1:])
    assert path.end.kind == "arrived"
    np.testing.assert_allclose(path.end.state.z, goal.z, rtol=0, atol=1e-7)


def test_way_points_the_other_way_round_meet_a_fold(arch_set, ends):
    route = plan(arch_set, *ends, via=OTHER_WAY)
    assert route.status == "refused"
    assert "segment 1 of 4 meets a fold" in route.why
    assert "snap" in route.why
    assert "Delta = 0.418136" in route.why
    assert route.schedule is None
    fold = route.path.end.state
    assert abs(fold["Delta"]) == pytest.approx(0.418, abs=5e-4)
    assert fold["Theta"] == 1.0


def test_route_without_way_points_is_shorter(by_way_points, free):
    assert free.arrived
    assert free.length < by_way_points.length
    assert (free.path.states.index == 0).all()
    assert free.margin > 0


@pytest.mark.parametrize("margin", [0.3, 0.6])
def test_demanded_margin_is_kept(arch_set, ends, free, margin):
    route = plan(arch_set, *ends, margin=margin)
    assert route.arrived
    assert route.margin >= margin
    assert route.schedule.margins.min() >= margin
    assert route.length > free.length


def test_margin_beyond_that_of_an_end_is_refused_by_name(arch_set, ends):
    start = ends[0]
    demanded = 1.1 * min(end.margin for end in ends)
    route = plan(arch_set, *ends, margin=demanded)
    assert route.status == "refused"
    assert "has a stability margin of" in route.why
    assert start.margin > 0


def test_margin_that_the_way_points_do_not_keep_is_refused(arch_set, ends):
    route = plan(arch_set, *ends, via=VIA, margin=0.5)
    assert route.status == "refused"
    assert route.why == "the stability margin falls to 0.4618 on the way, below 0.5"


def test_curvature_limit_that_the_goal_violates_is_named(arch_set, ends):
    arch = arch_set.structure
    for via in (VIA, None):
        route = plan(arch_set, *ends, via=via, within=[arch.max_curvature <= 6])
        assert route.status == "refused"
        assert route.why.startswith("the goal violates max_curvature <= 6: max_curvature = 10.549")


def test_curvature_limit_is_kept_on_the_way(arch_set, ends):
    arch = arch_set.structure
    route = plan(arch_set, *ends, within=[arch.max_curvature <= 11])
    assert route.arrived
    assert route.schedule.descriptors["max_curvature"].max() <= 11
    by_way_points = plan(arch_set, *ends, via=VIA, within=[arch.max_curvature <= 15])
    assert by_way_points.status == "refused"
    assert "meets the constraint max_curvature <= 15" in by_way_points.why


def test_constraint_that_separates_is_named(arch_set, ends):
    """|Δ| cannot stay below 0.1: on the way round the folds it must exceed about 0.5."""
    sideways = Descriptor("abs_Delta", "rad", lambda _, p: np.abs(p[:, 1]))
    route = plan(arch_set, *ends, within=[sideways <= 0.1])
    assert route.status == "refused"
    assert route.why == (
        "start and goal are connected by stable states, "
        "but not within max_curvature <= 20 and abs_Delta <= 0.1"
    )


def test_route_from_a_state_to_itself_is_short(arch_set, ends):
    route = plan(arch_set, ends[0], ends[0], via=[{"Theta": 1.1}])
    assert route.arrived
    assert route.way_points == [{"Theta": 1.1}, {"Theta": 1.0, "Delta": 0.0}]


def test_way_points_that_lead_to_another_equilibrium_are_refused(arch_set, ends):
    route = plan(arch_set, ends[0], ends[1], via=[{"Theta": 1.1}])
    assert route.status == "refused"
    assert route.why.startswith("the way-points lead to another equilibrium over the goal's")


def test_unstable_ends_are_refused_by_name(arch_set, ends):
    here = arch_set.at(Theta=1, Delta=0)
    saddle = here[int(np.flatnonzero(here.index == 2)[0])]
    assert plan(arch_set, ends[0], saddle).why == "the goal is unstable (index 2)"
    assert plan(arch_set, saddle, ends[0]).why == "the start is unstable (index 2)"


def test_route_under_a_load_given_as_a_function_has_a_schedule():
    """No file can hold the load, but the actuators can be told where to go."""
    rod = em.Rod(load=lambda s: 1.0 + s)
    box = em.Box(Theta=(0.5, 1.2), Delta=(-0.3, 0.4))
    with unchecked():
        eset = em.equilibrium_set(rod, box, fixed={"q": 1.0}, intervals=(2, 2), checks=0)
        start, goal = (
            eset.at(Theta=1.0, Delta=0.1).stable[0],
            eset.at(Theta=0.8, Delta=0.3).stable[0],
        )
        route = em.plan(eset, start, goal)
    assert route.arrived
    assert route.schedule.start["structure"] is None
