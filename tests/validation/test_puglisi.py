"""G. Puglisi, L. Truskinovsky: Mechanics of a discrete chain with bi-stable elements (2000).

A stack of n bistable elements under one dead load: every element is in one of three states, so that
3ⁿ equilibria exist below the largest load of an element, C(n, k) 2^(n−k) of them with k elements on
the falling branch, which are saddles of index k [PuglisiTruskinovsky2000]_. Here the elements are
bars that lean between two guides, a distance 1 apart: halves of von Mises trusses.
"""

from math import comb

import numpy as np
import pytest

import equimorph as em
from typecheck import unchecked

RISE = 0.2


def stack(bars):
    """Bars zigzag between the guides x = 0 and x = 1; F presses on the top, actuators lengthen."""
    joints = {f"J{k}": (k % 2, RISE * k) for k in range(bars + 1)}
    supports = dict.fromkeys(joints, "x") | {"J0": "xy"}
    pairs = [(f"J{k}", f"J{k + 1}") for k in range(bars)]
    loads = {"F": {f"J{bars}": (0.0, -1.0)}}
    return em.Truss(joints, pairs, supports, loads, {"a": {"J0-J1": 1.0}})


def limit(length):
    """Largest load of an element: (l₀^⅔ − 1)^(3/2)/l₀, see von Mises."""
    return (length ** (2 / 3) - 1.0) ** 1.5 / length


@pytest.mark.parametrize("bars", [2, 3])
def test_a_stack_has_three_to_the_power_of_its_bars_equilibria(bars):
    """Numbers by index. All heights are roots of one load: 1e-12 of EA."""
    load = 0.3 * limit(np.hypot(1.0, RISE))
    found = em.find_equilibria(stack(bars), {"F": load})
    assert len(found) == 3**bars
    expected = [comb(bars, k) * 2 ** (bars - k) for k in range(bars + 1)]
    np.testing.assert_array_equal(np.bincount(found.index), expected)
    heights = RISE + np.diff(found.z, axis=1, prepend=0.0)
    force = heights * (1 / np.hypot(1.0, heights) - 1 / np.hypot(1.0, RISE))
    np.testing.assert_allclose(force, load, atol=1e-12)


def test_the_weaker_element_snaps_first():
    """An element shortened by a snaps at its own limit. 1e-11: a fold, to round-off."""
    truss = stack(2)
    path = em.limit_load(truss.natural_state(a=-0.005), "F")
    assert path.kind == "fold"
    assert path.value == pytest.approx(limit(np.hypot(1.0, RISE) - 0.005), rel=1e-10)


@pytest.mark.parametrize("bars", [2, 3])
def test_equal_elements_reach_their_limits_together(bars):
    """As many eigenvalues vanish at once, no simple fold: the path ends there, and says so.

    1e-10: the load is level there, and the path comes as near as round-off lets it.
    """
    rest = stack(bars).natural_state()
    path = em.limit_load(rest, "F")
    assert path.kind == "multiple point"
    assert path.detail.startswith(f"{bars} eigenvalues vanish at once")
    assert path.value == pytest.approx(limit(np.hypot(1.0, RISE)), rel=1e-10)
    assert (np.diff(path.path.length) >= 0.0).all()
    many = em.limit_load(rest.batch, "F")
    assert many.kind[0] == "multiple point"
    assert many.value[0] == pytest.approx(path.value, rel=1e-10)


def test_equal_elements_snap_from_their_common_limit():
    path = em.limit_load(stack(2).natural_state(), "F")
    with unchecked():  # thousands of small steps of the gradient flow
        landed = [each for each in em.snap_landing(path.state) if each.landed]
    assert landed
    assert all(each.released > 0.0 for each in landed)
