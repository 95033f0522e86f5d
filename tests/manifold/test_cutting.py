"""Polygons cut along folds, and pieces into triangles: unit tests on hand-made polygons."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from equimorph.manifold.cutting import can_be_triangulated, cut, match_folds, triangulate


def matched(index_or_fold):
    """Match the folds of a polygon given as indices, with "F" for folds."""
    kinds = dict(enumerate(index_or_fold))
    return match_folds(
        list(kinds), lambda point: kinds[point] == "F", lambda point: int(kinds[point])
    )


def area(corners):
    x, y = np.asarray(corners).T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def test_polygon_without_folds_is_one_piece():
    assert matched([2, 2, 2]) == [[]]


def test_polygon_of_two_indices_without_folds_contradicts_itself():
    assert matched([0, 1, 0]) == []


def test_two_folds_between_two_indices_are_joined():
    assert matched([0, "F", 1, "F"]) == [[(1, 3)]]


def test_two_folds_that_part_equal_indices_contradict_themselves():
    assert matched([0, "F", 0, "F"]) == []


def test_odd_number_of_folds_contradicts_itself():
    assert matched([0, "F", 1]) == []


def test_change_of_index_without_a_fold_contradicts_itself():
    assert matched([0, "F", 1, 2, "F"]) == []


def test_two_neighbouring_folds_contradict_themselves():
    assert matched([0, "F", "F", 1]) == []


def test_four_folds_of_three_indices_have_one_way():
    assert matched([0, "F", 1, "F", 2, "F", 1, "F"]) == [[(1, 7), (3, 5)]]


def test_four_folds_of_two_indices_have_two_ways():
    ways = matched([0, "F", 1, "F", 0, "F", 1, "F"])
    assert sorted(ways) == [[(1, 3), (5, 7)], [(1, 7), (3, 5)]]


def test_nested_folds_have_one_way():
    assert matched(["F", 1, "F", 2, "F", 3, "F", 2, "F", 1, "F", 0]) == [[(0, 10), (2, 8), (4, 6)]]


def test_cut_without_chords_returns_the_polygon():
    assert cut([4, 7, 9], [], {}) == [(4, 7, 9)]


def test_cut_puts_the_extra_point_into_both_pieces():
    pieces = cut([0, 1, 2, 3], [(1, 3)], {(1, 3): 9})
    assert sorted(map(len, pieces)) == [4, 4]
    assert all({1, 3, 9} <= set(piece) for piece in pieces)


@pytest.mark.parametrize("chords", [[(1, 5)], [(0, 2), (3, 5)], [(0, 4), (1, 3)]])
def test_pieces_of_a_cut_keep_orientation_and_area(chords):
    """The pieces are disjoint: signed areas of equal sign that sum to that of the polygon."""
    angle = 2 * np.pi * np.arange(6) / 6
    corners = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    pieces = cut(range(6), chords, {})
    areas = [area(corners[list(piece)]) for piece in pieces]
    assert len(pieces) == len(chords) + 1
    assert min(areas) > 0
    assert sum(areas) == pytest.approx(area(corners), rel=1e-14)


@given(st.lists(st.floats(0.0, 6.28), min_size=3, max_size=9, unique=True))
def test_triangles_of_a_convex_polygon_fill_it(angles):
    """n − 2 triangles of positive orientation whose areas sum to that of the polygon."""
    corners = np.stack([np.cos(np.sort(angles)), np.sin(np.sort(angles))], axis=1)
    count = len(corners)
    triangles = triangulate(tuple(range(count)), [frozenset([k]) for k in range(count)], corners)
    assert triangles is not None
    assert len(triangles) == count - 2
    areas = [area(corners[list(triangle)]) for triangle in triangles]
    assert min(areas) >= -1e-15
    assert sum(areas) == pytest.approx(area(corners), rel=1e-12, abs=1e-15)


def test_triangulation_takes_the_shorter_diagonal():
    place = np.array([[0.0, 0.0], [3.0, -1.0], [6.0, 0.0], [3.0, 1.0]])
    triangles = triangulate((5, 6, 7, 8), [frozenset([k]) for k in range(4)], place)
    assert triangles is not None
    assert all({6, 8} <= set(triangle) for triangle in triangles)


def test_triangulation_avoids_diagonals_along_a_side_of_the_grid_triangle():
    """Corners 6 and 8 lie on one side: the longer diagonal is taken."""
    place = np.array([[0.0, 0.0], [3.0, -1.0], [6.0, 0.0], [3.0, 1.0]])
    sides = [frozenset([0]), frozenset([1]), frozenset([2]), frozenset([1])]
    triangles = triangulate((5, 6, 7, 8), sides, place)
    assert triangles is not None
    assert all({5, 7} <= set(triangle) for triangle in triangles)


def test_triangulation_reports_that_all_diagonals_are_forbidden():
    place = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    assert triangulate((0, 1, 2, 3), [frozenset([0])] * 4, place) is None


def test_triangle_needs_no_diagonal():
    assert triangulate((3, 1, 2), [frozenset([0])] * 3, np.zeros((3, 2))) == [(3, 1, 2)]


def test_band_over_one_corner_needs_a_point_on_its_fold():
    """Both fold curves cross the sides 1 and 2 of one corner: all short diagonals lie on a side."""
    corner, one, two = frozenset([1, 2]), frozenset([1]), frozenset([2])
    band = [corner, one, two, corner, one, two]
    assert not can_be_triangulated(band)
    assert can_be_triangulated([*band[:2], frozenset(), *band[2:]])
