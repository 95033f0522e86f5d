"""E. C. Zeeman's catastrophe machine: a disc turned by two elastic bands.

T. Poston, I. Stewart: Catastrophe theory and its applications (1978), section 5. The disc has
diameter 1; both bands have natural length 1 and pull at one pin on its rim; one ends at (0, −2),
the other where the hand holds it. On the axis the second derivative of the energy vanishes at
y² − 2.7 y + 0.6 = 0 with the pin towards the hand, at y² − 7y/6 − 1/3 = 0 with the pin away from
it.
"""

import numpy as np
import pytest

import equimorph as em
from typecheck import unchecked


@pytest.fixture(scope="module")
def machine():
    pin = "sin(theta)/2", "cos(theta)/2"
    return em.EnergyStructure(
        "(fixed - 1)**2 + (held - 1)**2",
        [em.Unknown("theta", "atan2(x, y)", guesses=(-np.pi, np.pi))],
        [
            em.Parameter("x", "diameter", 1.0, "actuator", 0.0),
            em.Parameter("y", "diameter", 1.0, "actuator", 3.0),
        ],
        definitions={
            "fixed": f"sqrt(({pin[0]})**2 + ({pin[1]} + 2)**2)",
            "held": f"sqrt(({pin[0]} - x)**2 + ({pin[1]} - y)**2)",
        },
        draw=[[0, -2], [*pin], ["x", "y"]],
    )


@pytest.fixture(scope="module")
def fold(machine):
    return em.lift(machine.natural_state(x=0.0, y=3.0), [{"x": 0.1}, {"y": 2.0}, {"x": -0.8}]).end


def test_folds_wind_through_four_cusps(machine, fold):
    """Two on the axis, two beside it, in one turn of the disc. 1e-10: cusps by Newton's method."""
    theta = machine.descriptor("theta")
    curve = em.fold_curve(fold.state, ("x", "y"), within=[theta <= 3.5, theta >= -2.7])
    cusps = [event.state.p for event in curve.events if event.kind == "cusp"]
    assert [end.kind for end in curve.ends] == ["constraint", "constraint"]
    assert len(cusps) == 4
    near = (7 / 6 + np.sqrt(49 / 36 + 4 / 3)) / 2
    far = (2.7 + np.sqrt(2.7**2 - 2.4)) / 2
    on_axis = np.sort([y for x, y in cusps if abs(x) < 1e-6])
    np.testing.assert_allclose(on_axis, [near, far], atol=1e-10)
    beside = np.array(sorted((p for p in cusps if abs(p[0]) > 1e-6), key=lambda p: p[0]))
    np.testing.assert_allclose(beside[0] * [-1, 1], beside[1], atol=1e-10)


def test_once_around_the_cusps_turns_the_disc_once(machine):
    """Around all four of them: the shape is the same as at the start, the state is another."""
    rest = machine.natural_state(x=0.0, y=3.0)
    way = [{"x": 1.0, "y": 2.5}, {"x": 1.0, "y": 1.0}, {"x": 0.0, "y": 0.9}, {"x": -1.0, "y": 1.0}]
    path = em.lift(rest, [*way, {"x": -1.0, "y": 2.5}, {"x": 0.0, "y": 3.0}])
    assert path.arrived
    assert path.end.state.z[0] == pytest.approx(2 * np.pi, abs=1e-9)


def test_a_bounded_turn_has_a_clean_set(machine):
    """Inside the cusps two stable states, and the pin towards the hand or, twice, away from it."""
    theta = machine.descriptor("theta")
    box, turn = em.Box(x=(-0.8, 0.8), y=(1.2, 2.8)), [theta <= 4, theta >= -4]
    with unchecked():
        eset = em.equilibrium_set(machine, box, intervals=(12, 12), within=turn)
    assert eset.audit.clean
    assert sorted(eset.at(x=0.0, y=2.0).index) == [0, 0, 1, 1, 1]
