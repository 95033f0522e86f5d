"""The a-priori speed limit against dynamics integrated by the library's own equations."""

from dataclasses import replace

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError

ROUTE = ({"Theta": 1.3}, {"Delta": 1.3}, {"Theta": 1.0}, {"Delta": 0.0})


def oscillate(schedule, start, eta, steps):
    """Largest deviation of the spring's mass: ``m (d/dt)² y = −dE/dy`` by fourth-order steps.

    y = x_l tan δ is the place of the mass; damping η times the stiffness ∂²E/∂y² at rest.
    """
    spring, k = start.structure, start["k"]
    mass, h = spring.inertia(np.zeros((1, 1)), np.ones((1, 3)))[0, 0, 0], schedule.duration / steps

    def force(y, x, load):
        length = np.hypot(x, y)
        return -k * (length - 1.0) * y / length - load

    def rate(state, t):
        x, load = schedule.at(t)[:2]
        y, v = state
        return np.array([v, (force(y, x, load) - eta * k * v) / mass])

    state, worst = np.array([0.0, 0.0]), 0.0
    state[0] = start["x_l"] * np.tan(start.z[0])
    for i in range(steps):
        t = i * h
        a = rate(state, t)
        b = rate(state + 0.5 * h * a, t + 0.5 * h)
        c = rate(state + 0.5 * h * b, t + 0.5 * h)
        d = rate(state + h * c, t + h)
        state = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        x, load = schedule.at(t + h)[:2]
        rest = state[0]
        for _ in range(20):
            length = np.hypot(x, rest)
            slope = -k * (1.0 - x * x / length**3)
            rest -= force(rest, x, load) / slope
        worst = max(worst, abs(state[0] - rest))
    return worst


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(each, marks=pytest.mark.slow) for each in range(1, 6))]
)
def test_the_spring_stays_within_the_bound_at_the_limit(seed):
    """Random legs of a stretched spring: never exceeded, at most 6 times too careful."""
    generator = np.random.default_rng(seed)
    start = em.Spring(mass=0.3).natural_state(x_l=1.5)
    rows = [
        {"x_l": float(x), "F": float(f)}
        for x, f in zip(
            generator.uniform(1.3, 1.8, 3), generator.uniform(-0.2, 0.2, 3), strict=True
        )
    ]
    schedule = em.verify(rows, start).schedule
    for tolerance in (0.02, 0.004):
        eta = float(generator.uniform(0.02, 0.3))
        limit = em.speed_limit(schedule, tolerance, damping=eta)
        found = oscillate(limit.schedule, start, eta, 4000)
        assert limit.bound.max() == pytest.approx(tolerance, rel=1e-6)
        assert tolerance / 6.0 < found <= tolerance


@pytest.fixture(scope="module")
def route():
    """The way-point route of the arch at q = 2.5."""
    rest = em.Rod(load="uniform").natural_state(Theta=1.0)
    return em.verify(ROUTE, em.lift(rest, {"q": 2.5}).end.state).schedule


def test_the_limit_of_the_route_is_near_what_was_measured(route):
    """Measured in MuJoCo: deviations 2.2e-3, 4.9e-3, 1.5e-2 at 0.05, 0.1, 0.2 rad/T."""
    for rate, measured in ((0.05, 2.2e-3), (0.1, 4.9e-3), (0.2, 1.5e-2)):
        timed = route.in_time(em.Rates({"Theta": rate, "Delta": rate}))
        times, bound = em.deviation_bound(timed, damping=0.05)
        assert measured < bound.max() < 5.0 * measured
        assert times[-1] == pytest.approx(timed.duration)


def test_limits_grow_with_the_tolerance_and_carry_a_schedule(route):
    """Rates by parameter, the times of the schedule, the frequencies along it."""
    tight, wide = (em.speed_limit(route, tolerance) for tolerance in (1e-3, 1e-2))
    assert tight.rate < wide.rate
    assert wide.frequencies[0] == pytest.approx(5.487, abs=1e-3)
    assert wide.frequencies.min() == pytest.approx(2.77, abs=0.02)
    assert wide.schedule.duration == pytest.approx(wide.duration)
    assert route.in_time(wide.rates).duration == pytest.approx(wide.duration, rel=1e-9)
    assert "lowest frequency 2.7" in repr(wide)


def test_near_a_fold_the_limit_slows_down_and_then_refuses(route):
    """The reverse route ends at a fold, Δ = 0.418136 [measured]: frequencies go to zero there."""
    rest = em.Rod(load="uniform").natural_state(Theta=1.0)
    up = em.lift(rest, {"q": 2.5}).end.state
    far, near = (em.verify([{"Delta": d}], up).schedule for d in (0.3, 0.418))
    slow, fast = (em.speed_limit(each, 0.02) for each in (near, far))
    assert slow.rate < 0.5 * fast.rate
    assert slow.frequencies[-1] < 0.2 * slow.frequencies[0]
    beyond = near.values.copy()
    beyond[-2:] = [[1.0, 0.4181360, 2.5, np.sin(1.0)], [1.0, 0.5, 2.5, np.sin(1.0)]]
    with pytest.raises(InputError, match=r"`schedule` must (stay away from folds|be safe at rest)"):
        em.speed_limit(replace(near, values=beyond), 0.02)
    bare = em.Rod(EI=1.0, length=1.0).natural_state(Theta=1.0)
    with pytest.raises(InputError, match="must have a mass"):
        em.speed_limit(em.verify([{"Delta": 0.1}], bare).schedule, 0.02)
