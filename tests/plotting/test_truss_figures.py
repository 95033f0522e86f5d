"""Supports and loads of trusses in figures: where they are, and how many."""

import numpy as np
from matplotlib.patches import Circle, Polygon

from equimorph.equilibria import lift
from equimorph.plotting import shapes
from equimorph.plotting.furniture import moving_parts
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
    """A hinge where both moves are held, a roller where one is."""
    ax = shapes(_bent(A="xy", C="y"), count=2)
    hinges = [each for each in ax.patches if isinstance(each, Polygon)]
    rollers = [each for each in ax.patches if isinstance(each, Circle)]
    np.testing.assert_allclose(hinges[0].get_xy()[0], (-1.0, 0.0))
    np.testing.assert_allclose(rollers[0].center, (1.0, 0.0))
    assert (len(hinges), len(rollers)) == (1, 1)


def test_the_arrow_of_a_load_moves_with_its_joint():
    """Downward, at B, in every state; the joint goes down."""
    path = _bent(A="xy", C="y")
    ax = shapes(path, count=2)
    states = path.states[[0, -1]]
    parts = moving_parts(ax, states)
    assert parts.arrows is not None
    heads, tails = parts.heads[1], parts.tails
    assert heads[1][0] == 0.0
    assert heads[1][1] < 0.0
    assert not heads[[0, 2]].any()
    np.testing.assert_allclose(tails[0, 1], (0.0, 0.5))
    assert tails[1, 1, 1] < 0.5
