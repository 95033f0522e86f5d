"""Compiled pressure on rods against the formulas of the enclosed area, and difference quotients."""

import numpy as np
import pytest

from equimorph.linalg.lanes import over_lanes
from equimorph.structures.rod.pressure_kernels import press_lanes
from oracles.specimens import specimens

INFLATED = [each for each in specimens() if each.name.startswith("inflated")]
LANES, STEP = 11, 1e-6


@pytest.fixture(params=INFLATED, ids=lambda each: each.name)
def drawn(request):
    """A rod, random states, parameters, and their changes; one rod closes its area by a line."""
    generator, rod = np.random.default_rng(0), request.param.structure
    p = np.array(request.param.centre) * generator.uniform(0.5, 1.5, (LANES, len(rod.parameters)))
    return rod, rod.sample(p, generator), p, generator.normal(size=p.shape)


def test_forces_are_those_of_the_enclosed_area(drawn):
    rod, z, p, dp = drawn
    mechanics, inner = rod.mechanics, rod.mechanics.unknown_nodes
    area, theta = mechanics._area, mechanics.nodal_angles(z, p)
    pull = mechanics._pressure(mechanics.scalars(z, p))[:, None]
    moved, change = mechanics._velocity(np.zeros_like(z), dp)
    out = np.empty((3, LANES, rod.unknowns))
    over_lanes(press_lanes, mechanics._pressed, [z, p, dp], list(out))
    work = area.gradient(theta)
    turn = pull * area.gradient_derivative(theta, moved) + change * work
    for found, expected in zip(out, (pull * work, turn, pull * area.curvature(theta)), strict=True):
        np.testing.assert_allclose(found, -expected[:, inner], atol=1e-14)


def test_the_matrix_is_the_derivative_of_the_forces(drawn):
    rod, z, p, _ = drawn
    parts = rod.mechanics.parts(z, p)
    full = rod.mechanics._full_layout.dense(rod.mechanics._pressed_entries(z, p, *parts))
    for k, step in enumerate(STEP * np.eye(rod.size)):
        slope = (rod.residual(z + step, p) - rod.residual(z - step, p)) / (2.0 * STEP)
        np.testing.assert_allclose(full[:, :, k], slope, atol=1e-7)
