"""The triangulation of the parameter box: conforming, filling, off lines of symmetry."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from equimorph.manifold.complex.base_mesh import BaseMesh
from equimorph.manifold.geometry.topology import adjacency, euler_characteristic, projected_volume
from equimorph.manifold.lifting.grid import (
    MARGIN,
    SHIFT,
    bisect,
    coarse_grid,
    grid_lines,
    grid_mesh,
)
from equimorph.model import Box

BOX = Box(a=(-1.0, 2.0), b=(-2.0, 2.0))


def regular(*intervals: int) -> BaseMesh:
    return grid_mesh(grid_lines(BOX, intervals))


def assert_conforming(mesh: BaseMesh) -> None:
    """Positive areas that fill the box, every inner edge with two triangles, a disc."""
    areas = projected_volume(mesh.vertices, mesh.triangles)
    assert areas.min() > 0
    assert areas.sum() == pytest.approx(12.0, rel=1e-13)
    whole = adjacency(mesh.triangles)
    assert whole.counts.max() == 2
    assert euler_characteristic(mesh.triangles) == 1
    once = mesh.vertices[whole.facets[whole.counts == 1]]
    on_side = (once == BOX.lower).all(axis=1) | (once == BOX.upper).all(axis=1)
    assert on_side.any(axis=1).all()
    for k in range(3):
        ends = np.sort(mesh.triangles[:, [k, (k + 1) % 3]], axis=1)
        assert np.array_equal(ends, np.sort(mesh.edges[mesh.sides[:, k]], axis=1))


@given(st.integers(2, 9), st.integers(2, 9))
def test_grid_mesh_conforms(n, m):
    mesh = regular(n, m)
    assert len(mesh.triangles) == 2 * n * m
    assert_conforming(mesh)


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_bisected_mesh_conforms(seed):
    """Also after many bisections of random edges."""
    generator = np.random.default_rng(seed)
    mesh = regular(3, 4)
    for _ in range(5):
        used = np.unique(mesh.sides)
        mesh = bisect(mesh, generator.choice(used, 6, replace=False))
        assert_conforming(mesh)


def test_bisected_edges_keep_the_numbers_of_the_others():
    mesh = regular(3, 4)
    finer = bisect(mesh, np.array([5]))
    assert np.array_equal(finer.edges[: len(mesh.edges)], mesh.edges)
    assert np.array_equal(finer.vertices[: len(mesh.vertices)], mesh.vertices)
    assert 5 not in finer.sides


def test_grid_lines_keep_off_a_line_of_symmetry():
    mesh = regular(4, 8)
    assert np.abs(mesh.vertices[:, 1]).min() > 0.05


def test_bisection_keeps_off_a_line_of_symmetry():
    mesh = regular(3, 3)
    ends = mesh.vertices[mesh.edges][:, :, 1]
    across = np.flatnonzero(np.abs(ends.sum(axis=1)) < 1e-12)
    assert len(across)
    finer = bisect(mesh, across[:1])
    assert np.abs(finer.vertices[:, 1]).min() > 0.05


def test_grid_lines_of_a_symmetric_range_are_mirror_images():
    mesh = regular(4, 9)
    lines = np.unique(mesh.vertices[:, 1])
    assert np.abs(lines + lines[::-1]).max() < 1e-15


def test_grid_lines_are_shifted_a_little_but_not_the_sides_of_the_box():
    """None of these lies on a line of symmetry."""
    lines = np.unique(regular(7, 9).vertices[:, 0])
    shift = np.abs(lines - np.linspace(-1.0, 2.0, 8))
    assert shift[0] == shift[-1] == 0.0
    assert 0.0 <= shift[1:-1].min() <= shift.max() <= SHIFT * 3.0 / 7.0


@given(st.floats(-1.0, 2.0), st.floats(-2.0, 2.0))
def test_locate_finds_the_triangle_around_a_point(a, b):
    mesh = regular(5, 6)
    corners = mesh.vertices[mesh.triangles[mesh.locate(np.array([a, b]))]]
    weights = np.linalg.solve(np.vstack([corners.T, np.ones(3)]), np.array([a, b, 1.0]))
    assert weights.min() > -1e-12


@given(st.integers(2, 40), st.integers(2, 40), st.integers(1, 15))
def test_coarse_grid_shares_vertices_with_the_grid_and_reaches_beyond_it(n, m, intervals):
    """By a fifth of the box, but not beyond half the way to a limit of a parameter's meaning."""
    lines = grid_lines(BOX, (n, m))
    limits = np.array([[-1.1, -np.inf], [np.inf, np.inf]])
    coarse, number = coarse_grid(lines, intervals, limits)
    fine = grid_mesh(lines)
    shared = number >= 0
    assert np.array_equal(coarse.vertices[shared], fine.vertices[number[shared]])
    own = (min(n, intervals) + 1) * (min(m, intervals) + 1)
    assert np.count_nonzero(shared) == len(np.unique(number[shared])) == own
    assert np.allclose(coarse.vertices.min(axis=0), [-1.05, -2.0 - 4.0 * MARGIN])
    assert np.allclose(coarse.vertices.max(axis=0), [2.0 + 3.0 * MARGIN, 2.0 + 4.0 * MARGIN])
    assert projected_volume(coarse.vertices, coarse.triangles).min() > 0
