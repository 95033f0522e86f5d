"""Sheets that no search sees are found by descents from the unstable sheet beside them."""

from dataclasses import replace

import numpy as np
import pytest

import equimorph as em
from equimorph.manifold.lifting import completeness, seeds
from oracles.close_states import close_roots, close_sheets
from sets import blind
from typecheck import unchecked

BOX = em.Box(p=(-1, 1), r=(-1, 1))


@pytest.mark.parametrize("distance", [0.1, 1e-3])
def test_a_stable_sheet_that_no_search_sees_is_found(monkeypatch, distance):
    """E' = (x − 3)(x − a)(x − a − d)(x − a − 2d): x = a + d lies between two unstable sheets."""
    for module in (seeds, completeness):
        monkeypatch.setattr(module, "search_points", blind(module.search_points))
    monkeypatch.setattr(completeness, "SCATTERED", 0)
    with unchecked():
        eset = em.equilibrium_set(close_sheets(distance), BOX, intervals=(6, 7))
    assert eset.audit.clean
    assert eset.audit.recovered > 0
    assert sorted(each.index for each in eset.strata) == [0, 0, 1, 1]
    here = eset.at(p=0.3, r=0.2)
    # Newton ends at corrections of 1e-10
    assert np.sort(here.z[:, 0]) == pytest.approx(close_roots(distance, 3, 0.3, 0.2), abs=1e-9)


@pytest.mark.parametrize("narrow", [1.0, 0.02])
def test_sheets_that_join_others_only_beyond_the_box_are_met_by_lines(monkeypatch, narrow):
    """E' = x³ − p x + r, p > 1: the sheets x > 0 and x < 0 join where r² > 4 p³/27, off the box.

    The search sees neither the unstable sheet nor the lower one; all three are there. Descents do
    not begin at a stable sheet, so lines beyond the box meet what it lacks.
    """

    def lower(states):
        return states.z[:, 0] < 0.5

    for module in (seeds, completeness):
        monkeypatch.setattr(module, "search_points", blind(module.search_points, lower))
    monkeypatch.setattr(completeness, "SCATTERED", 0)
    cusp = em.EnergyStructure(
        "x**4/4 - p*x**2/2 + r*x",
        [em.Unknown("x", "1", guesses=(-2.0, 2.0))],
        [em.Parameter("p", "1", 1.0, "actuator", 1.0), em.Parameter("r", "1", 1.0, "load", 0.0)],
    )
    with unchecked():
        eset = em.equilibrium_set(
            cusp, em.Box(p=(1.1, 1.5), r=(-0.2 * narrow, 0.2 * narrow)), intervals=(5, 4)
        )
    assert eset.audit.clean
    assert eset.audit.recovered > 0
    assert sorted(each.index for each in eset.strata) == [0, 0, 1]
    assert np.sort(eset.at(p=1.21, r=0.0).z[:, 0]) == pytest.approx([-1.1, 0.0, 1.1], abs=1e-12)
    assert "met" in dict(eset.audit.rows())["lines through all strata"]


def test_the_audit_says_what_descents_mean():
    with unchecked():
        eset = em.equilibrium_set(close_sheets(0.1), BOX, intervals=(6, 7))
    told = dict(eset.audit.rows())
    row = told["descents from unstable strata"]
    assert row.startswith("24 landed, 8 left the box of guesses; no stable sheet is missing unless")
    assert "fewer than 0 %" not in told["completeness check"]
    assert (
        dict(replace(eset.audit, checked=0).rows())["descents from unstable strata"] == "not made"
    )


@pytest.mark.parametrize(
    "radius", [0.003, *(pytest.param(e, marks=pytest.mark.slow) for e in (0.1, 0.03, 0.001))]
)
def test_closed_pieces_far_smaller_than_a_cell_are_found(radius):
    """Sphere x² + (p − .31)² + (r − .22)² = e² beside a sheet x = 3, in cells of 0.02 to 0.04."""
    gap = f"((p - 0.31)**2 + (r - 0.22)**2 - {radius}**2)"
    structure = em.EnergyStructure(
        f"x**4/4 - x**3 + {gap}*(x**2/2 - 3*x)",
        [em.Unknown("x", "3", guesses=(-2.5, 3.5))],
        [
            em.Parameter("p", "1", 1.0, "actuator", 0.0),
            em.Parameter("r", "1", 1.0, "load", 0.0),
        ],
    )
    with unchecked():
        eset = em.equilibrium_set(structure, BOX)
    assert eset.audit.clean
    assert [each.euler_characteristic for each in eset.components] == [1, 2]
    assert dict(eset.audit.rows())["closed pieces, necks"].startswith(
        "may be missed below p 0.043, r 0.025"
    )


@pytest.mark.slow
@pytest.mark.parametrize("sheets", [2, 3, 4, 5, 6])
@pytest.mark.parametrize("distance", [1e-1, 1e-2, 1e-3, 1e-4])
def test_sets_of_close_sheets_are_complete(distance, sheets):
    """As many sheets as roots, over the whole box."""
    with unchecked():
        eset = em.equilibrium_set(close_sheets(distance, sheets), BOX)
    assert eset.audit.clean
    assert len(eset.components) == sheets + 1
