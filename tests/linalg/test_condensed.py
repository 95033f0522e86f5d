"""The condensed layout equals a plain numpy twin and the dense, pivoted solve."""

import numpy as np
import pytest

from equimorph.linalg import CondensedLayout, solve_bordered
from equimorph.linalg.condensed import PIVOT_GUARD
from equimorph.linalg.null_vectors import near_null

ENDS = [(0, 0), (0, 1), (1, 0), (1, 1)]


def random_layout(generator, elements, degree, held=(1, 1)):
    element = generator.normal(size=(elements, degree + 1, degree + 1))
    return CondensedLayout(
        element + element.transpose(0, 2, 1), np.array([held[0], elements - held[1]])
    )


def random_system(generator, layout, lanes=13, k=1, sides=2, m=2):
    n = layout.unknown.stop - layout.unknown.start
    shapes = [(lanes, k, n + m), (lanes, k, n + m), (lanes, k, k), (lanes, sides, n + m + k)]
    diagonal = 3.0 * generator.normal(size=(lanes, layout.nodes))
    border = generator.normal(size=(lanes, m, layout.nodes))
    return diagonal, border, *[generator.normal(size=shape) for shape in shapes]


def plain_pivots(layout, diagonal):
    """Pivots of LDLᵀ without exchanges: inner nodes element by element, then the vertices."""
    degree = layout.stiffness.shape[1] - 1
    nodes = np.arange(layout.nodes)[layout.unknown]
    order = np.concatenate([nodes[nodes % degree > 0], nodes[nodes % degree == 0]])
    a = (layout.assembled + np.diag(diagonal))[np.ix_(order, order)]
    for k in range(len(a)):
        a[k + 1 :, k + 1 :] -= np.outer(a[k + 1 :, k], a[k, k + 1 :]) / a[k, k]
    return np.diag(a)


@pytest.mark.parametrize("held", ENDS)
@pytest.mark.parametrize(("elements", "degree"), [(2, 3), (5, 4), (7, 3), (12, 8)])
def test_pivots_are_those_of_plain_elimination_in_the_same_order(held, elements, degree):
    """Twin: outer-product elimination. 1e-9: elimination without exchanges loses digits."""
    generator = np.random.default_rng(elements * 10 + degree)
    layout = random_layout(generator, elements, degree, held)
    system = random_system(generator, layout, m=0, k=0, sides=0)
    solution = layout.solve(*system)
    for lane, diagonal in enumerate(system[0]):
        pivots = plain_pivots(layout, diagonal)
        ratio = np.abs(pivots).min() / np.abs(pivots).max()
        assert solution.negative[lane] == (pivots < 0).sum()
        if not solution.pivoted[lane]:
            assert solution.pivot_ratio[lane] == pytest.approx(ratio, rel=1e-9)


@pytest.mark.parametrize("held", ENDS)
@pytest.mark.parametrize("k", [0, 1, 2])
@pytest.mark.parametrize("sides", [0, 1, 3, 9])
def test_solutions_and_inertia_equal_the_dense_pivoted_ones(held, k, sides):
    """Oracle: LU and Bunch–Parlett on the full matrix. 1e-8: pivot ratios down to the guard."""
    generator = np.random.default_rng(7)
    layout = random_layout(generator, 5, 4, held)
    diagonal, border, *rest = random_system(generator, layout, k=k, sides=sides)
    solution = layout.solve(diagonal, border, *rest)
    dense = solve_bordered(layout.dense(diagonal, border), *rest)
    np.testing.assert_array_equal(solution.negative, dense.negative)
    scale = np.abs(dense.x).max(axis=(1, 2), keepdims=True, initial=1.0)
    np.testing.assert_allclose(solution.x / scale, dense.x / scale, atol=1e-8)


@pytest.mark.parametrize("lanes", [1, 7, 8, 9, 64, 65])
def test_a_lane_does_not_depend_on_the_lanes_beside_it(lanes):
    """Same operations in the same order: bit for bit."""
    generator = np.random.default_rng(3)
    layout = random_layout(generator, 6, 5)
    system = random_system(generator, layout, lanes=65)
    everything, some = layout.solve(*system), layout.solve(*[a[:lanes] for a in system])
    np.testing.assert_array_equal(everything.x[:lanes], some.x)
    np.testing.assert_array_equal(everything.negative[:lanes], some.negative)


