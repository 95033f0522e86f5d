"""Tracking with actuators to spare, and of many targets: the spring by an independent integration.

δ is led while F moves; x_l and k answer by the shortest motion. On F = k (1 − x_l/cos δ) sin δ the
gradient by (x_l, k) is n = (−k tan δ, (1 − x_l/cos δ) sin δ), so that (ẋ_l, k̇) is parallel to it.
"""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import equimorph as em
from equimorph.errors import InputError
from equimorph.structures import State
from typecheck import unchecked

SPRING = em.Spring()
ANGLE = SPRING.descriptor("angle")
SCALES = SPRING.scales[[0, 2]]


def force(delta, x, k):
    return k * (1 - x / np.cos(delta)) * np.sin(delta)


def rates(delta, f, place, dots):
    """(ẋ_l, k̇) of least length in the scales for rates (δ̇, Ḟ)."""
    del f
    x, k = place
    normal = np.array([-k * np.tan(delta), (1 - x / np.cos(delta)) * np.sin(delta)])
    by_delta = k * (np.cos(delta) - x / np.cos(delta) ** 2)
    scaled = normal * SCALES
    return SCALES * scaled * (dots[1] - by_delta * dots[0]) / (scaled @ scaled)


def reference(place, corners, events=None):
    for (d0, f0), (d1, f1) in pairwise(corners):
        run = solve_ivp(
            lambda t, y, a=(d0, f0), b=(d1, f1): rates(
                a[0] + t * (b[0] - a[0]), None, y, (b[0] - a[0], b[1] - a[1])
            ),
            (0, 1), place, rtol=1e-11, atol=1e-12, events=events,
        )  # fmt: skip
        place = run.y[:, -1]
    return place, run


@pytest.fixture(scope="module")
def start() -> State:
    return State(SPRING, np.array([0.70]), np.array([0.60, force(0.70, 0.60, 1.0), 1.0]))


def test_a_loop_of_targets_is_no_loop_of_the_actuators(start):
    f = start["F"]
    corners = [(0.70, f), (0.80, f), (0.80, f + 0.05), (0.70, f + 0.05), (0.70, f)]
    found = em.track(start, [{ANGLE: d, "F": q} for d, q in corners[1:]], actuators=["x_l", "k"])
    wanted, _ = reference([0.60, 1.0], corners)
    assert found.arrived
    assert found.states.p[-1, [0, 2]] == pytest.approx(wanted, abs=2e-7)
    change = np.array([found.holonomy["x_l"], found.holonomy["k"]])
    assert change == pytest.approx(wanted - [0.60, 1.0], abs=2e-7)
    assert np.linalg.norm(change) > 1e-3
    assert found.values[ANGLE.name] == pytest.approx(found.states.z[:, 0], abs=1e-12)
    assert found.states.residual.max() < 1e-10
    assert found.margin > 0


def test_the_way_back_undoes_the_way(start):
    found = em.track(start, [{ANGLE: 0.85}, {ANGLE: 0.70}], actuators=["x_l", "k"])
    assert [found.holonomy[name] for name in ("x_l", "k")] == pytest.approx([0, 0], abs=1e-6)


def test_an_actuator_at_its_limit_leaves_the_rest_to_the_other(start):
    """Once x_l = 0.58, k = F/((1 − x_l/cos δ) sin δ) is what is left."""
    f = start["F"]
    found = em.track(
        start, {ANGLE: 0.74, "F": f + 0.04}, actuators={"x_l": (0.58, 0.9), "k": (0.1, 9.0)}
    )
    assert found.arrived
    assert found.states["x_l"].min() == pytest.approx(0.58, abs=1e-8)
    assert found.states["x_l"][-1] == pytest.approx(0.58, abs=1e-8)
    left = (f + 0.04) / ((1 - 0.58 / np.cos(0.74)) * np.sin(0.74))
    assert found.states["k"][-1] == pytest.approx(left, abs=1e-7)


def test_both_at_their_limits_end_the_motion(start):
    found = em.track(
        start, {ANGLE: 0.74, "F": 0.4}, actuators={"x_l": (0.58, 0.9), "k": (0.5, 1.1)}
    )
    assert (found.status, found.failure) == ("refused", "actuator limit")
    end = found.path.end.state
    assert (end["x_l"], end["k"]) == pytest.approx((0.58, 1.1), abs=1e-8)
    assert found.schedule is None
    assert found.holonomy is None


def test_a_snap_is_located(start):
    """The event x_l = cos³ δ of the independent integration."""
    f = start["F"]
    found = em.track(start, {ANGLE: 0.10}, actuators=["x_l", "k"])
    assert (found.status, found.failure) == ("refused", "snap-through")

    def edge(t, y):
        return y[0] - np.cos(0.70 - 0.60 * t) ** 3

    edge.terminal = True
    _, run = reference([0.60, 1.0], [(0.70, f), (0.10, f)], edge)
    assert found.last_good == pytest.approx(run.t_events[0][0], abs=1e-6)


def test_a_constraint_ends_the_motion(start):
    found = em.track(start, {ANGLE: 0.9}, actuators=["x_l", "k"], within=[ANGLE <= 0.8])
    assert found.failure == "constraint"
    assert found.last_good == pytest.approx(0.5, abs=1e-8)


