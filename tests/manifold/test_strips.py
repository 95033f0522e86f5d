"""Side branches that leave a symmetric sheet and come back to it: tubes narrower than the grid."""

import numpy as np
import pytest

import equimorph as em
from oracles.complexes import assert_faithful
from typecheck import unchecked

BOX = em.Box(a=(-1.0, 1.1), b=(-1.0, 1.2))
SLANT = 0.13


def tube(squared_width, sign=1):
    """x (x² + (a − slant·b)² − w²) = 0: a plane, and a tube of half the width w around it."""
    energy = f"{sign} * (x**4/4 + ((a - {SLANT}*b)**2 - ({squared_width})) * x**2/2)"
    parameters = [
        em.Parameter("a", "1", 1.0, "actuator", 0.0),
        em.Parameter("b", "1", 1.0, "load", 0.0),
    ]
    return em.EnergyStructure(energy, [em.Unknown("x", "0", guesses=(-2.5, 3.5))], parameters)


def lifted(structure, grid):
    """Set without checks of shapes; those of the first test have them."""
    with unchecked():
        return em.equilibrium_set(structure, BOX, intervals=grid)


@pytest.fixture(scope="module")
def strip():
    return em.equilibrium_set(tube("0.01"), BOX, intervals=(6, 6), checks=0)


def test_a_strip_between_pitchforks_hangs_together(strip):
    """Euler characteristic: plane 1, tube 0, less two segments."""
    assert_faithful(strip)
    assert strip.audit.euler_characteristic == -1


@pytest.mark.parametrize(
    ("squared_width", "sign", "euler"),
    [
        pytest.param("0.01", -1, -1, id="subcritical", marks=pytest.mark.slow),
        pytest.param("0.01*(0.5 - b)*(b + 0.5)", 1, 3, id="closed", marks=pytest.mark.slow),
        pytest.param("0.0009", 1, -1, id="seen by no vertex"),
    ],
)
def test_strips_on_another_grid(squared_width, sign, euler):
    """A closed strip is a sphere: plane 1, sphere 2, less their common circle 0."""
    eset = lifted(tube(squared_width, sign), (7, 9))
    assert_faithful(eset)
    assert eset.audit.euler_characteristic == euler


def test_all_states_over_the_strip_are_in_the_set(strip):
    """Three over |a − slant·b| < w, from x² = w² − (a − slant·b)²; one beside it."""
    for b in np.linspace(-0.9, 1.1, 9):
        inside = np.sort(strip.at(a=SLANT * b + 0.03, b=b).z[:, 0])
        expected = np.sqrt(0.01 - 0.03**2) * np.array([-1, 0, 1])
        np.testing.assert_allclose(inside, expected, atol=1e-9)
        assert len(strip.at(a=SLANT * b + 0.13, b=b)) == 1


@pytest.mark.slow
@pytest.mark.parametrize("sign", [1, -1], ids=["supercritical", "subcritical"])
@pytest.mark.parametrize("grid", [(6, 6), (9, 7), (12, 12)])
@pytest.mark.parametrize("width", [0.05, 0.02, 0.01])
def test_strips_that_no_vertex_meets_are_found_or_named(width, grid, sign):
    """Down to a 35th of an interval, at which bisection ends on the coarsest grid."""
    audit = lifted(tube(repr(width**2), sign), grid).audit
    if width > 0.01 or grid != (6, 6):
        assert audit.clean
    assert not audit.clean or audit.euler_characteristic == -1
