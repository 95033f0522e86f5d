"""Branch switching on normal forms and on the arch."""

import numpy as np
import pytest
from hypothesis import Phase, given, settings, strategies as st

import equimorph as em
from equimorph.equilibria.critical import normal_form
from equimorph.errors import InputError
from oracles.polynomial import Polynomial, fold_form, pitchfork_form, slaved, transcritical_form
from typecheck import unchecked

PHASES = (Phase.explicit, Phase.generate)  # to shrink takes minutes
QUICK = settings(max_examples=5, deadline=None, derandomize=True, phases=PHASES)

factors = st.floats(0.1, 10.0)
stiff = st.floats(0.5, 4.0)
slopes = st.floats(-1.5, 1.5)


@QUICK
@given(sign=st.sampled_from([1.0, -1.0]), c=factors, k=stiff, m=slopes)
def test_side_branches_of_a_pitchfork_are_started_on(sign, c, k, m):
    """±x² = a beside x = 0: stable if supercritical. Tolerance: starts are exact equilibria."""
    form = slaved(pitchfork_form(sign, c), k, m)
    path = em.lift(form.state(0.0, 0.0, a=-1.0), {"a": 1.0})
    sides = em.branches(path.end.state, "a", path=path)
    assert [side.curve for side in sides] == [1, 1]
    assert [side.slope for side in sides] == pytest.approx([0.0, 0.0], abs=1e-9)
    x = np.array([side.state.z[0] for side in sides])
    assert sorted(np.sign(x)) == [-1.0, 1.0]
    assert [side.state["a"] for side in sides] == pytest.approx(sign * x**2, abs=1e-12)
    assert [side.state.index for side in sides] == [0 if sign > 0 else 1] * 2
    end = em.lift(sides[0].state, {"a": 2.0 * sign}).end
    assert end.state.z[0] == pytest.approx(np.sign(x[0]) * np.sqrt(2.0), rel=1e-11)


@QUICK
@given(c=factors, a=st.floats(0.5, 2.0), k=stiff, m=slopes)
def test_all_four_ways_from_a_transcritical_point_are_found(c, a, k, m):
    """x = 0 and x = a, both ways; the one that was travelled is left out on request."""
    form = slaved(transcritical_form(c), k, m)
    path = em.lift(form.state(-a, m * a**2, a=-a), {"a": a})
    ways = em.branches(path.end.state, "a")
    assert len(ways) == 4
    for way in ways:
        x, value = way.state.z[0], way.state["a"]
        assert min(abs(x), abs(x - value)) < 1e-12
        assert np.sign(way.slope) == np.sign(value)
    others = em.branches(path.end.state, "a", path=path)
    assert [abs(way.state.z[0]) < 1e-12 for way in others] == [True, True]


def test_path_on_a_side_branch_leaves_the_straight_one():
    """From x = √a down to the pitchfork: the other curve is x = 0."""
    path = em.lift(pitchfork_form(1.0).state(1.0, a=1.0), {"a": -1.0})
    others = em.branches(path.end.state, "a", path=path, distance=0.1)
    assert [way.curve for way in others] == [0, 0]
    assert [way.state.z[0] for way in others] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert sorted(way.state["a"] for way in others) == pytest.approx([-0.1, 0.1], rel=1e-9)


def test_arch_leaves_its_pitchfork_on_asymmetric_states():
    """Subcritical: both mirror images are unstable and lead back to smaller loads."""
    arch = em.Rod()
    with unchecked():
        path = em.lift(arch.natural_state(Theta=0.9), {"q": 8.0})
        sides = em.branches(path.end.state, "q", path=path)
    assert [side.state.index for side in sides] == [1, 1]
    assert max(side.state.residual for side in sides) < 1e-12
    left, right = (side.state for side in sides)
    assert left["q"] == pytest.approx(right["q"], rel=1e-11)
    assert left["q"] < path.end.state["q"]
    assert arch.height(0.3)(left) == pytest.approx(arch.height(0.7)(right), rel=1e-11)


def test_arms_of_the_arch_lead_back_to_its_two_states_of_index_one():
    """PHYSICS §5: of the five states at q = 2.5, (1, 0) two have index 1; here by searching."""
    arch = em.Rod()
    kappa, rise = arch.max_curvature, arch.height(0.3)
    with unchecked():
        path = em.lift(arch.natural_state(Theta=1.0), {"q": 8.0})
        assert path.end.criticality == "subcritical"
        sides = em.branches(path.end.state, "q", path=path)
        ends = [em.lift(side.state, {"q": 2.5}) for side in sides]
        known = em.find_equilibria(arch, {"Theta": 1, "Delta": 0, "q": 2.5}, within=[kappa <= 20])
    assert [end.arrived for end in ends] == [True, True]
    assert [end.end.state.index for end in ends] == [1, 1]
    found = sorted(rise(end.end.state) for end in ends)
    assert found == pytest.approx(sorted(rise(s) for s in known if s.index == 1), abs=1e-9)
    assert found[0] == pytest.approx(min(arch.height(0.7)(end.end.state) for end in ends), rel=1e-9)


def test_states_without_crossing_paths_are_refused():
    fold = em.lift(fold_form().state(1.0, a=1.0), {"a": -1.0}).end.state
    with pytest.raises(InputError, match=r"`state` must be a branch point of paths along a; got"):
        em.branches(fold, "a")
    regular = pitchfork_form(1.0).state(0.0, a=-1.0)
    with pytest.raises(InputError, match=r"`state` must be a branch point of paths along a; got"):
        em.branches(regular, "a")
    isola = Polynomial(lambda x, a: x**3 * (1 / 3) + a**2 * x, 1, ("a",)).state(0.0)
    with pytest.raises(InputError, match=r"simple branch point .* got kind 'isola'"):
        em.branches(isola, "a")
    with pytest.raises(InputError, match=r"`distance` must be positive and finite; got 0"):
        em.branches(pitchfork_form(1.0).state(0.0), "a", distance=0)


def test_forms_of_events_have_the_same_bits_in_any_batch():
    """The threads of a march share events among each other as they come."""
    rod, rng = em.Rod(load="uniform"), np.random.default_rng(4)
    p = np.array([1.0, 0.1, 1.5, 0.8]) + 0.1 * rng.uniform(-1.0, 1.0, (37, 4))
    z = rod.natural(p)[0] + 0.1 * rod.sample(p, rng)
    dp = np.broadcast_to([0.0, 0.0, 1.0, 0.0], p.shape)
    together = normal_form(rod, z, p, dp)
    alone = [normal_form(rod, z[k : k + 1], p[k : k + 1], dp[k : k + 1]) for k in range(len(z))]
    for name in ("phi", "psi", "quadratic", "mixed", "path", "cubic"):
        parts = np.concatenate([getattr(each, name) for each in alone])
        np.testing.assert_array_equal(parts, getattr(together, name), name)
