"""Refined sets: closed forms tell how far cells are from surfaces; topology must not change."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, strategies as st

from draws import few
from equimorph.errors import InputError
from equimorph.manifold import equilibrium_set, refine
from equimorph.manifold.complex.description import Complex
from equimorph.manifold.complex.edge_points import Places, on_edges, unmet
from equimorph.manifold.complex.excerpts import fabric_of
from equimorph.manifold.complex.marked_complex import Fabric, FacetMark, _bisect, edges_of
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.simplices import volumes
from equimorph.manifold.geometry.topology import adjacency, chains, euler_characteristic
from equimorph.manifold.queries.cusps import with_cusps_beside
from equimorph.manifold.refining.bisect import follow_edge
from equimorph.manifold.refining.deviation import Memory
from equimorph.manifold.refining.patches import patch_around
from equimorph.manifold.refining.quality import qualities_near, smallest_angle, smallest_angles
from equimorph.manifold.refining.refill import flip, refill, repeat
from equimorph.manifold.refining.vertex_stars import moves
from equimorph.model import Box, Descriptor
from equimorph.structures import Rod
from oracles.complexes import (
    assert_faithful,
    assert_folds_are_singular,
    assert_upright,
    farthest,
)
from oracles.polynomial import bead_on_a_circle, fold_form
from oracles.surfaces import cusp, sphere, swallowtail, torus
from typecheck import unchecked


def lifted(structure, box, intervals):
    with unchecked():
        return equilibrium_set(structure, box, checks=0, intervals=intervals)


def refined(eset, accuracy):
    with unchecked():
        return refine(eset, accuracy)


def topology(eset):
    pieces = sorted((c.euler_characteristic, c.loops, c.indices) for c in eset.components)
    return pieces, sorted(stratum.index for stratum in eset.strata), len(eset.folds)


def inside_cells(eset, seed=0):
    """A random point of every cell, in the embedding of a structure with one unknown."""
    place = np.concatenate([eset.points.z[:, :1], eset.coordinates], axis=1)
    weights = np.random.default_rng(seed).dirichlet(np.ones(eset.cells.shape[1]), len(eset.cells))
    return np.einsum("ck,ckd->cd", weights, place[eset.cells])


@few(4)
@given(st.tuples(st.integers(6, 10), st.integers(6, 10)), st.floats(0.004, 0.1))
def test_cells_of_the_refined_sphere_are_within_the_accuracy(grid, accuracy):
    """Distance from the unit sphere: | |x| − 1 |."""
    eset = lifted(sphere(), Box(a=(-1.3, 1.2), b=(-1.5, 1.5)), grid)
    fine = refined(eset, accuracy)
    assert_faithful(fine)
    assert_upright(fine)
    assert_folds_are_singular(fine, 1e-8)
    assert topology(fine) == topology(eset)
    assert np.abs(np.linalg.norm(inside_cells(fine), axis=1) - 1.0).max() <= accuracy
    assert fine.audit.deviation <= accuracy
    equator = fine.coordinates[fine.kinds == 1]
    np.testing.assert_allclose((equator**2).sum(axis=1), 1.0, rtol=1e-12)


def test_number_of_vertices_grows_inversely_with_the_accuracy():
    """Cells of size h deviate by h²: a hundredth of the deviation takes a hundred times the cells.

    A quarter more or less for vertices that the lifted grid has in excess.
    """
    eset = lifted(sphere(), Box(a=(-1.3, 1.2), b=(-1.5, 1.5)), (7, 8))
    coarse, fine = refined(eset, 0.02), refined(eset, 0.002)
    assert len(fine.points) / len(coarse.points) == pytest.approx(10.0, rel=0.25)


@pytest.mark.parametrize("accuracy", [0.1, 0.01])
def test_refined_torus_keeps_its_topology_and_has_no_slivers(accuracy):
    eset = lifted(torus(0.5), Box(a=(-1.7, 1.6), b=(-1.5, 1.5)), (12, 12))
    fine = refined(eset, accuracy)
    assert_faithful(fine)
    assert_upright(fine)
    assert topology(fine) == topology(eset)
    assert fine.audit.smallest_angle > 15.0


def test_folds_and_sides_of_the_box_carry_the_new_vertices_on_them():
    """a = −3x², b = 2x³ on the fold of the cusp; the boundary stays on the box."""
    eset = lifted(cusp(), Box(a=(-2, 1), b=(-3, 3)), (7, 8))
    fine = refined(eset, 0.001)
    assert_faithful(fine)
    assert_upright(fine)
    x, folded = fine.points.z[:, 0], fine.kinds == 1
    assert folded.sum() > 2 * (eset.kinds == 1).sum()
    np.testing.assert_allclose(fine.points["a"][folded], -3 * x[folded] ** 2, rtol=0, atol=1e-9)
    np.testing.assert_allclose(fine.points["b"][folded], 2 * x[folded] ** 3, rtol=0, atol=1e-9)
    at = fine.folds[0]
    a, b = fine.points["a"][at], fine.points["b"][at]
    middle = 0.5 * (x[at][1:] + x[at][:-1])
    off = np.hypot(0.5 * (a[1:] + a[:-1]) + 3 * middle**2, 0.5 * (b[1:] + b[:-1]) - 2 * middle**3)
    assert off.max() < 0.001 * 2.0  # it is measured at the chord's x, not across the curve


@pytest.mark.slow
@few(4)
@given(st.booleans(), st.tuples(st.integers(4, 9), st.integers(4, 9)))
def test_no_cell_is_folded_over_beside_cusps(several, grid):
    """There folds run along what vanishes in the parameters, and the outer sheet goes round."""
    form, box, fixed = cusp(), Box(a=(-2, 0.9), b=(-1.7, 1.9)), {}
    if several:
        form, box, fixed = swallowtail(), Box(b=(-1.7, 1.9), c=(-1, 0.7)), {"a": -1.0}
    with unchecked():
        eset = equilibrium_set(form, box, fixed=fixed, checks=0, intervals=grid)
    fine = refined(eset, 0.01)
    assert_faithful(fine)
    assert_upright(fine)
    assert topology(fine) == topology(eset)
    assert fine.audit.smallest_angle > 3.0


def test_constraints_carry_the_new_vertices_on_them():
    """x² + a² = 2, a curve on the surface."""
    round_ = Descriptor("x^2 + a^2", "1", lambda z, p: z[:, 0] ** 2 + p[:, 0] ** 2)
    box = Box(a=(-2, 1), b=(-4, 4))
    with unchecked():
        eset = equilibrium_set(cusp(), box, within=[round_ <= 2], checks=0, intervals=(7, 8))
    fine = refined(eset, 0.002)
    assert_faithful(fine)
    assert_upright(fine)
    assert (fine.kinds == 2).sum() > 1.5 * (eset.kinds == 2).sum()
    assert topology(fine) == topology(eset)


def test_bead_on_a_circle_with_its_multiplier_is_refined():
    eset = lifted(bead_on_a_circle(), Box(h=(-1.5, 1.4), g=(-1.3, 1.5)), (9, 9))
    fine = refined(eset, 0.02)
    assert_faithful(fine)
    assert_upright(fine)
    assert topology(fine) == topology(eset)
    h, g = fine.coordinates[fine.kinds == 1].T
    np.testing.assert_allclose(np.cbrt(h**2) + np.cbrt(g**2), 1.0, rtol=1e-8)


def test_parabola_over_one_parameter_is_refined():
    """x² = a: no segment is farther from the curve than asked for."""
    eset = refine(lifted(fold_form(), Box(a=(-1, 1)), (5,)), 1e-3)
    assert_faithful(eset)
    x, a = inside_cells(eset).T
    assert np.abs(a - x**2).max() < 2.5e-3  # the distance is less by the slope, √5 at most
    assert eset.audit.smallest_angle == 0.0


@pytest.fixture(scope="module")
def fine_arch(refined_arch):
    return refined_arch((47, 81), 0.01)


@pytest.mark.parametrize(
    "intervals",
    [
        pytest.param((6, 11), marks=pytest.mark.slow),
        pytest.param((12, 21), marks=pytest.mark.slow),
        pytest.param((24, 41), marks=pytest.mark.slow),
    ],
    ids="{0[0]}x{0[1]}".format,
)
def test_refined_arch_does_not_depend_on_the_grid(intervals, refined_arch, fine_arch):
    """Surfaces within 0.01 of the set, and of each other, with the same pieces."""
    assert fine_arch.audit.smallest_angle > 10.0
    eset = refined_arch(intervals, 0.01)
    assert_faithful(eset)
    assert_upright(eset)
    assert eset.audit.smallest_angle > 10.0
    assert_folds_are_singular(eset, 1e-8)
    assert topology(eset) == topology(fine_arch)
    assert max(farthest(eset, fine_arch), farthest(fine_arch, eset)) <= 0.01


@pytest.mark.slow
@pytest.mark.parametrize(
    ("load", "cap", "intervals", "accuracy"),
    [
        ("left-half", 20, (51, 19), 0.05),
        ("uniform", 20, (42, 50), 0.02),
        ("uniform", 20, (40, 21), 0.05),
        ("uniform", 10, (31, 33), 0.05),
        ("left-half", 20, (31, 33), 0.02),
        ("left-half", 20, (6, 50), 0.02),
        ("left-half", 40, (42, 50), 0.02),
    ],
)
def test_arches_on_odd_grids_are_faithful_without_slivers(load, cap, intervals, accuracy):
    """Of a sweep over random grids: with a hole before, cells turned over, or angles below 10°."""
    arch = Rod(load=load)
    given = {"fixed": {"q": 2.5}, "within": [arch.max_curvature <= cap], "checks": 0}
    with unchecked():
        box = Box(Theta=(0.2, 2.5), Delta=(-2, 2))
        eset = equilibrium_set(arch, box, intervals=intervals, **given)
        fine = refine(eset, accuracy)
    assert_faithful(fine)
    assert_upright(fine)
    assert topology(fine) == topology(eset)
    assert fine.audit.smallest_angle > 10.0
    assert fine.audit.deviation <= accuracy


@pytest.mark.slow
def test_a_fold_that_no_edge_meets_is_found_along_the_constraint():
    """A short fold from the constraint back to it in one cell, at which refinement ended."""
    arch = Rod(load="left-half")
    given = {"fixed": {"q": 2.5}, "within": [arch.max_curvature <= 40], "checks": 0}
    with unchecked():
        box = Box(Theta=(0.2, 2.5), Delta=(-2, 2))
        coarse = equilibrium_set(arch, box, intervals=(51, 19), **given)
        eset = refine(coarse, 0.02)
    assert_faithful(eset)
    assert topology(eset) == topology(coarse)
    assert np.count_nonzero(eset.kinds == VertexKind.CORNER) == 2
    assert len(eset.points) < 4000


@pytest.mark.slow
def test_a_grid_too_coarse_for_the_accuracy_is_made_finer():
    """Between its folds near (0.87, 0) edges of 6 × 11 intervals cannot be bisected."""
    arch = Rod()
    kappa, box = arch.max_curvature, Box(Theta=(0.2, 2.5), Delta=(-2, 2))
    given = {"fixed": {"q": 2.5}, "within": [kappa <= 20], "checks": 0, "intervals": (6, 11)}
    with unchecked():
        alone = refine(equilibrium_set(arch, box, **given), 0.002)
        eset = equilibrium_set(arch, box, accuracy=0.002, **given)
    assert alone.audit.unrefined > 0
    assert not alone.audit.clean
    assert_faithful(eset)
    assert_upright(eset)
    assert eset.audit.unrefined == 0
    assert eset.intervals > (6, 11)


def test_refined_arch_is_faithful(refined_arch):
    eset = refined_arch((12, 21), 0.02)
    assert_faithful(eset)
    assert_upright(eset)
    assert_folds_are_singular(eset, 1e-8)
    assert (eset.audit.components, eset.audit.euler_characteristic) == (2, 0)
    assert len(eset.boundaries) == 4
    assert eset.audit.deviation <= 0.02
    assert eset.audit.smallest_angle > 10.0


def test_refinement_is_deterministic():
    eset = lifted(sphere(), Box(a=(-1.3, 1.2), b=(-1.5, 1.5)), (7, 8))
    first, second = refined(eset, 0.05), refined(eset, 0.05)
    assert np.array_equal(first.points.z, second.points.z)
    assert np.array_equal(first.cells, second.cells)


def test_accuracy_in_the_call_is_that_of_refine():
    form, box = sphere(), Box(a=(-1.3, 1.2), b=(-1.5, 1.5))
    with unchecked():
        at_once = equilibrium_set(form, box, checks=0, intervals=(7, 8), accuracy=0.05)
    later = refined(lifted(form, box, (7, 8)), 0.05)
    assert np.array_equal(at_once.cells, later.cells)
    assert at_once.audit.accuracy == 0.05


def test_audits_of_refined_sets_keep_the_counts_of_searches():
    """Identity: refinement searches nothing, so that what was searched before still counts."""
    with unchecked():
        eset = equilibrium_set(fold_form(), Box(a=(-1, 1)), checks=3, intervals=(5,))
    fine, searched = refined(eset, 1e-3).audit, eset.audit
    assert 0 < searched.arrived <= searched.starts
    assert (fine.arrived, fine.starts) == (searched.arrived, searched.starts)


@pytest.mark.parametrize("accuracy", [0.0, -1.0, np.nan, np.inf])
def test_accuracy_must_be_positive(accuracy):
    eset = lifted(fold_form(), Box(a=(-1, 1)), (3,))
    with pytest.raises(InputError, match="`accuracy` must be positive"):
        refine(eset, accuracy)


@pytest.fixture(scope="module")
def coarse() -> Fabric:
    eset = lifted(torus(0.5), Box(a=(-1.7, 1.6), b=(-1.5, 1.5)), (12, 12))
    return fabric_of(eset)


def test_flips_keep_vertices_and_topology_and_widen_angles(coarse):
    flipped = flip(coarse)
    assert len(flipped.cells) == len(coarse.cells)
    assert euler_characteristic(flipped.cells) == euler_characteristic(coarse.cells)
    assert set(np.unique(flipped.cells)) == set(np.unique(coarse.cells))
    assert not np.array_equal(flipped.cells, coarse.cells)
    assert_sides_are_known(flipped)


def gains_of_flips(fabric: Fabric) -> list[float]:
    """Plain twin: what flips would gain that nothing forbids, edge by edge."""
    place, rows, beside = fabric.vertices.place, fabric.vertices.rows, {}
    for cell in fabric.cells.tolist():
        for k in range(3):
            beside.setdefault(frozenset(cell[:k] + cell[k + 1 :]), []).append((cell, k))
    fixed = set(map(frozenset, fabric.facets.tolist()))
    gains = []
    for edge, around in beside.items():
        if len(around) != 2 or edge in fixed:
            continue
        a, b = edge
        c, d = (cell[k] for cell, k in around)
        angles = [np.stack([place[a], place[b]]) - place[x] for x in (c, d)]
        if folds_over(fabric, (a, b, c, d)):
            continue
        total = sum(np.arccos(x @ y / np.linalg.norm(x) / np.linalg.norm(y)) for x, y in angles)
        if total <= np.pi + 1e-2 or frozenset((c, d)) in beside:
            continue
        flat = [(place[[a, b, c, d]] - place[a]) @ rows[x].T for x in (a, b, c, d)]
        new = np.array([[area(x[0], x[3], x[2]), area(x[3], x[1], x[2])] for x in flat])
        whole = new.sum(axis=1, keepdims=True)
        if (new * np.sign(whole) > 2e-3 * np.abs(whole)).all():
            gains.append(total - np.pi)
    return gains


def folds_over(fabric: Fabric, corners: tuple[int, ...]) -> bool:
    """Whether a flip leaves more area overturned in the parameters: the total of both grows."""
    a, b, c, d = fabric.vertices.place[list(corners), -2:]
    return abs(area(a, d, c)) + abs(area(d, b, c)) > (1 + 1e-9) * (
        abs(area(a, b, c)) + abs(area(b, a, d))
    )


def area(a, b, c):
    return (b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]


def test_no_flip_is_left_that_would_widen_angles(coarse):
    assert len(gains_of_flips(coarse)) > 50
    flipped = flip(coarse)
    assert gains_of_flips(flipped) == []
    assert flip(flipped) is flipped


@pytest.fixture(scope="module")
def plain_edges(coarse) -> tuple[Fabric, np.ndarray, np.ndarray]:
    """The fabric flipped, every third edge inside a sheet, and the index of the sheets."""
    flipped = flip(coarse)
    ends, of_cells = edges_of(flipped.cells, len(flipped.vertices))
    index = np.empty(len(ends), int)
    index[of_cells] = flipped.cell_index[:, None]
    some = np.flatnonzero(flipped.edge_marks(ends) == 0)[::3]
    return flipped, ends[some], index[some]


def test_after_a_bisection_flips_are_looked_for_around_its_vertices_only(plain_edges):
    """Equal to flips that look everywhere: elsewhere nothing was left to be flipped."""
    flipped, ends, index = plain_edges
    with unchecked():
        found, vertices = on_edges(flipped, Places(ends, 0, index, np.full(len(ends), 0.5)))
    halved = flipped.bisect(ends[found], vertices)
    everywhere = flip(halved)
    assert not np.array_equal(everywhere.cells, halved.cells)
    assert np.array_equal(flip(halved, since=len(flipped.vertices)).cells, everywhere.cells)


def test_rough_tangent_spaces_of_new_vertices_are_nearly_exact(plain_edges):
    """Those where Newton's last step began, against those solved for at the vertices."""
    flipped, ends, index = plain_edges
    half = np.full(len(ends), 0.5)
    with unchecked():
        found, exact = on_edges(flipped, Places(ends, 0, index, half))
        again, rough = on_edges(flipped, Places(ends, 0, index, half), refining=True)
    assert found.sum() > 50
    assert np.array_equal(again, found)
    np.testing.assert_array_equal(rough.index, exact.index)
    np.testing.assert_allclose(rough.z, exact.z, atol=1e-12)
    np.testing.assert_allclose(rough.p, exact.p, atol=1e-12)
    np.testing.assert_allclose(rough.rows, exact.rows, atol=1e-4)
    assert np.abs(flipped.setting.structure.residual(rough.z, rough.p)).max() < 1e-11


