"""Random trees over lifted edges: many actuators, moving loads, and the same answers as a grid."""

import re
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from equimorph.tasks.planning.planner import plan
from equimorph.tasks.planning.sampling import SamplingOptions, plan_sampled
from typecheck import unchecked

BOX = em.Box(Theta=(0.2, 2.5), Delta=(-2, 2))


@pytest.fixture(scope="module")
def bridge():
    file = Path(__file__).parents[2] / "examples" / "adaptive_bridge.py"
    spec = spec_from_file_location("adaptive_bridge", file)
    module = module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    with unchecked():
        return module.main()


def test_deck_stays_level_while_the_load_drives_across(bridge):
    """The passive bridge sinks seven times as far as is allowed here."""
    assert bridge.passive == pytest.approx(-0.2136, abs=5e-5)
    assert bridge.route.arrived
    assert bridge.check.verified
    assert np.abs(bridge.deck).max() <= 0.03 + 1e-9


def test_load_never_moves_back(bridge):
    loads = bridge.route.schedule.values[:, 8:]
    on_deck = loads.sum(axis=1) > 1.0 - 1e-9
    place = loads[on_deck] @ np.arange(1, 6)
    assert place[0] == pytest.approx(1.0)
    assert place[-1] == pytest.approx(5.0)
    assert (np.diff(place) >= -1e-9).all()
    assert loads.sum(axis=1).max() <= 1.0 + 1e-9


def test_ten_times_finer_steps_lead_the_same_way(bridge):
    fine = em.TraceOptions(largest_step=0.002, first_step=0.001, turning=0.05, steps=200000)
    with unchecked():
        again = em.verify(bridge.route.schedule, options=fine)
    assert again.verified
    assert again.margin == pytest.approx(bridge.route.margin, rel=1e-3)


def test_arch_turns_inside_out_without_a_grid_and_again_with_the_same_seed(arch_set, ends):
    with unchecked():
        free, again = (plan_sampled(*ends, BOX, options=SamplingOptions(seed=1)) for _ in range(2))
        grid = plan(arch_set, *ends)
    assert free.arrived
    assert free.length < 1.3 * grid.length
    assert free.way_points == again.way_points


def test_limits_and_margin_are_kept_on_random_ways(arch_set, ends):
    arch = arch_set.structure
    with unchecked():
        route = plan_sampled(*ends, BOX, within=[arch.max_curvature <= 11], margin=0.3)
    assert route.arrived
    assert route.margin >= 0.3
    assert route.schedule.descriptors["max_curvature"].max() <= 11


def test_open_end_follows_the_load(spring_set):
    """x_l is to keep the angle between bounds while F grows: δ ≥ 0.5 at F/k = 0.05."""
    spring = spring_set.structure
    start = em.lift(spring.natural_state(x_l=0.8), {"F": 0.0001}).end.state
    with unchecked():
        route = plan_sampled(
            start,
            None,
            em.Box(x_l=(0.3, 1.3)),
            loads=[{"F": 0.05}],
            within=[spring.angle >= 0.5, spring.angle <= 0.9],
        )
    assert route.arrived
    assert route.path.end.state["F"] == 0.05
    assert spring.angle(route.path.states).min() >= 0.5 - 1e-9


def test_no_route_is_named_as_what_it_is(short_spring_set):
    """x_l ≤ 0.95 parts the two sides of the spring: see test_spring_routes."""
    start, goal = (short_spring_set.at(x_l=0.8, F=0.0).stable[k] for k in (0, 1))
    box = em.Box(x_l=(0.3, 0.95), F=(-0.5, 0.5))
    with unchecked():
        route = plan_sampled(start, goal, box, options=SamplingOptions(lifts=2000))
    assert route.status == "refused"
    assert route.why.startswith(
        "no route was found with 2000 lifts and up to 12 slices over two actuators, which is no "
        "proof that none exists"
    )


def test_ends_that_break_the_demands_are_refused(arch_set, ends):
    arch = arch_set.structure
    with unchecked():
        route = plan_sampled(*ends, BOX, within=[arch.max_curvature <= 6])
        here = arch_set.at(Theta=1, Delta=0)
        saddle = here[int(np.flatnonzero(here.index == 2)[0])]
        unstable = plan_sampled(saddle, ends[1], BOX)
    assert route.why == "the goal violates the constraints or the margin"
    assert unstable.why == "the start is unstable (index 2)"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"goal": None}, "`goal` must be given, unless loads move; got none."),
        ({"margin": -1.0}, "`margin` must be a number >= 0; got -1.0."),
        (
            {"actuators": em.Box(Theta=(0.2, 0.5))},
            "`start` must lie in Box(Theta=(0.2, 0.5)); got ",
        ),
        ({"loads": [{"Theta": 1.0}]}, "`loads` must not move actuators; got 'Theta'."),
        ({"loads": [{"q": 2.0}]}, "`goal` must have the loads and fixed parameters of its end"),
        ({"actuators": em.Box(psi=(0, 1))}, "`psi` must be a parameter (Theta, Delta, q, nu)"),
    ],
)
def test_wrong_arguments_are_input_errors(ends, change, message):
    given = {"start": ends[0], "goal": ends[1], "actuators": BOX} | change
    with unchecked(), pytest.raises(InputError, match=f"^{re.escape(message)}"):
        plan_sampled(**given)


@pytest.mark.parametrize("knobs", [{"lifts": 0}, {"batch": 0}, {"reach": -1.0}])
def test_wrong_knobs_are_input_errors(knobs):
    with pytest.raises(InputError, match=r"^`(lifts|batch|reach)` must be"):
        SamplingOptions(**knobs)
