"""Dense factorisations: inertia, small solves, bordered solves."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from equimorph.linalg import no_border, orthonormal_rows, solve_bordered
from equimorph.linalg.determinants import in_units
from equimorph.linalg.kernels import solve_lanes
from equimorph.linalg.simd import LANES, work_rows


def negative_eigenvalues(matrices):
    """Negative eigenvalues that the bordered solve counts."""
    lanes, size = matrices.shape[:2]
    return solve_bordered(matrices, *no_border(lanes, size), np.zeros((lanes, 0, size))).negative


@settings(max_examples=60, deadline=None)
@given(
    signs=st.lists(st.sampled_from([-1.0, 1.0]), min_size=1, max_size=12),
    seed=st.integers(0, 2**32 - 1),
)
def test_inertia_is_that_of_the_congruent_diagonal(signs, seed):
    """Sylvester: QDQᵀ has the inertia of D; sizes spread over six decades."""
    generator = np.random.default_rng(seed)
    n = len(signs)
    q = np.linalg.qr(generator.normal(size=(n, n)))[0]
    matrix = (q * (np.array(signs) * 10.0 ** generator.uniform(-3, 3, n))) @ q.T
    counted = negative_eigenvalues(0.5 * (matrix + matrix.T)[None])
    assert counted[0] == signs.count(-1.0)


@settings(max_examples=60, deadline=None)
@given(n=st.integers(1, 9), seed=st.integers(0, 2**32 - 1))
def test_small_integer_matrices_agree_with_their_eigenvalues(n, seed):
    """Zero diagonals force 2 × 2 pivots. Singular matrices are left out: no sign to round to."""
    generator = np.random.default_rng(seed)
    half = np.triu(generator.integers(-2, 3, size=(n, n)).astype(float), 1)
    matrix = half + half.T
    values = np.linalg.eigvalsh(matrix)
    if np.abs(values).min() > 1e-8:
        assert negative_eigenvalues(matrix[None])[0] == (values < 0).sum()


def test_a_zero_matrix_has_no_negative_eigenvalue():
    assert negative_eigenvalues(np.zeros((1, 5, 5)))[0] == 0


def test_a_matrix_of_zero_diagonal_takes_two_by_two_pivots():
    """[[0, 1], [1, 0]] repeated: one negative eigenvalue each."""
    block = np.kron(np.eye(3), np.array([[0.0, 1.0], [1.0, 0.0]]))
    assert negative_eigenvalues(block[None])[0] == 3


@pytest.mark.parametrize("n", range(1, 8))
def test_pivots_that_overflow_count_as_minus_one_or_right(n):
    """Products of two entries of 1e300 are no numbers: nothing beyond the matrix is touched."""
    matrix = np.random.default_rng(n).normal(size=(50, n, n))
    matrix += matrix.transpose(0, 2, 1)
    found = negative_eigenvalues(matrix * 1e300)
    known = negative_eigenvalues(matrix)
    assert ((found == known) | (found == -1)).all()


def test_entries_that_are_not_finite_count_as_minus_one():
    matrices = np.stack([np.eye(3), np.full((3, 3), np.nan), -np.eye(3)])
    np.testing.assert_array_equal(negative_eigenvalues(matrices), [0, -1, 3])


@pytest.mark.parametrize("size", [1, 2, 3, 6])
def test_small_systems_of_all_lanes_at_once_are_solved_with_row_exchanges(size):
    """Oracle: LAPACK; zeros in a corner need exchanges, its own in each lane. 1e-12: conditions."""
    generator = np.random.default_rng(1)
    a = generator.normal(size=(LANES, size, size)) + 2 * np.eye(size)[::-1]
    b = generator.normal(size=(LANES, size, 2))
    a[::2, 0, 0] = 0.0 if size > 1 else 2.0
    rows = work_rows(size * (size + 2))
    rows[:] = np.concatenate([a, b], axis=2).transpose(1, 2, 0).reshape(-1, LANES)
    solve_lanes(rows, size, size + 2)
    found = rows.reshape(size, size + 2, LANES)[:, size:].transpose(2, 0, 1)
    np.testing.assert_allclose(found, np.linalg.solve(a, b), rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("zeros", [False, True])
def test_large_systems_have_the_solution_inertia_and_determinant_of_libraries(zeros):
    """Oracle: LAPACK. 1e-9 of the right-hand side, 1e-8 of det: conditions of random matrices."""
    generator = np.random.default_rng(2)
    matrix = generator.normal(size=(3, 60, 60))
    matrix += matrix.transpose(0, 2, 1)
    if zeros:  # a saddle point with more unknowns than multipliers
        matrix[:, 40:, 40:] = 0.0
    columns, rows = generator.normal(size=(2, 3, 2, 60))
    corner, rhs = generator.normal(size=(3, 2, 2)), generator.normal(size=(3, 4, 62))
    found = solve_bordered(matrix, columns, rows, corner, rhs)
    full = np.block([[matrix, columns.transpose(0, 2, 1)], [rows, corner]])
    left = np.einsum("lij,lsj->lsi", full, found.x) - rhs
    assert np.abs(left).max() < 1e-9
    np.testing.assert_array_equal(found.negative, (np.linalg.eigvalsh(matrix) < 0).sum(axis=1))
    told = in_units(found.determinant, 0.0)
    np.testing.assert_allclose(told, np.linalg.det(matrix), rtol=1e-8)


def test_one_singular_lane_is_not_a_number_and_leaves_the_others():
    """Oracle: LAPACK lane by lane. 1e-14: identity matrices."""
    matrix = np.stack([np.eye(2), np.zeros((2, 2)), 2 * np.eye(2)])
    nothing = np.zeros((3, 0, 2))
    found = solve_bordered(matrix, nothing, nothing, np.zeros((3, 0, 0)), np.ones((3, 1, 2)))
    np.testing.assert_allclose(found.x[[0, 2], 0], [[1, 1], [0.5, 0.5]], rtol=1e-14)
    assert np.isnan(found.x[1]).all()


def test_orthonormal_rows_are_those_of_the_triangular_factor():
    """The unique Q of QR with a positive diagonal of R, in the metric; others lose their shares."""
    generator = np.random.default_rng(3)
    rows, weights = generator.normal(size=(9, 4, 7)), np.array([0.5, 1.0, 2.0, 3.0, 1.0, 1.0, 0.0])
    found = orthonormal_rows(rows, 3, weights)
    factor = np.sqrt(weights)
    for lane in range(9):
        q, r = np.linalg.qr((rows[lane, :3] * factor).T)
        placed = (q * np.sign(np.diag(r))).T
        np.testing.assert_allclose(found[lane, :3] * factor, placed, atol=1e-12)
        rest = rows[lane, 3] - (placed @ (factor * rows[lane, 3])) @ found[lane, :3]
        np.testing.assert_allclose(found[lane, 3], rest, atol=1e-12)


def test_dependent_rows_become_no_numbers():
    """Nothing is left of the second row; the other lane is as it was."""
    rows = np.array([[[1.0, 0.0], [0.0, 2.0]], [[1.0, 0.0], [3.0, 0.0]]])
    found = orthonormal_rows(rows, 2, np.ones(2))
    assert np.array_equal(found[0], np.eye(2))
    assert np.isnan(found[1, 1]).all()
