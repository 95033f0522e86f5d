"""The controller against Kalman's formulas, under loads that wander, and where nothing is safe."""

from dataclasses import replace
from itertools import repeat

import numpy as np
import pytest

import equimorph as em
from equimorph.control.estimate import Measurement, fit_loads
from equimorph.control.likely_loads import LikelyLoads, positions
from equimorph.structures import join_states
from equimorph.tasks.planning.network import Demands
from oracles.wandering_load import Plant, PlantInMuJoCo, wandering
from sets import arch_set
from typecheck import unchecked

NOISE, DRIFT = 0.01, 0.01


@pytest.fixture(scope="module")
def spring_set():
    box = em.Box(x_l=(0.5, 1.2))
    return em.equilibrium_set(em.Spring(), box, fixed={"F": 0.1}, intervals=(15,), checks=0)


@pytest.fixture(scope="module")
def controller(spring_set):
    angle = spring_set.structure.angle
    goal = min(spring_set.at(x_l=0.7).stable, key=angle)
    errors, jumps = {angle: NOISE}, {"F": 0.03}
    return em.Controller(spring_set, goal, errors, {"F": DRIFT}, jumps=jumps, margin=0.05)


@pytest.fixture(scope="module")
def begun(controller, spring_set):
    return controller.start(min(spring_set.at(x_l=1.1).stable, key=spring_set.structure.angle))


def force_at(state: em.State, angle):
    """Loads of the spring at angles, by its own equilibrium: F is linear in it."""
    spring, lanes = state.structure, np.atleast_1d(angle)[:, None]
    low, high = (
        spring.residual(lanes, np.tile([state["x_l"], force, state["k"]], (len(lanes), 1)))[:, 0]
        for force in (0.0, 1.0)
    )
    return np.squeeze(-low / (high - low))[()]


def test_loads_are_estimated_as_kalman_says(controller, begun):
    """Prior variance P + Q, slope h of the descriptor: 1/(1/(P + Q) + h²/R), and the mode."""
    angle = begun.state.structure.angle
    seen = angle(begun.state) + 0.5 * NOISE
    here = replace(begun, way_points=())
    belief = controller.step(here, {angle: seen})
    prior = begun.covariance[0, 0] + DRIFT**2
    found, h = angle(belief.state), 1e-6
    slope = 2 * h / (force_at(belief.state, found + h) - force_at(belief.state, found - h))
    expected = 1.0 / (1.0 / prior + (slope / NOISE) ** 2)
    np.testing.assert_allclose(belief.covariance[0, 0], expected, rtol=1e-2)
    gradient = (found - seen) * slope / NOISE**2 + (belief.state["F"] - 0.1) / prior
    assert abs(gradient) * np.sqrt(expected) < 2e-3
    assert force_at(belief.state, found) == pytest.approx(belief.state["F"], abs=1e-9)


def test_estimates_come_as_close_to_a_fold_as_the_best_fit_is(begun):
    """Against all angles of the sheet, which ends at cos³ θ = x_l; some were measured beyond it."""
    spring, start = begun.state.structure, em.lift(begun.state, {"x_l": 0.7}).end.state
    angle, deviation, end = spring.angle, 0.2, -np.arccos(np.cbrt(0.7))
    places = np.linspace(-1.3, end, 20001)
    forces = force_at(start, places)
    prior, at = ((forces - start["F"]) / deviation) ** 2, positions(spring, ["F"])
    for seen in (-1.1, end - 0.01, end + 0.01, end + 0.03):
        measured = Measurement.of({angle: seen}, {angle: NOISE})
        best = (((places - seen) / NOISE) ** 2 + prior).min()
        found = fit_loads(start, at, np.array([[deviation**2]]), measured)
        assert found.state.index == 0
        assert found.misfit == pytest.approx(best, rel=1e-2, abs=0.05)


def test_without_measurements_the_variance_grows(controller, begun):
    belief = controller.step(begun, {})
    np.testing.assert_allclose(belief.covariance, begun.covariance + DRIFT**2)


def test_the_same_belief_and_measurement_give_the_same_step(controller, begun):
    angle = begun.state.structure.angle
    one, other = (controller.step(begun, {angle: 1.2}) for _ in range(2))
    np.testing.assert_array_equal(one.state.z, other.state.z)
    np.testing.assert_array_equal(one.covariance, other.covariance)
    assert one.status == other.status


@pytest.mark.parametrize("seed", range(2))
def test_a_spring_arrives_under_a_load_that_jumps(controller, begun, seed):
    random = np.random.default_rng(seed)
    errors = {begun.state.structure.angle: NOISE}
    plant = Plant(begun.state, wandering(0.1, random, 0.005, 0.03), "F", errors, random)
    belief = controller.run(begun, plant.read, plant.write, 40)
    assert not plant.snapped
    assert plant.least > 0.0
    assert belief.status == em.ControlStatus.ARRIVED
    assert controller.command(belief) == {"x_l": pytest.approx(0.7)}
    spread = np.sqrt(belief.covariance[0, 0])
    assert abs(belief.state["F"] - plant.state["F"]) < 5.0 * spread


