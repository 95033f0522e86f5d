"""Supports and loads of trusses in figures: where they are, and how many."""

import numpy as np
import pytest

from equimorph.equilibria import lift
from equimorph.plotting import shapes
from equimorph.plotting.surroundings import Surroundings
from equimorph.structures import Bar, Truss


def _bent(**supports: str):
    """A triangle under a load F on its top, lifted to F = 0.01."""
    truss = Truss(
        {"A": (-1.0, 0.0), "B": (0.0, 0.5), "C": (1.0, 0.0)},
        [Bar(("A", "B")), Bar(("B", "C")), Bar(("A", "C"))],
        supports,
        loads={"F": {"B": (0.0, -1.0)}},
    )
    return lift(truss.natural_state(), {"F": 0.01})


def test_joints_are_drawn_with_their_supports():
    """A pin where both moves are held, a roller where one is: at both ends of its way."""
    path = _bent(A="xy", C="y")
    ax = shapes(path, count=2)
    pins, rollers = (_triangles(ax, name) for name in ("pin", "roller"))
    np.testing.assert_allclose([each[0] for each in pins], [(-1.0, 0.0)])
    ends = path.states[[0, -1]].shape()[:, 2]
    np.testing.assert_allclose([each[0] for each in rollers], ends, atol=1e-12)
    assert ends[1, 0] > ends[0, 0]


def test_the_arrow_of_a_load_moves_with_its_joint():
    """Downward, onto B, in every state; the joint goes down."""
    states = _bent(A="xy", C="y").states[[0, -1]]
    ((tails, heads),) = Surroundings(states).arrows
    assert tails.shape == (2, 1, 2)
    along = heads - tails
    assert not along[0].any()
    assert along[1, 0, 0] == 0.0
    assert along[1, 0, 1] < 0.0
    np.testing.assert_allclose(heads[0, 0], (0.0, 0.5))
    above = heads[1, 0] - states.shape()[1, 1]
    assert 0.0 < above[1] == pytest.approx(0.012 * Surroundings(states).size)


def test_bars_that_change_their_length_are_marked_and_move_with_the_truss():
    """In the middle third of the bar."""
    truss = Truss(
        {"A": (-1.0, 0.0), "B": (0.0, 0.5), "C": (1.0, 0.0)},
        [Bar(("A", "B")), Bar(("B", "C"))],
        {"A": "xy", "C": "xy"},
        actuators={"a": {"A-B": 1.0}},
    )
    path = lift(truss.natural_state(), {"a": 0.1})
    ax = shapes(path, count=2)
    (mark,) = [each for each in ax.lines if each.get_gid() == "actuator length"]
    first, second = path.states.shape()[0, :2]
    np.testing.assert_allclose(mark.get_xydata()[0], first + (second - first) / 3, atol=1e-12)


def _triangles(ax, name):
    found = (each.get_xy() for each in ax.patches if each.get_gid() == name)
    return [xy for xy in found if len(xy) == 4]
