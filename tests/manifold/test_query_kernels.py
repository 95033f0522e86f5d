"""Compiled kernels of queries against plain numpy: the same pairs, guesses and choices."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

import equimorph as em
from equimorph.equilibria import Guards, settle
from equimorph.manifold.geometry.kernels import measure_edges
from equimorph.manifold.geometry.tangents import S_SHAPE, Cubics, Ends
from equimorph.manifold.lookup.cell_index import NUDGE, CellIndex, meeting_boxes
from equimorph.manifold.lookup.exact_states import CLOSEST, ROUND_OFF, exact_states, root_weights
from equimorph.manifold.lookup.kernels import (
    balanced,
    cells_by_bin,
    guesses,
    longest_sides,
    one_of_each,
    worth_trying,
)
from equimorph.manifold.refining.kernels import see_volumes
from equimorph.structures import Spring


def sheets(d: int) -> tuple[np.ndarray, np.ndarray]:
    """Corners and cells of two triangulations of the unit cube, one over the other."""
    generator = np.random.default_rng(d)
    cube = np.stack(np.meshgrid(*[[0.0, 1.0]] * d), axis=-1).reshape(-1, d)
    first, second = (
        np.concatenate([cube, generator.uniform(size=(number, d))]) for number in (14, 9)
    )
    cells = np.concatenate([simplices(first), len(first) + simplices(second)])
    return np.concatenate([first, second]), cells


def simplices(points: np.ndarray) -> np.ndarray:
    if points.shape[1] > 1:
        return Delaunay(points).simplices
    order = np.argsort(points[:, 0])
    return np.stack([order[:-1], order[1:]], axis=1)


def barycentric(corners: np.ndarray, point: np.ndarray) -> np.ndarray:
    matrix = np.concatenate([corners.T, np.ones((1, len(corners)))])
    return np.linalg.solve(matrix, np.append(point, 1.0))


@pytest.mark.parametrize("d", [1, 2, 3])
def test_boxes_that_meet_are_found_once(d):
    """Every pair by itself; a fifth of the boxes are up to a hundred times larger than others."""
    generator = np.random.default_rng(d)
    size = generator.uniform(0.01, 0.1, (80, 1, 1))
    size[::5] *= 10.0
    corners = generator.uniform(size=(80, 1, d)) + size * generator.uniform(size=(80, d + 1, d))
    pairs = meeting_boxes(corners)
    low, high = corners.min(axis=1), corners.max(axis=1)
    one, other = np.triu_indices(80, 1)
    meet = ((low[one] <= high[other]) & (low[other] <= high[one])).all(axis=1)
    found = np.sort(pairs, axis=1)
    assert len(np.unique(found, axis=0)) == len(found) > 50
    assert set(map(tuple, found.tolist())) == set(zip(one[meet], other[meet], strict=True))


@pytest.mark.parametrize("d", [1, 2, 3])
def test_the_longest_side_from_the_first_corner_is_measured_by_the_metric(d):
    """In numpy, cell by cell; entries behind the unknowns do not count."""
    x, cells = sheets(d)
    mass = np.array([0.5, 2.0, 3.0])
    z = np.random.default_rng(d).normal(size=(len(x), 5))
    room = np.empty(len(cells))
    longest_sides(cells, z, mass, room)
    for own, found in zip(cells, room, strict=True):
        sides = (z[own[1:]] - z[own[0]])[:, :3] * np.sqrt(mass)
        assert np.linalg.norm(sides, axis=1).max() == pytest.approx(found, rel=1e-14)


@pytest.mark.parametrize("d", [1, 2, 3])
def test_cells_near_points_are_those_whose_barycentric_coordinates_say_so(d):
    """Every cell and point by themselves; every point lies inside one cell of each sheet."""
    x, cells = sheets(d)
    overhang = np.random.default_rng(0).choice([0.0, 0.3], len(cells))
    points = np.concatenate([np.random.default_rng(1).uniform(size=(60, d)), x])
    hits = CellIndex.of(x[cells], overhang).near(points)
    weights = np.array([[barycentric(x[own], point) for own in cells] for point in points])
    near = weights.min(axis=2) > -overhang - NUDGE
    found = np.zeros(near.shape, bool)
    found[hits.point, hits.cell] = True
    assert near[found].all()
    assert found.sum() == len(hits)
    assert (np.diff(hits.point) >= 0).all()
    # bins list cells up to their overhang beyond the box around them
    low, high = x[cells].min(axis=1), x[cells].max(axis=1)
    room = overhang[:, None] * (high - low)
    beside = ((points[:, None] >= low - room) & (points[:, None] <= high + room)).all(axis=2)
    assert found[near & beside].all()
    np.testing.assert_allclose(hits.weights, weights[hits.point, hits.cell], rtol=0, atol=1e-10)
    number = np.bincount(hits.point[hits.inside], minlength=len(points))
    assert np.array_equal(number, np.full(len(points), 2))


def test_guesses_interpolate_and_follow_the_root_from_folds():
    """The formulas of both, hit by hit; beyond a facet on folds x² grows as inside, without end."""
    x, cells = sheets(2)
    generator = np.random.default_rng(0)
    z, folded = generator.normal(size=(len(x), 5)), generator.uniform(size=len(x)) < 0.4
    cell = generator.integers(len(cells), size=50)
    weights = generator.normal(0.3, 0.3, size=(50, 3))
    weights[:20] *= 30.0
    found = guesses((cell, weights), cells, folded, z, CLOSEST)
    beyond = ~folded[cells[cell]] & (weights < 0.0)
    beyond &= (~folded[cells[cell]]).sum(axis=1, keepdims=True) == 1
    assert beyond.any(axis=1).sum() > 5
    within = np.maximum(weights, 0.0)
    within /= within.sum(axis=1, keepdims=True)
    for guess, own, share, far, weight in zip(
        found, cells[cell], within, beyond, weights, strict=True
    ):
        if far.any():
            foot, root = share @ z[own], np.sqrt(max(-weight[far].item(), CLOSEST))
            np.testing.assert_allclose(guess, foot + root * (z[own][far][0] - foot), atol=1e-9)
            continue
        np.testing.assert_allclose(guess, plain_root(share, folded[own]) @ z[own], atol=1e-9)
        again = root_weights(share[None], folded[own][None])[0] @ z[own]
        np.testing.assert_allclose(again, guess, rtol=0, atol=1e-14)


def plain_root(share: np.ndarray, folded: np.ndarray) -> np.ndarray:
    """Shares off the fold add up to the root of what they added up to."""
    if folded.all() or not folded.any():
        return share
    share = share + 1e-12
    root = np.sqrt(max(share[~folded].sum(), CLOSEST))
    return np.where(
        folded,
        share / share[folded].sum() * (1.0 - root),
        share / share[~folded].sum() * root,
    )


def test_of_equal_states_that_on_a_cell_that_contains_the_point_is_taken():
    point, inside = np.array([0, 0, 0, 0, 1, 1]), np.array([False, True, True, False, True, True])
    z = np.array([[1.0], [2.0], [1.0], [3.0], [1.0], [1.0]])
    good, room = np.array([True] * 5 + [False]), np.array([1.0, 1.0, 1.0, 1e-3, 1.0, 1.0])
    kept = one_of_each((point, inside), (z, good), z + 0.1, room, np.ones(1), 1e-6)
    assert kept.tolist() == [1, 2, 4]
    assert good.tolist() == [True, True, True, False, True, False]  # one went too far


def test_points_are_sure_where_states_and_cells_have_the_same_parity():
    """Two cells of opposite sign over each point: both, one, or none of them found a state."""
    point, cell = np.repeat(np.arange(4), 2), np.tile([0, 1], 4)
    inside = np.ones(8, bool)
    nothing = np.zeros(2, bool)
    good = np.array([True, True, True, False, False, False, True, True])
    of_cells = np.array([1, -1]), nothing, nothing, nothing, nothing
    sure = balanced((point, cell, inside), good, np.flatnonzero(good), of_cells, 4)
    assert sure.tolist() == [True, False, False, True]
    # at a fold both may be missing; next to a constraint nothing may
    edge = np.array([1, -1]), nothing, ~nothing, nothing, nothing
    sure = balanced((point, cell, inside), good, np.flatnonzero(good), edge, 4)
    assert sure.tolist() == [True, False, True, True]
    capped = np.array([1, -1]), nothing, ~nothing, ~nothing, ~nothing
    sure = balanced((point, cell, inside), good, np.flatnonzero(good), capped, 4)
    assert sure.tolist() == [True, False, False, True]
    # one state beside a cell lies beyond its constraint, or beyond the fold of a strip
    for ended in (~nothing, nothing):
        beside = np.array([1, -1]), nothing, ~nothing, ~nothing, ended
        one = np.zeros(1, int), np.zeros(1, int), np.zeros(1, bool)
        sure = balanced(one, np.ones(1, bool), np.zeros(1, int), beside, 1)
        assert sure.tolist() == [bool(ended[0])]


def test_points_beyond_a_brim_or_within_a_nudge_of_it_are_tried():
    cell, inside = np.zeros(5, int), np.array([True, False, False, False, False])
    across = np.array([0.3, 0.6, -0.1, 1e-10, 1e-8])
    weights = np.stack([[0.2, -0.1, 0.6, 0.5, 0.5], across, np.full(5, 0.5)], axis=1)
    brims, maps = np.array([[False, True, False]]), np.ones((1, 3, 3))
    assert worth_trying((cell, weights), inside, brims, maps, 1e-9).tolist() == [0, 2, 3]


def test_exact_states_equal_those_of_the_general_corrector():
    """One method, compiled for queries; the bound of the next correction is its round-off."""
    rod = em.Rod(load="uniform")
    p = np.tile([0.9, 0.1, 0.5, np.sin(1.0)], (40, 1))
    start, _ = rod.natural(p * [1, 1, 0, 1])
    z = start + np.random.default_rng(4).uniform(-1.5, 1.5, start.shape)
    guards = Guards(40, longest=np.inf, too_long=1.0, converged=ROUND_OFF, following=ROUND_OFF)
    general, (found, good, index) = settle(rod, z, p, guards=guards), exact_states(rod, z, p)
    assert 0 < good.sum() < len(z)
    assert np.array_equal(good, general.found)
    assert np.array_equal(index[good], general.index[good])
    assert np.abs(found - general.z)[good].max() < 1e-13


def test_exact_states_do_not_depend_on_those_beside_them():
    """One state at a time or many, with lanes that are given up among them."""
    spring = Spring()
    generator = np.random.default_rng(3)
    p = np.stack(
        [generator.uniform(0.4, 1.2, 60), generator.uniform(-0.4, 0.4, 60), np.ones(60)], 1
    )
    z, wanted = generator.uniform(-1.5, 1.5, (60, 1)), generator.integers(2, size=60)
    together = exact_states(spring, z, p, wanted)
    assert 0 < together[1].sum() < 60
    assert np.abs(spring.residual(together[0], p)[together[1]]).max() < 1e-14
    for k in range(60):
        alone = exact_states(spring, z[k : k + 1], p[k : k + 1], wanted[k : k + 1])
        assert all(
            np.array_equal(one[0], all_[k]) for one, all_ in zip(alone, together, strict=True)
        )


@pytest.mark.parametrize("counts", [(7,), (5, 4), (3, 4, 2)])
def test_cells_are_listed_in_each_bin_that_they_reach(counts):
    """Against a plain search of all cells for each bin."""
    generator, d = np.random.default_rng(len(counts)), len(counts)
    first = generator.integers(0, counts, (30, d))
    last = np.minimum(first + generator.integers(0, 3, (30, d)), np.array(counts) - 1)
    starts, cells = cells_by_bin(first, last, np.array(counts))
    for number, place in enumerate(np.ndindex(*counts)):
        wanted = np.flatnonzero(((first <= place) & (place <= last)).all(axis=1))
        np.testing.assert_array_equal(cells[starts[number] : starts[number + 1]], wanted)


@pytest.mark.parametrize("d", [2, 3])
def test_cells_are_measured_in_the_tangent_spaces_as_by_numpy(d):
    """Volumes seen from corners; and the cubics over edges, with nothing that stays zero on them.

    Round-off: sums of nine terms near one.
    """
    generator = np.random.default_rng(d)
    place = generator.normal(size=(30, 9))
    rows = np.linalg.qr(generator.normal(size=(30, 9, d)))[0].transpose(0, 2, 1).copy()
    cells = np.stack([generator.permutation(30)[: d + 1] for _ in range(40)])
    seen, sides = np.empty(cells.shape), place[cells[:, 1:]] - place[cells[:, :1]]
    see_volumes(place, rows, cells, seen)
    flat = np.einsum("nic,nkjc->nkij", sides, rows[cells])
    np.testing.assert_allclose(seen, np.linalg.det(flat), atol=1e-12)
    ends, error = cells[:, :2].copy(), np.empty(40)
    measure_edges(place, rows, ends, S_SHAPE, error)
    free = [Ends(place[end], rows[end], np.zeros((40, 0, d))) for end in ends.T]
    np.testing.assert_allclose(error, Cubics(*free).error, rtol=1e-12)
