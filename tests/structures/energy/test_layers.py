"""Energies in every layer above: lifts, limits, searches, sets, routes. No layer knows of them."""

from functools import cache

import numpy as np
import pytest

import equimorph as em
from equimorph.structures import EnergyStructure, Spring, Unknown
from oracles.specimens import closed_chain, written_spring
from typecheck import unchecked

FOLD = (1.0 - 0.8 ** (2 / 3)) ** 1.5
BUCKLING = (3.0 - np.sqrt(5.0)) / 2.0


@cache
def column():
    """Two links of length 1 on hinge springs k = 1 under a dead weight P, on a turning foot."""
    return EnergyStructure(
        "((phi1 - alpha)**2 + (phi2 - phi1)**2)/2 + P*(cos(phi1) + cos(phi2))",
        [Unknown(name, "alpha", (-2.0, 2.0)) for name in ("phi1", "phi2")],
        [em.Parameter("alpha", "rad", 1.0, "actuator", 0.0), em.Parameter("P", "k", 1.0, "load")],
        descriptors={"lean": "sin(phi1) + sin(phi2)"},
    )


def test_a_lift_ends_at_the_fold_of_the_spring():
    """F/k = (1 − x_l^⅔)^(3/2), PHYSICS section 2. 1e-12: folds are located to round-off."""
    path = em.lift(written_spring().natural_state(x_l=0.8, k=1.0), to={"F": 1.0})
    assert path.end.kind == "fold"
    assert path.end.state["F"] == pytest.approx(FOLD, rel=1e-12)


def test_the_column_buckles_at_its_closed_form():
    """det [[2 − P, −1], [−1, 1 − P]] = 0 at P = (3 − √5)/2; supercritical. 1e-12: round-off."""
    limit = em.limit_load(column().natural_state(alpha=0.0), "P")
    assert limit.kind == "branch point"
    assert limit.criticality == "supercritical"
    assert limit.value == pytest.approx(BUCKLING, rel=1e-12)


def test_searches_find_what_the_written_out_spring_has():
    """Three equilibria at F = 0.05. 1e-12: polished states."""
    at = {"x_l": 0.8, "F": 0.05, "k": 1.3}
    found, expected = (em.find_equilibria(s, at) for s in (written_spring(), Spring()))
    np.testing.assert_allclose(np.sort(found.z[:, 0]), np.sort(expected.z[:, 0]), atol=1e-12)
    assert sorted(found.index) == sorted(expected.index)


def test_the_set_of_the_column_is_one_clean_disc_with_a_cusp():
    """Its folds meet at α = 0, P = (3 − √5)/2. 1e-2: the vertex of a polyline next to the cusp."""
    box, lean = em.Box(alpha=(-0.6, 0.6), P=(0.1, 0.6)), column().descriptor("lean")
    with unchecked():
        found = em.equilibrium_set(column(), box, intervals=(15, 15))
        there = found.at(alpha=0.0, P=0.45)
        start, goal = max(there.stable, key=lean), min(there.stable, key=lean)
        route = em.plan(found, start, goal, margin=0.05)
    assert found.audit.clean
    assert (found.audit.euler_characteristic, found.audit.components) == (1, 1)
    folds = found.points["P"][found.kinds == 1]
    assert folds.min() == pytest.approx(BUCKLING, abs=1e-2)
    assert lean(start) == pytest.approx(-lean(goal), rel=1e-12)  # mirror images
    assert route.status == "arrived"
    assert route.margin >= 0.05
    assert route.path.states["P"].min() < BUCKLING


def test_a_set_with_constraints_and_several_sheets_is_clean():
    """Eight equilibria of the five-link chain in index pairs: two stable, mirror images."""
    chain = closed_chain()
    angles = [chain.descriptor(f"phi{i}") for i in range(5)]
    box = em.Box(span=(0.75, 0.95), w=(-0.3, 0.33))
    within = [each for angle in angles for each in (angle <= 1.4, angle >= -1.4)]
    with unchecked():
        found = em.equilibrium_set(chain, box, within=within, intervals=(5, 5))
        here = found.at(span=0.85, w=0.1)
    assert found.audit.clean
    np.testing.assert_array_equal(np.bincount(here.index), [2, 2, 2, 2])
    lengths = np.cos(here.z[:, :5]).mean(axis=1)
    np.testing.assert_allclose(lengths, 0.85, rtol=1e-12)  # polished constraints
