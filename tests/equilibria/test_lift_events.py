"""Events of lifts on normal forms whose branches are known in closed form [Seydel2010]_."""

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st
from scipy.optimize import brentq

import equimorph as em
from equimorph.equilibria import ParameterLine, TraceOptions
from equimorph.equilibria.trace import trace
from equimorph.equilibria.trace_options import EventCode
from oracles.polynomial import (
    Polynomial,
    bead_on_a_circle,
    fold_form,
    pitchfork_form,
    slaved,
    transcritical_form,
)
from oracles.specimens import portal
from oracles.surfaces import butterfly

factors = st.floats(0.1, 10.0)
starts = st.floats(0.1, 2.0)
stiff = st.floats(0.5, 4.0)
slopes = st.floats(-1.5, 1.5)
QUICK = settings(max_examples=5, deadline=None, derandomize=True)


@QUICK
@given(c=factors, a=starts, below=starts)
def test_fold_is_where_the_discriminant_vanishes(c, a, below):
    """x² = a ends at (0, 0). Tolerance: the augmented system is solved to round-off."""
    path = em.lift(fold_form(c).state(np.sqrt(a), a=a), {"a": -below})
    assert path.end.kind == "fold"
    assert path.end.state.z[0] == pytest.approx(0.0, abs=1e-10)
    assert path.end.state["a"] == pytest.approx(0.0, abs=1e-12)
    assert path.end.at == pytest.approx(a / (a + below), rel=1e-9)
    assert (path.index == 0).all()


@QUICK
@given(c=factors, a=starts, k=stiff, m=slopes)
def test_path_through_a_fold_returns_on_the_other_branch(c, a, k, m):
    """x = −√a with index 1 is met back at the start's parameters."""
    form = slaved(fold_form(c), k, m)
    path = em.lift(form.state(np.sqrt(a), m * a, a=a), {"a": -1.0}, through_folds=True)
    assert [event.kind for event in path.events] == ["fold", "returned"]
    assert path.end.state.z == pytest.approx([-np.sqrt(a), m * a], rel=1e-9, abs=1e-9)
    assert path.end.state.index == 1
    assert path.events[0].state["a"] == pytest.approx(0.0, abs=1e-11)


@QUICK
@example(sign=1.0, c=5.0, a=1.75, k=1.0, m=0.0)  # a first guess that Newton throws far away
@given(sign=st.sampled_from([1.0, -1.0]), c=factors, a=starts, k=stiff, m=slopes)
def test_pitchfork_is_located_and_classified(sign, c, a, k, m):
    """±x³ = a x loses stability at a = 0; a slaved unknown changes nothing."""
    form = slaved(pitchfork_form(sign, c), k, m)
    end = em.lift(form.state(0.0, 0.0, a=-a), {"a": 1.3}).end
    assert (end.kind, end.criticality) == (
        "branch point",
        "supercritical" if sign > 0 else "subcritical",
    )
    assert end.state["a"] == pytest.approx(0.0, abs=1e-11)
    assert end.state.z == pytest.approx([0.0, 0.0], abs=1e-10)


@QUICK
@given(c=factors, a=starts, k=stiff, m=slopes)
def test_transcritical_point_is_located_and_classified(c, a, k, m):
    """x (x − a) = 0: the branches x = 0 and x = a exchange stability at a = 0."""
    form = slaved(transcritical_form(c), k, m)
    for start in (form.state(0.0, 0.0, a=-a), form.state(a, m * a**2, a=a)):
        end = em.lift(start, {"a": -1.7 * start["a"]}).end
        assert (end.kind, end.criticality) == ("branch point", "transcritical")
        assert end.state["a"] == pytest.approx(0.0, abs=1e-11)


