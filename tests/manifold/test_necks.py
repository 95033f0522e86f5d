"""Necks, gaps, cone points and spheres far smaller than a cell of the grid.

Quadrics known by name: yᵀ A y = ±e² with y = (x, p, r) − centre, A of signature (+, +, −). With a
plus they are joined by a neck of radius about e, with a minus they are two sheets apart; for e = 0
they are a cone. Beside them lies a sheet x = 3 (one disc), where the natural state is.
"""

import numpy as np
import pytest

import equimorph as em
from oracles.close_states import hyperboloid, quadric
from oracles.specimens import SPECIMENS
from typecheck import unchecked

BOX = em.Box(p=(-1, 1), r=(-1, 1))
NECK, GAP = (2, 1), (3, 3)
"""Components and Euler characteristic: an annulus and a disc, and three discs."""
RADII = (0.03, 0.01, 0.003, 0.001, 0.0003)
UPRIGHT = hyperboloid(0.0, 0.0, 1.0)


def lifted(form, centre, level, intervals=None):
    with unchecked():
        return em.equilibrium_set(quadric(form, centre, level), BOX, intervals=intervals)


def any_cone(number):
    """Form and centre; every second axis is near the plane of the parameters: folds cross there."""
    generator = np.random.default_rng(number)
    tilt = np.radians(generator.uniform(0.0, 30.0))
    tilt = 0.5 * np.pi - tilt if number % 2 else tilt
    form = hyperboloid(tilt, generator.uniform(0.0, 2.0 * np.pi), generator.uniform(0.1, 0.4))
    return form, (generator.uniform(-0.3, 0.3), *generator.uniform(-0.6, 0.6, 2))


def assert_known(eset, known):
    assert (eset.audit.components, eset.audit.euler_characteristic) == known
    assert eset.audit.clean, eset.audit


@pytest.mark.parametrize(("radius", "number"), [(0.003, 1), (0.0003, None)])
def test_necks_and_gaps_far_smaller_than_a_cell(radius, number):
    """Cells of 0.13 × 0.14: the edges of none of them sees the neck."""
    form, centre = any_cone(number) if number else (UPRIGHT, (0.0, 0.31, 0.22))
    assert_known(lifted(form, centre, radius**2, (15, 14)), NECK)
    assert_known(lifted(form, centre, -(radius**2), (15, 14)), GAP)


@pytest.mark.parametrize("number", [pytest.param(None, marks=pytest.mark.slow), 1])
def test_cone_points_are_named(number):
    form, centre = any_cone(number) if number is not None else (UPRIGHT, (0.0, 0.31, 0.22))
    audit = lifted(form, centre, 0.0, (15, 14)).audit
    assert not audit.clean
    (place,) = audit.touching
    assert dict(place) == pytest.approx({"p": centre[1], "r": centre[2]}, abs=1e-7)
    assert dict(audit.rows())["sheets touch"].startswith("in one point (cone point) at p = ")


def test_a_hole_inside_a_tetrahedron_is_found():
    """x² = p² + r² + s² − e² over three parameters: a neck S² × [0, 1], Euler characteristic 2."""
    radius, tip = 0.02, (0.03, 0.04, -0.02)
    gap = " + ".join(f"({name} - ({at}))**2" for name, at in zip("prs", tip, strict=True))
    parameters = [em.Parameter(name, "1", 1.0, "actuator", 0.0) for name in "prs"]
    energy = f"x**3/3 - x*({gap} - {radius}**2)"
    unknown = em.Unknown("x", "0.05", guesses=(-2, 2))
    structure = em.EnergyStructure(energy, [unknown], parameters)
    box = em.Box(p=(-1, 1), r=(-1, 1), s=(-1, 1))
    with unchecked():
        eset = em.equilibrium_set(structure, box, intervals=(5, 5, 5))
    assert eset.audit.clean, eset.audit
    assert (eset.audit.components, eset.audit.euler_characteristic) == (1, 2)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(10))
def test_necks_of_any_direction_on_the_default_grid(number):
    form, centre = any_cone(number)
    for radius in RADII:
        assert_known(lifted(form, centre, radius**2), NECK)
        assert_known(lifted(form, centre, -(radius**2)), GAP)
    audit = lifted(form, centre, 0.0).audit
    assert len(audit.touching) == 1
    assert not audit.clean


@pytest.mark.slow
@pytest.mark.parametrize("number", range(20))
def test_small_spheres_are_whole(number):
    """Radii from 0.03 to 0.003; one of 14 was closed in two halves, without a word."""
    generator = np.random.default_rng(number)
    centre = (generator.uniform(-0.5, 0.5), *generator.uniform(-0.8, 0.8, 2))
    radius = 10.0 ** generator.uniform(np.log10(0.003), np.log10(0.03))
    eset = lifted(np.eye(3), centre, radius**2)
    assert eset.audit.clean, eset.audit
    assert sorted(each.euler_characteristic for each in eset.components) == [1, 2]


@pytest.mark.slow
def test_folds_of_sheets_that_have_nothing_in_common_are_no_necks():
    """A truss with 200 states over a point: folds face each other everywhere, and nothing is there.

    Newton's method from between them diverged in the states while the parameters stood still,
    which passed for a neck: 70 triangles were bisected here, and 14 are.
    """
    truss = next(each.structure for each in SPECIMENS if each.name == "truss")
    box = em.Box(F=(-0.06, 0.02), H=(-0.1, -0.03))
    fixed = {"a": 0.1711, "b": -0.2033}
    eset = em.equilibrium_set(truss, box, fixed=fixed, intervals=(2, 2), checks=0)
    assert eset.audit.clean
    assert eset.audit.bisected < 20
