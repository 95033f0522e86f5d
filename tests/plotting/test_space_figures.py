"""Structures in space in figures: solids, the view of them, and everything around them."""

import numpy as np
import pytest
from matplotlib.image import AxesImage

import equimorph as em
from equimorph.plotting import portraits, shapes, style
from equimorph.plotting.depth import Viewpoint
from equimorph.plotting.surroundings import Surroundings
from equimorph.structures.solids import profile, solids, tube
from oracles.specimens import tripod
from typecheck import unchecked


@pytest.fixture(scope="module")
def path():
    """A round rod between clamps that is pushed down and out of its plane."""
    aside = {"out": em.Curvature(1.0, about="n")}
    rod = em.SpatialRod(torsion=0.77, lateral=1.0, actuators=aside, elements=4, degree=5)
    with unchecked():  # the tests of lifts check
        return em.lift(rod.natural_state(Theta=0.9), {"q": 2.2, "out": 0.3})


@pytest.mark.parametrize("upward", ["y", "z"])
def test_the_view_is_a_rotation_with_the_upward_axis_upward(upward):
    seen = Viewpoint(upward)
    np.testing.assert_allclose(seen.frame.T @ seen.frame, np.eye(3), atol=1e-14)
    assert np.linalg.det(seen.frame) == pytest.approx(1.0)
    across, up = seen.flat(np.eye(3)["xyz".index(upward)])
    assert across == pytest.approx(0.0, abs=1e-14)
    assert up > 0.9
    flat = np.linalg.norm(seen.directions(np.eye(3)), axis=1)
    np.testing.assert_allclose(flat, 1.0)


@pytest.mark.parametrize(("flatness", "area"), [(1.0, np.pi), (4.0, 4 * 1.3**2)])
def test_tubes_are_closed_with_their_normals_outward(flatness, area):
    """Their volume is area times length, by Gauss's theorem over the triangles.

    The twenty sides of a circle of radius 1 enclose 10 sin(2π/20), 1.6 % less than π; of the
    half circle that the middle line is, 40 chords are 0.03 % shorter.
    """
    t = np.linspace(0.0, np.pi, 41)
    places = 20.0 * np.stack([np.cos(t), np.sin(t), 0.0 * t], axis=1)
    tangent = np.stack([-np.sin(t), np.cos(t), 0.0 * t], axis=1)
    binormal = np.tile([0.0, 0.0, 1.0], (41, 1))
    frames = np.stack([tangent, np.cross(binormal, tangent), binormal], axis=2)
    mesh = tube(places, frames, profile(1.0, flatness))
    a, b, c = mesh.corners.swapaxes(0, 1)
    sides = np.cross(b - a, c - a)
    volume = np.einsum("ij,ij->", a, sides) / 6.0
    assert abs(volume) == pytest.approx(area * 20.0 * np.pi, rel=0.018)
    outward = np.sign(volume) * np.einsum("ij,ikj->ik", sides, mesh.normals)
    size = np.linalg.norm(sides, axis=1) > 1e-9
    assert (outward[size] > 0.0).all()


def test_the_stripe_of_a_tube_lies_along_the_normal(path):
    """Frames of the package; the stripe is pale and surrounds the normal within three sides."""
    state = path.states[-1:]
    size = Surroundings(state).size
    (mesh,) = solids(state, size)
    frames, shape = state.frames()[0], state.shape()[0]
    pale = mesh.corners[mesh.white > 0.0].mean(axis=1)
    nearest = np.linalg.norm(pale[:, None] - shape[None], axis=2).argmin(axis=1)
    away = pale - shape[nearest]
    along = np.einsum("ij,ij->i", away, frames[nearest][:, :, 1])
    assert (along > np.cos(3.0 * np.pi / 20.0) * 0.8 * np.linalg.norm(away, axis=1)).all()


def test_shapes_in_space_are_one_picture_with_directions_and_a_scale(path):
    ax = shapes(path, count=3)
    (image,) = [each for each in ax.get_images() if isinstance(each, AxesImage)]
    picture = np.asarray(image.get_array())
    assert 0.02 < (picture[..., 3] > 0).mean() < 0.6
    words = [text.get_text() for text in ax.texts]
    assert {"$x$", "$y$", "$z$", "0.05 L"} <= set(words)
    assert {"start", "goal"} <= set(words)
    assert ax.get_aspect() == 1.0


def test_supports_and_loads_lie_where_the_structure_is_seen(path):
    """The seen ends of the rod are where its clamps are drawn; arrows end on the rod."""
    around = Surroundings(path.states[[0, -1]])
    for support, at in zip(around.drawing.supports, (0, -1), strict=True):
        np.testing.assert_allclose(support.places, around.outlines[:, at], atol=1e-12)
    ((tails, heads),) = around.arrows
    assert ((tails - heads)[1, :, 1] > 0.0).all()
    assert np.abs((tails - heads)[..., 0]).max() < 1e-12


def test_trusses_in_space_are_drawn_like_rods():
    """Nine pieces of the walk over six bars; three pins; a load that leans to the right."""
    truss = tripod()
    states = em.lift(truss.natural_state(), {"F": 0.002}).states
    assert states.shape().shape[2] == 3
    ax = portraits(states[[0, -1]], ["before", "after"])
    assert len(ax.get_images()) == 1
    around = Surroundings(states)
    assert len(around.drawing.supports) == 3
    ((tails, heads),) = around.arrows
    lean = (heads - tails)[-1, 0]
    assert lean[0] > 0.0 > lean[1]


def test_planar_structures_are_drawn_as_before():
    states = em.Rod().natural_state(Theta=0.9).batch
    around = Surroundings(states)
    assert around.viewpoint is None
    np.testing.assert_array_equal(around.outlines, states.shape())


def test_a_figure_in_space_may_be_saved_in_every_format(path, tmp_path):
    style.save(shapes(path, count=2), tmp_path, "space")
    assert {each.suffix for each in tmp_path.iterdir()} == {".png", ".svg"}
