"""The tasks of the spring: [Feher2025]_ section 2.3, with the corrected numbers.

F/k = (1 − x_l/cos δ) sin δ. C_s = (δ, x_l) = (0.62, 0.80) has F/k = +0.009908. At this load
δ = −0.62 needs x_l = 0.82776 and lies on another stable component; with the load free there is a
way around x_l > 1.
"""

import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.manifold import VertexKind, equilibrium_set
from equimorph.model import Box
from equimorph.structures import Spring, State
from equimorph.tasks.planning.planner import plan
from oracles.sextics import random_energy, set_of
from typecheck import unchecked

LOAD = (1 - 0.8 / np.cos(0.62)) * np.sin(0.62)


def state(delta: float, x: float, force: float | None = None) -> State:
    load = (1 - x / np.cos(delta)) * np.sin(delta) if force is None else force
    return State(Spring(), np.array([delta]), np.array([x, load, 1.0]))


@pytest.fixture(scope="module")
def start() -> State:
    return state(0.62, 0.80)


@pytest.fixture(scope="module")
def below() -> State:
    """δ = −0.62 at the load of the start."""
    return state(-0.62, float(np.cos(0.62) * (1 + LOAD / np.sin(0.62))), LOAD)


def test_load_of_the_start_and_place_of_the_goal(start, below):
    assert start["F"] == pytest.approx(0.009908, abs=5e-7)
    assert below["x_l"] == pytest.approx(0.82776, abs=5e-6)
    assert start.stable
    assert below.stable
    assert max(start.residual, below.residual) < 1e-15


def test_angle_can_be_lowered_at_fixed_load(spring_set, start):
    """δ = 0.40 at the level of C_s needs x_l = 0.89763; still above the boundary at 0.2165."""
    x = float(np.cos(0.40) * (1 - LOAD / np.sin(0.40)))
    assert x == pytest.approx(0.89763, abs=5e-6)
    route = plan(spring_set, start, state(0.40, x, LOAD), via=[{"x_l": x}])
    assert route.arrived
    np.testing.assert_allclose(route.schedule.values[:, 1], LOAD, rtol=0, atol=1e-15)
    assert (np.diff(route.path.states.z[:, 0]) < 0).all()


def test_lowering_the_angle_at_fixed_load_ends_on_the_stability_boundary(spring_set, start, below):
    """x_l = cos³ δ is met at (0.2165, 0.9316): no path at fixed load leads on from there."""
    route = plan(spring_set, start, below, via=[{"x_l": 1.0}, {"x_l": below["x_l"]}])
    assert route.status == "refused"
    assert route.why.startswith("segment 1 of 2 meets a fold: stability is lost")
    fold = route.path.end.state
    assert fold.z[0] == pytest.approx(0.2165, abs=5e-5)
    assert fold["x_l"] == pytest.approx(0.9316, abs=5e-5)
    assert fold["x_l"] == pytest.approx(np.cos(fold.z[0]) ** 3, abs=1e-10)


def test_mirror_image_is_reached_around_the_cusp_with_the_load_free(spring_set, start, below):
    for goal in (below, state(-0.62, 0.80)):
        with unchecked():
            route = plan(spring_set, start, goal)
        assert route.arrived
        x, force = route.schedule.values[:, :2].T
        # only above x_l = 1, or beyond the fold load there, do the two sides hang together
        assert x.max() > 1.0
        assert (x > np.cos(route.path.states.z[:, 0]) ** 3).all()
        np.testing.assert_allclose(route.path.states.z[-1], goal.z, atol=1e-9)
        assert np.ptp(force) > 0


def test_without_the_stretched_states_the_sides_are_different_components(
    short_spring_set, start, below
):
    """x_l ≤ 0.95: the stable states of either sign of δ cannot be joined."""
    stable = [stratum for stratum in short_spring_set.strata if stratum.index == 0]
    assert len(stable) == 2
    for goal in (below, state(-0.62, 0.80)):
        route = plan(short_spring_set, start, goal)
        assert route.status == "refused"
        assert route.why == "start and goal lie on different stable components of the set"


def test_mirror_image_cannot_be_reached_near_the_load_of_the_start(start, below):
    """For F > 0 alone the two stable components stay apart, however long the spring."""
    box = Box(x_l=(0.3, 1.3), F=(0.5 * LOAD, 1.5 * LOAD))
    with unchecked():
        eset = equilibrium_set(Spring(), box, intervals=(12, 3), checks=0)
    assert eset.audit.clean
    route = plan(eset, start, below)
    assert route.status == "refused"
    assert route.why == "start and goal lie on different stable components of the set"


def test_goal_of_the_paper_on_another_level_is_no_equilibrium_at_the_load(spring_set, start):
    """C_t1 = (0.40, 0.90) lies on the level 0.008904, not on that of C_s."""
    assert state(0.40, 0.90)["F"] == pytest.approx(0.008904, abs=5e-7)
    with pytest.raises(ValueError, match="`goal` must"):
        plan(spring_set, start, state(0.40, 0.90, LOAD))


def test_a_demand_made_twice_counts_once(spring_set, start):
    """Constraints of equal meaning are one, though each was made from a spring of its own."""
    caps = [Spring().angle <= 1.4, Spring().descriptor("angle") <= 1.4]
    route = plan(spring_set, start, state(-0.62, 0.80), within=caps, margin=0.45)
    assert route.why == (
        "start and goal are connected by stable states, but not within "
        "angle <= 1.4 and margin >= 0.45"
    )


def test_a_route_to_its_start_is_a_loop_that_needs_way_points(spring_set, start):
    with pytest.raises(InputError, match="`goal` must differ from `start` without `via`"):
        plan(spring_set, start, start)


@pytest.mark.parametrize("seed", range(4))
def test_an_end_on_a_fold_is_refused_by_this_reason(seed):
    """At a fold the index is that of either side by round-off: the end is no other component."""
    eset, draw = set_of(random_energy(seed)), np.random.default_rng(seed)
    inside = eset.points[int(draw.choice(np.flatnonzero(eset.points.index == 0)))]
    for k in draw.choice(np.flatnonzero(eset.kinds == VertexKind.FOLD), 4):
        fold = eset.points[int(k)]
        reason = "lies on a fold or branch point, where stability is lost"
        assert plan(eset, inside, fold).why == f"the goal {reason}"
        assert plan(eset, fold, inside).why == f"the start {reason}"
