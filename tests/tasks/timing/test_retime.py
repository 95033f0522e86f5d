"""Motions along schedules: limits of rates, accelerations and jerks, corners, margins."""

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from equimorph.tasks.timing.retiming import FilteredMotion

CORNERS = ({"x_l": 1.3, "F": 0.0}, {"x_l": 1.3, "F": 0.2}, {"x_l": 1.5, "F": 0.2})
RATES = {"x_l": 0.5, "F": 0.2}
FAST = {"x_l": 1.0, "F": 0.4}
JERKS = {"x_l": 4.0, "F": 1.6}


@pytest.fixture(scope="module")
def schedule():
    """A spring along three legs; the last one turns back."""
    return em.verify(CORNERS, em.Spring().natural_state(x_l=1.5)).schedule


def test_one_leg_takes_the_time_of_trapezoidal_accelerations():
    """Closed form: way/v + v/a + a/j from rest to rest, the least possible for long ways."""
    rates = em.Rates({"x_l": 0.5}, {"x_l": 1.0}, {"x_l": 4.0})
    leg = em.verify([{"x_l": 3.5}], em.Spring().natural_state(x_l=1.5)).schedule
    motion = em.retime(leg, rates, sampling=200.0).schedule
    assert motion.duration == pytest.approx(2.0 / 0.5 + 0.5 / 1.0 + 1.0 / 4.0, abs=1.0 / 200.0)
    assert motion.accelerations[:, 0].max() == pytest.approx(1.0, rel=1e-9)
    assert motion.velocities[:, 0].max() == pytest.approx(0.5, rel=1e-9)
    assert motion.at(0.75)[0] - 1.5 == pytest.approx(0.5 * 0.75 / 2.0, abs=1e-3)


@pytest.mark.parametrize("tolerance", [None, 0.02, 0.2])
@pytest.mark.parametrize("limits", [(FAST, {}), (FAST, JERKS)], ids=["accelerations", "jerks"])
def test_limits_hold_at_every_instant(schedule, tolerance, limits):
    """Differences of a fine sampling against the limits; corners within the tolerance."""
    motion = em.retime(schedule, em.Rates(RATES, *limits), tolerance=tolerance, sampling=100.0)
    assert motion.verified
    found = motion.schedule
    step, rows = 1.0 / 100.0, found.values[:, :2]
    np.testing.assert_allclose(np.diff(found.times), step, rtol=1e-9)
    for order, limit in enumerate((RATES, *limits), start=1):
        size = np.abs(np.diff(rows, n=order, axis=0)).max(axis=0) / step**order
        for k, name in enumerate(("x_l", "F")):
            assert size[k] <= limit.get(name, np.inf) * (1.0 + 1e-6)
    for corner in ((1.3, 0.0), (1.3, 0.2)):
        gap = np.linalg.norm(rows - corner, axis=1).min()
        assert gap <= (1e-6 if tolerance is None else tolerance + 0.5 * step)


def test_samples_are_derivatives_of_each_other(schedule):
    """Central differences of the samples. 1e-3: kinks of the accelerations."""
    motion = em.retime(schedule, em.Rates(RATES, FAST, JERKS), tolerance=0.05, sampling=400.0)
    found = motion.schedule
    slope = np.gradient(found.values, found.times, axis=0)
    np.testing.assert_allclose(found.velocities[1:-1], slope[1:-1], atol=1e-4)
    slope = np.gradient(found.velocities, found.times, axis=0)
    np.testing.assert_allclose(found.accelerations[2:-2], slope[2:-2], atol=5e-3)
    assert np.abs(found.velocities[[0, -1]]).max() < 1e-12


def test_rounding_corners_saves_time_and_margins_are_those_of_the_motion(schedule):
    """The margins at the samples are those of states lifted there: identity."""
    rates = em.Rates(RATES, FAST, JERKS)
    exact, near, far = (em.retime(schedule, rates, tolerance=t).schedule for t in (None, 0.02, 0.2))
    assert exact.duration > near.duration > far.duration
    k = len(near.values) // 3
    p = dict(zip(near.names, near.values[k], strict=True))
    state = em.lift(em.Spring().natural_state(x_l=1.5), {"x_l": p["x_l"], "F": p["F"]}).end.state
    assert near.margins[k] == pytest.approx(state.margin, rel=1e-9)


def test_constant_rates_are_sampled_and_verified_too(schedule):
    """Without accelerations the motion is the polyline itself: 0.4 + 1 + 0.4."""
    motion = em.retime(schedule, em.Rates(RATES), sampling=10.0).schedule
    assert motion.velocities is None
    assert motion.duration == pytest.approx(0.4 + 1.0 + 0.4)
    assert motion.values[motion.way_points][:, :2] == pytest.approx(
        np.array([[1.5, 0.0], [1.3, 0.0], [1.3, 0.2], [1.5, 0.2]])
    )


def test_a_curve_is_followed_within_the_tolerance_without_stops():
    """A circle in 60 legs: no pause, and the radius shrinks by less than the tolerance."""
    turn = np.linspace(0.0, 2.0 * np.pi, 61)[1:]
    rows = [{"x_l": 1.5 + 0.2 * np.sin(t), "F": 0.2 - 0.2 * np.cos(t)} for t in turn]
    circle = em.verify(rows, em.Spring().natural_state(x_l=1.5)).schedule
    rates = em.Rates({"x_l": 0.5, "F": 0.5}, {"x_l": 2.0, "F": 2.0})
    motion = em.retime(circle, rates, tolerance=0.01, sampling=50.0).schedule
    radius = np.hypot(motion.values[:, 0] - 1.5, motion.values[:, 1] - 0.2)
    assert np.abs(radius - 0.2).max() < 0.0105
    speed = np.hypot(motion.velocities[:, 0], motion.velocities[:, 1])
    middle = slice(len(speed) // 4, -len(speed) // 4)
    assert speed[middle].min() > 0.5 * speed.max()
    with pytest.raises(InputError, match="`tolerance` must allow the motion to round the curve"):
        em.retime(circle, rates)


def test_what_is_not_safe_or_not_limited_is_refused(schedule):
    """A rounded corner is lifted anew, with the margin asked for."""
    rates = em.Rates(RATES, FAST)
    assert "below" in em.retime(schedule, rates, margin=1e3).why
    with pytest.raises(InputError, match="`rates` must limit every parameter that moves; got none"):
        em.retime(schedule, em.Rates({"x_l": 1.0}))
    with pytest.raises(InputError, match="`accelerations` must be of parameters with limits, too"):
        em.Rates({"x_l": 1.0}, {"F": 1.0})
    with pytest.raises(InputError, match="`jerks` must be of parameters with accelerations, too"):
        em.Rates({"x_l": 1.0}, {}, {"x_l": 1.0})


def test_averages_are_exact_polynomials():
    """One leg, windows 2 and 1: at rest, and ½ a₁ t² at constant acceleration."""
    leg = np.array([[0.0], [8.0]])
    motion = FilteredMotion(leg, np.array([4.0]), np.zeros(2), (2.0, 1.0))
    assert motion.duration == 7.0
    assert motion.at(np.array([-1.0, 0.0, 3.5, 7.0, 9.0]))[:, 0].tolist() == [
        0.0,
        0.0,
        4.0,
        8.0,
        8.0,
    ]
    assert [float(motion.largest(k)[0]) for k in (1, 2, 3)] == pytest.approx([2.0, 1.0, 1.0])
