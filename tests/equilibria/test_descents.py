"""Descents from unstable states, however narrow the wells are."""

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria.descents import descend
from equimorph.equilibria.gradient_flow import Ending
from oracles.close_states import close_roots, close_sheets

DISTANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5)


@pytest.mark.parametrize("distance", DISTANCES)
def test_descents_land_on_the_roots_beside(distance):
    """E' = (x − 3)(x − a)(x − a − d)(x − a − 2d): a, a + 2d are saddles; none is below a."""
    structure = close_sheets(distance)
    roots, p = close_roots(distance, 3, 0.3, 0.2), np.tile([0.3, 0.2], (2, 1))
    led = descend(structure, roots[[0, 2], None], p)
    assert led.code.tolist() == [[Ending.LANDED] * 2, [Ending.ESCAPED, Ending.LANDED]]
    # Newton ends at corrections of 1e-10
    assert led.z[0, :, 0] == pytest.approx(roots[[1, 3]], abs=1e-9)
    assert led.z[1, 1, 0] == pytest.approx(roots[1], abs=1e-9)


@pytest.mark.parametrize("distance", DISTANCES)
def test_snaps_land_in_the_next_well_however_narrow(distance):
    """The same, one state at a time and with the way."""
    structure = close_sheets(distance)
    roots = close_roots(distance, 3, 0.3, 0.2)
    up, down = em.snap_landing(em.State(structure, roots[2:3], np.array([0.3, 0.2])))
    assert up.landed
    assert down.landed
    assert [down.state.z[0], up.state.z[0]] == pytest.approx(roots[[1, 3]], abs=1e-9)
    assert (np.diff(down.way.z[:, 0]) < 0.0).all()


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_lengths_have_no_unit(unit):
    """E = ¼x⁴ − ½x² in other units of length: the same landings, whatever the unit."""
    well = em.EnergyStructure(
        f"(x/{unit})**4/4 - (x/{unit})**2/2 - a*x",
        [em.Unknown("x", unit, guesses=(-2.0 * unit, 2.0 * unit))],
        [em.Parameter("a", "1", 1.0, "load", 0.0)],
    )
    up, down = em.snap_landing(em.State(well, np.zeros(1), np.zeros(1)))
    assert [down.state.z[0], up.state.z[0]] == pytest.approx([-unit, unit], rel=1e-9)
    assert up.released == pytest.approx(0.25, rel=1e-9)
