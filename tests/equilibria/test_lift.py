"""Lifting along polylines: identities, constraints, and what is refused."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import equimorph as em
from equimorph.errors import InputError
from oracles import shooting
from oracles.polynomial import Polynomial, fold_form, pitchfork_form

QUICK = settings(max_examples=4, deadline=None, derandomize=True)


@pytest.fixture(scope="module")
def arch():
    return em.Rod()


@pytest.fixture(scope="module")
def rest(arch):
    return arch.natural_state(Theta=0.9, Delta=0.1)


def quadratic():
    """E = ½ x² − a x: x = a, stable everywhere."""
    return Polynomial(lambda x, a, b: x**2 * 0.5 - a * x + b * 0.0, 1, ("a", "b"))


# --- identities ----------------------------------------------------------------------------------


@QUICK
@given(
    x=st.lists(st.floats(1.05, 2.0), min_size=1, max_size=4),
    F=st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4),
)
def test_spring_lifted_there_and_back_is_where_it_was(x, F):
    """All states with x_l > 1 are stable, so every polyline there can be travelled both ways."""
    start = em.Spring().natural_state(x_l=1.5)
    corners = [{"x_l": a, "F": b} for a, b in zip(x, F, strict=False)]
    home = em.lift(start, [*corners, *corners[-2::-1], {"x_l": 1.5, "F": 0.0}])
    assert home.arrived
    assert home.end.state.z == pytest.approx(start.z, abs=1e-13)


@QUICK
@given(
    Theta=st.floats(0.7, 1.2), Delta=st.floats(-0.1, 0.1), q=st.floats(-2.0, 2.0),
    nu=st.floats(0.75, 0.9),
)  # fmt: skip
def test_arch_lifted_there_and_back_is_where_it_was(arch, rest, Theta, Delta, q, nu):
    """Tolerance: end points are polished to round-off."""
    there = em.lift(rest, {"Theta": Theta, "Delta": Delta, "q": q, "nu": nu})
    assert there.arrived
    home = em.lift(there.end.state, {"Theta": 0.9, "Delta": 0.1, "q": 0.0, "nu": rest["nu"]})
    assert home.arrived
    assert np.abs(home.end.state.z - rest.z).max() < 1e-11


def test_result_does_not_depend_on_the_step(rest):
    """Tolerance: round-off of the located fold."""
    coarse = em.lift(rest, {"q": 8.0})
    options = em.TraceOptions(first_step=0.01, largest_step=0.03)
    fine = em.lift(rest, {"q": 8.0}, options=options)
    assert coarse.end.kind == fine.end.kind == "fold"
    assert fine.end.state["q"] == pytest.approx(coarse.end.state["q"], rel=1e-12)
    assert len(fine.at) > 3 * len(coarse.at)


def test_load_cycle_and_its_mirror_image_agree(arch):
    """Mirror: Δ → −Δ swaps the ends; heights at s and 1 − s change places."""
    left = em.lift(arch.natural_state(Theta=0.9, Delta=0.1), {"q": 1.5}).end.state
    right = em.lift(arch.natural_state(Theta=0.9, Delta=-0.1), {"q": 1.5}).end.state
    assert arch.height(0.3)(left) == pytest.approx(arch.height(0.7)(right), rel=1e-12)


# --- what a path is ------------------------------------------------------------------------------


def test_path_is_made_of_equilibria_on_the_polyline(rest):
    corners = [{"q": 1.0}, {"Theta": 1.1, "Delta": 0.0}, {"nu": 0.8}]
    path = em.lift(rest, corners)
    assert path.arrived
    assert (path.states.residual < 1e-10).all()
    assert (path.index == path.states.index).all()
    assert path.at[0] == 0.0
    assert path.at[-1] == path.end.at == 3.0
    assert (np.diff(path.at) > 0).all()
    assert (np.diff(path.length) > 0).all()
    inner = (path.at > 1.0) & (path.at < 2.0)
    share = path.at[inner] - 1.0
    assert path.states["Theta"][inner] == pytest.approx(0.9 + 0.2 * share, rel=1e-14)
    assert path.states["Delta"][inner] == pytest.approx(0.1 - 0.1 * share, rel=1e-12)
    assert path.states["q"][inner] == pytest.approx(1.0, rel=1e-15)


def test_polyline_equals_its_segments_one_by_one(rest):
    corners = [{"q": 1.0}, {"Theta": 1.1}, {"Delta": -0.1}]
    whole = em.lift(rest, corners).end.state
    state = rest
    for corner in corners:
        state = em.lift(state, corner).end.state
    assert np.abs(whole.z - state.z).max() < 1e-13


def test_repeated_way_points_change_nothing(rest):
    once = em.lift(rest, [{"q": 1.0}, {"q": 2.0}])
    twice = em.lift(rest, [{"q": 0.0}, {"q": 1.0}, {"q": 1.0}, {"q": 2.0}, {"q": 2.0}])
    assert twice.arrived
    assert np.abs(once.end.state.z - twice.end.state.z).max() < 1e-13
    assert (np.diff(twice.at) > 0).all()


def test_index_changes_only_at_located_events(arch):
    """Between two states with different index there is exactly one fold or branch point."""
    path = em.lift(arch.natural_state(Theta=0.9), {"q": 8.0}, through_folds=True)
    changes = np.flatnonzero(np.diff(path.index))
    critical = [event for event in path.events if event.kind in {"fold", "branch point"}]
    assert len(changes) == len(critical) == 4
    for change, event in zip(changes, critical, strict=True):
        q = path.states["q"][change : change + 2]
        if event.kind == "branch point":
            assert q.min() <= event.state["q"] <= q.max()
        else:
            turns = event.state["q"] - q
            assert (turns > 0).all() or (turns < 0).all()
    assert (path.index == path.states.index).all()


def test_folds_close_to_a_cusp_are_told_apart(arch):
    """Θ = 1.314348, Δ = 0.464967: two folds 2e-4 apart in q, 0.03 in length, at any step control.

    Oracle: shooting from both. Tolerance: as for every fold.
    """
    rest = arch.natural_state(Theta=1.3143475664, Delta=0.4649670042)
    for options in (None, em.TraceOptions(first_step=0.01, largest_step=0.05)):
        path = em.lift(rest, {"q": 8.0}, through_folds=True, options=options)
        assert [event.kind for event in path.events] == ["fold", "fold", "arrived"]
        gap = path.events[0].state["q"] - path.events[1].state["q"]
        assert gap == pytest.approx(1.98e-4, rel=0.01)
    for event in path.events[:2]:
        exact = shooting.fold(shooting.from_package(event.state))
        assert event.state["q"] == pytest.approx(exact.q, rel=1e-11)


def test_located_events_are_singular_to_round_off(arch):
    """The smallest eigenvalue of the constrained Hessian vanishes at a fold and a pitchfork."""
    path = em.lift(arch.natural_state(Theta=0.9, Delta=0.02), {"q": 8.0})
    assert abs(path.end.state.margin) < 1e-9
    path = em.lift(arch.natural_state(Theta=0.9), {"q": 8.0})
    assert abs(path.end.state.margin) < 1e-9


# --- constraints ---------------------------------------------------------------------------------


@QUICK
@given(bound=st.floats(-0.9, 0.9), scale=st.floats(0.2, 5.0))
def test_constraint_is_met_exactly(bound, scale):
    """x = a ≤ bound. Tolerance: 1e-10 is asked, round-off is found."""
    structure = quadratic()
    x = structure.descriptor("0")
    path = em.lift(structure.state(-1.0, a=-1.0), {"a": scale + 1.0}, within=[x <= bound])
    assert (path.end.kind, path.end.detail) == ("constraint", f"u0 <= {bound:g}")
    assert path.end.state["a"] == pytest.approx(bound, abs=1e-12)
    assert (x(path.states) <= bound + 1e-12).all()


def test_curvature_bound_of_the_arch_is_met_exactly(arch):
    """max |κ| = 10 is located on the true maximum, not on a nodal one."""
    kappa = arch.max_curvature
    rest = arch.natural_state(Theta=0.6, Delta=0.76)
    path = em.lift(rest, {"q": 8.0}, within=[kappa <= 10.0])
    assert path.end.kind == "constraint"
    assert kappa(path.end.state) == pytest.approx(10.0, abs=1e-10)
    s = np.linspace(0.0, 1.0, 101)
    assert max(abs(arch.curvature(at)(path.end.state)) for at in s) <= 10.0 + 1e-9


def test_first_of_several_constraints_is_named():
    structure = quadratic()
    x = structure.descriptor("0")
    within = [x <= 0.8, x <= 0.3, x >= -2.0]
    end = em.lift(structure.state(0.0), {"a": 1.0}, within=within).end
    assert end.detail == "u0 <= 0.3"
    assert end.state["a"] == pytest.approx(0.3, abs=1e-12)


@pytest.mark.parametrize("error", [0.0, 1e-14, -1e-14, 1e-11])
def test_lift_from_a_bound_goes_inwards_and_not_outwards(error):
    """A start that an earlier lift left on the bound is accepted, round-off included."""
    structure = quadratic()
    x = structure.descriptor("0")
    start = structure.state(0.5 + error, a=0.5 + error)
    assert em.lift(start, {"a": -1.0}, within=[x <= 0.5]).arrived
    outwards = em.lift(start, {"a": 1.0}, within=[x <= 0.5]).end
    assert outwards.kind == "constraint"
    assert outwards.at < 1e-12 + 2 * abs(error)


def test_arch_can_be_lifted_back_from_its_curvature_bound(arch):
    kappa = arch.max_curvature
    rest = arch.natural_state(Theta=0.6, Delta=0.76)
    there = em.lift(rest, {"q": 8.0}, within=[kappa <= 10.0]).end.state
    home = em.lift(there, {"q": 0.0}, within=[kappa <= 10.0])
    assert home.arrived
    assert np.abs(home.end.state.z - rest.z).max() < 1e-10


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("to", "message"),
    [
        ({"theta": 1.0}, r"`theta` must be a parameter \(Theta, Delta, q, nu\); got 'theta'"),
        ({"nu": 1.0}, r"`nu` must be a finite number between 0 and 1 L .* got 1\.0"),
        ({"nu": 0.0}, r"`nu` must be a finite number between 0 and 1"),
        ({"q": float("nan")}, r"`q` must be a finite number; got nan"),
        ([{"q": 1.0}, {"Theta": float("inf")}], r"`Theta` must be a finite number; got inf"),
        ({"q": 0.0}, r"`to` must change at least one parameter; got the start itself"),
        ([], r"`to` must change at least one parameter"),
    ],
)
def test_way_points_without_meaning_are_refused(rest, to, message):
    with pytest.raises(InputError, match=message):
        em.lift(rest, to)


def test_start_that_is_no_equilibrium_is_refused(arch, rest):
    wrong = em.State(arch, rest.z + 0.01, rest.p)
    with pytest.raises(InputError, match=r"`state` must be an equilibrium .*residual of 0\.\d+"):
        em.lift(wrong, {"q": 1.0})


def test_start_that_violates_a_constraint_is_refused(arch, rest):
    with pytest.raises(InputError, match=r"`state` must obey max_curvature <= 1; got .* = \d\.\d+"):
        em.lift(rest, {"q": 1.0}, within=[arch.max_curvature <= 1.0])


def test_too_few_steps_end_as_lost_and_say_why(rest):
    """A numerical failure is a value that names its cause."""
    path = em.lift(rest, {"q": 2.0}, options=em.TraceOptions(steps=3))
    assert path.end.kind == "lost"
    assert path.end.detail == "no end in 3 steps"
    assert not path.arrived
    assert 0.0 < path.end.state["q"] < 2.0


def test_energy_without_equilibria_beyond_the_fold_is_never_followed_there():
    """x² = a has no state for a < 0: all states of the path keep a ≥ 0."""
    path = em.lift(fold_form().state(2.0, a=4.0), {"a": -9.0}, through_folds=True)
    assert (path.states["a"] >= -1e-12).all()


def test_supercritical_side_branches_are_followed_from_their_own_states():
    """x = √a from a = 1 to 4 keeps its side of the symmetry."""
    path = em.lift(pitchfork_form(1.0).state(-1.0, a=1.0), {"a": 4.0})
    assert path.end.state.z[0] == pytest.approx(-2.0, rel=1e-12)


@pytest.mark.parametrize("count", [1, 2])
def test_a_constraint_that_jumps_is_named(count):
    """Stability under another load is lost at x_l = 1 at once; the box of the other is far off."""
    spring = em.Spring()
    start = spring.natural_state(x_l=1.2)
    bounds = [
        em.outside(spring, em.Box(x_l=(0.7, 0.8), F=(-0.1, 0.1))) >= 0,
        em.stable_over(spring, "F", (-0.01, 0.01)),
    ]
    starts = (
        start
        if count == 1
        else em.States(spring, *(np.tile(a, (2, 1)) for a in (start.z, start.p)))
    )
    ended = em.lift(starts, {"x_l": 0.8, "F": 0.05}, within=bounds)
    details = [ended.end.detail] if count == 1 else list(ended.detail.values())
    assert details == count * [str(bounds[1])]
