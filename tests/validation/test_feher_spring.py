"""[Feher2025]_, section 2.3: the constrained spring; everything in closed form.

Errata (PHYSICS §2): the paper gives F = 1 for C_s (it is 0.009908 k), puts C_t1 = (0.40, 0.90) on
the level of C_s (it lies on 0.008904), calls (0.30, 0.925) a point of the stability boundary (it
is stable), and C_t3 = (−0.62, 0.80) an equilibrium at C_s's load (it needs the opposite one).
"""

import numpy as np
import pytest

import equimorph as em

EXACT = {"rel": 1e-12}


def load(delta, x):
    """F/k = (1 − x_l/cos δ) sin δ."""
    return (1 - x / np.cos(delta)) * np.sin(delta)


def actuator(delta, F):
    """x_l at which δ is an equilibrium under F."""
    return (1 - F / np.sin(delta)) * np.cos(delta)


LEVEL = load(0.62, 0.80)


@pytest.fixture(scope="module")
def spring():
    return em.Spring()


@pytest.fixture(scope="module")
def start(spring):
    """C_s = (δ, x_l) = (0.62, 0.80), reached by loading the natural state."""
    return em.lift(spring.natural_state(x_l=0.8), {"F": LEVEL}).end.state


def test_start_carries_a_hundredth_of_the_stiffness(spring, start):
    """PHYSICS §2: F/k = +0.009908 (the paper: F = 1)."""
    assert start["F"] == pytest.approx(0.009908, abs=5e-7)
    assert spring.angle(start) == pytest.approx(0.62, **EXACT)
    assert start.stable


def test_first_target_is_reached_at_the_corrected_actuator_position(spring, start):
    """δ = 0.40 at C_s's level needs x_l = 0.89763; (0.40, 0.90) has the level 0.008904."""
    path = em.lift(start, {"x_l": actuator(0.40, LEVEL)})
    assert path.arrived
    assert path.end.state["x_l"] == pytest.approx(0.89763, abs=5e-6)
    assert spring.angle(path.end.state) == pytest.approx(0.40, **EXACT)
    assert load(0.40, 0.90) == pytest.approx(0.008904, abs=5e-7)


def test_smallest_angle_at_the_level_lies_on_the_stability_boundary(spring, start):
    """PHYSICS §2: minimising δ ends at the fold (0.2165, 0.9316), where x_l = cos³ δ."""
    path = em.lift(start, {"x_l": 1.5})
    assert path.end.kind == "fold"
    delta, x = spring.angle(path.end.state), path.end.state["x_l"]
    assert (delta, x) == pytest.approx((0.2165, 0.9316), abs=5e-5)
    assert x == pytest.approx(np.cos(delta) ** 3, **EXACT)


def test_the_paper_s_optimum_is_stable_and_not_on_the_boundary():
    assert np.cos(0.30) ** 3 < 0.925 - 0.05


def test_mirrored_target_is_no_equilibrium_at_the_level(spring, start):
    """(−0.62, 0.80) has F/k = −0.009908: a start there under F = +0.009908 is refused."""
    assert load(-0.62, 0.80) == pytest.approx(-0.009908, abs=5e-7)
    wrong = em.State(spring, np.array([-0.62]), start.p)
    with pytest.raises(em.errors.InputError, match="must be an equilibrium"):
        em.lift(wrong, {"x_l": 0.9})


def test_no_path_at_fixed_load_leads_to_the_other_side(spring, start):
    """At fixed F > 0 states with δ < 0 are another component: even through folds δ stays > 0."""
    path = em.lift(start, {"x_l": 1.5}, through_folds=True)
    assert [event.kind for event in path.events] == ["fold", "returned"]
    assert (spring.angle(path.states) > 0).all()
    assert path.end.state.index == 1


def test_with_the_load_free_a_stable_path_around_the_cusp_leads_there(spring, start):
    """PHYSICS §2: δ = −0.62 at the level needs x_l = 0.82776; states with x_l > 1 are stable."""
    goal = {"x_l": actuator(-0.62, LEVEL), "F": LEVEL}
    path = em.lift(start, [{"F": -0.05}, {"x_l": 1.2}, {"F": 0.05}, goal])
    assert path.arrived
    assert (path.index == 0).all()
    assert path.end.state["x_l"] == pytest.approx(0.82776, abs=5e-6)
    assert spring.angle(path.end.state) == pytest.approx(-0.62, **EXACT)


@pytest.mark.parametrize("x", [0.1, 0.3, 0.5, 0.7, 0.9, 0.99])
@pytest.mark.parametrize("k", [1.0, 7.0])
def test_fold_load_is_the_cube_of_the_sine(x, k):
    """Closed form F/k = sin³ δ = (1 − x_l^⅔)^{3/2}, on the boundary x_l = cos³ δ."""
    spring = em.Spring(stiffness=k)
    found = em.limit_load(spring.natural_state(x_l=x), "F")
    assert found.kind == "fold"
    assert found.value / k == pytest.approx((1 - x ** (2 / 3)) ** 1.5, **EXACT)
    assert found.state["x_l"] == pytest.approx(np.cos(spring.angle(found.state)) ** 3, **EXACT)


def test_unloaded_spring_leaves_the_straight_line_at_a_supercritical_pitchfork(spring):
    """PHYSICS §1: at F = 0 the spring buckles where x_l falls through 1, without a snap."""
    end = em.lift(spring.natural_state(x_l=1.3), {"x_l": 0.7}).end
    assert (end.kind, end.criticality) == ("branch point", "supercritical")
    assert end.state["x_l"] == pytest.approx(1.0, **EXACT)


@pytest.mark.parametrize("F", [-0.3, 0.02, 0.4])
def test_every_state_beyond_the_natural_length_is_stable(spring, F):
    path = em.lift(spring.natural_state(x_l=1.2), {"F": F})
    assert path.arrived
    assert (path.states.margin > 0).all()


def test_margin_of_the_spring_is_its_second_derivative(spring, start):
    """E'' = k x_l (x_l − cos³δ)/cos⁴δ at equilibrium, metric 1."""
    cosine = np.cos(0.62)
    assert start.margin == pytest.approx(0.8 * (0.8 - cosine**3) / cosine**4, rel=1e-10)