def test_many_targets_are_exact_and_quick(start):
    """1000 close targets: x_l = cos δ (1 − F/(k sin δ)) at each."""
    delta = 0.70 + 0.12 * np.sin(np.linspace(0, 2 * np.pi, 1001)[1:])
    with unchecked():
        found = em.track(start, [{ANGLE: d} for d in delta], actuators=["x_l"])
    assert found.arrived
    at = np.flatnonzero(found.path.at == np.round(found.path.at))
    assert len(at) == 1001
    wanted = np.cos(delta) * (1 - start["F"] / np.sin(delta))
    assert found.states["x_l"][at[1:]] == pytest.approx(wanted, abs=1e-10)
    assert found.holonomy["x_l"] == pytest.approx(0.0, abs=1e-9)
    assert list(found.schedule.way_points) == at.tolist()


def test_many_targets_end_where_few_do(start):
    """Beyond the stability boundary, by blocks and by one continuation."""
    far = np.linspace(0.70, -0.1, 41)[1:]
    with unchecked():
        many = em.track(start, [{ANGLE: d} for d in far], actuators=["x_l"])
    few = em.track(start, {ANGLE: -0.1}, actuators=["x_l"])
    assert many.failure == few.failure == "snap-through"
    assert many.last_good / 40 == pytest.approx(few.last_good, abs=1e-8)
    assert ANGLE(many.path.end.state) == pytest.approx(ANGLE(few.path.end.state), abs=1e-8)


def test_curves_and_loads_in_blocks(start):
    """A dozen curves with the load on the way, as long as one."""
    f = start["F"]

    def piece(k):
        return lambda t: {ANGLE: 0.7 + 0.1 * np.sin((k + t) / 2), "F": f - 0.002 * (k + t)}

    found = em.track(start, [piece(k) for k in range(12)], actuators=["x_l"])
    assert found.arrived
    delta, load = 0.7 + 0.1 * np.sin(6.0), f - 0.024
    assert found.states["F"][-1] == pytest.approx(load, abs=1e-12)
    assert found.states["x_l"][-1] == pytest.approx(np.cos(delta) * (1 - load / np.sin(delta)))


def test_a_measured_state_is_a_start(spring_set):
    state = max(spring_set.at(x_l=0.6, F=0.1).stable, key=ANGLE)
    seen = {ANGLE: ANGLE(state), "x_l": 0.6}
    where = em.locate(spring_set, seen)
    told = em.estimate_state(spring_set, seen, {ANGLE: 0.01, "x_l": 0.01})
    for start in (where, told):
        found = em.track(start, {ANGLE: 0.7}, actuators=["x_l"])
        assert found.arrived
        assert found.states["F"] == pytest.approx(0.1, abs=1e-8)
    goal = max(spring_set.at(x_l=0.7, F=0.05).stable, key=ANGLE)
    with unchecked():
        route = em.plan(spring_set, told, goal)
    assert route.arrived
    assert route.path.states.z[0] == pytest.approx(state.z, abs=1e-8)
    doubtful = em.estimate_state(spring_set, {"x_l": 0.8, "F": 0}, {"x_l": 0.01, "F": 0.01})
    with pytest.raises(InputError, match="must be known; got an estimate that is ambiguous"):
        em.track(doubtful, {ANGLE: 0.7}, actuators=["x_l"])


@pytest.mark.parametrize(
    ("targets", "words"),
    [
        ([{ANGLE: 0.8}, {SPRING.descriptor("height"): 0.4}], "same descriptors on all legs"),
        ({ANGLE: np.nan}, "must be finite"),
        (lambda t: {ANGLE: 0.9 - 0.1 * t}, "must begin where the leg before ends"),
    ],
)
def test_bad_targets_are_refused(start, targets, words):
    with unchecked(), pytest.raises(InputError, match=words):
        em.track(start, targets, actuators=["x_l", "k"])


def test_heights_of_the_arch_with_a_third_actuator():
    """Θ, Δ and the span ν lead two heights around a square: shorter than Θ and Δ alone do."""
    arch = em.Rod()
    left, right = arch.height(1 / 3), arch.height(2 / 3)
    loaded = em.lift(arch.natural_state(Theta=1.0), {"q": 2.5}).end.state
    square = [{left: x, right: y} for x, y in [(0.2, 0.18), (0.19, 0.18), (0.19, 0.2), (0.2, 0.2)]]
    with unchecked():
        begin = em.track(loaded, {left: 0.2, right: 0.2}, actuators=["Theta", "Delta"])
        three, two = (
            em.track(begin.path.end.state, [*square], actuators=names)
            for names in (["Theta", "Delta", "nu"], ["Theta", "Delta"])
        )
    assert three.arrived
    assert two.arrived
    assert abs(two.holonomy["Theta"]) < 1e-9
    lengths = [
        np.linalg.norm(np.diff(found.states.p / arch.scales, axis=0), axis=1).sum()
        for found in (three, two)
    ]
    assert lengths[0] < lengths[1]
    assert max(abs(change) for change in three.holonomy.values()) > 1e-6
