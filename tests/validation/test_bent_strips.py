"""Strips bent between clamps that are moved aside or twisted: where they lose their symmetry.

The settings are those of [YuHanna2019]_ (one clamp is moved along the width) and [SanoWada2019]_
(both clamps are turned about their tangents, against each other), as Kirchhoff rods with
C = 4/(2 (1 + ν)) = 4/3 EI and stiffness aside (w/t)² EI. The texts print figures; the values here
are found again by multiple shooting, which shares nothing with the package.
"""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import equimorph as em
from oracles.kirchhoff import Rod, about, clamp
from oracles.spatial_rods import shot

TORSION = 4.0 / 3.0
ALONG = (1.0, 0.0, 0.0)
SHARES = -0.02 * np.cos(np.linspace(0.0, 1.45, 9))
"""Relative distances to the critical value at which the determinant is computed."""
pytestmark = pytest.mark.slow


def moved(span, aside):
    """Clamps, one moved along the width."""
    return clamp(), clamp((span, 0.0, aside))


def twisted(span, turn):
    """Clamps turned against each other about their tangents."""
    return clamp(turn=about(ALONG, -turn)), clamp((span, 0.0, 0.0), about(ALONG, turn))


def zero_of_determinant(first, ends, wanted):
    """Zero near `wanted` of the polynomial through determinants before it.

    Solutions begin where polynomials through the last four lead.
    """
    rods, values, guess = [], wanted * (1.0 + SHARES), first
    for k, value in enumerate(values):
        near = slice(max(k - 4, 0), k)
        if k > 1:
            x, y = values[near], np.array([rod.y.ravel() for rod in rods[near]])
            ahead = np.polynomial.polynomial.polyfit(x - value, y, len(x) - 1)[0]
            guess = replace(first, y=ahead.reshape(first.y.shape))
        start, end = ends(value)
        rods.append(replace(guess, start=start, end=end).solved())
        assert rods[-1].index() == 0
    fit = np.polynomial.Polynomial.fit(values, [rod.determinant for rod in rods], 6)
    roots = fit.roots()
    return float(roots[np.abs(roots - wanted).argmin()].real)


@pytest.mark.parametrize("aspect", [2.0, 5.0])
@pytest.mark.parametrize("span", [0.9, 0.6])
def test_a_bent_strip_gives_way_where_shooting_says(aspect, span):
    """Pitchforks of both settings. Tolerance: 1e-8 of eight elements of degree six.

    Moved aside, all branch without a snap. Twisted, a long narrow strip snaps (subcritical).
    """
    lateral = aspect**2
    rod = em.SpatialRod(torsion=TORSION, lateral=lateral, loads={}, coordinates={}, elements=8)
    bent = rod.natural_state(theta_A=0.4, theta_B=-0.4, nu=0.9)
    flat = em.lift(bent, [{"theta_A": 0.0, "theta_B": 0.0}, {"nu": span}]).end.state
    ways = {"sideways": (partial(moved, span), {"sideways": 1.0}),
            "twist_B": (partial(twisted, span), {"twist_A": -1.0, "twist_B": 1.0})}  # fmt: skip
    for name, (ends, way) in ways.items():
        largest = {"sideways": np.sqrt(1.0 - span**2), "twist_B": 3.0}[name]
        end = em.lift(flat, {each: rate * largest for each, rate in way.items()}).end
        snaps = (name, aspect, span) == ("twist_B", 2.0, 0.6)
        assert end.kind == "branch point"
        assert end.criticality == ("subcritical" if snaps else "supercritical")
        critical = end.state[name]
        before = {each: 0.98 * rate * critical for each, rate in way.items()}
        y, stiffness = shot(em.lift(flat, before).end.state, (TORSION, lateral, 1.0))
        first = Rod(y, *ends(0.98 * critical), stiffness)
        assert zero_of_determinant(first, ends, critical) == pytest.approx(critical, rel=1e-8)
