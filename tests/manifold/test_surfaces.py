"""Sets of polynomial structures: surfaces known by name, over random boxes and grids."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from draws import few
from equimorph.manifold import equilibrium_set
from equimorph.manifold.lifting import completeness, spread
from equimorph.manifold.lifting.seeds import seeds
from equimorph.model import Box, Descriptor
from oracles.complexes import assert_faithful, assert_folds_are_singular
from oracles.polynomial import Polynomial, Sum, bead_on_a_circle
from oracles.surfaces import (
    cusp,
    integral,
    sphere,
    swallowtail,
    three_sheets,
    torus,
)
from typecheck import unchecked

intervals = st.tuples(st.integers(3, 9), st.integers(3, 9))
# round numbers, which put grid lines through cusps and vertices on folds, on purpose
sizes = st.integers(2, 20).map(lambda tenths: tenths / 10)


def lifted(structure, box, checks=0, **options):
    """Set without checks of shapes, which the tests that lift by `equilibrium_set` make."""
    with unchecked():
        return equilibrium_set(structure, box, checks=checks, **options)


def topology(eset):
    audit = eset.audit
    assert audit.missing == 0
    return audit.components, audit.euler_characteristic, len(eset.boundaries)


@few(3)
@given(st.tuples(sizes, sizes, sizes, sizes), intervals)
def test_cusp_is_a_disc_with_one_fold_curve(box, grid):
    """b = −x³ − a x is a graph over (x, a); a box meets a = −3x², b = 2x³ in one piece."""
    left, right, below, above = box
    eset = lifted(cusp(), Box(a=(-left, right), b=(-below, above)), intervals=grid)
    assert_faithful(eset)
    assert topology(eset) == (1, 1, 1)
    assert len(eset.folds) == 1
    x, a, b = eset.points.z[:, 0], eset.points["a"], eset.points["b"]
    folded = eset.kinds == 1
    np.testing.assert_allclose(a[folded], -3 * x[folded] ** 2, rtol=0, atol=1e-9)
    np.testing.assert_allclose(b[folded], 2 * x[folded] ** 3, rtol=0, atol=1e-9)
    # a fold vertex on an edge along b lies on a side of the box where the curve leaves it
    ends = eset.folds[0][[0, -1]]
    reach = min(np.sqrt(left / 3), np.cbrt(above / 2)), min(np.sqrt(left / 3), np.cbrt(below / 2))
    assert sorted(x[ends]) == pytest.approx([-reach[1], reach[0]], rel=1e-8)


def test_cusp_cut_below_its_point_has_two_fold_curves():
    """Over a < 0 the folds x = ±√(−a/3) are apart."""
    eset = lifted(cusp(), Box(a=(-2, -0.5), b=(-3, 3)), checks=2, intervals=(5, 8))
    assert_faithful(eset)
    assert topology(eset) == (1, 1, 1)
    assert len(eset.folds) == 2
    assert [stratum.index for stratum in eset.strata].count(0) == 2


def test_cusp_without_its_folds_is_one_stable_sheet():
    eset = equilibrium_set(cusp(), Box(a=(0.5, 2), b=(-1, 1)), intervals=(4, 4))
    assert_faithful(eset)
    assert eset.folds == ()
    assert len(eset.strata) == 1
    assert (eset.cell_index == 0).all()


@few(3)
@given(intervals)
def test_swallowtail_is_a_disc_with_one_fold_curve_with_two_cusps(grid):
    """c = −(x⁴ − x² + b x), folds b = 2x − 4x³: the curve turns at x = ±1/√6."""
    eset = lifted(swallowtail(), Box(b=(-1, 1), c=(-1, 1.5)), fixed={"a": -1}, intervals=grid)
    assert_faithful(eset)
    assert topology(eset) == (1, 1, 1)
    assert len(eset.folds) == 1
    x = eset.points.z[:, 0]
    folded = eset.kinds == 1
    wanted = 2 * x[folded] - 4 * x[folded] ** 3
    np.testing.assert_allclose(eset.points["b"][folded], wanted, rtol=0, atol=1e-9)
    assert (np.diff(x[eset.folds[0]]) > 0).all() or (np.diff(x[eset.folds[0]]) < 0).all()


@few(3)
@given(intervals)
def test_three_sheets_that_never_meet_are_three_discs(grid):
    eset = lifted(three_sheets(), Box(a=(-2, 1), b=(-1.5, 1.5)), intervals=grid)
    assert_faithful(eset)
    assert topology(eset) == (3, 3, 3)
    assert eset.folds == ()
    assert sorted(component.indices for component in eset.components) == [(0,), (0,), (1,)]
    assert {component.euler_characteristic for component in eset.components} == {1}
    assert {component.cells for component in eset.components} == {2 * grid[0] * grid[1]}


def test_sheets_that_the_seeds_lack_are_found_by_the_checks(monkeypatch):
    """Without seeds but one, the independent checks bring the other two sheets in."""

    def first(*given):
        return tuple(column[:1] for column in seeds(*given))

    monkeypatch.setattr(spread, "seeds", first)
    eset = lifted(three_sheets(), Box(a=(-2, 1), b=(-1.5, 1.5)), intervals=(4, 5), checks=2)
    assert topology(eset) == (3, 3, 3)
    assert eset.audit.recovered >= 2
    assert eset.audit.clean


def test_all_points_are_searched_once_nothing_is_missing(monkeypatch):
    """Of eight points two come first; where something is missing there, the others wait."""
    searched = []

    def counted(eset, places, seed):
        found = search(eset, places, seed)
        searched.append((len(places), len(found.missing)))
        return found

    search = completeness._searched
    monkeypatch.setattr(completeness, "_searched", counted)
    monkeypatch.setattr(spread, "seeds", lambda *given: tuple(each[:1] for each in seeds(*given)))
    eset = lifted(three_sheets(), Box(a=(-2, 1), b=(-1.5, 1.5)), intervals=(4, 5), checks=8)
    assert eset.audit.clean
    *before, first, last = searched
    assert before
    assert all(points == 2 for points, _ in before)
    assert before[0][1] > 0
    assert (first, last) == ((2, 0), (6, 0))
    assert eset.audit.starts == 8 * 200 * three_sheets().guesses_per_start


def island(radius: float, places: tuple[float, ...]) -> Polynomial:
    """x² + (a − a₀)² + (b − b₀)² + … = r², over as many parameters as there are places."""

    def energy(x: Sum, *parameters: Sum) -> Sum:
        force = x**2 - radius**2
        for each, place in zip(parameters, places, strict=True):
            force = force + (each - place) ** 2
        return integral(force)

    return Polynomial(energy, 1, ("a", "b", "c")[: len(places)])


@pytest.mark.parametrize(
    ("radius", "places", "euler"),
    [
        pytest.param(0.1, (0.1,), 0, marks=pytest.mark.slow),
        (0.07, (0.1, 0.2), 2),
        pytest.param(0.3, (0.1, 0.2), 2, marks=pytest.mark.slow),
        pytest.param(0.2, (0.1, 0.2, 0.3), 0, marks=pytest.mark.slow),
    ],
)
def test_islands_between_grid_lines_are_found(radius, places, euler):
    """Intervals are 0.8 long: the random states of the checks find the island, bisection shows it.

    Closed curve, sphere and three-sphere: Euler characteristic 0, 2 and 0.
    """
    names = ("a", "b", "c")[: len(places)]
    box = Box(**dict.fromkeys(names, (-2.0, 2.0)))
    eset = lifted(island(radius, places), box, intervals=(5,) * len(places), checks=1)
    assert eset.audit.clean, eset.audit
    assert topology(eset) == (1, euler, 0)
    assert len(eset.folds) == (2 if len(places) == 1 else 1)


@few(3)
@given(st.tuples(st.integers(6, 20), st.integers(6, 20)))
def test_sphere_is_closed_with_one_closed_fold(grid):
    eset = lifted(sphere(), Box(a=(-1.3, 1.2), b=(-1.5, 1.5)), intervals=grid)
    assert_faithful(eset)
    assert topology(eset) == (1, 2, 0)
    assert len(eset.folds) == 1
    assert eset.folds[0][0] == eset.folds[0][-1]
    equator = eset.coordinates[eset.kinds == 1]
    np.testing.assert_allclose((equator**2).sum(axis=1), 1.0, rtol=1e-12)


@pytest.mark.parametrize("tilt", [0.0, 0.5, 1.2])
def test_torus_is_closed_orientable_and_of_characteristic_zero(tilt):
    """Two closed fold curves; with a tilt the inner one has cusps where a plane is touched."""
    eset = lifted(torus(tilt), Box(a=(-1.7, 1.6), b=(-1.5, 1.5)), intervals=(12, 12))
    assert_faithful(eset)
    assert topology(eset) == (1, 0, 0)
    assert [bool(fold[0] == fold[-1]) for fold in eset.folds] == [True, True]


def test_bead_on_a_circle_has_an_annulus_folded_along_the_astroid():
    """h = (1 + λ) cos φ, g = λ sin φ: a cylinder (φ, λ), cut by the box at both ends."""
    eset = equilibrium_set(
        bead_on_a_circle(), Box(h=(-1.5, 1.4), g=(-1.3, 1.5)), intervals=(9, 9), checks=0
    )
    assert_faithful(eset)
    assert_folds_are_singular(eset, 1e-8)
    assert topology(eset) == (1, 0, 2)
    assert len(eset.folds) == 1
    h, g = eset.coordinates[eset.kinds == 1].T
    np.testing.assert_allclose(np.cbrt(h**2) + np.cbrt(g**2), 1.0, rtol=1e-8)


def test_constraint_cuts_a_set_off_along_itself():
    """x ≤ 0.4 cuts the sphere above: a disc whose boundary lies on the constraint."""
    ball = sphere()
    x = Descriptor("x", "1", lambda z, _: z[:, 0].copy())
    eset = lifted(ball, Box(a=(-1.3, 1.2), b=(-1.5, 1.5)), within=[x <= 0.4], intervals=(11, 13))
    assert_faithful(eset)
    assert topology(eset) == (1, 1, 1)
    assert eset.boundaries[0].kind == "cap"
    np.testing.assert_allclose(x(eset.points)[eset.boundaries[0].vertices], 0.4, atol=1e-10)


def test_constraint_can_cut_folds():
    """x + a ≤ 0.3 cuts the sphere obliquely: the fold ends on the constraint, in corners."""
    ball = sphere()
    slant = Descriptor("x + a", "1", lambda z, p: z[:, 0] + p[:, 0])
    eset = equilibrium_set(
        ball, Box(a=(-1.3, 1.2), b=(-1.5, 1.5)), within=[slant <= 0.3], intervals=(11, 13)
    )
    assert_faithful(eset)
    assert topology(eset) == (1, 1, 1)
    assert len(eset.folds) == 1
    ends = eset.folds[0][[0, -1]]
    assert (eset.kinds[ends] == 4).all()
    np.testing.assert_allclose(eset.points["a"][ends], 0.3, atol=1e-8)
    assert_folds_are_singular(eset, 1e-7)


def test_constraint_that_is_never_active_changes_nothing():
    x = Descriptor("x", "1", lambda z, _: z[:, 0].copy())
    box = Box(a=(-1.3, 1.2), b=(-1.5, 1.5))
    free = lifted(sphere(), box, intervals=(9, 9))
    held = lifted(sphere(), box, within=[x <= 5.0], intervals=(9, 9))
    assert np.array_equal(free.cells, held.cells)
    assert np.array_equal(free.points.z, held.points.z)


def test_set_without_equilibria_is_empty_and_says_so():
    eset = equilibrium_set(sphere(), Box(a=(1.2, 2.0), b=(1.2, 2.0)), intervals=(3, 3))
    assert len(eset.cells) == len(eset.points) == 0
    assert eset.components == eset.strata == eset.boundaries == eset.folds == ()
    assert eset.audit.clean
    assert eset.audit.checked == 0


def test_same_seed_gives_the_same_set():
    box = Box(a=(-2, 1), b=(-1.5, 1.5))
    first = lifted(cusp(), box, intervals=(6, 7))
    again = lifted(cusp(), box, intervals=(6, 7))
    assert np.array_equal(first.cells, again.cells)
    assert np.array_equal(first.points.z, again.points.z)
    assert first.audit == again.audit
