"""Surface and curves in axes: what is hidden, at which resolution, in which format."""

import io

import numpy as np
import pytest
from PIL import Image

from equimorph.plotting.depth import view_of
from equimorph.plotting.scene import Curve, Scene
from equimorph.plotting.shading import Paint
from equimorph.plotting.style import Picture

RED, GREEN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
SQUARE = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], float)
LINE = {"color": GREEN, "linewidth": 3.0}


def drawn(curves, corners=SQUARE):
    """A red square at z = 0 with curves, seen from straight above."""
    figure = Picture(2, 2)
    axes = figure.add_axes((0, 0, 1, 1), projection="3d")
    axes.set_proj_type("ortho")
    axes.view_init(elev=90, azim=-90)
    axes.set(xlim=(-1, 2), ylim=(-1, 2), zlim=(-1, 2))
    axes.set_axis_off()
    upward = np.broadcast_to([0.0, 0.0, 1.0], corners.shape)
    paint = Paint(upward, np.ones(3), np.array([RED] * len(corners)), (), np.zeros(3))
    axes.add_artist(Scene(corners, paint, curves))
    return figure


def pixels(figure, dpi=100):
    file = io.BytesIO()
    figure.savefig(file, dpi=dpi)
    return np.asarray(Image.open(file).convert("RGB")).astype(float) / 255


def share_of(colour, picture):
    """Share of the pixels whose strongest channel is that of `colour`, by far."""
    channel = int(np.argmax(colour))
    others = np.delete(picture, channel, axis=2).max(axis=2)
    return float((picture[..., channel] - others > 0.3).mean())


def across(z):
    return np.array([[-0.5, 0.5, z], [1.5, 0.5, z]])


@pytest.mark.parametrize("dpi", [100, 300])
def test_a_square_covers_the_area_of_its_projection(dpi):
    """One row of pixels more or less, at 43 pixels: 2 %; neither red nor black have much green."""
    figure = drawn([])
    cover = pixels(figure, dpi)[..., 1] < 0.5
    view = view_of(figure.axes[0])  # at the 100 dots per inch of the figure
    area = float(np.linalg.norm(np.cross(view.linear[0], view.linear[1]))) / 200**2
    assert cover.mean() == pytest.approx(area, rel=0.04)


def test_a_curve_in_front_is_seen_and_one_behind_only_beside_the_surface():
    front, behind = (share_of(GREEN, pixels(drawn([Curve(across(z), LINE)]))) for z in (1.0, -1.0))
    assert behind == pytest.approx(0.5 * front, rel=0.15)


def test_hidden_parts_have_their_own_look():
    blue = {"color": (0.0, 0.0, 1.0), "linewidth": 3.0}
    picture = pixels(drawn([Curve(across(-1.0), LINE, blue)]))
    assert share_of((0, 0, 1), picture) == pytest.approx(share_of(GREEN, picture), rel=0.15)


def test_a_curve_on_the_surface_is_seen():
    on, front = (share_of(GREEN, pixels(drawn([Curve(across(z), LINE)]))) for z in (0.0, 1.0))
    assert on == pytest.approx(front, rel=0.02)


def test_the_resolution_of_the_picture_follows_that_of_the_file():
    """The dark outline is a fixed width on paper; its share of the picture stays."""
    dark = [float((pixels(drawn([]), dpi).max(axis=2) < 0.3).mean()) for dpi in (200, 400)]
    assert dark[0] == pytest.approx(dark[1], rel=0.5)


def test_vector_files_keep_curves_as_paths_and_hold_one_picture():
    file = io.StringIO()
    drawn([Curve(across(1.0), LINE)]).savefig(file, format="svg")
    assert file.getvalue().count("<image") == 1
    assert "stroke: #00ff00" in file.getvalue()


def test_an_invisible_scene_is_left_out():
    figure = drawn([Curve(across(1.0), LINE)])
    (scene,) = [each for each in figure.axes[0].get_children() if isinstance(each, Scene)]
    scene.set_visible(False)
    assert pixels(figure).min() == 1.0