def test_a_load_that_takes_the_goal_away_stops_it(controller, begun):
    """At x_l = 0.7 its sheet ends at F = −(1 − x_l^(2/3))^(3/2) = −0.0973."""
    errors = {begun.state.structure.angle: 1e-4}
    loose = em.Controller(controller.eset, controller.goal, errors, {"F": 0.1}, margin=0.05)
    plant = Plant(begun.state, repeat(-0.25), "F", errors, np.random.default_rng(0))
    belief = loose.run(begun, plant.read, plant.write, 3)
    assert belief.status == em.ControlStatus.NO_SAFE_WAY
    assert "goal" in belief.why
    assert loose.command(belief) == loose.command(begun)
    assert belief.state["F"] == pytest.approx(-0.25, abs=2e-3)


def test_no_stride_goes_where_a_jump_would_snap(spring_set):
    """At F = 0.1 the sheet of x_l < 1 bears no jump by more than 0.1 + (1 − x_l^(2/3))^(3/2)."""
    angle = spring_set.structure.angle
    goal, start = (min(spring_set.at(x_l=x).stable, key=angle) for x in (0.7, 1.1))
    for jump, status in ((0.05, em.ControlStatus.FOLLOWING), (0.11, em.ControlStatus.NO_SAFE_WAY)):
        careful = em.Controller(spring_set, goal, {angle: NOISE}, {"F": 1e-3}, jumps={"F": jump})
        assert careful.start(start).status == status


def test_a_moving_target_is_met_under_a_load_that_walks(spring_set):
    """The schedule of `track` misses by what the load does; the controller by its sensor."""
    angle = spring_set.structure.angle
    start = min(spring_set.at(x_l=0.9).stable, key=angle)
    legs = [{angle: angle(start) - 0.02 * k} for k in range(1, 16)]
    followed = em.track(start, legs, actuators=["x_l"])
    assert followed.arrived
    errors, loads = {angle: 1e-3}, {"F": 0.01}
    controller = em.Controller(spring_set, followed, errors, loads, jumps={"F": 0.05}, stride=0.1)
    random = np.random.default_rng(4)
    plant = Plant(start, wandering(0.1, random, 0.005, 0.04), "F", errors, random)
    belief, misses, blind = controller.start(start), [], []
    while belief.status == em.ControlStatus.FOLLOWING:
        plant.write(controller.command(belief))
        aim, k = angle(start) - 0.02 * belief.at, len(misses)
        misses.append(angle(plant.state) - aim)
        planned = followed.states[int(np.searchsorted(followed.path.at, k))]
        blind.append(angle(em.lift(planned, {"F": plant.state["F"] + 1e-9}).end.state) - aim)
        belief = controller.step(belief, plant.read())
    assert belief.status == em.ControlStatus.ARRIVED
    assert len(misses) == 16
    assert np.linalg.norm(misses) < 0.5 * np.linalg.norm(blind)


def test_a_structure_that_snapped_is_found_again(controller, spring_set):
    """No way leads from the other sheet; once the structure is on that of the goal one does."""
    angle = spring_set.structure.angle
    other, own = sorted(spring_set.at(x_l=0.6).stable, key=angle, reverse=True)
    begun = controller.start(other)
    assert begun.status == em.ControlStatus.NO_SAFE_WAY
    belief = controller.step(begun, {angle: angle(own)})
    assert angle(belief.state) == pytest.approx(angle(own), abs=0.1)
    for _ in range(5):
        belief = controller.step(belief, {angle: angle(belief.state)})
    assert belief.status == em.ControlStatus.ARRIVED


def test_what_no_state_explains_is_named(controller, begun):
    belief = controller.step(begun, {begun.state.structure.angle: 3.0})
    assert belief.status == em.ControlStatus.NOT_EXPLAINED
    assert controller.command(belief) == controller.command(begun)
    assert "1 measured value" in belief.why


def test_starts_and_goals_are_stable_states_of_the_problem(controller, begun, spring_set):
    angle = spring_set.structure.angle
    elsewhere = em.lift(begun.state, {"F": 0.2}).end.state
    unstable = next(each for each in spring_set.at(x_l=0.55) if each.index == 1)
    for state, words in ((elsewhere, "fixed parameters"), (unstable, "must be stable")):
        with pytest.raises(em.errors.InputError, match=words):
            controller.start(state)
        with pytest.raises(em.errors.InputError, match=words):
            em.Controller(spring_set, state, {angle: 0.1}, {"F": 0.1})


