"""Schedules in time: durations, and parameters as functions of time."""

from dataclasses import replace

import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.model import Rates, Schedule


@pytest.fixture
def schedule():
    """Two actuators along three legs, and a load that rests."""
    values = np.array([[0.0, 0.0, 2.5], [1.0, 0.0, 2.5], [1.0, 3.0, 2.5], [0.0, 2.0, 2.5]])
    return Schedule(
        names=("a", "b", "q"),
        roles=("actuator", "actuator", "load"),
        units=("rad", "m", "N"),
        values=values,
        progress=np.array([0.0, 0.2, 0.8, 1.0]),
        margins=np.full(4, 0.5),
        descriptors={"h": np.arange(4.0)},
        start={"structure": None, "unknowns": [0.0]},
        way_points=np.array([0, 1, 2, 3]),
        time_unit="s",
    )


def test_at_every_instant_one_parameter_moves_at_its_own_rate(schedule):
    """Legs take 1/0.5, 3/1 and max(1/0.5, 1/1)."""
    timed = schedule.in_time(Rates({"a": 0.5, "b": 1.0}))
    assert timed.times.tolist() == [0.0, 2.0, 5.0, 7.0]
    assert timed.duration == 7.0
    assert repr(timed) == "Schedule(a, b: 4 steps in 7 s; margin 0.5)"
    assert timed.at(1.0).tolist() == [0.5, 0.0, 2.5]
    assert timed.velocity(1.0).tolist() == [0.5, 0.0, 0.0]
    assert timed.at(np.array([-1.0, 3.5, 9.0])).tolist() == [
        [0.0, 0.0, 2.5],
        [1.0, 1.5, 2.5],
        [0.0, 2.0, 2.5],
    ]
    assert timed.velocity(np.array([-1.0, 2.0, 7.0]))[:, 1].tolist() == [0.0, 1.0, 0.0]


def test_a_duration_is_spent_as_the_progress_is_made(schedule):
    """Times are shares of the length."""
    timed = schedule.in_time(duration=10.0)
    np.testing.assert_allclose(timed.times, [0.0, 2.0, 8.0, 10.0], rtol=1e-15)


def test_pauses_that_take_no_time_are_left_out(schedule):
    """Two equal settings in a row are one instant."""
    values = schedule.values[[0, 1, 1, 2]]
    timed = replace(schedule, values=values).in_time(Rates({"a": 0.5, "b": 1.0}))
    assert timed.times.tolist() == [0.0, 2.0, 5.0]
    assert timed.descriptors["h"].tolist() == [0.0, 1.0, 3.0]
    assert timed.way_points.tolist() == [0, 1, 2]


def test_with_velocities_and_accelerations_the_curve_is_the_quintic(schedule):
    """t³ (10 − 15 t + 6 t²) is the rest-to-rest quintic: ½ and 15/8 at its middle."""
    values, still = schedule.values[:2], np.zeros((2, 3))
    timed = Schedule(
        schedule.names, schedule.roles, schedule.units, values, np.array([0.0, 1.0]),
        np.ones(2), {}, {}, times=np.array([0.0, 1.0]), velocities=still, accelerations=still,
    )  # fmt: skip
    t = np.linspace(0.0, 1.0, 7)
    np.testing.assert_allclose(timed.at(t)[:, 0], t**3 * (10 - 15 * t + 6 * t * t), atol=1e-15)
    assert timed.velocity(0.5)[0] == pytest.approx(15.0 / 8.0, rel=1e-14)
    assert replace(timed, accelerations=None).velocity(0.5)[0] == pytest.approx(1.5, rel=1e-14)


def test_wrong_times_are_refused(schedule):
    """One line each."""
    with pytest.raises(InputError, match="`schedule` must have times; got one without"):
        schedule.at(1.0)
    with pytest.raises(InputError, match="`rates` must limit every parameter that moves; got none"):
        schedule.in_time(Rates({"a": 0.5}))
    with pytest.raises(InputError, match="`rates` or `duration` must be given, one of them"):
        schedule.in_time()
    with pytest.raises(InputError, match="`duration` must be positive"):
        schedule.in_time(duration=0.0)
    with pytest.raises(InputError, match="`times` must begin with 0 and increase"):
        replace(schedule, times=np.array([0.0, 1.0, 1.0, 2.0]))
    with pytest.raises(InputError, match="`times` must be given with velocities"):
        replace(schedule, velocities=schedule.values)
