"""Searches find the states of trusses in which bars on one line have turned over."""

from itertools import product

import numpy as np
import pytest

from equimorph import Bar, Truss, find_equilibria

STIFFNESS = np.array([1.0, 0.7, 1.6])
LENGTHS = np.array([1.0, 0.8, 1.3])
PUSHES = np.array([0.11, -0.07, -0.23])


def chain(bars, axis=0, space=2):
    """Bars in line, held at the first joint and across all others, pushed along themselves."""
    far = np.concatenate([[0.0], np.cumsum(LENGTHS[:bars])])
    names, along = "ABCD"[: bars + 1], np.eye(space)[axis]
    return Truss(
        {name: tuple(at * along) for name, at in zip(names, far.tolist(), strict=True)},
        [Bar((names[k], names[k + 1]), EA=float(STIFFNESS[k])) for k in range(bars)],
        {name: "xyz"[:space].replace("" if name == "A" else "xyz"[axis], "") for name in names},
        {"F": {names[k + 1]: tuple(PUSHES[k] * along) for k in range(bars)}},
    )


def places(bars, load):
    """All: a force N of a bar makes it 1 + N/EA as long, or turned over 1 − N/EA."""
    strain = load * np.cumsum(PUSHES[:bars][::-1])[::-1] / STIFFNESS[:bars]
    ways = [
        np.cumsum(sense * LENGTHS[:bars] * (1.0 + sense * strain))
        for sense in map(np.array, product((1.0, -1.0), repeat=bars))
        if (sense * strain > -0.99).all()
    ]
    return np.array(sorted(map(tuple, np.round(ways, 10))))


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize(
    ("axis", "space", "bars"), [(0, 2, 1), (1, 2, 1), (2, 3, 1), (0, 2, 2), (1, 3, 2), (0, 2, 3)]
)
def test_each_bar_of_a_chain_may_have_turned_over(axis, space, bars, seed):
    """One bar had one state, "at most 1": guesses reached as far as it is long."""
    truss = chain(bars, axis, space)
    for load in (0.0, 1.0):
        found = find_equilibria(
            truss, {"F": load}, within=[truss.max_shortening <= 0.99], seed=seed
        )
        drawn = np.cumsum(LENGTHS[:bars])
        met = np.array(sorted(map(tuple, np.round(found.z + drawn, 10))))
        np.testing.assert_allclose(met, places(bars, load), atol=1e-9)
        assert found.completeness.upper >= 2**bars


def test_a_bar_pushed_by_two_fifths_of_its_stiffness_is_shorter_or_has_turned_over():
    bar = Truss(
        {"A": (0, 0), "B": (1, 0)}, [("A", "B")], {"A": "xy", "B": "y"}, {"F": {"B": (-1, 0)}}
    )
    found = find_equilibria(bar, {"F": 0.4})
    np.testing.assert_allclose(np.sort(1.0 + found.z[:, 0]), [-1.4, 0.6], atol=1e-12)
    assert found.completeness.upper == 2


def test_a_joint_reaches_as_far_from_its_nearest_support_as_bars_do():
    truss = Truss(
        {"A": (0, 0), "B": (3, 4), "C": (6, 0), "D": (3, 1)},
        [("A", "B"), ("B", "C"), Bar(("D", "B"), rest=2.5), ("A", "D"), ("C", "D")],
        {"A": "xy", "C": "y"},
        {"F": {"B": (0, -1)}},
    )
    middle, width = truss.network.region
    across = np.hypot(3.0, 1.0)
    np.testing.assert_allclose(middle, [(0, 0), (0, 0), (0, 0), (0, 0)], atol=0.0)
    np.testing.assert_allclose(width[:, 0], [0.0, 5.0, 2.0 * across, across], rtol=1e-15)
    np.testing.assert_allclose(width[[0, 1, 3], 1], [0.0, 5.0, across], rtol=1e-15)