def test_flips_do_not_make_edges_that_are_ruled_out(coarse):
    def edges(fabric):
        return {tuple(sorted(pair)) for a, b, c in fabric.cells.tolist()
                for pair in ((a, b), (b, c), (c, a))}  # fmt: skip

    new = np.array(sorted(edges(flip(coarse)) - edges(coarse)))
    assert len(new) > 50
    assert edges(flip(coarse, new)).isdisjoint(map(tuple, new.tolist()))


def test_several_edges_of_a_cell_are_cut_alike_on_both_sides():
    """All edges of two tetrahedra: their common face is cut into the same triangles."""
    cells = np.array([[0, 1, 2, 3], [4, 2, 1, 3]])
    edges, _ = edges_of(cells, 5)
    order = np.random.default_rng(0).permutation(len(edges))
    parts, parents = _bisect(cells, edges[order], 5)
    assert euler_characteristic(parts) == 1
    assert len(np.unique(parts)) == 5 + len(edges)
    assert (adjacency(parts).counts <= 2).all()
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
    place = np.concatenate([corner, corner[edges[order]].mean(axis=1)])
    whole = np.abs(volumes(corner[cells]))
    np.testing.assert_allclose(np.bincount(parents, np.abs(volumes(place[parts]))), whole)


def test_collapses_take_slivers_away_and_keep_the_topology(coarse):
    less = refill(coarse, Memory())
    assert len(less.cells) < len(coarse.cells)
    assert euler_characteristic(less.cells) == euler_characteristic(coarse.cells)
    assert smallest_angle(less) > 2 * smallest_angle(coarse)
    assert_sides_are_known(less)
    rest: Complex = less.complex()
    assert len(np.unique(rest.cells)) == len(rest.points)


