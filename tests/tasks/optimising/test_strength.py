"""Settings with the largest limit load: both loads of the arch, on ridges, cliffs and robust."""

import numpy as np
import pytest
from scipy.optimize import brentq

import equimorph as em
from equimorph.errors import InputError
from equimorph.model import Box
from equimorph.tasks.optimising.two_parameter_search import climb, maximise_least
from typecheck import unchecked


def map_of(load, **grid):
    arch = em.Rod(load)
    with unchecked():
        return em.limit_load_map(arch, em.Grid(**grid), "q", within=[arch.max_curvature <= 10])


@pytest.fixture(scope="module")
def left_half():
    return map_of("left-half", Theta=(0.8, 1.1, 6), Delta=(0.5, 0.7, 8))


@pytest.fixture(scope="module")
def uniform():
    return map_of("uniform", Theta=(0.8, 1.2, 8), Delta=(-0.2, 0.2, 8))


def test_the_uniform_arch_is_strongest_on_its_ridge(uniform):
    """On Δ = 0 the load is that of a pitchfork, its top where it is stationary in Θ."""
    with unchecked():
        best = em.strongest(uniform).best
    assert best.kind == "branch point"
    assert best.slope < 1e-6
    assert best.value == pytest.approx(4.264995, abs=1e-6)
    assert best.setting["Delta"] == pytest.approx(0.0, abs=1e-9)
    theta = best.setting["Theta"]
    beside = [uniform.at(Theta=theta + step, Delta=0.0).value for step in (-1e-2, 0.0, 1e-2)]
    assert beside[1] == pytest.approx(best.value, abs=1e-9)
    assert max(beside[0], beside[2]) < best.value
    # both sides of the ridge fall like Δ^(2/3), towards the same limit
    assert best.one_sided == pytest.approx((best.value, best.value), abs=1e-5)
    fall = best.value - best.sides[0]
    assert fall[1:] / fall[:-1] == pytest.approx(0.1 ** (2 / 3), rel=0.05)


@pytest.mark.slow
def test_an_optimum_where_the_map_ends_is_found():
    """A round arch that must not leave its plane is strongest where κ = 10 without load, Δ = 0.

    2.2925 was the answer over most of the plane, on a cliff, while many vertices had more. The
    place is that of a root of κ − 10 along Δ = 0.
    """
    rod = em.Rod("uniform", torsion=1.0 / 1.3, lateral=1.0)
    grid = em.Grid(Theta=(1.4, 1.6, 2), Delta=(-0.2, 0.25, 2))
    within = [rod.max_curvature <= 10, rod.stable_in_space]
    with unchecked():
        best = em.strongest(em.limit_load_map(rod, grid, "q", within=within)).best

        def excess(theta):
            rest, _ = rod.natural_states(np.array([(theta, 0.0, 0.0, np.sin(1.0))]))
            return float(rod.max_curvature(rest)[0]) - 10.0

        theta = brentq(excess, 1.5, 1.6)
        rest, _ = rod.natural_states(np.array([(theta - 1e-9, 0.0, 0.0, np.sin(1.0))]))
        known = em.limit_load(rest, "q", within=within).value[0]
    assert best.kind == "edge"
    assert best.value == pytest.approx(known, abs=1e-5)
    assert tuple(best.setting.values()) == pytest.approx((theta, 0.0), abs=1e-5)


def test_the_best_setting_under_half_a_load_is_at_the_edge_of_a_cliff(left_half):
    """3.9908 from one side at (0.9426, 0.6045), 3.8665 from the other; the paper has 4.0."""
    with unchecked():
        found = em.strongest(left_half)
    best = found.best
    assert best.kind == "branch point, cliff"
    assert best.value == pytest.approx(3.990785, abs=2e-6)
    assert tuple(best.setting.values()) == pytest.approx((0.94261, 0.60451), abs=2e-4)
    assert max(best.one_sided) == pytest.approx(best.value, abs=1e-6)
    assert min(best.one_sided) == pytest.approx(3.8665, abs=1e-3)
    generator = np.random.default_rng(4)
    near = np.array(list(best.setting.values())) + generator.uniform(-0.02, 0.02, (60, 2))
    with unchecked():
        assert left_half.rays(near).max() < best.value


@pytest.mark.slow
def test_a_robust_setting_keeps_away_from_the_cliff(left_half):
    """Errors of ±0.02: the worst case of the best setting is far below its value."""
    offsets = {"Theta": 0.02, "Delta": 0.02}
    with unchecked():
        robust = em.strongest(left_half, offsets=offsets)
    sure = 3.990785
    assert robust.at_risk < sure - 0.3
    assert robust.guaranteed > robust.at_risk + 0.2
    assert robust.margin == pytest.approx(robust.guaranteed - robust.at_risk)
    assert robust.price == pytest.approx(sure - robust.best.value, abs=1e-5)
    assert robust.price > 0
    here = np.array(list(robust.best.setting.values()))
    corners = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)]) * 0.02

    def worst(setting):
        return left_half.rays(setting + corners).min()

    with unchecked():
        assert worst(here) == pytest.approx(robust.guaranteed, abs=1e-9)
        for step in np.random.default_rng(6).normal(0, 3e-3, (16, 2)):
            assert worst(here + step) <= robust.guaranteed + 1e-4


def test_a_smooth_top_is_climbed_to_round_off():
    """exp(−(x − 0.3)² − 2 (y + 0.1)² − (x − 0.3)(y + 0.1)) has its only top at (0.3, −0.1)."""

    def bump(s):
        x, y = s[:, 0] - 0.3, s[:, 1] + 0.1
        return np.exp(-(x**2) - 2 * y**2 - x * y)

    box = Box(x=(-1, 1), y=(-1, 1))
    top = climb(bump, np.array([0.7, 0.4]), np.array([0.1, 0.1]), box)
    assert top.smooth
    assert top.setting == pytest.approx((0.3, -0.1), abs=1e-5)
    assert top.value == pytest.approx(1.0, abs=1e-10)


def test_the_least_of_several_functions_is_raised_to_its_kink():
    """min(x, y, 1 − x − y) is largest at (1/3, 1/3)."""

    def pieces(s):
        return np.stack([s[:, 0], s[:, 1], 1.0 - s.sum(axis=1)], axis=1)

    box = Box(x=(-1, 1), y=(-1, 1))
    setting, value = maximise_least(pieces, np.array([-0.4, 0.9]), np.array([0.2, 0.2]), box)
    assert setting == pytest.approx((1 / 3, 1 / 3), abs=1e-6)
    assert value == pytest.approx(1 / 3, abs=1e-6)


def test_bad_questions_are_refused(uniform):
    with pytest.raises(
        InputError, match="`offsets` must be positive numbers for Theta or Delta; got q"
    ):
        em.strongest(uniform, offsets={"q": 0.1})
    with pytest.raises(InputError, match=r"got Theta = -0\.1"):
        em.strongest(uniform, offsets={"Theta": -0.1})
