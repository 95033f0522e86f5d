"""Compiled pressure on rods against the formulas of the enclosed area, and difference quotients."""

from dataclasses import replace

import numpy as np
import pytest

from equimorph.structures.equations import Equations
from equimorph.structures.rod.general import GeneralMechanics
from oracles.specimens import specimens

INFLATED = [each for each in specimens() if each.name.startswith("inflated")]
LANES, STEP = 11, 1e-6


@pytest.fixture(params=INFLATED, ids=lambda each: each.name)
def drawn(request):
    """A rod, random states, parameters, and their changes; one rod closes its area by a line."""
    generator, rod = np.random.default_rng(0), request.param.structure
    p = np.array(request.param.centre) * generator.uniform(0.5, 1.5, (LANES, len(rod.parameters)))
    return rod, rod.sample(p, generator), p, generator.normal(size=p.shape)


def dense(rod, z, p):
    """F_z in full."""
    mechanics = rod.mechanics
    bent = mechanics.nodal_angles(z, p), mechanics._pressure(mechanics.scalars(z, p))
    return mechanics.layout.dense(*mechanics.parts(z, p), bent)


def bare(mechanics):
    """Mechanics of the same rod without pressure."""
    model = mechanics.model
    return GeneralMechanics(replace(model, pressure=np.zeros_like(model.pressure)))


def velocity(mechanics, dz, dp):
    """Changes of the angles of all nodes, and of the pressure."""
    y = mechanics.scalars(dz, dp)
    y[:, -1] = 0.0
    return mechanics._angles(dz, y), mechanics._pressure(y)[:, None]


def test_forces_are_those_of_the_enclosed_area(drawn):
    rod, z, p, dp = drawn
    mechanics, area, n = rod.mechanics, rod.mechanics._area, rod.unknowns
    theta, inner = mechanics.nodal_angles(z, p), mechanics.unknown_nodes
    pull = mechanics._pressure(mechanics.scalars(z, p))[:, None]
    moved, change = velocity(mechanics, np.zeros_like(z), dp)
    found, expected = mechanics.linearised(z, p, dp), bare(mechanics).linearised(z, p, dp)
    work = area.gradient(theta)
    turn = pull * area.gradient_derivative(theta, moved) + change * work
    for one, other, part in zip(found, expected, (pull * work, turn), strict=False):
        np.testing.assert_allclose(one[:, :n], other[:, :n] - part[:, inner], atol=1e-13)


def test_the_area_is_that_of_the_formula(drawn):
    rod, z, p, _ = drawn
    mechanics, theta = rod.mechanics, rod.mechanics.nodal_angles(z, p)
    pull = mechanics._pressure(mechanics.scalars(z, p))
    expected = bare(mechanics).energy(z, p) - pull * mechanics._area.value(theta)
    np.testing.assert_allclose(mechanics.energy(z, p), expected, rtol=1e-12, atol=1e-12)


def test_second_derivatives_are_those_of_the_enclosed_area(drawn):
    rod, z, p, dp = drawn
    mechanics, area, n = rod.mechanics, rod.mechanics._area, rod.unknowns
    generator, theta = np.random.default_rng(2), mechanics.nodal_angles(z, p)
    directions = [
        (generator.normal(size=z.shape), by) for by in (dp, generator.normal(size=dp.shape))
    ]
    (v, v_pull), (w, w_pull) = (velocity(mechanics, *each) for each in directions)
    found, expected = (
        each.second_derivative(z, p, *directions) for each in (mechanics, bare(mechanics))
    )
    pull = mechanics._pressure(mechanics.scalars(z, p))[:, None]
    part = pull * area.second(theta, v, w) + v_pull * area.gradient_derivative(theta, w)
    part += w_pull * area.gradient_derivative(theta, v)
    expected[:, :n] -= part[:, mechanics.unknown_nodes]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_the_matrix_is_the_derivative_of_the_forces(drawn):
    rod, z, p, _ = drawn
    full = dense(rod, z, p)
    for k, step in enumerate(STEP * np.eye(rod.size)):
        slope = (rod.residual(z + step, p) - rod.residual(z - step, p)) / (2.0 * STEP)
        np.testing.assert_allclose(full[:, :, k], slope, atol=1e-7)


@pytest.mark.parametrize("k", [0, 1, 3])
def test_bordered_solves_are_those_of_the_full_matrix(drawn, k):
    """Dense LU and eigenvalues of numpy; random states have up to ten negative eigenvalues."""
    rod, z, p, _ = drawn
    generator, full = np.random.default_rng(k), dense(rod, z, p)
    columns, rows = generator.normal(size=(2, LANES, k, rod.size))
    corner, rhs = (
        generator.normal(size=(LANES, k, k)),
        generator.normal(size=(LANES, 5, rod.size + k)),
    )
    found = rod.solve(z, p, rhs, (columns, rows, corner))
    assert not found.pivoted.any()
    whole = np.concatenate([full, columns.transpose(0, 2, 1)], axis=2)
    whole = np.concatenate([whole, np.concatenate([rows, corner], axis=2)], axis=1)
    expected = np.linalg.solve(whole, rhs.transpose(0, 2, 1)).transpose(0, 2, 1)
    np.testing.assert_allclose(found.x, expected, rtol=1e-8, atol=1e-8)
    np.testing.assert_array_equal(found.negative, (np.linalg.eigvalsh(full) < 0.0).sum(axis=1))
    sign, size = np.linalg.slogdet(full)
    np.testing.assert_array_equal(np.sign(found.determinant[:, 0]), sign)
    own = np.log(np.abs(found.determinant[:, 0])) + found.determinant[:, 1] * np.log(2.0)
    np.testing.assert_allclose(own, size, atol=1e-8)


def test_the_fused_step_is_that_of_the_bordered_solve(drawn):
    rod, z, p, dp = drawn
    generator = np.random.default_rng(1)
    row, (corner, defect) = generator.normal(size=z.shape), generator.normal(size=(2, LANES))
    given = z, p, dp, row, corner, defect
    found, expected = rod.mechanics.advance(*given), Equations.advance(rod.mechanics, *given)
    for name, value in vars(expected).items():
        np.testing.assert_allclose(getattr(found, name), value, rtol=1e-7, atol=1e-8, err_msg=name)
