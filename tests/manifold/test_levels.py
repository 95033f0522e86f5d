"""Level sets, parts and cusps of sets that are known in closed form, and of the arch."""

import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.manifold import (
    cell_sizes,
    cusps,
    equilibrium_set,
    level_set,
    part,
    refine,
    restricted,
    singular_set,
)
from equimorph.model import Box, Descriptor
from equimorph.structures import Spring
from oracles.complexes import assert_faithful, assert_folds_are_singular
from oracles.polynomial import fold_form
from oracles.surfaces import cusp, sphere, swallowtail
from typecheck import unchecked

B = Descriptor("b", "1", lambda z, p: p[:, 1].copy())


def lifted(structure, box, intervals, **options):
    with unchecked():
        return equilibrium_set(structure, box, checks=0, intervals=intervals, **options)


@pytest.fixture(scope="module")
def ball():
    """Unit sphere x² + a² + b² = 1, refined to 0.02."""
    eset = lifted(sphere(), Box(a=(-1.3, 1.2), b=(-1.5, 1.5)), (7, 8))
    with unchecked():
        return refine(eset, 0.02)


@pytest.mark.parametrize("height", [-0.7, 0.1, 0.9])
def test_level_of_the_sphere_is_a_circle(ball, height):
    with unchecked():
        level = level_set(ball, ball.structure.descriptor("0"), height)
    assert level.lost == 0
    assert [piece[0] == piece[-1] for piece in level.pieces] == [True]
    assert np.abs(level.states.z[:, 0] - height).max() < 1e-11
    np.testing.assert_allclose((level.states.p**2).sum(axis=1), 1 - height**2, atol=1e-11)


def test_level_beyond_the_set_is_empty(ball):
    level = level_set(ball, ball.structure.descriptor("0"), 1.5)
    assert (len(level.states), level.pieces, level.lost) == (0, (), 0)


def test_height_and_width_of_the_sphere_do_not_steer_it_on_a_great_circle(ball):
    """dx ∧ db vanishes on a sphere where its normal has no part along a, folds included."""
    with unchecked():
        level = singular_set(ball, [ball.structure.descriptor("0"), B])
    assert level.lost == 0
    assert [piece[0] == piece[-1] for piece in level.pieces] == [True]
    assert np.abs(level.states["a"]).max() < 1e-9


@pytest.mark.parametrize("height", [-0.6, 0.3])
def test_part_below_a_level_is_a_cap_of_the_sphere(ball, height):
    """Area 2π(1 + h); chords lose about accuracy over radius."""
    with unchecked():
        below = restricted(ball, ball.structure.descriptor("0") <= height)
    assert_faithful(below)
    assert below.audit.euler_characteristic == 1
    assert [piece.kind for piece in below.boundaries] == ["cap"]
    assert cell_sizes(below).sum() == pytest.approx(2 * np.pi * (1 + height), rel=0.04)


def test_area_converges_as_the_square_of_the_cells():
    """4π for the sphere: a tenth of the deviation is a tenth of the error."""
    eset = lifted(sphere(), Box(a=(-1.3, 1.2), b=(-1.5, 1.5)), (7, 8))
    with unchecked():
        errors = [4 * np.pi - cell_sizes(refine(eset, each)).sum() for each in (0.05, 0.005)]
    assert errors[1] > 0
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.4)


def test_stable_part_is_bounded_by_the_fold(ball):
    stable = part(ball, ball.cell_index == 0)
    assert [piece.kind for piece in stable.boundaries] == ["fold"]
    assert stable.audit.euler_characteristic == 1
    assert (stable.index == 0).all()
    assert_folds_are_singular(stable, 1e-8)


def test_level_of_a_curve_is_a_point():
    """x² = a at x = 0.3."""
    form = fold_form()
    eset = lifted(form, Box(a=(-1, 1)), (7,))
    level = level_set(eset, form.descriptor("0"), 0.3)
    assert level.states["a"] == pytest.approx([0.09], rel=1e-10)
    below = restricted(eset, form.descriptor("0") <= 0.3)
    assert_faithful(below)
    assert below.coordinates[below.kinds == 2, 0] == pytest.approx([0.09], rel=1e-10)


def test_levels_of_force_on_the_spring_are_its_closed_form():
    """F/k = (1 − x_l/cos δ) sin δ, here as the level of the angle over (x_l, F)."""
    spring = Spring()
    eset = lifted(spring, Box(x_l=(0.3, 1.3), F=(-0.5, 0.5)), (12, 12))
    angle = Descriptor("angle", "rad", lambda z, p: z[:, 0].copy())
    level = level_set(eset, angle, 0.4)
    states = level.states
    wanted = states["k"] * (1 - states["x_l"] / np.cos(0.4)) * np.sin(0.4)
    np.testing.assert_allclose(states["F"], wanted, atol=1e-11)
    assert len(level.pieces) == 1


@pytest.mark.parametrize("grid", [(5, 5), (7, 8), (6, 7)])
def test_the_cusp_has_its_cusp_at_the_origin(grid):
    """On the first two grids a vertex is the cusp to round-off."""
    found = cusps(lifted(cusp(), Box(a=(-2, 1), b=(-3, 3)), grid))
    assert np.abs(found.states.z).max() < 1e-10
    assert np.abs(found.states.p).max() < 1e-10
    assert found.index.tolist() == [0]


@pytest.mark.parametrize("refined", [False, True])
@pytest.mark.parametrize(
    ("a", "grid"), [(1.0, (5, 5)), (1.0, (6, 8)), (2.0, (8, 7)), (2.0, (5, 5)), (1.5, (7, 8))]
)
def test_the_swallowtail_has_two_cusps(a, grid, refined):
    """x⁴ − a x² + b x + c: cusps where 12 x² = 2 a; on coarse sets, too."""
    eset = lifted(swallowtail(), Box(b=(-4, 4), c=(-3, 3)), grid, fixed={"a": -a})
    with unchecked():
        found = cusps(refine(eset, 0.02) if refined else eset)
    x = np.sqrt(a / 6.0)
    assert found.lost == 0
    assert np.sort(found.states.z[:, 0]) == pytest.approx([-x, x], rel=1e-8)


def test_smooth_folds_have_no_cusps(ball):
    assert len(cusps(ball).states) == 0


def test_cusps_of_the_arch(even_arch_set):
    """On the boundary of stability near (Θ, Δ) = (1.12, ±0.59); mirror images to round-off.

    A fold of index 1 has its cusp on Δ = 0, where the set has a pitchfork along Θ.
    """
    with unchecked():
        found = cusps(even_arch_set)
    at = np.stack([found.states["Theta"], found.states["Delta"]], axis=1)
    stable = at[found.index == 0][np.argsort(at[found.index == 0, 1])]
    assert stable[:, 0] == pytest.approx([1.12327601, 1.12327601], abs=1e-8)
    assert stable[:, 1] == pytest.approx([-0.58931659, 0.58931659], abs=1e-8)
    symmetric = at[found.index == 1]
    assert symmetric[:, 1] == pytest.approx([0.0], abs=1e-9)
    assert found.states.residual.max() < 1e-10


def test_wrong_requests_are_refused(ball):
    x = ball.structure.descriptor("0")
    with pytest.raises(InputError, match="`value` must be a finite number"):
        level_set(ball, x, np.nan)
    with pytest.raises(InputError, match="`descriptors` must be 2, one per free parameter"):
        singular_set(ball, [x])
    with pytest.raises(InputError, match="`eset` must be over two parameters"):
        cusps(lifted(fold_form(), Box(a=(-1, 1)), (3,)))
