"""All answers speak the same words: status, why, states, margin, schedule."""

import inspect
import re

import numpy as np
import pytest

import equimorph as em

TASKS = "equimorph.tasks."


@pytest.fixture(scope="module")
def spring():
    return em.Spring()


@pytest.fixture(scope="module")
def eset(spring):
    return em.equilibrium_set(spring, em.Box(x_l=(0.3, 1.5), F=(-0.4, 0.4)), intervals=(24, 24))


@pytest.fixture(scope="module")
def start(spring, eset):
    return max(eset.at(x_l=0.8, F=0.0).stable, key=spring.descriptor("angle"))


def test_a_route_has_its_states_and_its_schedule(spring, eset, start):
    goal = min(eset.at(x_l=0.8, F=0.0).stable, key=spring.descriptor("angle"))
    route = em.plan(eset, start, goal)
    assert (route.status, route.why) == ("arrived", "")
    assert 0.0 < route.margin <= route.states.margin.min()
    assert len(route.states) == len(route.schedule.values)
    none = em.plan(eset, start, goal, within=[em.value_of(spring, "x_l") <= 0.9])
    assert none.status == "refused"
    assert none.why
    assert none.states is None
    assert none.schedule is None


def test_shapes_have_the_schedule_to_the_best(spring, eset, start):
    angle = spring.descriptor("angle")
    found = em.solve_shape(eset, {angle: 0.3, em.value_of(spring, "x_l"): 0.95}, start=start)
    assert found.status == "solved"
    assert found.states.parameters["x_l"] == pytest.approx([0.95])
    assert found.schedule.values[-1] == pytest.approx(found.states.p[0], abs=1e-9)
    assert em.solve_shape(eset, {angle: 0.3, em.value_of(spring, "x_l"): 0.95}).schedule is None
    none = em.solve_shape(eset, {angle: 1.6}, start=start)
    assert none.status == "refused"
    assert len(none.states) == len(none.margin) == 0
    assert none.schedule is None


def test_robustness_says_what_bounds_it(eset, start):
    room = em.stable_room(start, {"F": 0.1})
    assert room.status == "bounded"
    assert room.why.startswith("fold at State(spring: x_l=0.8, F=")
    assert np.array_equal(room.states.z[0], start.z)
    free = em.stable_room(start, {"F": 1e-4}, most=2.0)
    assert (free.status, free.why) == ("open", "")
    snap = em.least_snap(eset, start)
    assert snap.status == "found"
    assert snap.states.margin == pytest.approx([0.0, snap.landing.state.margin], abs=1e-9)


def test_trials_say_how_many_fail_and_of_what(start):
    safe = em.random_trials(start, [{"x_l": 0.85}], {"F": 1e-4}, trials=20)
    assert (safe.status, safe.why) == ("arrived", "")
    assert safe.margin.min() > 0.0
    risky = em.random_trials(start, [{"x_l": 0.99}], {"F": 1e-2}, trials=20)
    assert risky.status == "failed"
    assert risky.why == f"{np.sum(~risky.arrived)} fold"
    assert risky.margin[~risky.arrived] == pytest.approx(0.0, abs=1e-9)


def test_optima_that_do_not_exist_say_so(spring, eset):
    angle = spring.descriptor("angle")
    found = em.optimise(eset, angle)
    assert found.states[0].p == pytest.approx(found.best.state.p)
    none = em.optimise(eset, angle, within=[angle >= 2])
    assert none.status == "refused"
    assert none.why.startswith("no stable optimum within angle >= 2")
    assert len(none.states) == 0
    assert none.schedule is None
    assert np.isnan(none.margin)
    with pytest.raises(em.InputError, match=r"got none: no stable optimum"):
        none.best  # noqa: B018


def test_landscapes_have_a_status(spring, eset):
    angle, grid = spring.descriptor("angle"), em.Grid(x_l=(0.4, 1.4, 4), F=(-0.3, 0.3, 4))
    found = em.landscape(eset, angle, grid)
    assert (found.status, found.why) == ("found", "")
    assert len(found.margin) == len(found.states)
    none = em.landscape(eset, angle, grid, within=[angle >= 2])
    assert none.status == "refused"
    assert none.why
    assert len(none.margin) == 0


def test_every_task_documents_each_of_its_parameters_on_its_own():
    """Study files take the keys of a section and their words from signature and docstring."""
    public = (getattr(em, name) for name in em.__all__)
    tasks = [each for each in public if getattr(each, "__module__", "").startswith(TASKS)]
    assert len(tasks) > 50
    for task in tasks:
        if inspect.isclass(task):
            continue
        section = re.search(r"Parameters\n-+\n(.*?)(\n\n\w+\n-+\n|\Z)", inspect.getdoc(task), re.S)
        documented = [line for line in section[1].splitlines() if line and line[0] != " "]
        assert documented == list(inspect.signature(task).parameters), task