def test_wrong_input_is_refused(controller, begun, spring_set):
    angle = spring_set.structure.angle
    goal = begun.state
    for arguments, words in (
        (({}, {"F": 0.1}), "`errors` must name what is measured"),
        (({angle: 0.1}, {"x_l": 0.1}), "`unknown` must name parameters that the set fixes"),
        (({angle: 0.0}, {"F": 0.1}), "must be positive"),
        (({angle: 0.1}, {"F": float("nan")}), "must be"),
    ):
        with pytest.raises(em.errors.InputError, match=words):
            em.Controller(spring_set, goal, *arguments)
    with pytest.raises(em.errors.InputError, match="numbers"):
        controller.step(begun, {angle: float("nan")})
    with pytest.raises(em.errors.InputError, match="standard errors"):
        controller.step(begun, {em.Rod().height(0.5): 1.0})


@pytest.fixture(scope="module")
def turning():
    """Controller that turns an arch over under an unknown load, its start, and its sensors."""
    eset = arch_set()
    arch = eset.structure
    with unchecked():
        inverted, upright = sorted(eset.at(Theta=1, Delta=0).stable, key=arch.height(0.5))
        errors = {arch.height(s): 0.005 for s in (1 / 3, 0.5, 2 / 3)}
        controller = em.Controller(
            eset, inverted, errors, {"q": 0.03}, jumps={"q": 0.5}, margin=0.05, stride=0.1
        )
        return controller, controller.start(upright), errors


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_the_arch_turns_over_under_an_unknown_load(turning, seed):
    """Load 2.5 with a walk of 0.03 a step and a jump of 0.5; heights with 2 % of the rise."""
    controller, begun, errors = turning
    with unchecked():
        random = np.random.default_rng(seed)
        plant = Plant(begun.state, wandering(2.5, random, 0.03, 0.5), "q", errors, random)
        belief = controller.run(begun, plant.read, plant.write, 150)
        assert not plant.snapped
        assert plant.least > 0.05
        assert belief.status == em.ControlStatus.ARRIVED


@pytest.mark.slow
def test_a_schedule_played_blindly_snaps_under_these_loads(turning):
    """The route of `plan` with the same margin, in strides of the same length."""
    controller, begun, errors = turning
    names, snapped = controller.eset.names, 0
    with unchecked():
        route = em.plan(controller.eset, begun.state, controller.goal, margin=0.05)
        table = route.schedule.parameters
        for seed in range(8):
            random = np.random.default_rng(seed)
            plant = Plant(begun.state, wandering(2.5, random, 0.03, 0.5), "q", errors, random)
            for share in np.linspace(0.0, 1.0, 25):
                if not plant.snapped:
                    at = route.schedule.progress
                    plant.write({name: np.interp(share, at, table[name]) for name in names})
            snapped += plant.snapped
    assert snapped >= 2


@pytest.mark.slow
def test_the_arch_turns_over_in_mujoco(turning):
    """The plant moves in time, as a chain of links, under a load that walks and jumps."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra `replay`)")
    controller, begun, errors = turning
    with unchecked():
        random = np.random.default_rng(2)
        used = em.ReplaySettings(links=20, step=0.05, hold=5.0)
        simulated = em.SimulatedPlant(begun.state, rate=0.1, settings=used)
        loads = wandering(2.5, random, 0.03, 0.5)
        plant = PlantInMuJoCo(begun.state, loads, "q", errors, random, simulated=simulated)
        belief = controller.run(begun, plant.read, plant.write, 150)
    assert belief.status == em.ControlStatus.ARRIVED
    assert not plant.snapped
    assert simulated.departure(plant.state) < 0.01


def test_routes_have_few_corners():
    """From one side of a spring to the other, around the cusp at (1, 0): seven straight moves.

    The path over the vertices of the cells has 14; where straight moves between these are safe
    under all likely loads, what lies between is left out.
    """
    box = em.Box(x_l=(0.5, 1.4), F=(-0.4, 0.4))
    eset = em.equilibrium_set(em.Spring(), box, fixed={"k": 1.0}, intervals=(9, 9), checks=0)
    angle = eset.structure.angle
    start, goal = (best(eset.at(x_l=0.7, F=0.0).stable, key=angle) for best in (min, max))
    careful = em.Controller(eset, goal, {angle: NOISE}, {"k": 0.02}, margin=0.05)
    belief = careful.start(start)
    assert belief.status == em.ControlStatus.FOLLOWING
    assert len(belief.way_points) <= 8
    assert max(point["x_l"] for point in belief.way_points) > 1.0


def test_places_are_known_under_the_estimated_loads_first(spring_set):
    """Three places under five loads: the estimated one, by its spread, and by a jump more."""
    spring, one = spring_set.structure, np.ones(1)
    demands = Demands.of(spring, "length", (), 0.0)
    at = positions(spring, ["F"])
    likely = LikelyLoads.around(at, 0.1 * one, 0.01 * one, 0.02 * one, demands)
    states = join_states(
        spring, [min(spring_set.at(x_l=x).stable, key=spring.angle) for x in (0.7, 0.9, 1.1)]
    )
    found = likely.under(states)
    np.testing.assert_allclose(np.unique(found.states["F"]), [0.07, 0.09, 0.1, 0.11, 0.13])
    np.testing.assert_allclose(found.estimated["F"], 0.1)
    np.testing.assert_allclose(found.estimated["x_l"], states["x_l"])
