"""The equilibrium surface: what is drawn, and the light on it."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.plotting.painter import PaintedPieces
from equimorph.plotting.shading import brightness, corner_normals, split_long


def legend(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_surface_of_the_spring_is_named_and_labelled(spring_set):
    ax = plotting.surface(spring_set, spring_set.structure.angle)
    assert legend(ax) == ["stable", "index 1", "fold"]
    assert ax.get_zlabel() == "δ (rad)"
    low, high = ax.get_zlim()
    angles = spring_set.structure.angle(spring_set.points)
    assert low < angles.min() < angles.max() < high


def test_route_lies_on_the_surface_from_start_to_goal(spring_set, route, ends):
    angle = spring_set.structure.angle
    ax = plotting.surface(spring_set, angle, route=route)
    (line,) = [each for each in ax.lines if str(each.get_label()).startswith("route")]
    x_l, force, heights = (np.asarray(values) for values in line.get_data_3d())
    assert heights[0] == pytest.approx(angle(ends[0]), abs=1e-9)
    assert heights[-1] == pytest.approx(angle(ends[1]), abs=1e-6)
    # Every point is an equilibrium: PHYSICS §2.
    residual = (1 - x_l / np.cos(heights)) * np.sin(heights) - force
    np.testing.assert_allclose(residual, 0.0, rtol=0, atol=1e-9)


def test_one_collection_holds_cells_and_curves(spring_set):
    ax = plotting.surface(spring_set, spring_set.structure.angle)
    (pieces,) = [each for each in ax.collections if isinstance(each, PaintedPieces)]
    ax.figure.canvas.draw()
    assert len(pieces.get_paths()) > len(spring_set.cells)


def test_flat_axes_are_refused(spring_set):
    with pytest.raises(InputError, match="`ax` must be three-dimensional"):
        plotting.surface(spring_set, spring_set.structure.angle, ax=Figure().add_subplot())


def test_normals_are_continuous_across_a_fold():
    """A strip bent over an edge: both sides lean 45° from the upright edge, towards each other."""
    corners = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 1], [1, 0, -1]], dtype=float)
    cells = np.array([[0, 1, 2], [0, 1, 3]])
    normals = corner_normals(corners[cells], cells, np.array([0, 1]))
    # At the fold (vertices 0 and 1) the mean normal points straight away from the strip.
    np.testing.assert_allclose(normals[:, :2], np.tile([-1.0, 0.0, 0.0], (2, 2, 1)), atol=1e-12)


def test_a_surface_is_lit_alike_from_both_sides():
    normals = np.random.default_rng(0).normal(size=(20, 3, 3))
    np.testing.assert_array_equal(brightness(normals, 20.0, 9.0), brightness(-normals, 20.0, 9.0))


def test_long_triangles_are_split_without_changing_their_area():
    corners = np.array([[[0, 0, 0], [4, 0, 0], [0, 3, 0]], [[0, 0, 1], [1, 0, 1], [0, 1, 1]]])
    pieces, _, owner = split_long(corners.astype(float), np.ones((2, 3, 3)), longest=1.5)
    area = np.linalg.norm(
        np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0]), axis=1
    )
    edges = np.linalg.norm(pieces - np.roll(pieces, 1, axis=1), axis=2)
    assert edges.max() <= 1.5
    np.testing.assert_allclose(np.bincount(owner, area / 2), [6.0, 0.5], rtol=1e-12)
