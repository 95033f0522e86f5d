"""Steps to pairs of states beside singular curves, against the formula in plain numpy."""

import numpy as np
import pytest

from equimorph.charts.kernels import predicted_pairs


@pytest.mark.parametrize("d", [1, 2, 3])
def test_steps_are_the_roots_of_the_reduced_equation(d):
    """σ ξ + ½ (η + ξ v)ᵀ H (η + ξ v) = u·r to round-off; the nearest states alone are tried."""
    generator, states, starts, most = np.random.default_rng(d), 30, 12, 5
    values, normal, null, points = generator.normal(size=(4, states, d))
    slope, bend = generator.normal(size=(2, states, d, d))
    curvature, least = bend + bend.transpose(0, 2, 1), generator.uniform(0.0, 0.1, states)
    near = np.array([generator.permutation(states)[:starts] for _ in points])
    near[:, ::4] = -1
    near[-1] = -1
    longest = 3.0
    told = values, slope, normal, least, null, curvature
    point, row, step = predicted_pairs(points, near, *told, most, longest)
    assert 0 < len(point) == 2 * len(set(zip(point.tolist(), row.tolist(), strict=True)))
    assert (np.linalg.norm(step, axis=1) <= longest).all()
    for n, k, x in zip(point, row, step, strict=True):
        own = near[n][near[n] >= 0]
        order = own[np.argsort(np.linalg.norm(points[n] - values[own], axis=1))]
        assert k in order[:most]
        rest = points[n] - values[k]
        eta = slope[k] @ rest
        xi = (x - eta) @ null[k] / (null[k] @ null[k])
        np.testing.assert_allclose(eta + xi * null[k], x, atol=1e-12)
        a, b = null[k] @ curvature[k] @ null[k], null[k] @ curvature[k] @ eta + least[k]
        c = 0.5 * eta @ curvature[k] @ eta - normal[k] @ rest
        # where there is no root, the distance from the middle is that of the mirrored parabola
        sign = np.sign(b**2 - 2.0 * a * c)
        middle = -b / a
        assert (xi - middle) ** 2 * sign == pytest.approx((b**2 - 2.0 * a * c) / a**2)


def test_points_without_singular_states_have_no_steps():
    """No state may be near, or there may be none at all."""
    nothing = (np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros((0, 2)), np.zeros(0))
    told = (*nothing, np.zeros((0, 2)), np.zeros((0, 2, 2)))
    point, row, step = predicted_pairs(np.ones((3, 2)), np.full((3, 4), -1), *told, 8, 1.0)
    assert len(point) == len(row) == 0
    assert step.shape == (0, 2)


def test_flat_coordinates_have_no_pairs():
    """Without curvature along v there is one state alone: steps are not finite."""
    told = (np.zeros((1, 1)), np.ones((1, 1, 1)), np.ones((1, 1)), np.ones(1), np.ones((1, 1)))
    found = predicted_pairs(
        np.ones((1, 1)), np.zeros((1, 1), int), *told, np.zeros((1, 1, 1)), 8, 1e9
    )
    assert len(found[0]) == 0
