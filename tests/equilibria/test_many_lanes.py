"""Lifts and limit loads of many states: equal to those of each alone, in bounded memory."""

import tracemalloc
from importlib import import_module

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from equimorph.structures import States
from oracles.polynomial import fold_form, pitchfork_form
from typecheck import unchecked


@pytest.fixture(scope="module")
def arch():
    return em.Rod(elements=6, degree=6)


def rest_states(arch, lanes, Theta=(0.5, 1.3), Delta=(0.0, 0.4)):
    generator = np.random.default_rng(3)
    p = np.zeros((lanes, 4))
    p[:, 0], p[:, 1] = generator.uniform(*Theta, lanes), generator.uniform(*Delta, lanes)
    p[:, 3] = np.sin(1.0)
    states, found = arch.natural_states(p)
    assert found.all()
    return states


def batch(form, z, **p):
    """States of a polynomial structure from arrays."""
    lanes = len(z)
    columns = [np.broadcast_to(p.get(q.name, 0.0), lanes) for q in form.parameters]
    return States(form, np.array(z, float).reshape(lanes, -1), np.stack(columns, 1))


def test_each_lift_of_many_is_that_of_its_state_alone(arch):
    """Polyline with folds, constraints and arrivals; only steps that hide something may differ."""
    states = rest_states(arch, 60)
    states = states[np.flatnonzero(arch.max_curvature(states) <= 6.0)[:40]]
    legs = [{"q": 3.0}, {"Theta": 1.0, "Delta": 0.1}, {"q": 8.0}]
    within = [arch.max_curvature <= 6.0]
    many = em.lift(states, legs, within=within)
    assert set(many.kind.tolist()) == {"fold", "constraint"}
    for lane in range(0, len(states), 4):
        alone = em.lift(states[lane], legs, within=within)
        end = many[lane]
        assert (end.kind, end.detail) == (alone.end.kind, alone.end.detail)
        assert end.at == pytest.approx(alone.end.at, rel=1e-12)
        assert np.abs(end.state.z - alone.end.state.z).max() < 1e-11
        assert many.length[lane] == pytest.approx(alone.length[-1], rel=1e-12)
        assert many.index[lane] == alone.index[-1]


def test_way_points_may_differ_from_lane_to_lane():
    """x² = a: x = √a at the goal of each lane; a lane that meets the fold stays there."""
    form = fold_form()
    goal = np.array([4.0, -1.0, 9.0])
    many = em.lift(batch(form, np.ones(3), a=1.0), [{"a": goal}, {"a": goal + 1.0}])
    assert many.kind.tolist() == ["arrived", "fold", "arrived"]
    assert many.states.z[[0, 2], 0] == pytest.approx(np.sqrt(goal[[0, 2]] + 1.0), rel=1e-13)
    assert many.at.tolist() == [2.0, pytest.approx(0.5), 2.0]


def test_smooth_curves_and_splines_may_differ_from_lane_to_lane():
    """x² = a with a = 1 + c t², c another one for each lane."""
    form, c = fold_form(), np.array([1.0, 3.0, 8.0])
    start = batch(form, np.ones(3), a=1.0)
    curves = em.lift(start, lambda t: {"a": 1.0 + c * t * t})
    spline = em.Spline(a=1.0 + c * np.linspace(0.0, 1.0, 4)[:, None] ** 2)
    for many in (curves, em.lift(start, spline)):
        assert many.arrived.all()
        assert many.states.z[:, 0] == pytest.approx(np.sqrt(1.0 + c), rel=1e-12)


def test_unknown_parameters_are_found_for_many_lanes():
    form = fold_form()
    goal = np.array([2.0, 3.0, 0.5])
    many = em.lift(batch(form, np.ones(3), a=1.0), {form.descriptor("0"): goal, "a": None})
    assert many.arrived.all()
    assert many.states["a"] == pytest.approx(goal**2, rel=1e-12)


def test_events_on_the_way_are_kept_with_their_lanes():
    """x² = a through the fold and back to a = 1; a pitchfork is passed with its criticality."""
    folds = em.lift(batch(fold_form(), np.ones(3), a=1.0), {"a": -1.0}, through_folds=True)
    assert folds.kind.tolist() == ["returned"] * 3
    assert folds.index.tolist() == [1, 1, 1]
    assert folds.events.lane.tolist() == [0, 1, 2]
    assert folds.events.states["a"] == pytest.approx(0.0, abs=1e-11)
    start = batch(pitchfork_form(1.0), np.zeros(2), a=-1.0)
    forks = em.lift(start, {"a": 1.0}, through_folds=True)
    assert forks.arrived.all()
    assert forks.events.kind.tolist() == ["branch point"] * 2
    assert forks.events.criticality.tolist() == ["supercritical"] * 2
    assert em.lift(start, {"a": 1.0}).criticality.tolist() == ["supercritical"] * 2
    assert em.lift(start, {"a": 1.0})[0].criticality == "supercritical"


def test_points_are_kept_if_asked_for():
    many = em.lift(
        batch(fold_form(), np.ones(3), a=1.0), {"a": 4.0}, options=em.TraceOptions(record=True)
    )
    assert set(many.points.lane.tolist()) == {0, 1, 2}
    assert many.points.states.z[:, 0] == pytest.approx(np.sqrt(many.points.states["a"]), rel=1e-9)
    assert em.lift(batch(fold_form(), np.ones(3), a=1.0), {"a": 4.0}).points is None