def test_a_patch_goes_back_as_it_is(coarse):
    """All cells, facets and marks; nothing is flipped or drawn over the rim."""
    near = np.zeros(len(coarse.vertices), bool)
    near[coarse.cells[5]] = True
    patch = patch_around(coarse, near, 4)
    assert 10 < len(patch.fabric.cells) < len(coarse.cells)
    back = patch.replace_by(patch.fabric)
    for whole, again in ((coarse.cells, back.cells), (coarse.facets, back.facets)):
        assert sorted(map(tuple, whole.tolist())) == sorted(map(tuple, again.tolist()))
    better = patch.replace_by(refill(patch.fabric, Memory()))
    assert len(better.cells) < len(coarse.cells)
    assert (adjacency(better.cells).counts <= 2).all()
    assert euler_characteristic(better.cells) == euler_characteristic(coarse.cells)
    assert_sides_are_known(better)


def test_a_patch_of_a_patch_keeps_both_rims(coarse):
    """The rim of the larger one comes back with what the smaller one makes of its cells."""
    near = np.zeros(len(coarse.vertices), bool)
    near[coarse.cells[5]] = True
    outer = patch_around(coarse, near, 4).fabric
    inner = patch_around(outer, near, 3)
    assert ((inner.fabric.marks & FacetMark.RIM) > 0).sum() > 0
    back = inner.replace_by(inner.fabric)
    for whole, again in ((outer.cells, back.cells), (outer.facets, back.facets)):
        assert sorted(map(tuple, whole.tolist())) == sorted(map(tuple, again.tolist()))
    for fabric in (outer, inner.fabric):
        rims = fabric.facets[(fabric.marks & FacetMark.RIM) > 0]
        assert (fabric.edge_marks(np.sort(rims, axis=1)) & FacetMark.RIM).all()


