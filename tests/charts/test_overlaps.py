"""Triangles that lie over each other, against areas of polygons cut by half planes."""

import numpy as np

from equimorph.charts.conflicts import TOUCHING, _inward
from equimorph.charts.kernels import overlap_flags


def common_area(one, other):
    """Area of a triangle that is cut by the sides of another one, both turning left."""
    polygon = list(one)
    for a, b in zip(other, np.roll(other, -1, axis=0), strict=True):
        side = [(b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0] for c in polygon]
        kept = []
        for k, corner in enumerate(polygon):
            if side[k - 1] * side[k] < 0.0:
                share = side[k - 1] / (side[k - 1] - side[k])
                kept.append(polygon[k - 1] + share * (corner - polygon[k - 1]))
            if side[k] >= 0.0:
                kept.append(corner)
        polygon = kept
    x, y = np.array(polygon).reshape(-1, 2).T
    return 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def test_triangles_overlap_where_they_have_an_area_in_common():
    """Random ones, of which some touch along a side; those with a common vertex do not count."""
    generator = np.random.default_rng(2)
    corners = generator.uniform(0.0, 3.0, (60, 1, 2)) + generator.uniform(-0.6, 0.6, (60, 3, 2))
    corners[1] = corners[0] + 2.0 * (corners[0, 1] - corners[0, 0])
    corners[2] = corners[0, [0, 1, 1]] + [[0, 0], [0, 0], [0.3, 0.1]]
    turn = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0.0
    corners[turn] = corners[turn][:, ::-1]
    vertices = np.arange(180).reshape(60, 3)
    vertices[50:, 0] = vertices[:10, 1]
    pairs = np.stack(np.triu_indices(60, 1), axis=1)
    found = overlap_flags(pairs, vertices, corners, _inward(corners), TOUCHING)
    for (a, b), flag in zip(pairs.tolist(), found.tolist(), strict=True):
        shared = np.isin(vertices[a], vertices[b]).any()
        assert flag == (not shared and common_area(corners[a], corners[b]) > 1e-9)
    assert 20 < found.sum() < len(found) - 20