def test_states_that_violate_a_constraint_end_at_once():
    form = fold_form()
    states = batch(form, np.array([1.0, 3.0]), a=np.array([1.0, 9.0]))
    many = em.lift(states, {"a": 16.0}, within=[form.descriptor("0") <= 2.0])
    assert many.kind.tolist() == ["constraint", "constraint"]
    assert many.states["a"].tolist() == [pytest.approx(4.0), 9.0]
    assert many.detail == {0: "u0 <= 2", 1: "u0 <= 2"}


def test_lane_that_starts_at_a_fold_is_lost_alone():
    many = em.lift(batch(fold_form(), np.array([1.0, 0.0]), a=np.array([1.0, 0.0])), {"a": 2.0})
    assert many.kind.tolist() == ["arrived", "lost"]
    assert "singular" in many.detail[1]


# --- limit loads ---------------------------------------------------------------------------------


def test_limit_loads_of_many_are_those_of_each(arch):
    """Constraints below and above the unloaded curvature, folds, and symmetric branch points."""
    states = rest_states(arch, 30, Delta=(-0.4, 0.4))
    symmetric = rest_states(arch, 3, Delta=(0.0, 1e-300))
    states = States(arch, np.r_[states.z, symmetric.z], np.r_[states.p, symmetric.p])
    within = [arch.max_curvature <= 5.0]
    many = em.limit_load(states, "q", within=within)
    kinds = {"fold", "constraint", "undefined unloaded"}
    assert kinds <= set(many.kind.tolist())
    for lane in (*range(0, 30, 3), 30, 31, 32):
        alone = em.limit_load(states[lane], "q", within=within)
        one = many[lane]
        assert (one.kind, one.criticality) == (alone.kind, alone.criticality)
        assert one.value == pytest.approx(alone.value, rel=1e-11, nan_ok=True)


def test_limit_loads_of_springs_are_those_of_the_closed_form():
    """F = (1 − x_l^⅔)^{3/2}."""
    spring = em.Spring()
    x = np.linspace(0.2, 0.9, 50)
    z = np.array([spring.natural_state(x_l=float(each)).z for each in x])
    p = np.array([spring.natural_state(x_l=float(each)).p for each in x])
    found = em.limit_load(States(spring, z, p), "F")
    assert set(found.kind.tolist()) == {"fold"}
    assert found.value == pytest.approx((1 - x ** (2 / 3)) ** 1.5, rel=1e-11)
    assert repr(found) == "LimitLoads(50: 50 fold)"


def test_bad_batches_are_refused():
    form = fold_form()
    stable = batch(form, np.ones(2), a=1.0)
    with pytest.raises(InputError, match=r"`bound` must exceed a = 1; got 0\.5"):
        em.limit_load(stable, "a", bound=0.5)
    with pytest.raises(InputError, match="must be stable; got index 1 in number 1"):
        em.limit_load(batch(form, np.array([1.0, -1.0]), a=1.0), "a")
    with pytest.raises(InputError, match=r"must hold equilibria .* residual of 3 in number 1"):
        em.lift(batch(form, np.array([1.0, 2.0]), a=1.0), {"a": 2.0})
    with pytest.raises(InputError, match="at least one state"):
        em.lift(stable[:0], {"a": 2.0})
    with pytest.raises(InputError, match="one for each of 2 states"):
        em.lift(stable, {"a": np.ones(3)})


# --- long queues ---------------------------------------------------------------------------------


@pytest.mark.parametrize("times", [40, pytest.param(400, marks=pytest.mark.slow)])
def test_memory_beyond_states_and_results_does_not_grow_with_the_lanes(arch, times):
    """Bound: four times the states (start, results, work) and 24 MB for what is under way.

    Each lane takes about 12 steps of 60 work arrays; keeping them would take 40 times the states.
    """
    seed = rest_states(arch, 250)
    states = States(arch, np.tile(seed.z, (times, 1)), np.tile(seed.p, (times, 1)))
    with unchecked():
        em.limit_load(seed, "q")
        tracemalloc.start()
        found = em.limit_load(states, "q")
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert len(found) == 250 * times
    assert peak < 4 * (states.z.nbytes + states.p.nbytes) + 24e6
    assert np.array_equal(found.value, np.tile(found.value[:250], times))


class StopAfter:
    """Cancels as soon as some lanes are finished."""

    def __init__(self, lanes):
        self.lanes, self.seen = lanes, []

    def report(self, stage, done, total):
        self.seen.append((done, total))
        if done >= self.lanes:
            raise em.CancelledError


def test_cancelled_lifts_keep_what_is_done(arch, monkeypatch):
    """The finished lanes equal those of an undisturbed run; the others are "cancelled"."""
    monkeypatch.setattr(import_module("equimorph.equilibria.trace"), "REPORT_EVERY", 0.0)
    seed = rest_states(arch, 250)
    states = States(arch, np.tile(seed.z, (40, 1)), np.tile(seed.p, (40, 1)))
    sink = StopAfter(500)
    with unchecked():
        found = em.limit_load(states, "q", progress=sink)
        whole = em.limit_load(seed, "q")
    done = found.kind != "cancelled"
    assert 500 <= done.sum() < 10_000
    assert sink.seen[-1] == (pytest.approx(done.sum(), abs=2000), 10_000)
    assert np.isnan(found.value[~done]).all()
    assert np.array_equal(found.value[done], np.tile(whole.value, 40)[done])


def test_cancelled_lift_of_one_state_is_said_to_be_cancelled(arch, monkeypatch):
    monkeypatch.setattr(import_module("equimorph.equilibria.trace"), "REPORT_EVERY", 0.0)
    path = em.lift(rest_states(arch, 1)[0], {"q": 2.0}, progress=StopAfter(0))
    assert path.end.kind == "cancelled"
