"""Constraints with kinks on coarse grids: every cell is that of its own sheet, and upright."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from draws import few
from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.manifold.complex.description import contradictions, overturned_off_folds
from equimorph.manifold.geometry.topology import adjacency, senses
from equimorph.model import Box, Constraint, Descriptor
from oracles.complexes import SINGULAR, assert_faithful
from oracles.polynomial import Polynomial
from oracles.surfaces import integral
from typecheck import unchecked

BOX = Box(a=(-1.3, 1.2), b=(-1.5, 1.4), c=(-1.4, 1.3))
weights = st.tuples(*(st.floats(0.3, 2.5) for _ in range(3)))
bounds = st.floats(0.2, 0.9)
coarse = st.tuples(*(st.integers(2, 5) for _ in range(3)))


def ball() -> Polynomial:
    """x² + a² + b² + c² = 1: a three-sphere, folded along the sphere x = 0."""
    return Polynomial(lambda x, a, b, c: integral(x**2 + a**2 + b**2 + c**2 - 1.0), 1, "abc")


def ridge_of(w):
    """x + w₁|a| + w₂|b|: a convex set is left, with two edges."""
    return lambda z, p: z[:, 0] + w[0] * np.abs(p[:, 0] - 0.1) + w[1] * np.abs(p[:, 1] + 0.2)


def roof_of(w):
    """The larger of two slanted planes."""
    return lambda z, p: np.maximum(
        z[:, 0] + w[0] * p[:, 0], z[:, 0] - w[1] * p[:, 1] + w[2] * p[:, 2]
    )


def valley_of(w):
    """The smaller of two slanted planes: what is left is not convex."""
    return lambda z, p: np.minimum(z[:, 0] + w[0] * p[:, 0], z[:, 0] - w[1] * p[:, 1])


def cut_off(shape, weights, bound, grid) -> tuple[EquilibriumSet, Constraint]:
    constraint = Descriptor("kinked", "1", shape(weights)) <= bound
    with unchecked():
        return equilibrium_set(
            ball(), BOX, intervals=grid, within=[constraint], checks=0
        ), constraint


def assert_upright_off_folds(eset: EquilibriumSet) -> None:
    """Cells of one index project with one sense: there parameters are coordinates of the set.

    Those at folds that do not are few, up to 31 of 2950 on 2 × 2 × 2 intervals, and slivers: less
    than a thousandth of the volume.
    """
    sense = senses(eset.cells, eset.cell_index, eset.coordinates, adjacency(eset.cells))
    folded = np.isin(eset.kinds[eset.cells], SINGULAR).any(axis=1)
    assert not sense.overturned[~folded].any()
    assert sense.overturned.mean() < 0.011
    corners = eset.coordinates[eset.cells]
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    assert volume[sense.overturned].sum() < 1e-3 * volume.sum()


def assert_counts(eset: EquilibriumSet, constraint: Constraint) -> None:
    """Over random points: as many states as x = ±√(1 − a² − b² − c²) that obey the constraint."""
    p = np.random.default_rng(5).uniform(BOX.lower, BOX.upper, (400, 3))
    with unchecked():
        found = eset.over(a=p[:, 0], b=p[:, 1], c=p[:, 2])
    height = 1.0 - (p**2).sum(axis=1)
    x = np.sqrt(np.maximum(height, 0.0))
    wanted = np.zeros(len(p), int)
    for z in (x, -x):
        wanted += (height > 0) & (constraint.excess(z[:, None], p) <= 0.0)
    # coarse cells miss slivers at folds and beside kinks
    assert np.mean([len(each.states) for each in found] == wanted) > 0.97


def assert_right(shape, weights, bound, grid) -> None:
    eset, constraint = cut_off(shape, weights, bound, grid)
    assert_faithful(eset)
    assert_upright_off_folds(eset)
    assert_counts(eset, constraint)


@pytest.mark.parametrize(
    ("shape", "weights", "bound", "grid"),
    [
        (ridge_of, (0.8, 1.8, 0.9), 0.5, (2, 3, 3)),
        # two folds end on one lid, both of one fold surface
        (ridge_of, (1.0659283835396909, 0.7549, 0.973), 0.618, (2, 5, 4)),
        (roof_of, (1.1, 0.8, 1.5), 0.36, (2, 2, 5)),
        (valley_of, (0.6, 0.8, 0.5), 0.4, (3, 3, 3)),
    ],
)
def test_kinks_cut_the_three_sphere_without_wrong_cells(shape, weights, bound, grid):
    assert_right(shape, weights, bound, grid)


@pytest.mark.slow
@pytest.mark.parametrize("shape", [ridge_of, roof_of, valley_of])
@few(12)
@given(weights, bounds, coarse)
def test_random_kinks_cut_the_three_sphere_without_wrong_cells(shape, weights, bound, grid):
    assert_right(shape, weights, bound, grid)


def test_the_audit_names_cells_of_a_wrong_index_and_sense():
    """Of a clean set, one vertex is exchanged for that on the other sheet, or moved across."""
    eset, _ = cut_off(roof_of, (1.1, 0.8, 1.5), 0.36, (2, 2, 5))
    regular = ~np.isin(eset.kinds, SINGULAR)
    own = np.flatnonzero(regular & (np.abs(eset.points.z[:, 0]) > 0.1))[0]
    points = replace(eset.points, z=eset.points.z.copy())
    points.z[own] *= -1.0
    bad = contradictions(points, eset.kinds, eset.cells, eset.cell_index)
    assert np.array_equal(bad, (eset.cells == own).any(axis=1))
    assert not contradictions(eset.points, eset.kinds, eset.cells, eset.cell_index).any()
    # a point pushed through the opposite facet turns its cell over
    sense = senses(eset.cells, eset.cell_index, eset.coordinates, adjacency(eset.cells))
    inner = np.flatnonzero(regular[eset.cells].all(axis=1))
    place = eset.coordinates.copy()
    corners = place[eset.cells[inner]]
    # slivers do not count: the largest one is none
    cell = inner[np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).argmax()]
    corners = place[eset.cells[cell]]
    place[eset.cells[cell, 0]] = 2 * corners[1:].mean(axis=0) - corners[0]
    turned = senses(eset.cells, eset.cell_index, place, adjacency(eset.cells)).overturned
    assert overturned_off_folds(eset.kinds, eset.cells, turned, place)[cell]
    assert not overturned_off_folds(
        eset.kinds, eset.cells, sense.overturned, eset.coordinates
    ).any()
