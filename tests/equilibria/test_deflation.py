"""Newton that is pushed away from known solutions."""

import numpy as np

from equimorph.equilibria import deflated_newton, newton
from oracles.polynomial import Polynomial


def test_deflation_finds_the_roots_that_newton_does_not():
    """x³ = x: from x = 0.9 Newton finds 1; with 1 known, another; with two known, the last."""
    form = Polynomial(lambda x, a: x**4 * 0.25 - x**2 * 0.5 + 0.0 * a, 1, ("a",))
    start, p = np.array([[0.9]]), np.zeros((1, 1))
    roots = []
    z, found = newton(form, start, p)
    while found[0]:
        roots.append(z[0, 0])
        z, found = deflated_newton(form, start, p, np.array(roots)[None, :, None])
    assert np.allclose(sorted(roots), [-1.0, 0.0, 1.0], atol=1e-12)


def test_rows_of_nan_stand_for_no_known_solution():
    form = Polynomial(lambda x, a: x**4 * 0.25 - x**2 * 0.5 + 0.0 * a, 1, ("a",))
    start, p = np.array([[0.9], [1.3]]), np.zeros((2, 1))
    plain, _ = newton(form, start, p)
    z, found = deflated_newton(form, start, p, np.full((2, 3, 1), np.nan))
    assert found.all()
    assert np.allclose(z, plain, atol=1e-12)
