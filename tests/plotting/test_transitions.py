"""Figures of transition networks."""

import numpy as np
import pytest

import equimorph as em
from equimorph import plotting
from equimorph.errors import InputError
from oracles.close_states import truss_row
from oracles.polynomial import Polynomial


@pytest.fixture(scope="module")
def network():
    return em.transition_network(truss_row(2, 0), {"F": 0.0})


def test_leaves_stand_at_energies_and_bars_at_saddles(network):
    """Lines lead from each group up to the saddle; the last one to the top of the axes."""
    ax = plotting.disconnectivity(network)
    dots = np.array([line.get_xydata()[0] for line in ax.lines if line.get_marker() == "o"])
    levels = sorted(merge.energy for merge in network.merges)
    assert np.sort(dots[:, 1])[4:] == pytest.approx(levels)
    assert np.sort(dots[:, 1])[:4] == pytest.approx(network.energy[network.minima])
    assert len(ax.child_axes) == 4  # shapes
    lines = [line.get_xydata() for line in ax.lines if line.get_marker() != "o"]
    assert len(lines) == 3 * 3 + 1


def test_the_energy_along_a_path_is_that_of_its_states(network):
    minima = network.states[network.minima]
    path = network.path(minima[0], minima[3])
    ax = plotting.energy_path(path)
    assert ax.lines[0].get_ydata() == pytest.approx(path.states.energy)
    assert ax.lines[2].get_ydata() == pytest.approx(path.saddles.energy)
    # smooth at the saddles: points lie close to them
    steps = np.diff(path.length)
    assert steps.max() < 0.1 * path.length[-1]


def test_a_network_without_a_stable_state_has_no_graph():
    hill = Polynomial(lambda x, a: x**2 * -0.5 - a * x, 1, ("a",))
    empty = em.transition_network(hill, {"a": 0.1})
    with pytest.raises(InputError, match="must have a stable state"):
        plotting.disconnectivity(empty)
