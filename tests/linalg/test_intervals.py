"""Intervals hold the exact results: against rational arithmetic and series of rational terms."""

from fractions import Fraction

import numpy as np
import pytest

from equimorph.linalg.intervals import (
    Interval,
    cosine,
    inverse,
    power,
    product,
    sine,
    square,
)

GENERATOR = np.random.default_rng(11)
ONE = GENERATOR.normal(size=40) * 10.0 ** GENERATOR.integers(-8, 8, 40)
OTHER = GENERATOR.normal(size=40) * 10.0 ** GENERATOR.integers(-8, 8, 40)


def holds(bounds, exact):
    """Whether intervals hold rational numbers, and are no wider than needed."""
    lows, highs = bounds.low.ravel().tolist(), bounds.high.ravel().tolist()
    return all(
        Fraction(low) <= value <= Fraction(high)
        for low, high, value in zip(lows, highs, exact, strict=True)
    )


def rational(values):
    return [Fraction(each) for each in np.asarray(values).ravel().tolist()]


@pytest.mark.parametrize(
    ("ours", "exact"),
    [
        (lambda x, y: x + y, lambda x, y: x + y),
        (lambda x, y: x - y, lambda x, y: x - y),
        (lambda x, y: x * y, lambda x, y: x * y),
        (lambda x, y: x / y, lambda x, y: x / y),
        (lambda x, y: square(x) - inverse(y), lambda x, y: x * x - 1 / y),
    ],
    ids=["sum", "difference", "product", "quotient", "composed"],
)
def test_arithmetic_holds_the_rational_result(ours, exact):
    found = ours(Interval.at(ONE), Interval.at(OTHER))
    values = [exact(x, y) for x, y in zip(rational(ONE), rational(OTHER), strict=True)]
    assert holds(found, values)
    assert (found.radius <= 1e-14 * (np.abs(ONE) + found.size + 1 / np.abs(OTHER))).all()


def test_sums_and_products_with_matrices_hold_the_rational_result():
    """Terms of very different size cancel."""
    matrix = GENERATOR.normal(size=(6, 30)) * 10.0 ** GENERATOR.integers(-6, 6, 30)
    column = GENERATOR.normal(size=30)
    matrix[:, -1] = -(matrix[:, :-1] @ column[:-1]) / column[-1]
    exact = [sum(x * y for x, y in zip(map(Fraction, row), map(Fraction, column.tolist()),
                                       strict=True)) for row in matrix.tolist()]  # fmt: skip
    assert holds(product(matrix, Interval.at(column[:, None])), exact)
    assert holds((matrix * Interval.at(column)).sum(1), exact)


def series(angle, first):
    """Sine (first = 1) or cosine (first = 0) by its series, in rational numbers."""
    x, term, total = Fraction(angle), Fraction(1), Fraction(0)
    for k in range(60):
        if k % 2 == first:
            total += term if k % 4 < 2 else -term
        term = term * x / (k + 1)
    return total


def test_sine_and_cosine_hold_their_series():
    """Near multiples of a quarter of a turn, too."""
    turns = 0.5 * np.pi * np.arange(-3, 4)
    angles = np.concatenate([turns, turns + 1e-9, GENERATOR.uniform(-6, 6, 12)])
    for function, first in ((sine, 1), (cosine, 0)):
        found = function(Interval.at(angles))
        assert holds(found, [series(each, first) for each in angles.tolist()])
        assert found.radius.max() < 2e-15


@pytest.mark.parametrize(("function", "plain"), [(sine, np.sin), (cosine, np.cos)])
def test_waves_over_intervals_hold_all_values_and_no_more(function, plain):
    low = GENERATOR.uniform(-7, 7, 50)
    high = low + GENERATOR.uniform(0, 4, 50)
    values = plain(np.linspace(low, high, 2001))
    found = function(Interval(low, high))
    assert (found.low <= values.min(axis=0)).all()
    assert (found.high >= values.max(axis=0)).all()
    np.testing.assert_allclose(found.low, values.min(axis=0), atol=2e-6)
    np.testing.assert_allclose(found.high, values.max(axis=0), atol=2e-6)


def test_what_is_unknown_stays_unknown():
    """1/x over zero has no bounds, whatever it is multiplied with."""
    unknown = inverse(Interval(np.array([-1.0]), np.array([1.0])))
    for each in (unknown, unknown * 2.0, 3.0 - unknown, unknown - unknown):
        assert np.isinf(each.size).all()


def test_powers_are_bounded_for_constant_exponents_where_they_are_defined():
    """x³ rises, x² turns at 0, 1/x has a pole; of a variable exponent nothing is known."""

    def bounds(low, high, n, most=None):
        exponent = Interval(np.array([n]), np.array([n if most is None else most]))
        found = power(Interval(np.array([low]), np.array([high])), exponent)
        return found.low[0], found.high[0]

    assert bounds(-2.0, 1.0, 3.0) == pytest.approx((-8.0, 1.0))
    assert bounds(-2.0, 1.0, 2.0) == pytest.approx((0.0, 4.0), rel=1e-12, abs=1e-300)
    assert bounds(1.0, 4.0, 0.5) == pytest.approx((1.0, 2.0))
    assert bounds(-1.0, 2.0, -1.0) == (-np.inf, np.inf)
    assert bounds(1.0, 2.0, 2.0, 3.0) == (-np.inf, np.inf)
