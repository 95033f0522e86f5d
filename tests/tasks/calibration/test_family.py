"""Data of structures fitted to measurements whose truth is known."""

import numpy as np
import pytest

import equimorph as em
from equimorph.tasks.calibration.calibrate import Branch
from equimorph.tasks.calibration.unknowns import unknowns
from typecheck import unchecked

LOADS = np.array([0.05, 0.1, 0.2, 0.3])
NOMINAL = {"EI": 0.02, "length": 0.5}


def cantilever(EI, length):
    """A strip clamped at one end, N and m, with a dead load P at its tip."""
    return em.Rod(
        ends=("clamped", "free"), loads={"P": em.PointForce(1.0)}, EI=EI, length=length, elements=3
    )


def loaded(rod, loads=LOADS):
    """States under several loads."""
    rest = rod.natural_state()
    start = em.States(rod, np.tile(rest.z, (len(loads), 1)), np.tile(rest.p, (len(loads), 1)))
    return em.lift(start, {"P": loads}).states


def fit(wanted, truth, sigma=None, nominal=NOMINAL):
    """Fit to the tip's way of a strip of other data."""
    measured = loaded(cantilever(**truth))
    start = loaded(cantilever(**nominal))
    rod = start.structure
    tips = [
        em.MeasuredValues(one, there(measured), sigma)
        for one, there in zip(rod.position(1.0), measured.structure.position(1.0), strict=True)
    ]
    family = em.Family(cantilever, nominal)
    with unchecked():
        return em.calibrate(start, wanted, tips, family=family)


def test_stiffness_and_length_are_found():
    """1e-8: round-off of the states times how strongly the unknowns depend on them."""
    truth = {"EI": 0.0231, "length": 0.47}
    found = fit({"EI": "data", "length": "data"}, truth)
    assert found.fitted
    assert [found[name] for name in truth] == pytest.approx(list(truth.values()), rel=1e-8)
    assert found.states.structure.units.length == found["length"]
    np.testing.assert_allclose(found.states.residual, 0.0, atol=1e-10)


def test_a_stiffness_is_the_inverse_of_a_gain_of_the_load():
    """The same fit in other unknowns: EI = EI₀/g, and their relative deviations are the same."""
    truth = {**NOMINAL, "EI": 0.025}
    stiff, gain = fit({"EI": "data"}, truth, 1e-3), fit({"P": "gain"}, truth, 1e-3)
    assert stiff["EI"] == pytest.approx(0.025, rel=1e-8)
    assert stiff["EI"] * gain["gain of P"] == pytest.approx(NOMINAL["EI"], rel=1e-8)
    relative = [each.deviations[0] / each.values[0] for each in (stiff, gain)]
    assert relative[0] == pytest.approx(relative[1], rel=1e-5)


def test_the_jacobian_by_data_is_that_of_the_equilibria():
    """Central differences of whole solutions, of second order: 1e-6."""
    start = loaded(cantilever(**NOMINAL))
    free = unknowns(start, {"length": "data", "P": "gain"}, em.Family(cantilever, NOMINAL))
    tip = em.MeasuredValues(start.structure.height(1.0), np.zeros(4))
    table = np.zeros((4, 1))
    branch = Branch(free, [tip], table, np.ones((4, 1)), start.z, start.p, free.start)
    with unchecked():
        branch.residuals(free.start)
        jacobian = branch.jacobian(free.start)
        for k, step in enumerate((1e-5, 1e-5)):
            change = np.eye(2)[k] * step
            sides = [branch.residuals(free.start + sign * change) for sign in (1.0, -1.0)]
            slope = (sides[0] - sides[1]) / (2.0 * step)
            np.testing.assert_allclose(jacobian[:, k], slope, rtol=1e-6, atol=1e-8)


def test_a_stiffness_of_nothing_is_not_reached():
    """Tips far below what any strip of this length does: least squares leads to EI = 0."""
    start = loaded(cantilever(**NOMINAL))
    tip = em.MeasuredValues(start.structure.height(1.0), np.full(4, -0.6))
    with unchecked():
        found = em.calibrate(start, {"EI": "data"}, [tip], family=em.Family(cantilever, NOMINAL))
    assert not found.fitted
    assert found.why


@pytest.mark.parametrize(
    ("wanted", "family", "message"),
    [
        ({"EI": "data"}, None, "`family` must be given to fit the data of a structure; got none"),
        (
            {"EA": "data"},
            NOMINAL,
            r"`unknown` must name data of the family \(EI, length\); got",
        ),
        ({"EI": "data"}, {**NOMINAL, "EI": 0.03}, "`family` must make the structure of the states"),
    ],
)
def test_wrong_families_are_named(wanted, family, message):
    start = loaded(cantilever(**NOMINAL))
    tip = em.MeasuredValues(start.structure.height(1.0), np.zeros(4))
    made = None if family is None else em.Family(cantilever, family)
    with pytest.raises(em.InputError, match=message):
        em.calibrate(start, wanted, [tip], family=made)
