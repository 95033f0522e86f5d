"""Counting projected cells: exact values from hand-made surfaces and from counting one by one."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from equimorph.charts.arrangement import outline
from equimorph.charts.regions import count_regions, empty_regions, loop_area

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]])


def covers(coordinates, cells, place):
    """Number of triangles over a place, one triangle at a time."""
    a, b, c = (coordinates[cells[:, k]] - place for k in range(3))
    turns = [u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] for u, v in ((a, b), (b, c), (c, a))]
    turn = np.stack(turns)
    return int(((turn > 0).all(axis=0) | (turn < 0).all(axis=0)).sum())


def cusp_surface(columns=48, rows=49):
    """Surface b = w³ − a w over the plane (a, b), |b| ≤ 1: three sheets inside the cusp.

    Every column of constant a is cut at its folds, so that projected folds are chords of the exact
    curve 27 b² = 4 a³.
    """
    a = np.linspace(-1.0, 1.5, columns)
    third = rows // 3
    sheets = []
    for value in a:
        roots = np.roots([1.0, 0.0, -value, -1.0])
        end = roots[np.abs(roots.imag) < 1e-9].real.max()
        fold = np.sqrt(max(value, 0.0) / 3)
        # Without folds the middle part is squeezed to a point that covers nothing.
        parts = [(-end, -fold), (-fold, fold), (fold, end)]
        sheets.append(np.concatenate([np.linspace(low, high, third) for low, high in parts]))
    w = np.array(sheets)
    coordinates = np.stack([np.repeat(a, w.shape[1]), (w**3 - a[:, None] * w).ravel()], axis=1)
    number = np.arange(w.size).reshape(w.shape)
    corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    p, q, r, s = (corner.ravel() for corner in corners)
    return coordinates, np.concatenate([np.stack([p, q, r], 1), np.stack([p, r, s], 1)])


def test_two_halves_of_a_square_have_the_square_as_outline():
    edges, jump = outline(SQUARE, HALVES)
    assert {tuple(edge) for edge in edges.tolist()} == {(0, 1), (1, 2), (2, 3), (0, 3)}
    assert np.abs(jump).tolist() == [1, 1, 1, 1]


def test_one_square_is_one_region_of_count_one():
    regions = count_regions(SQUARE, HALVES)
    assert regions.areas() == pytest.approx({1: 1.0}, rel=1e-12)
    assert len(regions.levels[0]) == 1


def test_the_order_of_corners_of_a_cell_does_not_matter():
    turned = HALVES[:, ::-1]
    turned[0] = HALVES[0]
    assert count_regions(SQUARE, turned).areas() == pytest.approx({1: 1.0}, rel=1e-12)


def test_no_cells_make_no_regions():
    regions = count_regions(SQUARE, np.empty((0, 3), int))
    assert regions.largest == 0
    assert regions.areas() == {}
    assert regions.count(np.array([[0.5, 0.5]])).tolist() == [0]


def test_two_shifted_squares_overlap_in_a_quarter():
    coordinates = np.concatenate([SQUARE, SQUARE + 0.5])
    regions = count_regions(coordinates, np.concatenate([HALVES, HALVES + 4]))
    assert regions.areas() == pytest.approx({1: 1.5, 2: 0.25}, rel=1e-8)


def test_sheets_that_share_an_edge_of_the_box_are_counted_apart():
    """Two sheets over the same square with different vertices along the common sides."""
    fine = np.array([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.3, 1.0]])
    fan = np.array([[0, 1, 4], [1, 5, 4], [1, 3, 5], [1, 2, 3]])
    regions = count_regions(np.concatenate([SQUARE, fine]), np.concatenate([HALVES, fan + 4]))
    assert regions.areas() == pytest.approx({1: 0.0, 2: 1.0}, abs=1e-8)


def test_a_ring_has_a_hole_of_count_zero():
    inner = 0.25 + 0.5 * SQUARE
    ring = np.array([[k, (k + 1) % 4, 4 + k] for k in range(4)])
    ring = np.concatenate([ring, [[(k + 1) % 4, 4 + (k + 1) % 4, 4 + k] for k in range(4)]])
    regions = count_regions(np.concatenate([SQUARE, inner]), ring)
    assert regions.areas() == pytest.approx({1: 0.75}, rel=1e-12)
    assert sorted(len(loop) for loop in regions.levels[0]) == [5, 5]
    assert regions.count(np.array([[0.5, 0.5], [0.1, 0.5]])).tolist() == [0, 1]


def test_cusp_surface_has_three_sheets_inside_27b2_below_4a3():
    """Closed form: area ∫ 2·√(4a³/27) da from 0 to 1.5, with |b| ≤ 1 never reached (b ≤ 0.71).

    Chords over columns h = 2.5/47 wide lose at most h²/12·(b'(1.5) − …) ≈ 4e-4 of the area.
    """
    regions = count_regions(*cusp_surface())
    inside = 2 * np.sqrt(4 / 27) * 1.5**2.5 / 2.5
    areas = regions.areas()
    assert areas[3] == pytest.approx(inside, rel=2e-3)
    assert areas[1] == pytest.approx(2.5 * 2 - inside, rel=2e-3)
    assert areas[2] == pytest.approx(0.0, abs=1e-6)


def test_stable_sheets_of_the_cusp_surface_are_two_inside_and_one_outside():
    """Stable where db/dw = 3w² − a > 0: the middle sheet drops out."""
    coordinates, cells = cusp_surface()
    rows = 3 * (49 // 3)
    middle = (cells % rows >= 49 // 3 - 1) & (cells % rows <= 2 * (49 // 3))
    regions = count_regions(coordinates, cells[~middle.all(axis=1)])
    places = np.array([[1.2, 0.0], [1.2, 0.9], [-0.5, 0.3]])
    assert regions.count(places).tolist() == [2, 1, 1]


@given(st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_count_of_any_triangles_equals_counting_them_one_by_one(seed):
    generator = np.random.default_rng(seed)
    coordinates = generator.normal(size=(14, 2))
    cells = np.array([generator.permutation(14)[:3] for _ in range(10)])
    regions = count_regions(coordinates, cells)
    places = generator.normal(size=(60, 2))
    assert regions.count(places).tolist() == [covers(coordinates, cells, p) for p in places]
    # Every cell is counted once: Σ k·area(k) is the area of all cells.
    a, b = (coordinates[cells[:, k]] - coordinates[cells[:, 0]] for k in (1, 2))
    total = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum() / 2
    counted = sum(k * area for k, area in regions.areas().items())
    assert counted == pytest.approx(total, rel=1e-6)
    assert all(area > -1e-6 * total for area in regions.areas().values())


def test_raster_equals_counting_place_by_place():
    regions = count_regions(*cusp_surface())
    x, y = np.linspace(-0.99, 1.49, 23), np.linspace(-0.98, 0.97, 31)
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    assert regions.raster(x, y).ravel().tolist() == regions.count(places).tolist()


@pytest.mark.parametrize("turn", [0, 1, 2, 3])
def test_what_covers_half_a_box_leaves_the_other_half_empty(turn):
    """The covered half has vertices on three sides, one of them in the middle of a side."""
    half = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.3], [1.0, 0.5], [0.0, 0.5]])
    for _ in range(turn):
        half = np.stack([1.0 - half[:, 1], half[:, 0]], axis=1)
    cells = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4]])
    regions = count_regions(half, cells)
    (loops,) = empty_regions(regions, np.zeros(2), np.ones(2))
    assert len(loops) == 1
    assert loop_area(loops[0]) == pytest.approx(0.5, abs=1e-6)