def test_a_vanishing_pivot_is_caught_and_solved_with_pivoting():
    """First inner pivot engineered to 0, 1e-14, 1e-9; 1e-9: conditioning of the random matrix."""
    generator = np.random.default_rng(5)
    layout = random_layout(generator, 4, 4)
    diagonal, border, *rest = random_system(generator, layout, lanes=4)
    diagonal[:3, 1] = np.array([0.0, 1e-14, 1e-9]) - layout.stiffness[0, 1, 1]
    solution = layout.solve(diagonal, border, *rest)
    assert solution.pivoted[:3].all()
    assert not (solution.pivot_ratio[:3] >= PIVOT_GUARD).any()
    full = layout.dense(diagonal, border)
    for lane in range(4):
        assert solution.negative[lane] == (np.linalg.eigvalsh(full[lane]) < 0).sum()
        n = full.shape[1]
        product = solution.x[lane, :, :n] @ full[lane] + solution.x[lane, :, n:] @ rest[0][lane]
        np.testing.assert_allclose(product, rest[3][lane, :, :n], atol=1e-9)


def test_a_singular_matrix_bordered_to_be_regular_is_solved():
    """H with a null vector and a border across it: the extended systems of folds and branches."""
    generator = np.random.default_rng(6)
    layout = random_layout(generator, 4, 4)
    diagonal, border, *rest = random_system(generator, layout, lanes=2)
    full = layout.dense(diagonal, border)[0]
    inner = full[:-2, :-2]
    shift = np.linalg.eigvalsh(inner)[3]
    diagonal[0] -= shift
    solution = layout.solve(diagonal, border, *rest)
    dense = solve_bordered(layout.dense(diagonal, border), *rest)
    np.testing.assert_allclose(solution.x, dense.x, rtol=1e-7, atol=1e-8)


def test_lanes_that_are_not_numbers_do_not_sink_the_batch():
    generator = np.random.default_rng(8)
    layout = random_layout(generator, 4, 4)
    system = random_system(generator, layout)
    clean = layout.solve(*system)
    system[0][2, 5], system[1][9, 0, 3] = np.nan, np.inf
    dirty = layout.solve(*system)
    others = np.setdiff1d(np.arange(13), [2, 9])
    np.testing.assert_array_equal(dirty.x[others], clean.x[others])
    np.testing.assert_array_equal(dirty.negative[others], clean.negative[others])
    assert np.isnan(dirty.x[[2, 9]]).all()


def test_no_lanes_give_no_solutions():
    generator = np.random.default_rng(9)
    layout = random_layout(generator, 4, 4)
    assert layout.solve(*random_system(generator, layout, lanes=0)).x.shape[0] == 0


def test_solutions_with_a_small_pivot_are_refined_to_full_accuracy():
    """A pivot of 1e-5 loses five digits; refinement restores them without pivoting."""
    generator = np.random.default_rng(11)
    layout = random_layout(generator, 4, 4)
    diagonal, border, *rest = random_system(generator, layout, lanes=9)
    diagonal[:8, 1] = 10.0 ** np.linspace(-5.4, -4.9, 8) - layout.stiffness[0, 1, 1]
    solution = layout.solve(diagonal, border, *rest)
    dense = solve_bordered(layout.dense(diagonal, border), *rest)
    assert (solution.pivot_ratio[:8] < PIVOT_GUARD).all()
    assert not solution.pivoted.any()
    np.testing.assert_array_equal(solution.negative, dense.negative)
    size = np.abs(dense.x).max(axis=(1, 2), keepdims=True)
    np.testing.assert_allclose(solution.x / size, dense.x / size, atol=1e-12)


@pytest.mark.parametrize("lanes", [0, 1, 3, 13])
def test_null_vectors_at_once_are_those_of_single_solves(lanes):
    """Bit for bit, lanes with an unsafe pivot and those that are not numbers among them."""
    layout = random_layout(np.random.default_rng(5), 5, 4)
    diagonal, border = (
        each[:lanes] for each in random_system(np.random.default_rng(6), layout)[:2]
    )
    diagonal[1:2, 1] = -layout.stiffness[0, 1, 1]
    diagonal[2:3] = np.nan

    def solve(rhs, around):
        return layout.solve(diagonal, border, *around, rhs).x

    found = layout.near_null(diagonal, border)
    size = layout.unknown.stop - layout.unknown.start + border.shape[1]
    np.testing.assert_array_equal(found, near_null(solve, lanes, size))


def test_null_vectors_of_nearly_singular_matrices():
    """Closed form: the eigenvector that belongs to the one small eigenvalue, 1e-6."""
    generator = np.random.default_rng(8)
    layout = random_layout(generator, 5, 4)
    diagonal, border = random_system(generator, layout, lanes=1, m=0)[:2]
    sizes, vectors = np.linalg.eigh(layout.dense(diagonal, border)[0])
    nearest = np.argmin(np.abs(sizes))
    diagonal = diagonal - sizes[nearest] + 1e-6
    found = layout.near_null(diagonal, border)[0]
    np.testing.assert_allclose(abs(found @ vectors[:, nearest]), 1.0, atol=1e-10)
