"""Numbers of way-points find room."""

import numpy as np
from matplotlib.figure import Figure

from equimorph.plotting.labels import number_way_points


def test_a_badge_keeps_off_curves_and_stays_in_the_frame():
    ax = Figure(figsize=(4, 4), dpi=72).add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, 288), ylim=(0, 288))  # one unit is one point
    ax.plot([0, 40], [20, 20])
    ax.plot([20, 20], [20, 60])
    rim = number_way_points(ax, np.array([[20.0, 20.0]]))
    assert [text.get_text() for text in ax.texts] == ["1"]
    assert rim.min() > 0.0
    assert np.abs(rim[:, 1] - 20.0).min() > 2.0
    beside = rim[rim[:, 1] > 20.0]
    assert np.abs(beside[:, 0] - 20.0).min(initial=np.inf) > 2.0


def test_way_points_too_close_to_another_get_no_number():
    ax = Figure(figsize=(4, 4), dpi=72).add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, 288), ylim=(0, 288))
    number_way_points(ax, np.array([[50.0, 50.0], [53.0, 50.0], [200.0, 90.0]]))
    assert [text.get_text() for text in ax.texts] == ["1", "3"]


def test_the_ends_of_a_route_come_before_the_points_near_them():
    """The last way-point keeps its number, the one before it gives way."""
    ax = Figure(figsize=(4, 4), dpi=72).add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, 288), ylim=(0, 288))
    number_way_points(ax, np.array([[50.0, 50.0], [197.0, 90.0], [200.0, 90.0]]))
    assert [text.get_text() for text in ax.texts] == ["1", "3"]
