"""Curves through single grid triangles: arcs of circles, whose distances from sides are known."""

from types import SimpleNamespace

import numpy as np
import pytest

from equimorph.manifold.lifting.courses import Courses, on_sides, ways_out
from typecheck import unchecked

TOP = np.sqrt(0.75)


@pytest.fixture(autouse=True)
def _stand_ins():
    """A triangle and its ends stand in for a grid and for points on its edges."""
    with unchecked():
        yield


CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, TOP]])


def arc(height, radius, scales):
    """Lower arc of a circle around (0.5, height) from the left side of a triangle to the right one.

    The left side is y = √3 x: there 4 x² − (1 + 2√3 h) x + ¼ + h² − ρ² = 0.
    """
    b, c = 1.0 + 2.0 * np.sqrt(3.0) * height, 0.25 + height**2 - radius**2
    x = (b - np.sqrt(b**2 - 16.0 * c)) / 8.0
    ends = np.array([[x, np.sqrt(3.0) * x], [1.0 - x, np.sqrt(3.0) * x]])
    normals = (ends - np.array([0.5, height]))[None]
    mesh = SimpleNamespace(
        vertices=CORNERS * scales,
        triangles=np.array([[0, 1, 2]]),
        sides=np.array([[0, 1, 2]]),
        edges=np.array([[0, 1], [1, 2], [0, 2]]),
    )
    pairing = SimpleNamespace(
        mesh=mesh,
        setting=SimpleNamespace(scales=scales, free=np.arange(2)),
        points=SimpleNamespace(p=ends * scales),
    )
    return pairing, np.array([[0, 1]]), np.array([0]), normals


@pytest.mark.parametrize("scales", [(1.0, 1.0), (3.0, 0.01)])
@pytest.mark.parametrize(("height", "radius"), [(0.6, 0.4), (0.5, 0.49), (0.5, 0.53), (0.3, 0.33)])
def test_distances_of_arcs_from_the_third_side(height, radius, scales):
    """Exact for parabolas, to a few per cent of its depth for an arc of up to 150°."""
    pairing, ends, triangle, normals = arc(height, radius, np.array(scales))
    courses = Courses.of(pairing, ends, triangle, normals)
    assert courses.third.tolist() == [2]
    (low,) = courses.shares[:, 0, 2] * TOP
    length = 1.0 - 2.0 * courses.shares[0, 1, 0] - courses.shares[0, 1, 2]
    np.testing.assert_allclose(courses.cosines, (height - low) / radius, rtol=1e-12)
    gap, place = courses.nearest()
    depth = low - (height - radius)
    assert gap * abs(length) * TOP == pytest.approx(height - radius, abs=0.03 * depth)
    side, share = on_sides(pairing.mesh, triangle, courses.third, place)
    assert (side.tolist(), share.tolist()) == ([0], pytest.approx([0.5]))


def test_curves_lead_to_where_they_go_and_straight_out_of_their_triangle():
    """An arc leads to its lowest point, not to the highest of its circle."""
    pairing, ends, triangle, normals = arc(0.5, 0.4, np.ones(2))
    courses = Courses.of(pairing, ends, triangle, normals)
    for y, right in ((0.1, True), (0.9, False)):
        middle = np.array([[0.5 - 0.5 * y / TOP, 0.5 - 0.5 * y / TOP, y / TOP]])
        assert courses.lead_to(middle).tolist() == [right]
    ways = ways_out(pairing, ends, triangle, normals)
    assert ways.apexes.tolist() == [[2, 2]]
    np.testing.assert_allclose(ways.middle, [[0.5, 0.5, 0.0]], atol=1e-12)
