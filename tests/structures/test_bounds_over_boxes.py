"""Enclosures of F, F_z and F_p hold every value in their boxes, and little more."""

import numpy as np
import pytest

from equimorph.linalg.intervals import Interval
from oracles.specimens import SPECIMENS

ENCLOSED = [
    each for each in SPECIMENS
    if each.structure.enclosure(*(Interval.at(x[:1]) for x in each.states()[:2])) is not None
]  # fmt: skip


def derivatives(structure, z, p):
    """F, F_z and F_p by solving with unit vectors and by the parameters one by one."""
    lanes, size = z.shape
    unit = np.broadcast_to(np.eye(size), (lanes, size, size)).copy()
    matrix = np.linalg.inv(structure.solve(z, p, unit).x.transpose(0, 2, 1))
    units = np.eye(p.shape[1])
    columns = [structure.parameter_derivative(z, p, np.tile(one, (lanes, 1))) for one in units]
    return structure.residual(z, p), matrix, np.stack(columns, axis=2)


@pytest.mark.parametrize("specimen", ENCLOSED, ids=lambda each: each.name)
def test_values_in_boxes_lie_within_their_bounds(specimen):
    """And reach more than a third of them: the bounds are not much larger than what occurs."""
    structure, generator = specimen.structure, np.random.default_rng(1)
    z, p, _, _ = specimen.states(lanes=4)
    reach = np.full_like(z, 1e-3), np.full_like(p, 1e-3)
    boxes = (Interval.around(*each) for each in zip((z, p), reach, strict=True))
    bounds = structure.enclosure(*boxes)
    found = bounds.residual, bounds.matrix, bounds.columns
    share = np.zeros(2)
    for _ in range(60):
        inside = [
            x + r * generator.choice([-1.0, 1.0], x.shape)
            for x, r in zip((z, p), reach, strict=True)
        ]
        values = derivatives(structure, *inside)
        for each, value in zip(found, values, strict=True):
            rounding = 1e-9 * np.abs(value).max()  # of the inverse of the inverse
            assert (each.low - rounding <= value).all()
            assert (value <= each.high + rounding).all()
        for k in range(2):
            wide = found[k].radius > 1e-3 * found[k].radius.max()
            gap = np.abs(values[k] - found[k].middle)[wide] / found[k].radius[wide]
            share[k] = max(share[k], gap.max())
    assert (share > 0.3).all()
    assert (share <= 1.0 + 1e-5).all()


@pytest.mark.parametrize("specimen", ENCLOSED, ids=lambda each: each.name)
def test_bounds_at_points_are_as_narrow_as_rounding(specimen):
    z, p, _, _ = specimen.states()
    bounds = specimen.structure.enclosure(Interval.at(z), Interval.at(p))
    for each in (bounds.residual, bounds.matrix, bounds.columns):
        assert each.radius.max() <= 1e-12 * (1.0 + each.size.max())
    np.testing.assert_allclose(bounds.residual.middle, specimen.structure.residual(z, p),
                               rtol=0, atol=bounds.residual.radius.max())  # fmt: skip
