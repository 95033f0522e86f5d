"""Splines: what they pass through, and what they refuse."""

import re

import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.model import Spline
from typecheck import unchecked


def test_a_cubic_is_its_own_spline():
    """Four knots that are not equidistant: "not a knot" leaves one cubic, exact to round-off."""
    t = np.array([0.0, 0.2, 0.7, 1.0])
    spline = Spline(t, q=t**3 - t, Theta=2.0 * t)
    for at in np.linspace(0.0, 1.0, 7):
        values = spline(at)
        assert values["q"] == pytest.approx(at**3 - at, abs=1e-14)
        assert values["Theta"] == pytest.approx(2.0 * at, abs=1e-14)
    assert repr(spline) == "Spline(q, Theta: 4 knots)"


@pytest.mark.parametrize(
    "t", [[0.1, 0.5, 1.0], [0.0, 0.5, 0.9], [0.0, 0.0, 1.0], [0.0, 0.6, 0.5], [0.0, 1.0]]
)
def test_knots_grow_from_zero_to_one(t):
    with pytest.raises(InputError, match="`t` must be 3 numbers that grow from 0 to 1"):
        Spline(t, q=[0.0, 1.0, 2.0])


@pytest.mark.parametrize(
    ("samples", "said"),
    [
        ({}, "`Spline` must name at least one parameter; got none."),
        ({"q": [1.0]}, "as many of each parameter; got {'q': 1}."),
        ({"q": [1.0, 2.0], "F": [1.0] * 3}, "as many of each parameter; got {'q': 2, 'F': 3}."),
        ({"q": [1.0, np.nan]}, "an array of finite numbers (knots, *lanes); got nan."),
        ({"q": 1.0}, "an array of finite numbers (knots, *lanes); got 1.0."),
    ],
)
def test_samples_are_two_or_more_numbers_each(samples, said):
    with unchecked(), pytest.raises(InputError, match=re.escape(said)):
        Spline(**samples)
