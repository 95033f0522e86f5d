"""Sets over one parameter, bifurcation diagrams: curves known in closed form, and the arch."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from draws import few
from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.model import Box, Descriptor
from equimorph.structures import Rod, Spring
from oracles.complexes import assert_faithful, assert_folds_are_singular
from oracles.polynomial import fold_form, pitchfork_form
from oracles.surfaces import cusp, sphere, swallowtail
from typecheck import unchecked

grids = st.integers(2, 12).map(lambda n: (n,))


def lifted(structure, box, checks=0, **options) -> EquilibriumSet:
    """Diagram without checks of shapes, which one test that lifts by `equilibrium_set` makes."""
    with unchecked():
        return equilibrium_set(structure, box, checks=checks, **options)


def topology(eset: EquilibriumSet) -> list[tuple[int, int]]:
    """Characteristic and number of ends of every curve: (1, 2) for a line, (0, 0) for a circle."""
    return sorted((piece.euler_characteristic, piece.loops) for piece in eset.components)


def fold_points(eset: EquilibriumSet) -> np.ndarray:
    """Unknown and parameter at the folds, sorted."""
    at = np.concatenate(eset.folds) if eset.folds else np.zeros(0, int)
    rows = np.stack([eset.points.z[at, 0], eset.coordinates[at, 0]], axis=1)
    return rows[np.argsort(rows[:, 0])]


def test_fold_joins_a_stable_and_an_unstable_branch():
    """x² = a: one curve, with its fold at the origin."""
    eset = equilibrium_set(fold_form(), Box(a=(-1, 1)), intervals=(7,))
    assert_faithful(eset)
    assert topology(eset) == [(1, 2)]
    np.testing.assert_allclose(fold_points(eset), [[0.0, 0.0]], atol=1e-12)
    assert eset.components[0].indices == (0, 1)
    assert [piece.kind for piece in eset.boundaries] == ["box", "box"]
    assert np.sort(eset.at(a=0.25).z[:, 0]) == pytest.approx([-0.5, 0.5], rel=1e-12)


@few(5)
@given(st.floats(-0.9, 0.9), grids)
def test_isola_is_closed_with_two_folds(b, grid):
    """x² + a² = 1 − b², which natural states do not reach along b."""
    eset = lifted(sphere(), Box(a=(-1.5, 1.6)), fixed={"b": b}, intervals=grid, checks=1)
    assert_faithful(eset)
    assert topology(eset) == [(0, 0)]
    assert eset.boundaries == ()
    radius = np.sqrt(1 - b**2)
    assert np.sort(fold_points(eset)[:, 1]) == pytest.approx([-radius, radius], rel=1e-12)


@few(5)
@given(st.floats(0.2, 2.0), grids)
def test_hysteresis_has_two_folds(a, grid):
    """x³ − a x + b = 0 folds at x = ±√(a/3)."""
    eset = lifted(cusp(), Box(b=(-3.0, 3.1)), fixed={"a": -a}, intervals=grid)
    assert_faithful(eset)
    assert topology(eset) == [(1, 2)]
    x = np.sqrt(a / 3) * np.array([-1, 1])
    np.testing.assert_allclose(fold_points(eset), np.stack([x, a * x - x**3], 1), atol=1e-9)
    assert len(eset.strata) == 3


@few(5)
@given(st.floats(0.02, 0.5), grids)
def test_imperfect_pitchfork_has_a_fold_apart_from_the_main_branch(b, grid):
    """x³ − a x = b: the side branch folds at x = −∛(b/2), a = 3x²."""
    eset = lifted(pitchfork_form(1), Box(a=(-1.5, 3.1)), fixed={"b": b}, intervals=grid)
    assert_faithful(eset)
    assert topology(eset) == [(1, 2), (1, 2)]
    x = -np.cbrt(b / 2)
    np.testing.assert_allclose(fold_points(eset), [[x, 3 * x**2]], rtol=0, atol=1e-9)


@few(5)
@given(grids)
def test_folds_within_one_interval_are_told_apart(grid):
    """c = x² − x⁴ − x/5 over c: three folds, where 4x³ − 2x + 1/5 = 0."""
    eset = lifted(swallowtail(), Box(c=(-3, 1.5)), fixed={"a": -1.0, "b": 0.2}, intervals=grid)
    assert_faithful(eset)
    x = np.sort(np.roots([4, 0, -2, 0.2]).real)
    np.testing.assert_allclose(fold_points(eset)[:, 0], x, rtol=0, atol=1e-9)


def test_constraint_cuts_a_closed_curve():
    """x ≤ 0.4 on the circle."""
    x = Descriptor("x", "1", lambda z, _: z[:, 0].copy())
    box = Box(a=(-1.5, 1.6))
    eset = lifted(sphere(), box, fixed={"b": 0.3}, within=[x <= 0.4], intervals=(7,))
    assert_faithful(eset)
    assert topology(eset) == [(1, 2)]
    ends = [int(piece.vertices[0]) for piece in eset.boundaries]
    assert [piece.kind for piece in eset.boundaries] == ["cap", "cap"]
    np.testing.assert_allclose(x(eset.points)[ends], 0.4, rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    ("box", "fixed"),
    [(Box(F=(-0.5, 0.5)), {"x_l": 0.7}), (Box(x_l=(0.3, 1.3)), {"F": 0.05})],
    ids=["load", "actuator"],
)
def test_spring_along_its_load_and_along_its_actuator(box, fixed):
    """Folds on x_l = cos³ δ."""
    eset = lifted(Spring(), box, fixed=fixed, intervals=(20,), checks=1)
    assert_faithful(eset)
    at = np.concatenate(eset.folds)
    delta = eset.points.z[at, 0]
    np.testing.assert_allclose(eset.points["x_l"][at], np.cos(delta) ** 3, rtol=0, atol=1e-9)


def test_arch_along_its_load_folds_where_it_snaps():
    """Q_s, (Θ, Δ) = (0.9, 0.02): the fold of the natural path is at q = 3.9485039281."""
    arch = Rod()
    eset = lifted(
        arch,
        Box(q=(0, 6)),
        fixed={"Theta": 0.9, "Delta": 0.02},
        within=[arch.max_curvature <= 20],
        intervals=(30,),
    )
    assert_faithful(eset)
    assert_folds_are_singular(eset, 1e-8)
    loads = fold_points(eset)[:, 1]
    assert np.abs(loads - 3.9485039281).min() < 1e-9
    natural = eset.at(q=0.0)
    assert natural.index[0] == 0
