"""Sorting by depth, with colours and line widths kept together."""

import numpy as np
from matplotlib.figure import Figure

from equimorph.plotting.painter import Coat, PaintedPieces
from equimorph.plotting.style import attach_canvas, rgba


def painted(coats):
    """Pieces as they are drawn, seen from straight above."""
    figure = attach_canvas(Figure())
    axes = figure.add_subplot(projection="3d")
    axes.set_proj_type("ortho")
    axes.view_init(elev=90, azim=-90)
    pieces = PaintedPieces(coats)
    axes.add_collection3d(pieces, autolim=False)
    figure.canvas.draw()
    return pieces


def triangles(*heights):
    return np.array([[[0, 0, z], [1, 0, z], [0, 1, z]] for z in heights], dtype=float)


def test_what_is_nearer_is_painted_later():
    colours = np.array([rgba("red"), rgba("green"), rgba("blue")])
    pieces = painted([Coat(triangles(0.5, 0.9, 0.1), colours, 0.3)])
    assert pieces.get_facecolor().tolist() == colours[[2, 0, 1]].tolist()


def test_line_widths_travel_with_their_pieces():
    pieces = painted(
        [
            Coat(triangles(0.2), rgba("red"), 0.3),
            Coat(triangles(0.1), rgba("black"), 2.0),
            Coat(triangles(0.3), rgba("blue"), 1.0),
        ]
    )
    assert np.asarray(pieces.get_linewidth()).tolist() == [2.0, 0.3, 1.0]


def test_a_lifted_line_lies_on_the_surface_through_which_it_runs():
    """The line runs through the middle of a tilted triangle, below its mean depth."""
    tilted = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.6]]])
    line = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]])
    flat = painted([Coat(tilted, rgba("red"), 0.3), Coat(line, rgba("black"), 2.0)])
    lifted = painted([Coat(tilted, rgba("red"), 0.3), Coat(line, rgba("black"), 2.0, lift=1.0)])
    assert np.asarray(flat.get_linewidth()).tolist() == [2.0, 0.3]
    assert np.asarray(lifted.get_linewidth()).tolist() == [0.3, 2.0]
