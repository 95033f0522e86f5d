"""Searches count no states with members squeezed through length zero; these are named."""

import numpy as np
import pytest

from equimorph import Bar, Frame, Member, Truss, find_equilibria, transition_network
from typecheck import unchecked

DRAWN = {"A": (-1.0, 0.0), "B": (0.0, 0.3), "C": (1.0, 0.0)}
PAIRS = (("A", "B"), ("B", "C"))


def three_hinged() -> Frame:
    """Two members, hinged at both ends: while straight, the bars of a truss."""
    members = [Member(pair, EA=50.0, hinges=list(pair)) for pair in PAIRS]
    return Frame(DRAWN, members, {"A": "pinned", "C": "pinned"}, {"F": {"B": (0.0, -1.0)}})


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_members_of_less_than_no_length_are_no_states(seed):
    """1, 7, 8 or 10 states were told: shortenings were 1.01 in all but three."""
    frame, bars = three_hinged(), [Bar(pair, EA=50.0) for pair in PAIRS]
    truss = Truss(DRAWN, bars, {"A": "xy", "C": "xy"}, {"F": {"B": (0.0, -1.0)}})
    found = find_equilibria(frame, {"F": 1.0}, seed=seed)
    assert (frame.max_shortening(found) <= 0.99).all()
    assert (frame.max_curvature(found) <= 1e-6).all()
    exact = truss.displacement("B", "y")(find_equilibria(truss, {"F": 1.0}, seed=seed))
    gap = np.abs(frame.displacement("B", "y")(found)[:, None] - exact)
    assert (gap.min(axis=1) < 1e-9).all()
    assert found.invalid is not None
    assert (frame.max_shortening(found.invalid) > 0.99).all()
    said = f"; {len(found.invalid)} more, not counted, violate max_shortening <= 0.99"
    assert (said in repr(found)) == (len(found.invalid) > 0)


def test_states_met_beyond_validity_are_named_once():
    found = find_equilibria(three_hinged(), {"F": 1.0})
    assert found.completeness.found == len(found) == 3
    gaps = np.abs(found.invalid.z[:, None] - found.invalid.z).max(axis=2)
    assert (gaps[np.triu_indices(len(gaps), 1)] > 1e-3).all()
    assert len(gaps) >= 4


def test_states_beyond_a_constraint_are_not_named():
    frame = three_hinged()
    bounds = [frame.max_shortening <= 0.5]
    assert not find_equilibria(frame, {"F": 1.0}, within=bounds).invalid


def test_networks_of_transitions_label_states_beyond_validity():
    frame = three_hinged()
    with unchecked():
        network = transition_network(frame, {"F": 1.0})
    short = frame.max_shortening(network.states)
    np.testing.assert_array_equal(network.admissible, short <= 0.99)
