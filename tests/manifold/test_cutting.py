"""Polygons cut along folds, and pieces into triangles: unit tests on hand-made polygons."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from equimorph.manifold.lifting.polygon_cuts import (
    MEETING,
    MOST_FOLDS,
    TURN,
    chords_to_split,
    cut,
    has_triangulation,
    match_around_hub,
    match_folds,
    triangulate,
)

FLAT = np.array([[0.0, 0.0], [3.0, -1.0], [6.0, 0.0], [3.0, 1.0]])


def matched(index_or_fold, joined=()):
    """Match the folds of a polygon given as indices, with "F" for folds."""
    kinds = dict(enumerate(index_or_fold))
    return match_folds(
        list(kinds), lambda point: kinds[point] == "F", lambda point: int(kinds[point]), joined
    )


def matched_around_hub(index_or_sort):
    """Match around a hub, with "F" for folds and "C" for points of crossings."""
    kinds = dict(enumerate(index_or_sort))
    sorts = {"F": TURN, "C": MEETING}
    return match_around_hub(
        list(kinds), lambda point: sorts.get(kinds[point], 0), lambda point: int(kinds[point])
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


def test_fold_and_crossing_that_follow_in_turn_meet_in_a_hub():
    assert matched_around_hub([0, "C", 0, "F", 1, "C", 1, "F"]) == [[(1, 5), (3, 7)]]


def test_fold_that_parts_equal_indices_meets_no_crossing():
    assert matched_around_hub([0, "C", 0, "F", 0, "C", 0, "F"]) == []


def test_fold_beside_a_hub_may_be_any_of_three():
    """The other two are joined."""
    polygon = [0, "C", 0, "F", 1, "F", 0, "F", 1, "C", 1, "F"]
    assert matched_around_hub(polygon) == [
        [(1, 9), (3, 5), (7, 11)],
        [(1, 9), (3, 11), (5, 7)],
    ]


def test_folds_that_need_no_hub_have_none():
    assert matched_around_hub([0, "C", 0, "F", 1, "F", 0, "C"]) == []


def test_four_folds_of_three_indices_have_one_way():
    assert matched([0, "F", 1, "F", 2, "F", 1, "F"]) == [[(1, 7), (3, 5)]]


def test_four_folds_of_two_indices_have_two_ways():
    ways = matched([0, "F", 1, "F", 0, "F", 1, "F"])
    assert sorted(ways) == [[(1, 3), (5, 7)], [(1, 7), (3, 5)]]


def test_known_chords_leave_fewer_ways():
    polygon = [0, "F", 1, "F"] * 3
    assert len(matched(polygon)) == 5
    assert matched(polygon, [(1, 3)]) == [
        [(1, 3), (5, 7), (9, 11)],
        [(1, 3), (5, 11), (7, 9)],
    ]
    assert matched(polygon, [(1, 5)]) == []


def test_more_folds_than_can_be_joined_in_all_ways_need_known_chords():
    polygon = [0, "F", 1, "F"] * (MOST_FOLDS // 2 + 1)
    chords = [(k, k + 2) for k in range(1, len(polygon), 4)]
    assert matched(polygon) == []
    assert matched(polygon, chords[2:]) == [
        [(1, 3), (5, 7), *chords[2:]],
        [(1, 7), (3, 5), *chords[2:]],
    ]
    assert matched(polygon, chords) == [chords]


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


def triangles_of(corners, sides=None):
    """Triangles of one piece; None if there is no way."""
    masks = [0] * len(corners) if sides is None else sides
    triangles, possible = triangulate(np.asarray(corners, float)[None], np.array([masks]))
    return triangles[0].tolist() if possible[0] else None


@given(st.lists(st.floats(0.0, 6.28), min_size=3, max_size=9, unique=True))
def test_triangles_of_a_convex_polygon_fill_it(angles):
    """n − 2 triangles of positive orientation whose areas sum to that of the polygon."""
    corners = np.stack([np.cos(np.sort(angles)), np.sin(np.sort(angles))], axis=1)
    triangles = triangles_of(corners)
    assert triangles is not None
    assert len(triangles) == len(corners) - 2
    areas = [area(corners[triangle]) for triangle in triangles]
    assert min(areas) >= -1e-15
    assert sum(areas) == pytest.approx(area(corners), rel=1e-12, abs=1e-15)


@given(st.integers(4, 8), st.integers(0, 99))
def test_pieces_are_triangulated_together_as_alone(count, seed):
    generator = np.random.default_rng(seed)
    places, sides = generator.normal(size=(5, count, 3)), generator.integers(0, 4, (5, count))
    triangles, possible = triangulate(places, sides)
    for place, side, own, good in zip(places, sides, triangles, possible, strict=True):
        assert triangles_of(place, side) == (own.tolist() if good else None)


def test_triangulation_takes_the_shorter_diagonal():
    triangles = triangles_of(FLAT)
    assert triangles is not None
    assert all({1, 3} <= set(triangle) for triangle in triangles)


def test_triangulation_avoids_diagonals_along_a_side_of_the_grid_triangle():
    """Corners 1 and 3 lie on one side: the longer diagonal is taken."""
    triangles = triangles_of(FLAT, [0b001, 0b010, 0b100, 0b010])
    assert triangles is not None
    assert all({0, 2} <= set(triangle) for triangle in triangles)


def test_triangulation_reports_that_all_diagonals_are_forbidden():
    assert triangles_of(FLAT, [1, 1, 1, 1]) is None


def test_triangle_needs_no_diagonal():
    assert triangles_of(np.zeros((3, 2)), [1, 1, 1]) == [[0, 1, 2]]


def test_band_over_one_corner_needs_a_point_on_its_fold():
    """Both fold curves cross the sides 1 and 2 of one corner: all short diagonals lie on a side."""
    band = (0b11, 0b01, 0b10, 0b11, 0b01, 0b10)
    assert not has_triangulation(band)
    assert has_triangulation((*band[:2], 0, *band[2:]))


def test_chord_along_a_side_of_the_grid_triangle_is_split():
    assert chords_to_split((0b101, 0b001, 0b011, 0b010, 0b110), ((1, 3),)) == ()
    assert chords_to_split((0b101, 0b001, 0b000, 0b001, 0b011, 0b110), ((1, 3),)) == ((1, 3),)
