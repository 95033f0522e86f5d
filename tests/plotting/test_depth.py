"""The depth buffer: against the nearest triangle found pixel by pixel, and on crossing planes."""

import numpy as np
from hypothesis import given, settings, strategies as st

from equimorph.plotting.depth import depth_buffer, slopes


def nearest(corners, x, y):
    """Nearest triangle over a place by barycentric coordinates, and its depth; −1 without one."""
    best, depth = -1, np.inf
    for k, (a, b, c) in enumerate(corners):
        edges = np.column_stack([b[:2] - a[:2], c[:2] - a[:2]])
        if abs(np.linalg.det(edges)) < 1e-9:
            continue
        s, t = np.linalg.solve(edges, [x - a[0], y - a[1]])
        z = a[2] + s * (b[2] - a[2]) + t * (c[2] - a[2])
        if min(s, t, 1 - s - t) > 0 and z < depth:
            best, depth = k, z
    return best, depth


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_every_pixel_shows_the_nearest_triangle(seed):
    """Depths are compared in steps of 2⁻³¹ of their range: 1e-8 is twenty steps."""
    corners = np.random.default_rng(seed).uniform(0, 12, size=(6, 3, 3))
    buffer = depth_buffer(corners, 10, 12)
    for row in range(10):
        for column in range(12):
            owner, depth = nearest(corners, column + 0.5, row + 0.5)
            assert buffer.owner[row, column] == owner
            np.testing.assert_allclose(buffer.depth[row, column], depth, rtol=0, atol=1e-8)


def test_neighbours_share_no_pixel_and_leave_none_out():
    """A fan around an odd point covers a square; each pixel belongs to one of its triangles."""
    rim = np.array([[0, 0, 0], [8, 0, 0], [8, 8, 0], [0, 8, 0], [0, 0, 0]], dtype=float)
    fan = np.array([[rim[k], rim[k + 1], [3.3, 5.1, 0.0]] for k in range(4)])
    assert (depth_buffer(fan, 8, 8).owner >= 0).all()
    counts = [np.count_nonzero(depth_buffer(fan[k : k + 1], 8, 8).owner >= 0) for k in range(4)]
    assert sum(counts) == 64


def test_crossing_planes_change_places_where_they_cross():
    """z = x and z = 10 − x meet at x = 5: neither order of drawing them would be right."""
    square = np.array([[[0, 0], [10, 0], [10, 10]], [[0, 0], [10, 10], [0, 10]]], dtype=float)
    rising = np.concatenate([square, square[..., :1]], axis=2)
    falling = np.concatenate([square, 10 - square[..., :1]], axis=2)
    owner = depth_buffer(np.concatenate([rising, falling]), 10, 10).owner
    assert (owner[:, :5] < 2).all()
    assert (owner[:, 5:] >= 2).all()


def test_what_lies_outside_the_picture_is_left_out():
    corners = np.array([[[-30, -30, 1], [40, -30, 1], [5, 60, 1]]], dtype=float)
    assert (depth_buffer(corners, 6, 7).owner == 0).all()
    assert (depth_buffer(corners + np.array([100, 0, 0]), 6, 7).owner == -1).all()


def test_a_triangle_seen_edge_on_covers_nothing():
    corners = np.array([[[1, 1, 0], [5, 5, 3], [9, 9, -2]]], dtype=float)
    buffer = depth_buffer(corners, 10, 10)
    assert (buffer.owner == -1).all()
    assert np.isinf(buffer.depth).all()


def test_points_are_seen_unless_something_is_nearer():
    """A plane at depth 2, and points in front of, on and behind it, and beside it."""
    plane = np.array([[[0, 0, 2], [20, 0, 2], [0, 20, 2]]], dtype=float)
    places = np.array([[4, 4, 1], [4, 4, 2], [4, 4, 2.2], [4, 4, 3], [19, 19, 3]], dtype=float)
    shows = depth_buffer(plane, 20, 20).shows(places, slack=0.3)
    assert shows.tolist() == [True, True, True, False, True]


def test_slopes_are_those_of_a_linear_function():
    random = np.random.default_rng(1)
    corners = random.uniform(0, 9, size=(5, 3, 3))
    values = corners[..., :2] @ np.array([[2.0, -1.0], [0.5, 3.0]])
    expected = np.broadcast_to([[2.0, -1.0], [0.5, 3.0]], (5, 2, 2))
    np.testing.assert_allclose(slopes(corners, values), expected, rtol=1e-9)