def test_cusps_are_not_put_on_the_rim_of_a_patch():
    """Cells beyond it would not be cut, and a hole would be left."""
    with unchecked():
        box = Box(b=(-1.7, 1.9), c=(-1, 0.7))
        eset = equilibrium_set(swallowtail(), box, fixed={"a": -1.0}, checks=0, intervals=(5, 6))
    fabric = fabric_of(eset)
    everywhere = np.ones(len(fabric.cells), bool)
    cut = with_cusps_beside(fabric, everywhere)
    assert len(cut.cells) == len(fabric.cells) + 4
    folds = fabric.facets[(fabric.marks & FacetMark.FOLD) > 0]
    rim = replace(
        fabric,
        facets=np.concatenate([fabric.facets, folds]),
        marks=np.concatenate([fabric.marks, np.full(len(folds), FacetMark.RIM)]),
    )
    assert with_cusps_beside(rim, everywhere) is rim


def test_a_fold_that_bulges_far_out_is_followed_to_its_end(coarse):
    """From one of its vertices to the eighth after it, halfway; but not as one of another index."""
    folds = chains(coarse.facets[(coarse.marks & FacetMark.FOLD) > 0])
    line = max(folds, key=len)[:9]
    found = follow_edge(coarse, line[[0, 8]], FacetMark.FOLD, 0)
    place = coarse.vertices.place[line]
    length = np.linalg.norm(np.diff(place, axis=0), axis=1)
    before = np.concatenate([[0.0], np.cumsum(length)])
    near = np.linalg.norm(place - found.place, axis=1)
    assert abs(before[near.argmin()] - 0.5 * before[-1]) < near.min() + 0.2 * before[-1]
    assert near.min() <= length.max()
    assert np.abs(coarse.setting.structure.residual(found.z, found.p)).max() < 1e-12
    assert follow_edge(coarse, line[[0, 8]], FacetMark.FOLD, 1) is None


