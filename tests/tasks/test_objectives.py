"""Routes that are the best in different senses, each better than the others in its own."""

import re

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from equimorph.tasks.planning.objectives import objective_of
from equimorph.tasks.planning.planner import plan
from typecheck import unchecked

WISHES = {
    "length": "length",
    "travel": "travel",
    "work": "work",
    "time": em.Rates({"Theta": 0.2, "Delta": 0.05}),
}


@pytest.fixture(scope="module")
def routes(arch_set, ends):
    with unchecked():
        return {name: plan(arch_set, *ends, objective=wish) for name, wish in WISHES.items()}


def test_each_route_is_the_best_of_all_in_its_own_objective(arch_set, routes):
    for name, wish in WISHES.items():
        objective = objective_of(wish, arch_set.structure)
        costs = {other: objective.along(route.path.states) for other, route in routes.items()}
        assert routes[name].cost == pytest.approx(costs[name], rel=1e-12)
        assert min(costs.values()) >= 0.999 * costs[name]


def test_a_route_for_rates_has_the_times_that_it_takes(routes):
    """At every instant one of the parameters moves at its own rate."""
    schedule, limits = routes["time"].schedule, WISHES["time"].limits
    assert schedule.duration == pytest.approx(routes["time"].cost, rel=1e-9)
    at = [schedule.names.index(name) for name in limits]
    rates = np.abs(np.diff(schedule.values[:, at], axis=0)) / np.diff(schedule.times)[:, None]
    np.testing.assert_allclose((rates / list(limits.values())).max(axis=1), 1.0, rtol=1e-9)
    assert routes["length"].schedule.times is None


@pytest.mark.parametrize("wish", ["length", "work", "clearance"])
def test_inside_out_under_a_limit_on_curvature(arch_set, ends, wish):
    """The goal itself has max |κ| = 10.55: 11 is kept on the way, 6 excludes the goal."""
    arch = arch_set.structure
    with unchecked():
        route = plan(arch_set, *ends, objective=wish, within=[arch.max_curvature <= 11])
        refused = plan(arch_set, *ends, objective=wish, within=[arch.max_curvature <= 6])
    assert route.arrived
    assert route.schedule.descriptors["max_curvature"].max() <= 11
    assert refused.why.startswith("the goal violates max_curvature <= 6: max_curvature = 10.549")


def test_a_descriptor_counts_like_the_margin(arch_set, routes):
    """∫ ds/d: with the stability margin for d this is clearance."""
    structure, states = arch_set.structure, routes["length"].path.states
    margin = objective_of(em.margin_of(structure), structure)
    cost = objective_of("clearance", structure).along(states)
    assert margin.along(states) == pytest.approx(cost, rel=1e-9)
    both = objective_of([(1.0, "clearance"), (2.0, em.margin_of(structure))], structure)
    assert both.along(states) == pytest.approx(3.0 * cost, rel=1e-9)
    assert str(both) == "clearance + 2 length/stability_margin"


def test_routes_say_what_they_are_for(routes):
    assert all(route.arrived for route in routes.values())
    assert {name: route.objective for name, route in routes.items()} == {n: n for n in WISHES}


def test_length_is_shorter_than_over_the_corners_of_the_mesh(routes):
    """The route over vertices of this mesh, straightened, has length 2.05."""
    assert routes["length"].length < 1.95


def test_time_is_that_of_the_schedule(routes):
    spent = WISHES["time"].times(routes["time"].schedule)[-1]
    assert routes["time"].cost == pytest.approx(spent, rel=1e-9)


def test_work_of_a_loaded_actuator_is_the_change_of_energy(spring_set):
    """At F = 0.1 and growing x_l the effort keeps its sign, so that nothing is got back."""
    spring = spring_set.structure
    start = em.lift(spring.natural_state(x_l=0.5), {"F": -0.1}).end.state
    goal = em.lift(start, {"x_l": 0.7}).end.state
    work = objective_of("work", spring)
    path = em.lift(start, {"x_l": 0.7}, options=em.TraceOptions(largest_step=0.01))
    effort = spring.effort(path.states.z, path.states.p)[:, 0]
    assert (np.sign(effort) == np.sign(effort[0])).all()
    assert work.along(path.states) == pytest.approx(abs(goal.energy - start.energy), rel=1e-4)


def test_clearance_keeps_away_from_instability(spring_set):
    """From δ > 0 to δ < 0 around the cusp: the margin is a multiple of that of the shortest way."""
    start, goal = (spring_set.at(x_l=0.8, F=0.0).stable[k] for k in (0, 1))
    with unchecked():
        near = plan(spring_set, start, goal)
        far = plan(spring_set, start, goal, objective="clearance")
    assert near.arrived
    assert far.arrived
    assert far.margin > 1.5 * near.margin
    assert far.length > near.length


def test_weighted_sums_lie_between(arch_set, ends, routes):
    with unchecked():
        route = plan(arch_set, *ends, objective=[(1.0, "length"), (20.0, "work")])
    assert route.objective == "length + 20 work"
    work = objective_of("work", arch_set.structure)
    assert work.along(route.path.states) < work.along(routes["length"].path.states)
    assert route.length < routes["work"].length * 1.001


def test_load_may_be_steered_where_it_is_a_free_parameter(spring_set):
    """With F free the two sides of the spring join around x_l > 1; travel takes the short way."""
    start, goal = (spring_set.at(x_l=0.8, F=0.0).stable[k] for k in (0, 1))
    with unchecked():
        route = plan(spring_set, start, goal, objective="travel")
    assert route.arrived
    assert route.schedule.values[:, 0].max() > 1.0
    assert np.ptp(route.schedule.values[:, 1]) > 0.0


@pytest.mark.parametrize(
    ("wish", "message"),
    [
        (
            "lenght",
            "`objective` must be made of length, travel, work, clearance, Rates or descriptors; ",
        ),
        ([], "`objective` must have at least one term; got none."),
        ([(0.0, "work")], "`objective` must have positive weights; got 0.0."),
        ([(float("nan"), "work")], "`objective` must have positive weights; got nan."),
        ([("work", 1.0)], "`objective` must have positive weights; got 'work'."),
        (["work"], "`objective` must be a term or pairs (weight, term); got 'work'."),
        (em.Rates({"psi": 1.0}), "`objective` must limit parameters (Theta, Delta, q, nu); got "),
    ],
)
def test_wishes_without_meaning_are_input_errors(arch_set, ends, wish, message):
    with unchecked(), pytest.raises(InputError, match=f"^{re.escape(message)}"):
        plan(arch_set, *ends, objective=wish)


@pytest.mark.slow
def test_a_route_for_barriers_can_be_knocked_harder(arch_set, ends):
    """The smallest barrier grows from below 1e-3 to above 0.04."""
    with unchecked():
        field = em.barriers(arch_set)
        short, safe = (plan(arch_set, *ends, objective=o) for o in ("length", field.descriptor))
        least = [field.of(route.states).energy.min() for route in (short, safe)]
    assert least[0] < 1e-3
    assert least[1] > 0.04
