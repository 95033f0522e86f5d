"""Compiled energies and largest curvatures of general rods against plain formulas."""

import numpy as np
import pytest
from numpy.polynomial import legendre

from equimorph.structures import Rod
from equimorph.structures.rod.general import GeneralMechanics
from equimorph.structures.rod.general_field_kernels import KAPPA
from oracles.specimens import specimens

GENERAL = [
    each
    for each in specimens()
    if isinstance(each.structure, Rod) and isinstance(each.structure.mechanics, GeneralMechanics)
]
LANES = 11


@pytest.fixture(params=GENERAL, ids=lambda each: each.name)
def drawn(request):
    """Mechanics, random states and parameters, and the rod."""
    generator, rod = np.random.default_rng(0), request.param.structure
    p = np.array(request.param.centre) * generator.uniform(0.5, 1.5, (LANES, len(rod.parameters)))
    return rod.mechanics, rod.sample(p, generator), p, rod


def test_energy_is_the_lagrangian_without_the_multipliers_part(drawn):
    """L of `RodModel`, and its derivative by the multipliers at fixed angles, by numpy."""
    mechanics, z, p, _ = drawn
    model, m = mechanics.model, mechanics.constraints
    theta, y = mechanics.nodal_angles(z, p), mechanics.scalars(z, p)
    total = 0.5 * np.einsum("li,ij,lj->l", theta, mechanics.layout.assembled, theta)
    total -= np.einsum("li,ji,lj->l", theta, model.slope, y)
    total += 0.5 * np.einsum("li,ij,lj->l", y, model.quadratic, y)
    places = model.mesh.element_nodes.ravel()
    sine, cosine, pull = (y @ each for each in (model.sine, model.cosine, model.tension))
    normal = sine * np.sin(theta)[:, places] + cosine * np.cos(theta)[:, places]
    total += (normal - 0.5 * model.softness * (normal + pull) ** 2).sum(axis=1)
    if mechanics._area is not None:
        total -= mechanics._pressure(y) * mechanics._area.value(theta)
    total -= (y[:, :m] * mechanics._gradient(theta, y)[:, :m]).sum(axis=1)
    np.testing.assert_allclose(mechanics.energy(z, p), total, rtol=1e-11, atol=1e-11)


def test_largest_curvature_is_that_of_many_places(drawn):
    """Curvatures of the elements' polynomials at 4001 places miss a peak by a share of 1e-5.

    Between two elements κ has two values, which differ by the error of the discretisation.
    """
    mechanics, z, p, rod = drawn
    z, found = rod.natural(p)
    z, p = z[found], p[found]
    value, place = mechanics.largest_curvature(z, p)
    fields = mechanics._fields
    kappa = fields.everywhere(mechanics.nodal_angles(z, p), mechanics.scalars(z, p))[:, :, KAPPA]
    basis = legendre.legvander(np.linspace(-1.0, 1.0, 4001), fields.reference.degree)
    sampled = np.abs(np.einsum("ij,lej->lei", basis @ fields.reference.to_legendre, kappa))
    np.testing.assert_allclose(value, sampled.max(axis=(1, 2)), rtol=1e-5)
    at = range(len(z))
    there = np.abs(mechanics.fields(z, p, place)[at, at, 1])
    assert len(z) > 2
    np.testing.assert_allclose(there, value, rtol=1e-7)
