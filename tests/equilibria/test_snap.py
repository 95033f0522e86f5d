"""Snap landings: gradient flow from states that cannot be kept."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import equimorph as em
from equimorph.equilibria.gradient_flow import gradient_flow, implicit_step
from equimorph.equilibria.snap import snap_landings
from equimorph.errors import InputError
from equimorph.structures import join_states
from oracles.polynomial import Polynomial, bead_on_a_circle, fold_form, pitchfork_form, slaved
from oracles.shots import UNIFORM, from_states

QUICK = settings(max_examples=5, deadline=None, derandomize=True)
FOLD = 2.0 / (3.0 * np.sqrt(3.0))
"""Tilt b at which x³ − x = b has its folds, at x = ∓1/√3."""


@pytest.fixture(scope="module")
def arch():
    return em.Rod()


@pytest.fixture(scope="module")
def fold(arch):
    """(Θ, Δ) = (0.9, 0.02), uniform load: q = 3.94850393 [PHYSICS §5]."""
    return em.lift(arch.natural_state(Theta=0.9, Delta=0.02), {"q": 8.0}).end.state


@pytest.fixture(scope="module")
def branch_point(arch):
    """(0.9, 0), uniform load: a subcritical pitchfork at q = 4.2439977594 [PHYSICS §5]."""
    return em.lift(arch.natural_state(Theta=0.9, Delta=0.0), {"q": 8.0}).end.state


def double_well() -> Polynomial:
    """E = x⁴/4 − x²/2 − b x."""
    return Polynomial(lambda x, b: x**4 * 0.25 - x**2 * 0.5 - b * x, 1, ("b",))


def test_a_double_well_lets_go_both_ways():
    """b = 0: from x = 0 to ±1, releasing ¼."""
    landings = em.snap_landing(double_well().state(0.0))
    assert [landing.status for landing in landings] == ["landed", "landed"]
    assert [landing.direction for landing in landings] == [1, -1]
    assert [landing.state.z[0] for landing in landings] == pytest.approx([1.0, -1.0], abs=1e-12)
    assert [landing.released for landing in landings] == pytest.approx([0.25, 0.25], abs=1e-12)


@QUICK
@given(b=st.floats(-0.999 * FOLD, 0.999 * FOLD))
def test_a_tilted_double_well_lands_on_the_roots_beside(b):
    """The middle root of x³ − x = b lets go to the outer ones, even close to a fold."""
    low, middle, high = sorted(np.roots([1.0, 0.0, -1.0, -b]).real)
    well = double_well()
    start = well.state(middle, b=b)
    up, down = em.snap_landing(start)
    assert up.landed
    assert down.landed
    assert [down.state.z[0], up.state.z[0]] == pytest.approx([low, high], abs=1e-9)
    assert up.released == pytest.approx(start.energy - well.state(high, b=b).energy, abs=1e-12)


def test_a_fold_lets_go_one_way():
    """From x = −1/√3 to 2/√3, releasing ¾; towards the stable side the energy rises."""
    forth, back = em.snap_landing(double_well().state(-1.0 / np.sqrt(3.0), b=FOLD))
    assert forth.landed
    assert forth.state.z[0] == pytest.approx(2.0 / np.sqrt(3.0), abs=1e-12)
    assert forth.released == pytest.approx(0.75, abs=1e-12)
    assert (back.status, back.released, len(back.way)) == ("held", 0.0, 1)


def test_nothing_leaves_a_supercritical_branch_point():
    landings = em.snap_landing(pitchfork_form(1.0).state(0.0))
    assert [landing.status for landing in landings] == ["held", "held"]


def test_a_subcritical_branch_point_lets_go_both_ways():
    """E = x⁶/6 − x⁴/4: from 0 to ±1, releasing 1/12."""
    form = Polynomial(lambda x, a: x**6 * (1 / 6) - x**4 * 0.25 - a * x**2 * 0.5, 1, ("a",))
    landings = em.snap_landing(form.state(0.0))
    assert [landing.state.z[0] for landing in landings] == pytest.approx([1.0, -1.0], abs=1e-10)
    assert [landing.released for landing in landings] == pytest.approx([1 / 12] * 2, abs=1e-12)


@pytest.mark.parametrize(("sign", "status"), [(1.0, "held"), (-1.0, "escaped")])
def test_unknowns_that_follow_are_relaxed_before_the_verdict(sign, status):
    """y = x² exactly: along x alone the energy would rise for either sign."""
    landings = em.snap_landing(slaved(pitchfork_form(sign), 4.0, 1.0).state(0.0, 0.0))
    assert [landing.status for landing in landings] == [status, status]


def test_a_well_without_bottom_is_escaped_from():
    """E = x³/3 − x falls for ever below the unstable x = −1."""
    up, down = em.snap_landing(fold_form().state(-1.0, a=1.0))
    assert up.state.z[0] == pytest.approx(1.0, abs=1e-12)
    assert down.status == "escaped"
    assert down.detail == "the flow left for infinity"


def test_symmetry_leads_to_a_saddle_from_where_one_can_go_on():
    """E = (x⁴ + y⁴)/4 − (x² + 0.81 y²)/2: from the top along x to (±1, 0), then to (±1, ±0.9)."""
    form = Polynomial(
        lambda x, y, a: (x**4 + y**4) * 0.25 - (x**2 + 0.81 * y**2) * 0.5 + 0.0 * a, 2, ("a",)
    )
    saddle, _ = em.snap_landing(form.state(0.0, 0.0))
    assert saddle.status == "saddle"
    assert saddle.state.z == pytest.approx([1.0, 0.0], abs=1e-9)
    up, down = em.snap_landing(saddle.state)
    assert up.state.z == pytest.approx([1.0, 0.9], abs=1e-9)
    assert down.state.z == pytest.approx([1.0, -0.9], abs=1e-9)


def test_a_bead_stays_on_its_circle():
    """E = ½ x² on x² + y² = 1: from (1, 0) to (0, ±1), releasing ½, in steps that fall."""
    for landing in em.snap_landing(bead_on_a_circle().state(1.0, 0.0, -1.0)):
        assert landing.landed
        assert landing.state.z[:2] == pytest.approx([0.0, float(landing.direction)], abs=1e-12)
        assert landing.released == pytest.approx(0.5, abs=1e-12)
        x, y = landing.way.z[:, :2].T
        assert np.abs(x**2 + y**2 - 1.0).max() < 1e-13
        assert (np.diff(landing.way.energy) <= 1e-15).all()
        assert (np.diff(landing.time) > 0).all()


def test_the_flow_runs_in_the_metric_at_its_own_pace():
    """Bead on a circle: φ̇ = sin φ cos φ, so that tan φ grows like eᵗ. Steps are of first order."""
    bead, start = bead_on_a_circle(), 0.1
    z = np.array([[np.cos(start), np.sin(start), -(np.cos(start) ** 2)]])
    flow = gradient_flow(bead, z, np.zeros((1, 2)), np.ones(1), np.full(1, start))
    angle = np.arctan2(flow.points[:, 1], flow.points[:, 0])
    some = (angle > 0.2) & (angle < 1.4)
    exact = np.log(np.tan(angle[some]) / np.tan(start))
    assert some.sum() > 5
    assert flow.time[some] == pytest.approx(exact, rel=0.1)


@QUICK
@given(
    z=st.lists(st.floats(-2.0, 2.0), min_size=2, max_size=2),
    h=st.floats(1e-3, 10.0),
)
def test_every_step_that_is_taken_lowers_the_energy(z, h):
    """E(u⁺) + ‖u⁺ − u‖²/(2h) ≤ E(u), whatever the step, where the problem of the step is convex."""
    form = Polynomial(
        lambda x, y, a: (x**4 + y**4) * 0.25 - x**2 * 0.5 + x * y + 0.0 * a, 2, ("a",)
    )
    u, p = np.array([z]), np.zeros((1, 1))
    new, solved = implicit_step(form, u, p, np.array([min(h, 0.5)]))
    spent = ((new - u) ** 2).sum() / (2.0 * min(h, 0.5))
    assert not solved[0] or form.energy(new, p)[0] + spent <= form.energy(u, p)[0] + 1e-12


def test_a_spring_at_its_fold_snaps_through():
    """x_l = 0.8, F/k = sin³δ at cos³δ = x_l: to the stable root of F = (1 − x_l/cos δ) sin δ."""
    spring, delta = em.Spring(), np.arccos(0.8 ** (1 / 3))
    load = np.sin(delta) ** 3
    fold = em.State(spring, np.array([delta]), np.array([0.8, load, 1.0]))
    landed = [landing for landing in em.snap_landing(fold) if landing.landed]
    assert len(landed) == 1
    angle = landed[0].state.z[0]
    assert angle < -delta
    assert (1.0 - 0.8 / np.cos(angle)) * np.sin(angle) == pytest.approx(load, abs=1e-12)
    assert landed[0].released == pytest.approx(fold.energy - landed[0].state.energy, abs=1e-15)


def test_the_arch_lands_at_the_only_stable_state_left(arch, fold):
    """Shooting knows the landing."""
    landed = [landing for landing in em.snap_landing(fold) if landing.landed]
    assert len(landed) == 1
    end = landed[0].state
    stable = em.find_equilibria(arch, end.parameters, within=[arch.max_curvature <= 20]).stable
    away = stable[np.abs(stable.energy - fold.energy) > 1e-6]
    assert len(away) == 1
    assert end.z == pytest.approx(away.z[0], abs=1e-9)
    shot, found = from_states(end.batch, UNIFORM).solved()
    assert found.all()
    assert shot.index().tolist() == [0]
    assert shot.heights()[0, 2] == pytest.approx(arch.height(0.5)(end), abs=1e-8)
    drift = np.abs(arch.residual(landed[0].way.z, landed[0].way.p)[:, arch.unknowns :])
    assert drift.max() < 1e-13
    assert (np.diff(landed[0].way.energy) <= 1e-13).all()


def test_the_symmetric_arch_lands_on_mirror_images(arch, branch_point):
    left, right = em.snap_landing(branch_point)
    assert left.landed
    assert right.landed
    assert left.released == pytest.approx(right.released, abs=1e-10)
    image, _ = arch.symmetries()[0].apply(left.state.z[None], left.state.p[None])
    # both come to the same inverted arch, which is its own image
    assert image[0] == pytest.approx(right.state.z, abs=1e-8)


def test_the_same_snap_lands_bit_for_bit_at_the_same_place(fold):
    first, again = (em.snap_landing(fold) for _ in range(2))
    for one, other in zip(first, again, strict=True):
        assert np.array_equal(one.way.z, other.way.z)
        assert np.array_equal(one.state.z, other.state.z)


def test_snaps_that_are_followed_together_are_the_same_bits(fold, branch_point):
    """Also at other parameters, which decide how far random guesses, the scale of lengths, lie."""
    states = join_states(fold.structure, [fold.batch, branch_point.batch])
    for state, landings in zip((fold, branch_point), snap_landings(states), strict=True):
        for one, other in zip(em.snap_landing(state), landings, strict=True):
            assert one.status == other.status
            np.testing.assert_array_equal(one.state.z, other.state.z)
            np.testing.assert_array_equal(one.way.z, other.way.z)
            np.testing.assert_array_equal(one.time, other.time)


def test_a_sudden_load_is_followed_to_its_landing(fold):
    """Just past the fold the landing is the one at the fold, to first order."""
    at_fold = next(landing for landing in em.snap_landing(fold) if landing.landed)
    (past,) = em.snap_landing(fold, at={"q": fold["q"] + 1e-5})
    assert past.landed
    assert past.state.z == pytest.approx(at_fold.state.z, abs=1e-4)
    assert past.released == pytest.approx(at_fold.released, abs=1e-5)


def test_a_shape_is_moved_onto_changed_constraints_first(arch):
    """ν = 0.8: the supports come closer at once; the arch rises, on the constraints."""
    rest = arch.natural_state(Theta=0.9, Delta=0.0)
    (landing,) = em.snap_landing(rest, at={"nu": 0.8})
    assert landing.landed
    assert landing.state["nu"] == 0.8
    assert landing.state.residual < 1e-12
    assert np.abs(arch.residual(landing.way.z, landing.way.p)[:, arch.unknowns :]).max() < 1e-13
    assert arch.height(0.5)(landing.state) > arch.height(0.5)(rest)


@pytest.mark.parametrize(("margin", "leaves"), [(0.8e-6, True), (1.2e-6, False)])
def test_a_state_of_index_0_is_critical_up_to_a_margin_of_a_millionth(margin, leaves):
    """E = x⁶/6 − x⁴/4 + m x²/2 at x = 0: its margin is m."""
    form = Polynomial(lambda x, m: x**6 * (1 / 6) - x**4 * 0.25 + m * x**2 * 0.5, 1, ("m",))
    state = form.state(0.0, m=margin)
    assert (state.index, state.margin) == (0, pytest.approx(margin, rel=1e-6))
    if leaves:
        assert [abs(landing.state.z[0]) for landing in em.snap_landing(state)] == pytest.approx(
            [1.0, 1.0], abs=1e-5
        )
    else:
        with pytest.raises(InputError, match=r"got index 0 with a margin of 1\.2e-06"):
            em.snap_landing(state)


def test_a_stable_state_stays(arch):
    rest = arch.natural_state(Theta=0.9, Delta=0.0)
    with pytest.raises(InputError, match="`state` must be unstable or critical; got index 0"):
        em.snap_landing(rest)
    with pytest.raises(InputError, match="`state` must be unstable or critical; got index 0"):
        em.snap_landing(rest, at={"q": 0.0})
    off = em.State(arch, rest.z + 0.01, rest.p)
    with pytest.raises(InputError, match="`state` must be an equilibrium"):
        em.snap_landing(off)
