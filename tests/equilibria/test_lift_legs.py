"""Legs between known states, followed side by side, against the same legs one after the other."""

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria import TraceOptions, lift_legs
from equimorph.structures import States

OPTIONS = TraceOptions(largest_step=0.1)
WAY = [{"Theta": 1.2}, {"Delta": 0.4}, {"Theta": 1.0, "Delta": 0.1}]


@pytest.fixture(scope="module")
def path():
    arch = em.Rod()
    rest = arch.natural_state(Theta=1.0, Delta=0.0)
    start = em.lift(rest, {"q": 1.0}).end.state
    return em.lift(start, WAY, within=[arch.max_curvature <= 30], options=OPTIONS)


@pytest.fixture(scope="module")
def corners(path):
    at = [int(np.argmin(np.abs(path.at - number))) for number in range(len(WAY) + 1)]
    return path.states[np.array(at)]


def test_legs_side_by_side_make_the_same_path(path, corners):
    """Up to round-off of the corners from which legs start."""
    within = (path.states.structure.max_curvature <= 30,)
    found = lift_legs([corners], within, OPTIONS)[0]
    assert found.arrived
    np.testing.assert_allclose(found.at, path.at, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.length, path.length, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.states.z, path.states.z, rtol=0, atol=1e-7)
    assert np.array_equal(found.index, path.index)


def test_a_leg_that_leads_elsewhere_makes_no_path(corners):
    """The second corner is put over other parameters: its state is no longer the end of a leg."""
    z = corners.z.copy()
    z[1, : corners.structure.unknowns] += 1e-3
    assert lift_legs([States(corners.structure, z, corners.p)], (), OPTIONS) == [None]


def test_a_leg_that_violates_a_constraint_makes_no_path(corners):
    arch = corners.structure
    tight = arch.max_curvature <= float(arch.max_curvature(corners).max()) - 0.1
    assert lift_legs([corners], (tight,), OPTIONS) == [None]


def test_a_leg_of_no_length_makes_no_path(corners):
    assert lift_legs([corners[np.array([0, 1, 1, 2])]], (), OPTIONS) == [None]


def test_chains_side_by_side_make_the_paths_that_each_makes_alone(corners):
    """Bit for bit; chains that make no path are left out."""
    halted = corners[np.array([0, 1, 1, 2])]
    chains = [
        corners[:3],
        halted,
        corners[1:],
        States(corners.structure, corners.z[::2], corners.p[:2]),
    ]
    found = lift_legs(chains, (), OPTIONS)
    assert found[1] is None
    assert found[3] is None
    for chain, path in zip(chains[::2], found[::2], strict=True):
        alone = lift_legs([chain], (), OPTIONS)[0]
        for name in ("at", "length", "index"):
            np.testing.assert_array_equal(getattr(path, name), getattr(alone, name))
        np.testing.assert_array_equal(path.states.z, alone.states.z)
        assert path.end.at == alone.end.at == len(chain) - 1
