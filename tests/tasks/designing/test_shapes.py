"""A strip whose stable shapes are prescribed: heights that another strip of its family has."""

import numpy as np
import pytest

import equimorph as em
from typecheck import unchecked

S, PLACES = (0.0, 0.25, 0.5, 0.75, 1.0), (0.25, 0.5, 0.75)
SETTINGS = (({"Theta": 0.2}, 1.0), ({"Theta": 0.2}, -1.0), ({"Delta": 0.2}, -1.0))


def curved(k):
    """Strip between clamps of a span of 0.95 with intrinsic curvature at five places."""
    return em.Rod(loads={}, span=0.95, curvature=[[s, float(v)] for s, v in zip(S, k, strict=True)])


def shapes(rod):
    """Stable states under three settings, the first two under the same one."""
    found, rise = [], rod.height(0.5)
    lines = {
        delta: em.equilibrium_set(rod, em.Box(Theta=(-0.4, 0.4)), fixed={"Delta": delta}, checks=0)
        for delta in (0.0, 0.2)
    }
    for at, side in SETTINGS:
        stable = lines[at.get("Delta", 0.0)].at(Theta=at.get("Theta", 0.0)).stable
        found.append(stable[int(np.argmax(side * rise(stable)))])
    return found


def heights(rod, state):
    return [float(rod.height(s)(state)) for s in PLACES]


def gap(rod, targets):
    """Largest distance from given heights."""
    each = [
        abs(em.function_of(f"gap at {s}", lambda y, to=to: y - to, rod.height(s)))
        for s, to in zip(PLACES, targets, strict=True)
    ]
    return em.largest_of("gap", *each)


@pytest.mark.slow
def test_three_stable_shapes_of_a_strip_are_prescribed():
    """Nine heights of a known strip, from a straight one: to 1e-4 L, and again when rebuilt."""
    known, first = curved([0.6, -0.5, 0.4, 0.8, -0.7]), curved([0.0] * 5)
    with unchecked():
        targets = [heights(known, each) for each in shapes(known)]
        asked = [
            em.StateValue(state, em.peak(gap(first, to)))
            for state, to in zip(shapes(first), targets, strict=True)
        ]
        found = em.design(curved, {"k": ([-3.0] * 5, [3.0] * 5, [0.0] * 5)}, asked, tolerance=1e-8)
        again = [heights(found.structure, each) for each in shapes(found.structure)]
    assert found.history[0].value > 0.02
    assert found.value < 1e-4
    assert np.abs(np.array(again) - targets).max() == pytest.approx(found.value, abs=1e-8)
    assert min(each.margin for each in found.found) > 0.3
