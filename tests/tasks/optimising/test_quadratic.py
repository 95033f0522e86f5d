"""Small quadratic programmes against their optimality conditions and dense search."""

import numpy as np
from hypothesis import given, settings, strategies as st

from equimorph.tasks.optimising.quadratic import Quadratic, solve

DRAWN = settings(max_examples=60, deadline=None, derandomize=True, database=None)


@given(seed=st.integers(0, 2**32 - 1), d=st.integers(1, 3))
@DRAWN
def test_no_feasible_step_does_better(seed, d):
    """4000 random steps within reach; the step itself obeys all rows to 1e-8."""
    generator = np.random.default_rng(seed)
    m, k, reach = generator.integers(1, 5), generator.integers(0, 4), 0.7
    root = generator.normal(size=(d, d))
    problem = Quadratic(
        generator.normal(size=m),
        generator.normal(size=(m, d)),
        -generator.uniform(0.0, 0.5, k),
        generator.normal(size=(k, d)),
        root @ root.T + 0.1 * np.eye(d),
    )

    def value(steps):
        largest = (problem.f + steps @ problem.a.T).max(axis=1)
        return largest + 0.5 * np.einsum("si,ij,sj->s", steps, problem.hessian, steps)

    answer = solve(problem, reach)
    assert answer is not None
    assert np.abs(answer.step).max() <= reach + 1e-9
    assert (problem.g + problem.b @ answer.step <= 1e-8).all()
    assert abs(answer.weights.sum() - 1.0) < 1e-8
    assert min(answer.weights.min(), answer.multipliers.min(initial=0.0)) >= -1e-8
    steps = generator.uniform(-reach, reach, (4000, d))
    steps = steps[(problem.g + steps @ problem.b.T <= 0.0).all(axis=1)]
    if len(steps):
        assert value(answer.step[None])[0] <= value(steps).min() + 1e-9


def test_contradicting_rows_have_no_answer():
    """c ≤ −1 and c ≥ 1."""
    one = np.eye(1)
    problem = Quadratic(np.zeros(1), one, np.array([1.0, 1.0]), np.array([[1.0], [-1.0]]), one)
    assert solve(problem, 10.0) is None


def test_branches_that_do_not_exist_are_left_out():
    f = np.array([0.0, -np.inf])
    problem = Quadratic(f, np.array([[1.0], [0.0]]), np.zeros(0), np.zeros((0, 1)), np.eye(1))
    answer = solve(problem, 0.5)
    assert answer is not None
    np.testing.assert_allclose(answer.step, [-0.5])
