"""Maps as pictures: faces cut along jumps, curves by kind, the hatched rest."""

import numpy as np
import pytest

import equimorph as em
from equimorph import plotting
from equimorph.plotting.map_faces import faces

AXIS = np.linspace(0.0, 3.0, 4)


def area(polygon):
    x, y = polygon.T
    return 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def test_a_map_without_jumps_is_all_triangles():
    found = faces((AXIS, AXIS), np.ones((4, 4)), np.empty((0, 2)))
    assert len(found.triangles) == 18
    assert not found.pieces


def test_cells_are_cut_along_a_jump_and_keep_the_values_of_their_sides():
    """A jump on x = 1.25: the three cells that it crosses fall into a quarter and three."""
    value = np.where(AXIS[:, None] < 1.25, 1.0, 5.0) * np.ones((4, 4))
    cuts = np.array([[1.25, y] for y in AXIS])
    found = faces((AXIS, AXIS), value, cuts)
    assert len(found.triangles) == 12
    sizes = sorted((round(area(p), 12), v) for p, v in zip(found.pieces, found.values, strict=True))
    assert sizes == [(0.25, 1.0)] * 3 + [(0.75, 5.0)] * 3


def test_cells_end_at_the_edge_of_definition():
    """Defined below x + y = 2.5 only: a triangle of half the square of 2.5, less nothing."""
    x, y = np.meshgrid(AXIS, AXIS, indexing="ij")
    value = np.where(x + y < 2.5, 1.0, np.nan)
    cuts = np.array([[0, 2.5], [1, 1.5], [2, 0.5], [0.5, 2], [1.5, 1], [2.5, 0]], dtype=float)
    found = faces((AXIS, AXIS), value, cuts)
    covered = 0.5 * len(found.triangles) + sum(map(area, found.pieces))
    assert covered == pytest.approx(2.5**2 / 2, rel=1e-12)


@pytest.fixture(scope="module")
def lmap():
    rod = em.Rod()
    grid = em.Grid(Theta=(0.4, 1.4, 5), Delta=(-1.5, 1.5, 11))
    return em.limit_load_map(rod, grid, "q", within=[rod.max_curvature <= 10])


def test_a_limit_load_map_is_labelled_and_its_curves_are_drawn(lmap):
    ax = plotting.load_map(lmap)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Θ (rad)", "Δ (rad)")
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels[0] == "jump: two folds merge"
    assert labels[-1] == "undefined"
    drawn = [np.column_stack(line.get_data()) for line in ax.lines]
    for curve in lmap.curves:
        if len(curve.points) > 1:
            assert any(np.array_equal(curve.points, line) for line in drawn)


def test_a_map_is_saved_in_both_formats(lmap, tmp_path):
    files = plotting.save(plotting.load_map(lmap), tmp_path, "map")
    assert [file.suffix for file in files] == [".png", ".svg"]
    assert all(file.stat().st_size > 10_000 for file in files)


def test_a_curvature_map_dots_what_snaps_and_draws_barriers():
    rod = em.Rod()
    grid = em.Grid(Theta=(0.4, 1.2, 4), Delta=(-1.0, 1.0, 10))
    cmap = em.curvature_map(rod, grid, "q", 2.5)
    ax = plotting.curvature_map(cmap)
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels[0] == "barrier: fold"
    assert labels[-1] == "snaps on the way"
    assert any(axes.get_ylabel() == "max |κ| (1/L) at $q$ = 2.5" for axes in ax.figure.axes)


def test_stripes_mark_where_the_rod_leaves_its_plane_first():
    """A round rod does so nearly everywhere; the dots' entry has no place."""
    rod = em.Rod(torsion=0.77, lateral=1.0)
    grid = em.Grid(Theta=(0.8, 1.0, 2), Delta=(-0.1, 0.1, 2))
    within = [rod.max_curvature <= 10, rod.stable_in_space]
    ax = plotting.load_map(em.limit_load_map(rod, grid, "q", within=within))
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["leaves its plane first"]
