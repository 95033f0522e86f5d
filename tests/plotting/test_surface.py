"""The equilibrium surface: what is drawn, and the light on it."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import proj3d

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.model import Descriptor
from equimorph.plotting import style
from equimorph.plotting.raster_kernels import GLOSS, shade_pixel
from equimorph.plotting.scene import Scene
from equimorph.plotting.shading import corner_normals


def legend(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_surface_of_the_spring_is_named_and_labelled(spring_set):
    ax = plotting.surface(spring_set, spring_set.structure.angle)
    assert legend(ax) == ["stable", "index 1", "fold"]
    assert ax.get_zlabel() == "δ (rad)"
    low, high = ax.get_zlim()
    angles = spring_set.structure.angle(spring_set.points)
    assert low < angles.min() < angles.max() < high


def curve_of(ax, colour):
    (scene,) = [each for each in ax.get_children() if isinstance(each, Scene)]
    return [each.points for each in scene.curves if each.seen["color"] == colour]


def test_route_lies_on_the_surface_from_start_to_goal(spring_set, route, ends):
    angle = spring_set.structure.angle
    ax = plotting.surface(spring_set, angle, route=route)
    ((x_l, force, heights),) = [each.T for each in curve_of(ax, style.ROUTE_COLOUR)]
    assert heights[0] == pytest.approx(angle(ends[0]), abs=1e-9)
    assert heights[-1] == pytest.approx(angle(ends[1]), abs=1e-6)
    # Every point is an equilibrium: PHYSICS §2.
    residual = (1 - x_l / np.cos(heights)) * np.sin(heights) - force
    np.testing.assert_allclose(residual, 0.0, rtol=0, atol=1e-9)


def test_ends_of_a_route_are_marked(spring_set, route, ends):
    angle = spring_set.structure.angle
    ax = plotting.surface(spring_set, angle, route=route)
    marks = [np.concatenate(line.get_data_3d()) for line in ax.lines]
    expected = [[0.8, 0.0, angle(end)] for end in ends]
    np.testing.assert_allclose(marks, expected, rtol=0, atol=1e-6)


def test_a_refused_route_is_named_as_such(spring_set, refused):
    ax = plotting.surface(spring_set, spring_set.structure.angle, route=refused)
    assert legend(ax)[-1] == "route, refused (○ start, ● fold)"


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
    random = np.random.default_rng(0)
    normals, colours = random.normal(size=(20, 3)), random.uniform(size=(20, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    lit = np.empty((2, 20, 3))
    light, halfway = np.array([-0.50, 0.55, 0.67]), np.array([-0.27, 0.30, 0.915])
    for turned, shaded in zip((normals, -normals), lit, strict=True):
        for colour, normal, here in zip(colours, turned, shaded, strict=True):
            shade_pixel(colour, normal, light, halfway, here)
    np.testing.assert_array_equal(*lit)
    assert lit.min() >= 0.0
    assert lit.max() <= 1.0


def test_what_faces_halfway_between_light_and_viewer_shines():
    """A black surface shows its highlight alone, straight on; across it none is left."""
    light, halfway, lit = np.array([-0.6, 0.0, 0.8]), np.array([0.0, 0.0, 1.0]), np.empty((2, 3))
    for normal, shaded in zip((halfway, np.array([1.0, 0.0, 0.0])), lit, strict=True):
        shade_pixel(np.zeros(3), normal, light, halfway, shaded)
    np.testing.assert_allclose(lit[0], GLOSS, rtol=1e-12)
    np.testing.assert_array_equal(lit[1], 0.0)


def test_the_surface_keeps_clear_of_its_legend(spring_set):
    """Highest at the back, it would be drawn over the legend if nothing made room."""
    back = Descriptor("back", "1", lambda _, p: 30 * p[:, 0] - p[:, 1])
    ax = plotting.surface(spring_set, back)
    points = np.column_stack([spring_set.coordinates, back(spring_set.points)])
    across, up, _ = proj3d.proj_transform(*points.T, ax.get_proj())
    x, y = ax.transData.transform(np.column_stack([across, up])).T
    box = ax.get_legend().get_window_extent()
    assert not ((box.x0 < x) & (x < box.x1) & (box.y0 < y)).any()
    low, high = ax.get_zlim()
    assert high - points[:, 2].max() > points[:, 2].min() - low  # room was made