@QUICK
@given(sign=st.sampled_from([1.0, -1.0]), power=st.floats(-8.0, -1.0), c=factors)
def test_imperfect_pitchfork_is_never_taken_for_a_perfect_one(sign, power, c):
    """±x³ − a x = b, b > 0: no event if supercritical; else a fold at a = −3 (b/2)^⅔.

    Tolerances: 1e-9 relative to the unfolding's own size.
    """
    b = 10.0**power
    form = pitchfork_form(sign, c)
    roots = np.roots([sign, 0.0, 1.0, -b])
    x = float(roots[np.argmin(np.abs(roots))].real)
    path = em.lift(form.state(x, a=-1.0, b=b), {"a": 1.0})
    if sign > 0:
        assert path.arrived
        assert (path.index == 0).all()
        assert path.end.state.z[0] > 1.0
    else:
        assert path.end.kind == "fold"
        assert path.end.state["a"] == pytest.approx(-3 * (b / 2) ** (2 / 3), rel=1e-9)
        assert path.end.state.z[0] == pytest.approx((b / 2) ** (1 / 3), rel=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_side_branch_of_a_pitchfork_ends_at_the_branch_point(side):
    """x = ±√a of x³ = a x leads into (0, 0), where the paths cross."""
    end = em.lift(pitchfork_form(1.0).state(side, a=1.0), {"a": -1.0}).end
    assert (end.kind, end.criticality) == ("branch point", "supercritical")
    assert end.state["a"] == pytest.approx(0.0, abs=1e-11)
    assert end.state.z[0] == pytest.approx(0.0, abs=1e-10)


def test_through_folds_means_through_branch_points_too():
    """The straight branch is followed across, with its index on either side."""
    path = em.lift(pitchfork_form(1.0).state(0.0, a=-1.0), {"a": 1.0}, through_folds=True)
    assert [event.kind for event in path.events] == ["branch point", "arrived"]
    assert path.end.state.z[0] == pytest.approx(0.0, abs=1e-12)
    assert path.end.state.index == 1


@QUICK
@given(h=st.floats(0.001, 0.95))
def test_constrained_bead_folds_on_the_astroid(h):
    """[StonerWohlfarth1948]_: |h|^⅔ + |g|^⅔ = 1; the multiplier is part of the state."""
    bead = bead_on_a_circle()
    upright = bead.state(0.0, 1.0, 1.0, g=1.0)
    assert upright.residual < 1e-15
    assert upright.index == 0
    leaning = em.lift(upright, {"h": h}).end.state
    end = em.lift(leaning, {"g": -2.0}).end
    assert end.kind == "fold"
    assert end.state["g"] == pytest.approx(-((1 - h ** (2 / 3)) ** 1.5), rel=1e-10, abs=1e-12)
    assert end.state.z[0] == pytest.approx(h ** (1 / 3), rel=1e-9)


def test_constrained_bead_without_side_load_meets_a_subcritical_pitchfork():
    """Reduced energy ½ sin²φ − g cos φ = −φ⁴/8 + … at g = −1."""
    end = em.lift(bead_on_a_circle().state(0.0, 1.0, 1.0, g=1.0), {"g": -2.0}).end
    assert (end.kind, end.criticality) == ("branch point", "subcritical")
    assert end.state["g"] == pytest.approx(-1.0, rel=1e-12)


@pytest.mark.parametrize("offset", [0.0, 1e-13, 1e-10, 1e-6, -1e-13, -1e-10, -1e-6])
def test_goal_at_a_fold_is_reached_or_missed_by_its_offset(offset):
    """The goal a = offset: inside the range (≥ 0) it is reached, outside the fold ends the lift.

    Within 1e-12 of the fold either answer is right, and both are the same state.
    """
    end = em.lift(fold_form().state(1.0, a=1.0), {"a": offset}).end
    allowed = (
        {"arrived"} if offset > 1e-12 else {"fold"} if offset < -1e-12 else {"arrived", "fold"}
    )
    assert end.kind in allowed
    assert end.state["a"] == pytest.approx(max(offset, 0.0), abs=1e-12)
    assert end.state.z[0] == pytest.approx(np.sqrt(max(offset, 0.0)), abs=2e-6)


@pytest.mark.parametrize("offset", [1e-12, 1e-9, 1e-3, -1e-12, -1e-9, -1e-3])
def test_goal_near_a_branch_point_is_reached_or_missed_by_its_offset(offset):
    end = em.lift(pitchfork_form(1.0).state(0.0, a=-1.0), {"a": offset}).end
    assert end.kind == ("arrived" if offset < 0 else "branch point") or abs(offset) < 1e-11
    assert end.state["a"] == pytest.approx(min(offset, 0.0), abs=2e-12)


@pytest.mark.parametrize("goal", [1.0, -1.0])
def test_critical_states_are_refused_as_starts_by_name(goal):
    """From a fold or a branch point no direction is distinguished."""
    fold = em.lift(fold_form().state(1.0, a=1.0), {"a": -1.0}).end.state
    branch = em.lift(pitchfork_form(1.0).state(0.0, a=-1.0), {"a": 1.0}).end.state
    for state in (fold, branch):
        end = em.lift(state, {"a": goal}).end
        assert end.kind == "lost"
        assert "singular" in end.detail
        assert end.at == 0.0


def test_fold_and_constraint_in_one_step_end_at_the_first():
    """x² = a falling: x ≥ 0.1 is violated before the fold, x ≥ −0.1 after it."""
    form = fold_form()
    x = form.descriptor("0")
    start = form.state(1.0, a=1.0)
    before = em.lift(start, {"a": -1.0}, within=[x >= 0.1])
    assert (before.end.kind, before.end.detail) == ("constraint", "u0 >= 0.1")
    assert before.end.state["a"] == pytest.approx(0.01, rel=1e-10)
    after = em.lift(start, {"a": -1.0}, within=[x >= -0.1])
    assert after.end.kind == "fold"
    through = em.lift(start, {"a": -1.0}, within=[x >= -0.1], through_folds=True)
    assert [event.kind for event in through.events] == ["fold", "constraint"]
    assert through.end.state.z[0] == pytest.approx(-0.1, rel=1e-10)


@QUICK
@given(beyond=st.floats(0.001, 0.05), k=stiff, m=slopes)
def test_index_at_an_end_just_behind_a_fold_or_branch_point_is_that_of_its_state(beyond, k, m):
    """Fold and bound, branch point and goal within one step: the index is one more behind."""
    fold = slaved(fold_form(), k, m)
    bound = fold.descriptor("0") >= -beyond
    path = em.lift(fold.state(1.0, m, a=1.0), {"a": -1.0}, within=[bound], through_folds=True)
    assert [event.kind for event in path.events] == ["fold", "constraint"]
    assert path.index[-1] == path.end.state.index == 1
    pitchfork = slaved(pitchfork_form(1.0), k, m)
    path = em.lift(pitchfork.state(0.0, 0.0, a=-1.0), {"a": beyond}, through_folds=True)
    assert [event.kind for event in path.events] == ["branch point", "arrived"]
    assert path.index[-1] == path.end.state.index == 1


@pytest.mark.parametrize("end", [1e-4, 1e-3, 1e-2])
@pytest.mark.parametrize("share", [0.8, 0.95, 0.99, 0.999, 0.9999])
def test_a_bound_just_before_the_end_of_a_bent_path_ends_it(end, share):
    """x³ + 0.002 x = a, y = 3 x², x bounded by its value at a share of the way.

    The end of the way and the bound may lie in one step, whose chord is shorter than the path.
    """
    steep = Polynomial(lambda x, a: x**4 * 0.25 + x**2 * 0.001 - x * a, 1, ("a",))
    form = slaved(steep, 1.0, 3.0)
    begin, stop = -1e-6, share * (end + 1e-6) - 1e-6
    x, bound = (brentq(lambda x, a=a: x**3 + 0.002 * x - a, -3.0, 3.0) for a in (begin, stop))
    along = em.Descriptor("along", "1", lambda z, p: z[:, 0])
    start = form.state(x, 3.0 * x * x, a=begin)
    path = em.lift(start, {"a": end}, within=[along <= bound])
    assert path.end.kind == "constraint"
    assert path.end.state["a"] == pytest.approx(stop, abs=1e-10)


def test_two_folds_that_a_long_step_may_pass_are_met():
    """x⁵ + a x³ + b x + c along a line through the tail of a butterfly: folds by its derivative.

    As edges of sets are lifted at first: without a look at the eigenvalues inside of steps.
    """
    form = butterfly()
    start, end = (
        np.array([-0.098344, 0.000188, -0.000217]),
        np.array([-0.10105, -0.000369, 0.000823]),
    )
    line = ParameterLine(form, start[None], (end - start)[None])
    x = min(
        np.roots([1.0, 0.0, start[0], 0.0, start[1], start[2]]).real, key=lambda x: abs(x + 0.147)
    )
    options = TraceOptions(
        through_folds=True, through_branch_points=True, first_step=0.05, largest_step=0.5,
        smallest_step=1e-7, turning=0.25, look_inside=False,
    )  # fmt: skip
    found = trace(line, np.array([[x]]), (), options)
    places = np.linspace(-0.147, 0.32, 200_001)
    powers = np.stack([places**3, places, np.ones_like(places)])
    t = -(places**5 + start @ powers) / ((end - start) @ powers)
    turns = places[1:-1][np.diff(np.sign(np.diff(t))) != 0]
    assert len(turns) == 3
    np.testing.assert_allclose(found.passed.z[:, 0], turns, atol=1e-5)


@pytest.mark.parametrize("look_inside", [False, True])
@pytest.mark.parametrize("finer", [1.0, 0.35, 0.1225, 0.35**3])
def test_side_branches_that_turn_at_a_pitchfork_meet_nothing_else(finer, look_inside):
    """x = ±√|a| of ±x³ = a x: one branch point at a = 0, and back on the other side.

    There the eigenvalue touches zero, and index and tangent are others within a correction of it.
    As edges of sets are lifted.
    """
    random = np.random.default_rng(0)
    options = TraceOptions(
        through_folds=True, through_branch_points=True, first_step=0.05 * finer,
        largest_step=0.5 * finer, smallest_step=1e-7 * finer**2, turning=0.25 * finer,
        look_inside=look_inside,
    )  # fmt: skip
    for _ in range(20):
        sign, k, m = (
            random.choice([1.0, -1.0]),
            10 ** random.uniform(-0.3, 3),
            random.uniform(-2, 2),
        )
        form = slaved(pitchfork_form(sign, 10 ** random.uniform(-1, 1)), k, m)
        start, end = sign * random.uniform(0.1, 2), -sign * random.uniform(0.1, 2)
        line = ParameterLine(form, np.array([[start, 0.0]]), np.array([[end - start, 0.0]]))
        x = np.sqrt(abs(start))
        found = trace(line, np.array([[x, m * x**2]]), (), options)
        assert found.code == EventCode.RETURNED
        assert found.z[0, 0] == pytest.approx(-x, rel=1e-9)
        assert found.passed.code.tolist() == [EventCode.BRANCH_POINT]
        assert found.passed.z == pytest.approx(0.0, abs=1e-9)


def test_folds_are_located_beside_pitchforks_of_a_frame():
    """Two states over a point of a frame lead over a fold and a pitchfork 3e-4 apart, and back.

    With an eigenvalue of 1e-6 beside that which vanishes, round-off moves states by 1e-8.
    """
    frame = portal(50.0, 2, 8).resolving(4.67)
    start = {"k": 0.0, "d": 0.18531122, "P": 2.5145, "q": 0.18140901}
    found = em.find_equilibria(frame, start, within=[frame.max_curvature <= 3.2])
    rate = np.array([[0.0, 0.00108076, 0.0, 0.00750963]])
    line = ParameterLine(frame, found.p, np.repeat(rate, len(found), axis=0))
    options = TraceOptions(
        through_folds=True, through_branch_points=True, first_step=0.05, largest_step=0.5,
        smallest_step=1e-7, turning=0.25, look_inside=False,
    )  # fmt: skip
    ends = trace(line, found.z, (frame.max_curvature <= 4.67,), options)
    assert not ends.why
    met = [ends.passed.code[ends.passed.lanes == lane].tolist() for lane in range(len(found))]
    fold, branch = EventCode.FOLD, EventCode.BRANCH_POINT
    assert sorted(met) == [[], [], [], [], [fold, branch], [branch], [branch], [branch, fold]]
