"""Optima over sets: closed forms of the spring, the arch against a fine search of its own."""

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from sets import arch_set
from typecheck import unchecked

K_S = (1.0 - 0.80 / np.cos(0.62)) * np.sin(0.62)
"""Load of the state C_s = (0.62, 0.80) of the spring: 0.009908 k."""


@pytest.fixture(scope="module")
def level_set_of_spring():
    """The spring at the load of C_s, over x_l."""
    return em.equilibrium_set(em.Spring(), em.Box(x_l=(0.5, 1.2)), fixed={"F": K_S}, checks=0)


@pytest.fixture(scope="module")
def left_half():
    """The arch under a load on its left half."""
    return arch_set(load="left-half")


def test_flattest_spring_on_its_level_ends_on_the_stability_boundary(level_set_of_spring):
    """[PHYSICS 2] from C_s: x_l = cos³δ and sin³δ = F/k give (0.2165, 0.9316)."""
    eset = level_set_of_spring
    angle = eset.structure.descriptor("angle")
    start = max(eset.at(x_l=0.8).stable, key=angle)
    assert angle(start) == pytest.approx(0.62)
    found = em.optimise(eset, angle, start=start)
    delta = np.arcsin(np.cbrt(K_S))
    assert found.found
    assert found.best.value == pytest.approx(delta, abs=1e-8)
    assert found.best.state["x_l"] == pytest.approx(np.cos(delta) ** 3, abs=1e-8)
    assert found.best.certificate.kind == "stability boundary"
    assert found.best.certificate.residual < 1e-8
    assert found.margin == pytest.approx(0.0, abs=1e-8)
    assert found.schedule is not None
    assert found.schedule.margins.min() > 0


def test_the_whole_set_has_flatter_ones_that_the_start_cannot_reach(level_set_of_spring):
    """δ < 0 lies on another stable component; its best sits on the box, at x_l = 0.5."""
    eset = level_set_of_spring
    angle = eset.structure.descriptor("angle")
    found = em.optimise(eset, angle)
    assert found.best.value < -1.0
    assert found.best.certificate.kind == "box"
    assert found.best.state["x_l"] == pytest.approx(0.5)
    assert set(found.best.certificate.active) == {"x_l >= 0.5"}
    assert found.best.certificate.active["x_l >= 0.5"] > 0


@pytest.mark.parametrize("margin", [0.05, 0.2])
def test_a_demanded_margin_keeps_off_the_boundary(level_set_of_spring, margin):
    """E'' = k x_l (x_l − cos³δ)/cos⁴δ equals the margin at the optimum."""
    eset = level_set_of_spring
    spring, angle = eset.structure, eset.structure.descriptor("angle")
    start = max(eset.at(x_l=0.8).stable, key=angle)
    best = em.optimise(eset, angle, start=start, margin=margin).best
    x, cos = best.state["x_l"], np.cos(best.value)
    curvature = x * (x - cos**3) / cos**4
    assert curvature / spring.mass[0] == pytest.approx(margin, rel=1e-6)
    assert best.certificate.kind == "stability boundary"
    assert best.route.margin >= 0.98 * margin


def test_least_largest_curvature_of_the_uniform_arch_is_a_symmetric_kink(arch_set):
    """Both halves bend alike on Δ = 0: 2.0948 at Θ = 0.93616 (the paper: 2.1 at 0.96)."""
    arch = arch_set.structure
    kappa = arch.max_curvature
    best = em.optimise(arch_set, kappa).best
    assert best.value == pytest.approx(2.0948184, abs=2e-7)
    assert (best.state["Theta"], best.state["Delta"]) == pytest.approx((0.936160, 0.0), abs=1e-6)
    assert best.certificate.kind == "kink"
    assert best.certificate.residual < 1e-6
    assert min(best.certificate.across) > 0
    assert sum(best.certificate.branches) == pytest.approx(1.0, abs=1e-8)
    assert best.certificate.curvature > 0
    # no setting nearby does better
    for dt, dd in np.array([(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1)]) * 1e-3:
        near = em.lift(best.state, {"Theta": best.state["Theta"] + dt, "Delta": dd}).end.state
        assert kappa(near) > best.value


def test_least_largest_curvature_under_half_a_load(left_half):
    """3.0245 at (0.6468, 0.5168) with three extrema; the paper has 3.35 at (0.64, 1.16)."""
    arch = left_half.structure
    kappa = arch.max_curvature
    best = em.optimise(left_half, kappa).best
    assert best.value == pytest.approx(3.0245449, abs=2e-7)
    assert (best.state["Theta"], best.state["Delta"]) == pytest.approx(
        (0.646801, 0.516768), abs=2e-6
    )
    assert best.certificate.kind == "kink"
    for dt, dd in np.random.default_rng(2).uniform(-1, 1, (12, 2)) * 1e-3:
        at = {"Theta": best.state["Theta"] + dt, "Delta": best.state["Delta"] + dd}
        assert kappa(em.lift(best.state, at).end.state) > best.value


