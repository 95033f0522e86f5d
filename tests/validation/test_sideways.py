"""A round rod turns inside out sideways where a planar model snaps: examples/sideways.py, checked.

The states beside the plane are solved again by shooting, which shares nothing with the package.
"""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

import equimorph as em
from oracles.kirchhoff import Rod, about, clamp
from oracles.spatial_rods import shot

PIECES = 6


@pytest.fixture(scope="module")
def result():
    file = Path(__file__).parents[2] / "examples" / "sideways.py"
    spec = spec_from_file_location("sideways", file)
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.main()


def aside(state: em.State, torsion: float) -> Rod:
    """The state as a guess of shooting; the force across the middle lies between two pieces."""
    y, stiffness = shot(state, (torsion, 1.0, 1.0), PIECES)
    s = np.arange(PIECES) / PIECES
    y[:, 8] += state["q"] * s
    y[s >= 0.5, 9] -= state["side"]
    turn = [about((0, 0, 1), sign * 0.9) for sign in (1.0, -1.0)]
    ends = clamp(turn=turn[0]), clamp((state["nu"], 0.0, 0.0), turn[1])
    kicks = np.zeros((PIECES, 3))
    kicks[PIECES // 2, 2] = state["side"]
    return Rod(y, *ends, stiffness, load=np.array([0.0, -state["q"], 0.0]), kicks=kicks)


def test_the_plane_has_no_stable_way_on(result):
    """PHYSICS §5: a subcritical pitchfork at 4.2439977594."""
    assert result.planar.kind == "branch point"
    assert result.planar.criticality == "subcritical"
    assert result.planar.value == pytest.approx(4.2439977594, rel=1e-8)


def test_in_space_the_rod_is_stable_all_the_way_to_the_inverted_arch(result):
    """Its end is the inverted planar state, to the error that the rod estimates (some 1e-6)."""
    assert result.path.end.kind == "arrived"
    states = result.path.states
    assert (states.index == 0).all()
    assert states.margin.min() == pytest.approx(0.0246, abs=5e-4)
    end, flat = result.path.end.state, em.Rod()
    inverted = [
        each for each in em.find_equilibria(flat, {"Theta": 0.9, "Delta": 0.0, "q": 3.0}).stable
        if float(flat.height(0.5)(each)) < 0.0
    ]  # fmt: skip
    assert len(inverted) == 1
    assert end.error_estimate < 2e-3
    np.testing.assert_allclose(end.shape()[:, :2], inverted[0].shape(), atol=5e-6)
    assert np.abs(end.shape()[:, 2]).max() < 1e-8


def test_states_on_the_way_meet_shooting(result):
    """Sideways by up to 0.198; places, inside elements of degree six, to 2e-7, and the index."""
    states = result.path.states
    farthest = int(np.abs(states.shape()[:, 50, 2]).argmax())
    for state in (states[farthest], states[farthest - 3]):
        solved = aside(state, 1.0 / 1.3).solved()
        s = np.linspace(0.0, 1.0, 9)
        wanted = np.array([solved.place(each) for each in s])
        np.testing.assert_allclose(state.shape(s), wanted, atol=2e-7)
        assert solved.index() == state.index == 0
