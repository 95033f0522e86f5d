"""Interval arithmetic on tapes encloses what the tapes compute."""

import numpy as np
import pytest

from equimorph.linalg.intervals import Interval
from equimorph.structures import EnergyStructure
from equimorph.structures.energy.tape import can_enclose, casadi, enclosure, tape
from equimorph.tasks.verification.schedule_check import verify

FORMULAS = [
    "x*y - x/(2 + y)",
    "sin(3*x) + cos(4*y) - tan(x/3)",
    "exp(x) - log(3 + y) + sqrt(4 + x)",
    "x**3 - y**4 + (2 + x)**2.5 + 1/(3 + x)**2",
    "sinh(x) + cosh(y) + tanh(x*y) + atan(x) + asinh(y)",
    "asin(x/3) + acos(y/3) + log1p(x/2) + expm1(y)",
]


@pytest.mark.parametrize("formula", FORMULAS)
def test_values_lie_between_the_bounds(formula):
    ca = casadi()
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    functions = {
        name: getattr(ca, name)
        for name in ("sin", "cos", "tan", "exp", "log", "sqrt", "sinh", "cosh", "tanh", "atan",
                     "asinh", "asin", "acos", "log1p", "expm1")
    }  # fmt: skip
    one = tape((x, y), eval(formula, functions, {"x": x, "y": y}))  # our own
    assert can_enclose(one)
    generator = np.random.default_rng(3)
    low = generator.uniform(-1.2, 1.0, (60, 2))
    high = low + generator.uniform(0.0, 0.8, (60, 2))
    bounds = enclosure(one, Interval(low, high))
    for _ in range(100):
        inside = low + generator.random((60, 2)) * (high - low)
        value = one(inside)
        assert (bounds.low <= value).all()
        assert (value <= bounds.high).all()


def test_narrow_intervals_give_narrow_bounds():
    ca = casadi()
    x = ca.SX.sym("x")
    one = tape((x,), ca.sin(x) * x**2)
    at = np.linspace(-2, 2, 9)[:, None]
    bounds = enclosure(one, Interval(at - 1e-9, at + 1e-9))
    assert bounds.radius.max() < 5e-8
    np.testing.assert_allclose(bounds.middle, one(at), atol=1e-12)


def test_poles_have_no_bounds():
    ca = casadi()
    x = ca.SX.sym("x")
    around = Interval(np.array([[-0.1]]), np.array([[0.1]]))
    for formula in (1 / x, ca.tan(x + ca.pi / 2), ca.log(x), 2 * x / (x * x + x), x + ca.log(x)):
        assert np.isinf(enclosure(tape((x,), formula), around).size).all()


def test_unusual_functions_are_not_enclosed():
    ca = casadi()
    x = ca.SX.sym("x")
    assert not can_enclose(tape((x,), ca.fabs(x)))


def test_motion_of_a_formula_is_proved_with_enclosed_bounds():
    """k (1 − cos φ) − M φ: sin φ = M/k, stable with margin k cos φ."""
    parameters = [{"name": "M", "default": 0.0}]
    structure = EnergyStructure("1 - cos(phi) - M*phi", "phi", parameters)
    found = verify([{"M": 0.8}], structure.natural_state(), proof=True)
    assert found.proof.status == "proved"
    assert found.proof.bounds == "enclosed"
    assert 0.0 < found.proof.margin <= 0.6