def test_vertices_in_use_are_not_found_again(coarse):
    chosen = np.unique(coarse.cells)[[3, 5]]
    known = coarse.vertices.take(chosen)
    moved = replace(known, place=known.place + np.array([[0.0], [1e-3]]))
    ((found, new),) = unmet(coarse, [(np.array([True, False, True]), moved)])
    assert found.tolist() == [False, False, True]
    assert np.array_equal(new.z, known.z[1:])


def test_a_change_of_topology_is_no_clean_refinement():
    eset = lifted(fold_form(), Box(a=(-1, 1)), (3,))
    torn = replace(eset, audit=replace(eset.audit, components=2))
    fine = refined(torn, 0.2)
    assert fine.audit.changed == 1
    assert not fine.audit.clean
    assert ("changes of topology", "1") in fine.audit.rows()
    assert refined(fine, 0.1).audit.changed == 1


def test_vertices_that_are_added_twice_to_the_same_ones_do_not_meet(coarse):
    """They share room behind those that there are; only the first may take it."""
    store = coarse.vertices.join(coarse.vertices.take(np.array([0])))
    first = store.join(store.take(np.array([1])))
    second = store.join(store.take(np.array([2])))
    assert np.array_equal(first.z[-1], store.z[1])
    assert np.array_equal(second.z[-1], store.z[2])
    assert np.array_equal(first.z[:-1], second.z[:-1])


def test_smoothing_widens_angles_and_stays_on_the_surface(coarse):
    """Residuals are those of Newton's method; triangles below 20° get fewer."""
    flipped = flip(coarse)
    near = np.ones(len(flipped.vertices), bool)
    quality = qualities_near(flipped, near)
    sharp = partial(moves, sharp=np.radians(25.0))
    moved, *_ = repeat(sharp, 1, flipped, quality, near, Memory(), np.inf)
    before, after = (np.sort(smallest_angles(each.squared)) for each in (flipped, moved))
    assert (after < np.radians(20.0)).sum() < (before < np.radians(20.0)).sum()
    assert after[0] >= before[0]
    assert len(moved.vertices) > len(flipped.vertices)
    residual = coarse.setting.structure.residual(moved.vertices.z, moved.vertices.p)
    assert np.abs(residual).max() < 1e-10
    assert_sides_are_known(moved)


def assert_sides_are_known(fabric: Fabric) -> None:
    """Lengths that were carried along are those measured anew."""
    place = fabric.vertices.place[fabric.cells]
    for k, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
        wanted = ((place[:, i] - place[:, j]) ** 2).sum(axis=1)
        np.testing.assert_allclose(fabric.squared[:, k], wanted, rtol=1e-12)
