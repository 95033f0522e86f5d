"""Limit loads: each kind of end, on structures where it is known."""

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from oracles.polynomial import Polynomial, fold_form, pitchfork_form


@pytest.fixture(scope="module")
def arch():
    return em.Rod()


def test_fold_ends_a_rising_load():
    """Spring at x_l = 0.5: F = (1 − 0.5^⅔)^{3/2}."""
    found = em.limit_load(em.Spring().natural_state(x_l=0.5), "F")
    assert (found.kind, found.criticality) == ("fold", None)
    assert found.value == pytest.approx((1 - 0.5 ** (2 / 3)) ** 1.5, rel=1e-12)
    assert found.path.states["F"].max() == found.value
    assert found.state["F"] == found.value


@pytest.mark.parametrize(("sign", "word"), [(1.0, "supercritical"), (-1.0, "subcritical")])
def test_branch_point_ends_a_rising_load_and_tells_its_criticality(sign, word):
    found = em.limit_load(pitchfork_form(sign).state(0.0, a=-1.0), "a")
    assert (found.kind, found.criticality) == ("branch point", word)
    assert found.value == pytest.approx(0.0, abs=1e-12)


def loads_with_close_folds(lanes, distance, draw):
    """States at x = 0 of loads P(x) with P' = k (b − x) Π ((x − a)² − d²/4), and the first folds.

    One or two pairs of folds at a distance d stand before the fold b; y = m x² is slaved.
    """
    form = Polynomial(
        lambda x, y, P, m, *c: (
            sum(ck * x ** (k + 2) * (1 / (k + 2)) for k, ck in enumerate(c))
            + (y - m * x**2) ** 2
            - P * x
        ),
        2,
        ("P", "m", *(f"c{k}" for k in range(6))),
    )
    p, first = np.zeros((lanes, 8)), np.zeros(lanes)
    for lane in range(lanes):
        a = np.cumsum(draw.uniform(0.3, 1.0, draw.integers(1, 3)))
        roots = np.append(np.concatenate([a - 0.5 * distance, a + 0.5 * distance]), a[-1] + 1.0)
        slope = -np.poly(roots)[::-1]
        slope /= slope[0] * draw.uniform(0.3, 3.0)
        p[lane, 2 : 2 + len(slope)] = slope / np.arange(1, len(slope) + 1)
        p[lane, 1], first[lane] = draw.normal(), roots.min()
    return em.States(form, np.zeros((lanes, 2)), p), first


@pytest.mark.parametrize("distance", [0.1, 0.03, 0.01, 0.003])
def test_of_three_folds_inside_one_step_the_first_is_the_limit(distance):
    """575 of 18 000 such loads went past a pair of folds to the next one without a word."""
    states, first = loads_with_close_folds(400, distance, np.random.default_rng(8))
    found = em.limit_load(states, "P")
    assert (found.kind == "fold").all()
    assert found.states.z[:, 0] == pytest.approx(first, abs=1e-6)


def test_constraint_ends_a_rising_load_and_is_named():
    form = fold_form()
    x = form.descriptor("0")
    found = em.limit_load(form.state(1.0, a=1.0), "a", within=[x <= 3.0])
    assert (found.kind, found.detail) == ("constraint", "u0 <= 3")
    assert found.value == pytest.approx(9.0, rel=1e-11)


def test_load_without_limit_is_followed_to_the_bound():
    found = em.limit_load(fold_form().state(1.0, a=1.0), "a", bound=5.0)
    assert found.kind == "none below the bound"
    assert found.value == 5.0


def test_constraint_that_fails_unloaded_leaves_the_limit_undefined(arch):
    rest = arch.natural_state(Theta=0.66, Delta=1.36)
    found = em.limit_load(rest, "q", within=[arch.max_curvature <= 10.0])
    assert (found.kind, found.detail) == ("undefined unloaded", "max_curvature <= 10")
    assert np.isnan(found.value)
    assert found.path is None


def test_limit_is_the_largest_load_met_when_the_path_cannot_go_on(arch):
    """A lost path has no limit: its value is NaN, its cause is named."""
    rest = arch.natural_state(Theta=0.9)
    found = em.limit_load(rest, "q", options=em.TraceOptions(steps=2))
    assert (found.kind, found.detail) == ("lost", "no end in 2 steps")
    assert np.isnan(found.value)


def test_bound_below_the_present_load_is_refused(arch):
    rest = arch.natural_state(Theta=0.9)
    for bound, allowed in (
        (0.0, "exceed q = 0"),
        (-1.0, "exceed q = 0"),
        (np.inf, "be a finite number"),
        (np.nan, "be a finite number"),
    ):
        with pytest.raises(InputError, match=f"`bound` must {allowed}; got {bound}"):
            em.limit_load(rest, "q", bound=bound)


def test_unstable_start_is_refused():
    unstable = fold_form().state(-1.0, a=1.0)
    with pytest.raises(InputError, match="`state` must be stable; got index 1"):
        em.limit_load(unstable, "a")


def test_unknown_load_is_refused(arch):
    with pytest.raises(InputError, match=r"`Q` must be a parameter \(Theta, Delta, q, nu\)"):
        em.limit_load(arch.natural_state(Theta=0.9), "Q")


def test_rod_pulled_straight_is_lost_where_its_elements_are_too_long():
    """Layers at the ends have the width 1/(2π √λ), with λ near 10⁶: 10⁻⁴, the elements 1/6."""
    arch = em.Rod()
    end = em.lift(arch.natural_state(Theta=0.9, Delta=0.0), {"nu": 0.9999}).end
    assert end.kind == "lost"
    assert end.detail.endswith("the discretisation does not resolve the state: refine it")
    finer = em.Rod(elements=12)
    path = em.lift(finer.natural_state(Theta=0.9, Delta=0.0), {"nu": 0.99})
    assert path.arrived


@pytest.mark.parametrize("bound", [1e6, 1e12, 1e150])
def test_limits_do_not_depend_on_how_far_the_bound_is(bound):
    """The spring at x_l = 0.8 snaps at F = 0.0513907783; the start is as regular as ever."""
    spring = em.Spring()
    near, far = (em.limit_load(spring.natural_state(x_l=0.8), "F", bound=b) for b in (1.0, bound))
    assert (far.kind, far.detail) == (near.kind, "")
    np.testing.assert_allclose(far.value, near.value, rtol=1e-12)
    lifted = em.lift(spring.natural_state(x_l=1.2), {"F": bound}).end
    assert (lifted.kind, lifted.detail) == ("lost", "no end in 2000 steps")


def test_maps_do_not_depend_on_how_far_the_bound_is():
    grid = em.Grid(x_l=(0.6, 0.9, 3), k=(1, 2, 3))
    near, far = (em.limit_load_map(em.Spring(), grid, "F", bound=b) for b in (10.0, 1e12))
    np.testing.assert_allclose(far.value, near.value, rtol=1e-12)


@pytest.mark.parametrize("bound", [1e151, 1e300])
def test_values_whose_squares_overflow_are_refused(bound):
    spring, said = em.Spring(), r"`F` must be at most 1e\+150 in size; got 1e\+"
    up = spring.natural_state(x_l=0.8)
    grid = em.Grid(x_l=(0.6, 0.9, 3), k=(1, 2, 3))
    for call in (
        lambda: em.limit_load(up, "F", bound=bound),
        lambda: em.lift(up, {"F": bound}),
        lambda: em.limit_load_map(spring, grid, "F", bound=bound),
    ):
        with pytest.raises(InputError, match=said):
            call()
