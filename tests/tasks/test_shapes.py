"""Inverse kinematics: the spring against its closed form, the arch against PHYSICS §4.6."""

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from equimorph.structures import State

ANGLE, FORCE = 0.62, 0.009908


@pytest.fixture(scope="module")
def support():
    """Descriptor that is not a function of δ alone: the length of the spring, x_l / cos δ."""
    return em.Descriptor("length", "1", lambda z, p: p[:, 0] / np.cos(z[:, 0]))


def test_spring_takes_every_angle_and_length_once(spring_set, support):
    """δ and ℓ fix x_l = ℓ cos δ and F = (1 − ℓ) sin δ: one state, also close to folds."""
    angle = spring_set.structure.descriptor("angle")
    generator = np.random.default_rng(3)
    for delta, length in generator.uniform((-0.8, 0.5), (0.8, 1.2), (40, 2)):
        x, force = length * np.cos(delta), (1 - length) * np.sin(delta)
        if not (0.3 < x < 1.3 and abs(force) < 0.5):
            continue
        found = em.solve_shape(spring_set, {angle: delta, support: length})
        assert found.solved
        assert len(found) == 1
        assert found.states.p[0, :2] == pytest.approx([x, force], abs=1e-10)
        assert found.index[0] == (0 if x > np.cos(delta) ** 3 else 1)


def test_both_states_at_one_height_and_width_of_the_arch(arch_set):
    """Stable at Θ = 1.621098, Δ = 0; every solution is confirmed by its descriptors."""
    arch = arch_set.structure
    left, right = arch.height(1 / 3), arch.height(2 / 3)
    found = em.solve_shape(arch_set, {left: 0.15, right: 0.15})
    assert found.solved
    assert found.stable[0]["Theta"] == pytest.approx(1.621098, abs=5e-7)
    assert found.stable[0]["Delta"] == pytest.approx(0.0, abs=1e-9)
    for height in (left, right):
        assert height(found.states) == pytest.approx(0.15, abs=1e-10)
    assert (found.states.residual < 1e-9).all()
    assert (np.diff(found.index) >= 0).all()
    assert (found.margin[found.index == 0] > 0).all()


def test_solutions_are_ranked_by_the_routes_from_a_start(arch_set, ends):
    arch = arch_set.structure
    upright, _ = ends
    targets = {arch.height(1 / 3): 0.15, arch.height(2 / 3): 0.15}
    found = em.solve_shape(arch_set, targets, start=upright)
    assert len(found.routes) == len(found)
    assert found.routes[0].arrived
    lengths = [route.length for route in found.routes if route.arrived]
    assert lengths == sorted(lengths)
    by_margin = em.solve_shape(arch_set, targets, rank="margin")
    assert (np.diff(by_margin.margin[by_margin.index == 0]) <= 0).all()


def test_what_no_shape_has_is_refused_with_the_nearest_vertex(arch_set):
    arch = arch_set.structure
    found = em.solve_shape(arch_set, {arch.height(1 / 3): 0.3, arch.height(2 / 3): 0.3})
    assert (found.status, len(found)) == ("refused", 0)
    assert found.why.startswith("no state of the set has height")
    assert isinstance(found.closest, State)
    assert min(found.miss.values()) < 0


def test_constraints_take_solutions_away(arch_set):
    arch = arch_set.structure
    targets = {arch.height(1 / 3): 0.15, arch.height(2 / 3): 0.15}
    bound = float(arch.max_curvature(em.solve_shape(arch_set, targets).states[0]))
    assert em.solve_shape(arch_set, targets, within=[arch.max_curvature <= bound + 0.1]).solved
    tight = em.solve_shape(arch_set, targets, within=[arch.max_curvature <= bound - 0.1])
    assert (tight.status, len(tight)) == ("refused", 0)


def test_every_state_is_found_by_its_heights(arch_set):
    """All equilibria over random points of the plane, stable and unstable ones on both pieces."""
    arch = arch_set.structure
    heights = arch.height(1 / 3), arch.height(2 / 3)
    generator = np.random.default_rng(5)
    for theta, delta in generator.uniform(arch_set.box.lower, arch_set.box.upper, (6, 2)):
        for state in arch_set.at(Theta=theta, Delta=delta):
            found = em.solve_shape(arch_set, {each: each(state) for each in heights})
            gaps = np.abs(found.states.p - state.p).max(axis=1)
            assert gaps.min() < 1e-7, state


def test_bad_questions_are_refused(spring_set):
    angle = spring_set.structure.descriptor("angle")
    energy = spring_set.structure.descriptor("energy")
    with pytest.raises(InputError, match=r"as many descriptors as .* \(x_l, F\); got 1"):
        em.solve_shape(spring_set, {angle: 0.1})
    with pytest.raises(InputError, match="must be finite; got energy = nan"):
        em.solve_shape(spring_set, {angle: 0.1, energy: np.nan})
    with pytest.raises(InputError, match="route if there is a start"):
        em.solve_shape(spring_set, {angle: 0.1, energy: 0.1}, rank="route")
