"""Every kind of constraint in every task: obeyed, none silently ignored.

The start obeys the constraint, the goal, Θ = 1.4, does not, or cannot be reached with it.
"""

import numpy as np
import pytest

import equimorph as em
from typecheck import unchecked

pytestmark = pytest.mark.slow

KINDS = (
    "margin",
    "descriptor",
    "actuator",
    "effort",
    "keep-out",
    "all loads",
    "half-plane",
    "disc",
)


@pytest.fixture(scope="module")
def scene(arch_set, ends):
    start, _ = ends
    return arch_set, start, em.lift(start, {"Theta": 1.4}).end.state


def halfway(descriptor, start, goal):
    bound = 0.5 * (descriptor(start) + descriptor(goal))
    return descriptor <= bound if descriptor(goal) > bound else descriptor >= bound


def constraint_of(kind, start, goal):
    arch = start.structure
    kappa = arch.max_curvature
    if kind == "keep-out":
        return em.outside(arch, em.Box(Theta=(1.15, 1.25), Delta=(-3, 3))) >= 0
    if kind == "all loads":
        loaded = em.lift(start, {"q": 2.6}).end.state
        bound = 0.5 * (max(kappa(loaded), kappa(start)) + kappa(goal))
        return em.stable_over(arch, "q", (0.0, 2.6), [kappa <= bound])
    crown = arch.height(0.5)(start)
    descriptor = {
        "margin": em.margin_of(arch),
        "descriptor": kappa,
        "actuator": em.value_of(arch, "Theta"),
        "effort": em.effort_of(arch, "Theta"),
        "half-plane": em.distance_to(arch, em.HalfPlane((0.0, crown + 0.01), (0.0, -1.0))),
        "disc": em.distance_to(arch, em.Disc((0.4207, crown + 0.3), 0.05)),
    }[kind]
    return halfway(descriptor, start, goal)


@pytest.mark.parametrize("kind", KINDS)
def test_no_task_ignores_a_constraint(scene, kind):
    eset, start, goal = scene
    arch = start.structure
    heights = (arch.height(1 / 3), arch.height(2 / 3))
    targets = {each: each(goal) for each in heights}
    far = em.function_of("far", lambda t: (t - 1.4) ** 2, em.value_of(arch, "Theta"))

    def obeyed(states):
        excess = rule.excess(states.z, states.p)
        return bool((excess <= 1e-6 * max(1.0, abs(rule.bound))).all())

    with unchecked():
        rule = constraint_of(kind, start, goal)
        within = [rule]
        shapes = em.solve_shape(eset, targets, within=within)
        assert len(shapes.states) == 0 or obeyed(shapes.states)
        optima = em.optimise(eset, far, within=within)
        assert optima.found
        assert obeyed(optima.states)
        tracked = em.track(start, targets, actuators=["Theta", "Delta"], within=within)
        assert tracked.failure == "constraint"
        assert obeyed(tracked.path.states)
        spare = {arch.height(0.5): arch.height(0.5)(goal)}
        redundant = em.track(start, spare, actuators=["Theta", "Delta"], within=within)
        assert obeyed(redundant.path.states)
        moved = em.follow_optimum(start, far, {"q": 2.45}, actuators=["Theta"], within=within)
        assert obeyed(moved.states)
        reach = em.reachable(eset, start, heights, within=within)
        assert obeyed(reach.states)
        assert reach.query(targets).status == "refused"
        assert not em.plan(eset, start, goal, within=within).arrived
        few = em.SamplingOptions(lifts=300)
        assert not em.plan_sampled(start, goal, eset.box, within=within, options=few).arrived
        assert not any(each.arrived for each in em.alternatives(eset, start, goal, within=within))
        assert em.verify([{"Theta": 1.4}], start=start, within=within).status == "refused"
        grid = em.Grid(Theta=(0.5, 2, 3), Delta=(-1, 1, 2))
        assert obeyed(em.landscape(eset, heights[0], grid, within=within).states)
        trials = em.random_trials(start, [{"Theta": 1.4}], {"Theta": 1e-3}, trials=4, within=within)
        assert set(trials.kind) == {"constraint"}
        room = em.stable_room(start, {"Theta": 0.1}, within=within)
        assert np.all(room.scale < 4.0)
