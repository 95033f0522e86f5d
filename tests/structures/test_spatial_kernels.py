"""Kernels of rods in space against plain numpy and dense algebra, at random states and borders."""

import numpy as np
import pytest

import equimorph as em
from equimorph.linalg.determinants import in_units
from equimorph.structures.equations import Equations, advance_by
from oracles.spatial_twins import energy, equations, largest_curvature, nodal_fields

SOFT = {
    "ends": ("clamped", "free"), "axial": 5.0, "shear": 3.0, "natural_twist": 1.0, "curvature": 2.0,
    "loads": {"P": em.PointForce(1.0, (1.0, 2.0, 3.0))},
    "actuators": {"T": em.Tendon(0.05, 0.1, 0.5, binormal=0.02), "k": em.Curvature(about="n")},
}  # fmt: skip
FAMILY = {
    "clamped": {},
    "stretching, with a tendon": SOFT,
    "guided": {"axial": 5.0, "ends": ("clamped", "guided"), "actuators": {"T": em.Tendon(0.05)}},
    "spring, free end": {"axial": 5.0, "ends": ("free", {"x": 3.0}), "elements": 4, "degree": 5},
}
LANES = 21


@pytest.fixture(params=FAMILY, scope="module")
def case(request):
    """A rod's mechanics, random states with lengths near 1, and a generator."""
    rod = em.SpatialRod(torsion=0.77, lateral=1.5, **FAMILY[request.param])
    generator = np.random.default_rng(5)
    p = 0.3 * generator.normal(size=(LANES, len(rod.parameters)))
    z = rod.sample(p, generator)
    z[:, : rod.unknowns] += 0.05 * generator.normal(size=(LANES, rod.unknowns))
    return rod.mechanics, z, p, generator


def close(value, wanted, tolerance):
    assert np.abs(value - wanted).max() <= tolerance * np.abs(wanted).max()


def test_derivatives_equal_those_of_plain_jets(case):
    """Tolerance: round-off of some hundred terms."""
    mechanics, z, p, generator = case
    ways = [(generator.normal(size=z.shape), generator.normal(size=p.shape)) for _ in range(2)]
    for k in range(3):
        found = mechanics.equations(z, p, *ways[:k])
        for part, wanted in zip(found, equations(mechanics, z, p, *ways[:k]), strict=True):
            close(part, wanted, 1e-14)


def test_energies_and_shortenings_equal_plain_numpy(case):
    """Tolerance: round-off of some hundred terms."""
    mechanics, z, p, _ = case
    energies, shortenings = energy(mechanics, z, p)
    close(mechanics.energy(z, p), energies, 1e-13)
    assert np.abs(mechanics.shortenings(z, p) - shortenings).max() <= 1e-12


@pytest.mark.parametrize(("k", "sides"), [(0, 1), (1, 2), (2, 3)])
def test_bordered_solves_equal_dense_algebra(case, k, sides):
    """LU of the whole matrix; tolerance: condition numbers of random states up to 1e5."""
    mechanics, z, p, generator = case
    size, shift = mechanics.size, generator.normal(size=LANES) if k == 2 else None
    columns, rows = generator.normal(size=(2, LANES, k, size))
    corner = generator.normal(size=(LANES, k, k))
    rhs = generator.normal(size=(LANES, sides, size + k))
    solved = mechanics.solve(z, p, rhs, (columns, rows, corner) if k else None, shift)
    whole = np.zeros((LANES, size + k, size + k))
    whole[:, :size, :size] = mechanics.layout.dense(mechanics.entries(z, p, shift))
    negative = (np.linalg.eigvalsh(whole[:, :size, :size]) < 0.0).sum(axis=1)
    determinant = np.linalg.det(whole[:, :size, :size])
    whole[:, :size, size:], whole[:, size:, :size] = columns.transpose(0, 2, 1), rows
    whole[:, size:, size:] = corner
    wanted = np.linalg.solve(whole, rhs.transpose(0, 2, 1)).transpose(0, 2, 1)
    close(solved.x, wanted, 1e-9)
    np.testing.assert_array_equal(solved.negative, negative)
    np.testing.assert_allclose(in_units(solved.determinant, 0.0), determinant, rtol=1e-9)


def test_fused_steps_equal_those_of_the_general_solve(case):
    """Also where the rod stretches, and off the sphere |q| = 1."""
    mechanics, z, p, generator = case
    dp, row = generator.normal(size=p.shape), generator.normal(size=z.shape)
    corner, defect = generator.normal(size=(2, LANES))
    fused = mechanics.advance(z, p, dp, row, corner, defect)
    system = mechanics.linear_system(z, p, dp[:, None])
    general = advance_by(system, row, corner, defect, mechanics.constraints)
    for name, value in vars(general).items():
        close(getattr(fused, name), value, 1e-9)


def test_fused_steps_under_a_force_equal_those_of_the_general_solve(case):
    """Forces on all unknowns and closures, with parts along the quaternions."""
    mechanics, z, p, generator = case
    force, growth, row = generator.normal(size=(3, *z.shape))
    closing = row, *generator.normal(size=(2, LANES))
    fused = mechanics.advance_under((force, growth), z, p, *closing)
    general = Equations.advance_under(mechanics, (force, growth), z, p, *closing)
    for name, value in vars(general).items():
        close(getattr(fused, name), value, 1e-9)


def test_fields_equal_those_of_plain_numpy(case):
    mechanics, z, p, _ = case
    rod = em.structures.spatial.fields.SpatialFields(mechanics)
    nodal, (places, strains) = rod.nodal(z, p), nodal_fields(mechanics, z, p)
    close(nodal.places, places, 1e-13)
    close(nodal.strains, strains, 1e-13)
    largest, apart = largest_curvature(mechanics, z, p)
    assert (nodal.largest >= largest * (1.0 - 1e-12)).all()
    assert (nodal.largest <= largest + apart).all()
