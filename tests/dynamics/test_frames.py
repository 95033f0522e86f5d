"""A chain for each member stands for frames to second order, in statics and at rest in MuJoCo."""

import numpy as np
import pytest

import equimorph as em
from dynamics.frames import FRAMES
from equimorph.dynamics import ReplaySettings, replay
from equimorph.dynamics.frames import ChainedFrame
from equimorph.dynamics.linkage_model import LinkageModel
from equimorph.dynamics.plant import LinkagePlant


def loaded(name):
    frame, to = FRAMES[name]
    return em.lift(frame.natural_state(), to).end.state


@pytest.mark.parametrize("name", FRAMES)
def test_the_chains_are_accurate_to_second_order(name):
    state = loaded(name)
    gaps = []
    for links in (8, 16):
        made = LinkageModel(ChainedFrame(state.structure, links))
        found = made.balance(state)
        apart = made.points(found.v) - made.reference(state.batch)[0]
        gaps.append(np.linalg.norm(apart, axis=1).max() / state.structure.model.length)
    assert gaps[1] < 2e-3
    assert gaps[0] / gaps[1] == pytest.approx(4.0, abs=0.3)


@pytest.mark.parametrize("name", FRAMES)
def test_mujoco_rests_where_the_chains_have_their_equilibrium(name):
    """Joints are bodies that turn, members hang on one end and are closed at the other."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra `replay`)")
    state = loaded(name)
    made = LinkageModel(ChainedFrame(state.structure, 8))
    found = made.balance(state)
    plant = LinkagePlant(made.linkage, 0.02, 0.3)
    plant.start(found.v, found.y)
    for _ in range(500):
        plant.step()
    assert plant.speed < 1e-5
    assert np.abs(made.linkage.places(plant.v) - found.places).max() < 2e-5


@pytest.mark.parametrize("name", FRAMES)
def test_chains_rest_where_their_potential_is_critical(name):
    """Its gradient is one of closures, at what may move; 1e-6: central differences of 1e-5."""
    state = loaded(name)
    made = LinkageModel(ChainedFrame(state.structure, 6))
    found, linkage, step = made.balance(state), made.linkage, 1e-5
    ways = step * np.eye(linkage.size)[linkage.free]

    def change(function):
        return [(function(found.v + way) - function(found.v - way)) / (2 * step) for way in ways]

    slope = np.array(change(lambda v: linkage.potential(v, found.y)))
    closures = np.array(change(lambda v: linkage.closure(v).ravel()))
    multipliers = np.linalg.lstsq(closures, -slope, rcond=None)[0]
    np.testing.assert_allclose(slope, -closures @ multipliers, atol=1e-6)


@pytest.mark.slow
def test_lees_frame_snaps_where_it_folds():
    """The load limit of the inextensible frame [LeeManuelRossow1968]_ is P L²/EI = 18.5588."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra `replay`)")
    joints = {"A": (0, 0), "B": (0, 1), "P": (0.2, 1), "C": (1, 1)}
    pairs = [("A", "B"), ("B", "P"), ("P", "C")]
    members = [
        em.Member(pair, mass=float(np.linalg.norm(np.subtract(joints[pair[1]], joints[pair[0]]))))
        for pair in pairs
    ]
    frame = em.Frame(joints, members, {"A": "pinned", "C": "pinned"}, {"P": {"P": (0, -1)}})
    start = em.lift(frame.natural_state(), {"P": 17.0}).end.state
    used = ReplaySettings(links=10, step=0.05, damping=0.3)
    played = replay({"P": 21.0}, start, duration=100.0, settings=used)
    assert played.snapped
    limit = 17.0 + 4.0 * played.fold / 100.0
    assert limit == pytest.approx(18.5588, rel=0.01)
    assert played.landed_in is not None
    assert played.landed_in.stable


def test_a_frame_without_mass_is_refused():
    frame = em.Frame({"A": (0, 0), "B": (1, 0)}, [("A", "B")], {"A": "fixed"}, {"P": {"B": (0, 1)}})
    with pytest.raises(em.errors.InputError, match="every member"):
        replay({"P": 1.0}, frame.natural_state(), rate=0.1)
