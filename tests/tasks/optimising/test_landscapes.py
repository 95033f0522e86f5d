"""Landscapes of the arch and the spring, robust optima, constraints in one language."""

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from typecheck import unchecked


@pytest.fixture(scope="module")
def kappa_landscape(arch_set):
    arch = arch_set.structure
    grid = em.Grid(Theta=(0.2, 2.5, 11), Delta=(-1.9, 1.9, 19))
    with unchecked():
        return em.landscape(arch_set, arch.max_curvature, grid, within=[arch.max_curvature <= 15])


def test_every_setting_has_its_best_stable_state(arch_set, kappa_landscape):
    """Against `at` at random settings of the grid."""
    kappa = arch_set.structure.max_curvature
    axes = kappa_landscape.grid.axes()
    generator = np.random.default_rng(8)
    for i, j in generator.integers((0, 0), kappa_landscape.value.shape, (12, 2)):
        there = arch_set.at(Theta=axes[0][i], Delta=axes[1][j]).stable
        values = kappa(there)
        values = values[values <= 15]
        assert kappa_landscape.gaps[i, j] == (len(values) == 0)
        if len(values):
            assert kappa_landscape.value[i, j] == pytest.approx(values.min(), rel=1e-9)


def test_barriers_part_upright_and_inverted_arches(arch_set, kappa_landscape):
    """No barrier crosses Δ = 0 near the natural arch; those there are separate different states."""
    barriers = kappa_landscape.barriers
    assert len(barriers) > 0
    assert set(barriers.kind) <= {"stability", "preference"}
    gentle = np.abs(barriers.ends - (0.95, 0.0)).max(axis=(1, 2)) < 0.3
    assert not gentle.any()


def test_a_landscape_from_a_start_keeps_to_its_piece(spring_set):
    """F = k (1 − x_l/cos δ) sin δ: with x_l below 1 the springs to both sides are two pieces."""
    spring = spring_set.structure
    start = max(spring_set.at(x_l=0.8, F=0.0).stable, key=spring.angle)
    grid = em.Grid(x_l=(0.4, 1.2, 8), F=(-0.4, 0.4, 9))
    found = em.landscape(spring_set, spring.angle, grid, start=start)
    whole = em.landscape(spring_set, spring.angle, grid)
    assert found.gaps.sum() >= whole.gaps.sum()
    known = ~found.gaps
    assert (found.value[known] >= whole.value[known] - 1e-12).all()
    with pytest.raises(InputError, match="two free parameters"):
        em.landscape(spring_set, spring.angle, em.Grid(F=(-0.4, 0.4, 3), x_l=(0.4, 1.2, 3)))


def test_a_robust_optimum_pays_for_its_safety(arch_set):
    """Least worst max |κ| over Δ ± 0.05: no setting nearby has a better worst case."""
    arch = arch_set.structure
    kappa = arch.max_curvature
    worst = em.worst_over(arch, kappa, {"Theta": 0.05, "Delta": 0.05})
    with unchecked():
        sure = em.optimise(arch_set, kappa).best
        robust = em.optimise(arch_set, worst).best
    assert robust.value < worst(sure.state)
    assert kappa(robust.state) >= sure.value - 1e-9
    for step in np.random.default_rng(1).normal(0, 2e-3, (8, 2)):
        at = {
            name: robust.state[name] + d for name, d in zip(("Theta", "Delta"), step, strict=True)
        }
        assert worst(em.lift(robust.state, at).end.state) >= robust.value - 1e-9
    with pytest.raises(InputError, match="must be positive"):
        em.worst_over(arch, kappa, {"Theta": 0.0})


def test_worst_values_are_those_at_the_corners():
    """Against lifts, one by one; ∞ where one of them snaps."""
    arch = em.Rod()
    state = em.lift(arch.natural_state(Theta=0.9, Delta=0.02), {"q": 3.5}).end.state
    rise = arch.height(0.5)
    worst = em.worst_over(arch, rise, {"q": 0.2, "Delta": 0.005})
    corners = [
        em.lift(state, {"q": 3.5 + i * 0.2, "Delta": 0.02 + j * 0.005}).end.state
        for i in (-1, 1)
        for j in (-1, 1)
    ]
    assert worst(state) == pytest.approx(max(map(rise, [state, *corners])), abs=1e-10)
    assert em.worst_over(arch, rise, {"q": 0.6})(state) == np.inf


def test_one_language_for_all_tasks(arch_set, ends):
    """The same constraints bind in lifts, limit loads, shapes, optima, routes and tracking."""
    arch = arch_set.structure
    upright, _ = ends
    ceiling = em.distance_to(arch, em.HalfPlane((0.0, 0.235), (0.0, -1.0))) >= 0.0
    effort = em.effort_of(arch, "Theta")
    weak = effort <= effort(upright) + 0.02
    away = em.outside(arch, em.Box(Theta=(1.2, 1.5), Delta=(-0.1, 0.1))) >= 0.0
    with unchecked():
        limit = em.limit_load(
            arch.natural_state(Theta=0.9, Delta=0.02), "q", within=[em.margin_of(arch) >= 0.5]
        )
        assert limit.kind == "constraint"
        best = em.optimise(arch_set, arch.height(0.5), sense="max", within=[ceiling, weak]).best
        assert ceiling.descriptor(best.state) >= -1e-8
        assert effort(best.state) <= weak.bound + 1e-8
        goal = em.lift(upright, [{"Delta": 0.4}, {"Theta": 1.6}, {"Delta": 0.0}]).end.state
        walls = [em.value_of(arch, "Delta") >= -0.05, effort <= effort(goal) + 0.01]
        route = em.plan(arch_set, upright, goal, within=walls)
        assert route.arrived
        assert all(wall.holds(route.path.states).all() for wall in walls)
        stopped = em.lift(upright, {"Theta": 1.6}, within=[away]).end
        tracked = em.track(upright, {arch.height(0.5): 0.15}, actuators=["Theta"], within=[away])
        shape = em.solve_shape(arch_set, {arch.height(0.5): 0.19, arch.angle(0.5): 0.0})
        kept = em.solve_shape(
            arch_set, {arch.height(0.5): 0.19, arch.angle(0.5): 0.0}, within=[away]
        )
    assert stopped.kind == "constraint"
    assert stopped.state["Theta"] == pytest.approx(1.2, abs=1e-8)
    assert tracked.failure == "constraint"
    assert tracked.path.end.state["Theta"] == pytest.approx(1.2, abs=1e-8)
    assert len(kept) < len(shape)
    assert away.holds(kept.states).all() if len(kept) else True