def test_an_interior_optimum_of_a_combined_objective(arch_set):
    """(y(½) − 0.2)² + 0.01 Θ²: no better at 200 random states; KKT residual at round-off."""
    arch = arch_set.structure
    rise, turn = arch.height(0.5), em.value_of(arch, "Theta")
    cost = em.function_of("cost", lambda y, t: (y - 0.2) ** 2 + 0.01 * t**2, rise, turn)
    found = em.optimise(arch_set, cost)
    everywhere = cost(arch_set.points[arch_set.index == 0])
    assert found.best.value <= everywhere.min() + 1e-12
    assert found.best.certificate.residual < 1e-8


def test_constraints_bind_at_an_optimum(arch_set):
    """Highest crown with max |κ| ≤ 3: the bound is active, its multiplier positive."""
    arch = arch_set.structure
    rise, kappa = arch.height(0.5), arch.max_curvature
    found = em.optimise(arch_set, rise, sense="max", within=[kappa <= 3.0])
    assert found.best.certificate.kind == "constraint"
    assert kappa(found.best.state) == pytest.approx(3.0, abs=1e-7)
    assert found.best.certificate.active["max_curvature <= 3"] > 0
    stable = arch_set.points[arch_set.index == 0]
    allowed = kappa(stable) <= 3.0
    assert found.best.value >= rise(stable)[allowed].max()
    ceiling = em.distance_to(arch, em.HalfPlane((0.0, 0.2), (0.0, -1.0))) >= 0.0
    below = em.optimise(arch_set, rise, sense="max", within=[kappa <= 5.0, ceiling])
    assert below.best.value == pytest.approx(0.2, abs=1e-7)


def test_the_inverted_optimum_can_be_reached_and_the_way_is_planned(arch_set, ends):
    """Smallest effort of the actuators among inverted arches, from the upright one."""
    arch = arch_set.structure
    upright, _ = ends
    kappa, rise = arch.max_curvature, arch.height(0.5)
    found = em.optimise(arch_set, kappa, within=[rise <= -0.1], start=upright, margin=0.05)
    assert not found.found
    assert found.why == "the start violates height(0.5) <= -0.1: height(0.5) = 0.22583"
    found = em.optimise(arch_set, rise, start=upright, margin=0.05)
    assert found.best.value < -0.1
    assert found.best.route.arrived
    assert found.schedule.margins.min() >= 0.04


@pytest.mark.parametrize("load", [0.02, 0.03])
def test_optima_on_several_bounds_are_reached(spring_set, load):
    """Two bounds meet at the fold F = sin³δ under F ≥ 0.02; F itself is least all along one."""
    spring = spring_set.structure
    at_least = em.value_of(spring, "F") >= 0.02
    above = spring_set.at(x_l=0.8, F=load).stable
    start = max(above, key=spring.angle)
    flattest = em.optimise(spring_set, spring.angle, within=[at_least], start=start)
    np.testing.assert_allclose(flattest.best.value, np.arcsin(0.02 ** (1.0 / 3.0)), rtol=1e-7)
    assert flattest.best.route.arrived
    assert flattest.best.route.schedule.values[:, 1].min() >= 0.02 - 2e-9
    lightest = em.optimise(spring_set, em.value_of(spring, "F"), within=[at_least], start=start)
    np.testing.assert_allclose(lightest.best.value, 0.02, rtol=1e-7)
    assert lightest.best.route.arrived


def test_bad_questions_are_refused(level_set_of_spring, spring_set):
    eset = level_set_of_spring
    angle = eset.structure.descriptor("angle")
    with unchecked(), pytest.raises(InputError, match="`sense` must be min or max"):
        em.optimise(eset, angle, sense="least")
    with pytest.raises(InputError, match="`margin` must be a number >= 0"):
        em.optimise(eset, angle, margin=-1.0)
    unstable = next(s for s in eset.at(x_l=0.8) if not s.stable)
    with pytest.raises(InputError, match="`start` must be stable; got a state of index 1"):
        em.optimise(eset, angle, start=unstable)
    with pytest.raises(InputError, match="fixed parameters of the set"):
        em.optimise(eset, angle, start=next(iter(spring_set.at(x_l=1.2, F=0.1))))
    empty = em.optimise(eset, angle, within=[angle >= 3.0])
    assert (empty.status, len(empty)) == ("refused", 0)
    with pytest.raises(InputError, match="one or more of one structure"):
        em.function_of("nothing", lambda: 0.0)
