"""Sparse elimination against dense factorisations, on random patterns and matrices."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from equimorph.linalg import solve_bordered
from equimorph.linalg.sparse import SparseLayout

DRAWN = settings(max_examples=25, deadline=None, derandomize=True, database=None)


def random_layout(generator, size, multipliers):
    """A layout with a random pattern; rows of multipliers have no diagonal but a zero."""
    full = np.tril(generator.random((size, size)) < 0.3)
    full[size - multipliers :, size - multipliers :] = False
    full[size - multipliers :, : min(size - multipliers, 3)] = True
    np.fill_diagonal(full, True)
    rows, columns = np.nonzero(full)
    return SparseLayout(rows, columns, size, multipliers)


def random_values(generator, layout, lanes):
    """Entries of indefinite matrices, large on the diagonal, zero on that of multipliers."""
    values = generator.normal(size=(lanes, len(layout.rows)))
    signs = generator.choice([-1.0, 1.0, 1.0], (lanes, layout.size))
    values[:, layout.diagonal] += 6.0 * signs
    values[:, layout.diagonal[layout.size - layout.multipliers :]] = 0.0
    return values


def random_border(generator, lanes, k, size):
    shapes = ((lanes, k, size), (lanes, k, size), (lanes, k, k))
    columns, rows, corner = (generator.normal(size=shape) for shape in shapes)
    return columns, rows, corner


@given(
    seed=st.integers(0, 2**32 - 1),
    size=st.integers(1, 14),
    multipliers=st.integers(0, 2),
    k=st.integers(0, 2),
)
@DRAWN
def test_solutions_and_inertia_equal_the_dense_ones(seed, size, multipliers, k):
    """LU with partial pivoting and Bunch–Parlett. 1e-8: condition numbers up to 1e5 are drawn."""
    generator = np.random.default_rng(seed)
    multipliers = min(multipliers, max(size - 3, 0))
    layout = random_layout(generator, size, multipliers)
    values = random_values(generator, layout, 11)
    border = random_border(generator, 11, k, size)
    rhs = generator.normal(size=(11, 3, size + k))
    dense = layout.dense(values)
    found, exact = layout.solve(values, border, rhs), solve_bordered(dense, *border, rhs)
    full = np.block([[dense, border[0].transpose(0, 2, 1)], [border[1], border[2]]])
    usable = np.linalg.cond(full) < 1e5
    np.testing.assert_allclose(found.x[usable], exact.x[usable], rtol=1e-8, atol=1e-8)
    clear = np.abs(np.linalg.eigvalsh(dense)).min(axis=1) > 1e-8
    expected = (np.linalg.eigvalsh(dense) < 0.0).sum(axis=1)
    np.testing.assert_array_equal(found.negative[clear], expected[clear])


def test_a_chain_is_eliminated_without_fill_in():
    """A star has no fill-in if its centre goes last, a chain if it is taken from its ends."""
    count = 40
    chain = np.arange(count - 1)
    rows = np.concatenate([np.arange(count), chain + 1])
    columns = np.concatenate([np.arange(count), chain])
    assert len(SparseLayout(rows, columns, count).elimination.rows) == count - 1
    columns = np.concatenate([np.arange(count), np.zeros(count - 1, int)])
    assert len(SparseLayout(rows, columns, count).elimination.rows) == count - 1


@pytest.mark.parametrize(
    ("vanishing", "is_dense"), [((0,), False), ((11,), False), ((0, 11), True)]
)
def test_a_pivot_that_vanishes_is_avoided_in_another_order(vanishing, is_dense):
    """A chain is taken from one end or the other; where both pivots vanish, it is solved dense.

    The pivoted dense solver; 1e-12: a well-conditioned chain.
    """
    count = 12
    chain = np.arange(count - 1)
    rows = np.concatenate([np.arange(count), chain + 1])
    layout = SparseLayout(rows, np.concatenate([np.arange(count), chain]), count)
    values = np.ones((9, len(rows)))
    values[:, :count] = 3.0
    values[4, list(vanishing)] = 0.0
    rhs = np.random.default_rng(0).normal(size=(9, 1, count))
    found, full = layout.solve(values, None, rhs), layout.dense(values)
    np.testing.assert_array_equal(np.flatnonzero(found.pivoted), [4] if is_dense else [])
    expected = np.linalg.solve(full, rhs.transpose(0, 2, 1)).transpose(0, 2, 1)
    np.testing.assert_allclose(found.x, expected, rtol=1e-12, atol=1e-12)
    below = (np.linalg.eigvalsh(full) < 0.0).sum(axis=1)
    np.testing.assert_array_equal(found.negative, below)


def test_a_singular_matrix_within_a_regular_border_is_solved():
    """As at a fold: A = diag(1, 0) bordered by its null vector. 1e-15: a product of units."""
    layout = SparseLayout(np.array([0, 1, 1]), np.array([0, 0, 1]), 2)
    border = (np.array([[[0.0, 1.0]]]), np.array([[[0.0, 1.0]]]), np.zeros((1, 1, 1)))
    found = layout.solve(np.array([[1.0, 0.0, 0.0]]), border, np.array([[[2.0, 3.0, 5.0]]]))
    np.testing.assert_allclose(found.x, [[[2.0, 5.0, 3.0]]], rtol=1e-15)
    assert not found.pivoted[0]


@pytest.mark.parametrize("corner", [0.0, 1e-13])
def test_a_vanishing_first_pivot_is_pivoted(corner):
    """[[0, 1], [1, 0]] has one negative eigenvalue, and swaps. 1e-12: the perturbed entry."""
    layout = SparseLayout(np.array([0, 1, 1]), np.array([0, 0, 1]), 2)
    found = layout.solve(np.array([[corner, 1.0, 0.0]]), None, np.array([[[2.0, 3.0]]]))
    np.testing.assert_allclose(found.x, [[[3.0, 2.0]]], atol=1e-12)
    assert found.pivoted[0]
    assert found.negative[0] == 1


def test_a_lane_that_is_no_number_leaves_the_others_alone():
    """Bit for bit."""
    generator = np.random.default_rng(3)
    layout = random_layout(generator, 9, 1)
    values, rhs = random_values(generator, layout, 10), generator.normal(size=(10, 1, 9))
    clean = layout.solve(values, None, rhs)
    values[4, 2] = np.nan
    dirty = layout.solve(values, None, rhs)
    others = np.arange(10) != 4
    np.testing.assert_array_equal(dirty.x[others], clean.x[others])
    assert np.isnan(dirty.x[4]).all()
    assert dirty.negative[4] == -1


def test_the_number_of_lanes_does_not_change_a_solution():
    """Bit for bit: lanes beside one another never mix."""
    generator = np.random.default_rng(5)
    layout = random_layout(generator, 12, 2)
    values, rhs = random_values(generator, layout, 600), generator.normal(size=(600, 2, 12))
    whole = layout.solve(values, None, rhs).x
    for part in (slice(0, 1), slice(3, 10), slice(200, 531)):
        np.testing.assert_array_equal(layout.solve(values[part], None, rhs[part]).x, whole[part])
