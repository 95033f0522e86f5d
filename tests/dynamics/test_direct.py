"""Trusses in MuJoCo, and the library's own equations of motion."""

import numpy as np
import pytest

import equimorph as em
from equimorph.dynamics import ReplaySettings, replay
from equimorph.dynamics.own_equations import Motion, OwnPlant

ARCH = ({"A": (-1, 0), "B": (0, 0.1), "C": (1, 0)}, [("A", "B"), ("B", "C")])
HELD = {"A": "xy", "C": "xy"}
COARSE = ReplaySettings(step=0.03)


def von_mises(**more):
    return em.Truss(*ARCH, HELD, {"F": {"B": (0, -1)}}, masses={"B": 1.0}, **more)


@pytest.mark.parametrize("simulator", ["mujoco", "own"])
def test_the_von_mises_truss_snaps_late_by_what_its_fold_predicts(simulator):
    """Exact fold by `lift`; the delay by the normal form with damping and inertia."""
    if simulator == "mujoco":
        pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra `replay`)")
    start = em.lift(von_mises().natural_state(), {"F": 3e-4}).end.state
    played = replay({"F": 5e-4}, start, duration=4000.0, simulator=simulator, settings=COARSE)
    assert played.snapped
    assert played.landed_in.stable
    assert played.landed_in.z[1] < -0.2
    assert played.fold == pytest.approx(4000.0 * (3.810871904e-4 - 3e-4) / 2e-4, rel=1e-6)
    assert played.lateness == pytest.approx(played.expected_lateness, rel=0.3)


def test_a_fold_that_a_corner_between_samples_passes_is_met():
    """F turns back beyond the exact fold of `lift` by 1e-8, a hundredth of what a sample moves."""
    start, fold = em.lift(von_mises().natural_state(), {"F": 3e-4}).end.state, 3.810871904e-4
    there, back = {"F": fold + 1e-8}, {"F": 3.1e-4}
    played = replay([there, back], start, duration=400.0, simulator="own", settings=COARSE)
    whole = 2.0 * there["F"] - 3e-4 - back["F"]
    assert played.fold == pytest.approx(400.0 * (fold - 3e-4) / whole, rel=1e-6)
    assert np.isnan(played.deviation[-1])


def test_actuated_rest_lengths_are_followed():
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra `replay`)")
    truss = em.Truss(*ARCH, HELD, {"F": {"B": (0.2, -1)}}, {"a": {"A-B": 1.0}}, masses={"B": 1.0})
    played = replay({"a": 0.02, "F": 1e-4}, truss.natural_state(), duration=2000.0, settings=COARSE)
    assert not played.snapped
    assert played.largest_deviation < 2e-3
    assert played.deviation[-1] < 1e-6


def test_masses_in_space_are_followed():
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra `replay`)")
    joints = {"A": (1, 0, 0), "B": (-0.5, 0.8, 0), "C": (-0.5, -0.8, 0), "T": (0, 0, 0.5)}
    dome = em.Truss(
        joints, [("A", "T"), ("B", "T"), ("C", "T")], dict.fromkeys("ABC", "xyz"),
        {"F": {"T": (0.1, 0, -1)}}, masses={"T": 1.0},
    )  # fmt: skip
    played = replay({"F": 0.01}, dome.natural_state(), duration=200.0, settings=COARSE)
    assert not played.snapped
    assert played.deviation[-1] < 1e-6


def test_green_strain_and_structures_without_a_model_are_refused_by_name():
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra `replay`)")
    with pytest.raises(em.errors.InputError, match="Green strain"):
        replay({"F": 1e-4}, von_mises(strain="green").natural_state(), rate=0.1)
    with pytest.raises(em.errors.InputError, match="every structure by its own"):
        replay({"F": 0.01}, em.Spring().natural_state(x_l=1.5), rate=0.1)


def test_the_own_equations_agree_with_mujoco_on_an_arch():
    """Two simulations of one motion: chain of 40 links, and the rod itself."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra `replay`)")
    start = em.Rod(load="uniform").natural_state(Theta=1.0)
    used = ReplaySettings(links=20, step=0.05)
    chain, rod = (
        replay({"Delta": 0.2}, start, rate=0.05, simulator=each, settings=used)
        for each in ("mujoco", "own")
    )
    assert not rod.independent
    again = np.interp(chain.times[:-1], rod.times[:-1], rod.dynamics[:-1])
    assert np.abs(chain.dynamics[:-1] - again).max() < 1e-3
    assert rod.deviation[-1] < 1e-8


def test_a_step_in_time_that_newtons_method_loses_is_an_error(monkeypatch):
    """States after a lost step are none."""
    start = em.Spring().natural_state(x_l=1.5)
    plant = OwnPlant(start.structure, start, 0.1, 1.0)
    plant.step()
    assert plant.speed < 1e-9
    monkeypatch.setattr(Motion, "step", lambda motion, *_: (motion, np.zeros(1, bool)))
    with pytest.raises(ArithmeticError, match="choose a shorter step"):
        plant.step()
