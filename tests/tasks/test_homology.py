"""Ways around holes are told apart by whole numbers: cocycles of a triangulated surface."""

import numpy as np
import pytest

from equimorph.tasks.planning.homology import cocycles, signature

# in any order: signs depend on which end of an edge has the lower number
NUMBERS = np.random.default_rng(3).permutation(36)


def grid(holes=()):
    """Corners, edges and triangles of a 5 × 5 board of squares, some of them left out."""
    triangles = []
    for i in range(5):
        for j in range(5):
            if (i, j) not in holes:
                a, b, c, d = 6 * i + j, 6 * i + j + 1, 6 * i + j + 6, 6 * i + j + 7
                triangles += [[a, b, d], [a, c, d]]
    triangles = np.sort(NUMBERS[np.array(triangles)], axis=1)
    edges = np.unique(
        np.concatenate([triangles[:, pair] for pair in ([0, 1], [1, 2], [0, 2])]), axis=0
    )
    return 36, edges, triangles


def around(i: int, j: int) -> np.ndarray:
    """Corners of a square and back to the first."""
    a = 6 * i + j
    return NUMBERS[[a, a + 1, a + 7, a + 6, a]]


def test_a_disc_has_no_holes_to_go_around():
    assert cocycles(*grid()).shape[1] == 0


@pytest.mark.parametrize("holes", [[(2, 2)], [(1, 1), (3, 3)], [(1, 3), (3, 1), (1, 1)]])
def test_ways_around_each_hole_count_once_and_backwards_with_the_other_sign(holes):
    """As many independent numbers as holes; none for ways around a square that is there."""
    count, edges, triangles = grid(holes)
    values = cocycles(count, edges, triangles)
    assert values.shape[1] == len(holes)

    def told(path):
        return np.array(signature(count, edges, values, path))

    for corners in triangles:
        assert not told(corners[[0, 1, 2, 0]]).any()
    rounds = np.array([told(around(*hole)) for hole in holes])
    assert abs(round(np.linalg.det(rounds))) == 1
    for hole, number in zip(holes, rounds, strict=True):
        np.testing.assert_array_equal(told(around(*hole)[::-1]), -number)
    outside = [*range(6), *range(11, 36, 6), *range(34, 29, -1), *range(24, -1, -6)]
    np.testing.assert_array_equal(told(NUMBERS[outside]), rounds.sum(axis=0))
