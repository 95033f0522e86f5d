"""Natural states over a grid against those that the structure finds one by one."""

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria.natural_sheet import natural_sheet
from equimorph.model import parameter_vector


@pytest.fixture(scope="module")
def rod():
    return em.Rod()


def sheet_over(structure, grid, **corner):
    return natural_sheet(structure, grid, parameter_vector(structure.parameters, corner))


def test_continued_states_are_the_natural_states(rod):
    sheet = sheet_over(rod, em.Grid(Theta=(0.2, 1.7, 10), Delta=(-1.4, 1.4, 14)), Theta=0.2)
    assert sheet.found.all()
    for vertex in np.random.default_rng(1).integers(0, len(sheet.z), size=8):
        i, j = np.divmod(vertex, 15)
        state = rod.natural_state(Theta=sheet.axes[0][i], Delta=sheet.axes[1][j])
        np.testing.assert_allclose(sheet.z[vertex], state.z, rtol=0, atol=1e-9)


def test_states_between_the_vertices_are_exact(rod):
    sheet = sheet_over(rod, em.Grid(Theta=(0.5, 1.0, 4), Delta=(0.0, 0.4, 4)), Theta=0.5)
    z, found = sheet.states(np.array([[0.61, 0.13], [0.99, 0.39]]))
    assert found.all()
    for each, (Theta, Delta) in zip(z, [(0.61, 0.13), (0.99, 0.39)], strict=True):
        np.testing.assert_allclose(
            each, rod.natural_state(Theta=Theta, Delta=Delta).z, rtol=0, atol=1e-9
        )


def test_an_arch_without_an_upright_side_has_no_natural_state(rod):
    """Θ ≤ 0: continued from Θ > 0 there is a stable state, but not the natural one."""
    sheet = sheet_over(rod, em.Grid(Theta=(-0.2, 0.6, 4), Delta=(-0.1, 0.1, 2)), Theta=-0.2)
    expected = np.repeat([False, False, True, True, True], 3)
    np.testing.assert_array_equal(sheet.found, expected)
    assert not sheet.states(np.array([[-0.01, 0.0]]))[1].any()


def test_pieces_beyond_a_branch_point_are_asked_for_again():
    """The spring's unloaded states have a pitchfork at x_l = 1: no continuation passes it."""
    spring = em.Spring()
    sheet = sheet_over(spring, em.Grid(x_l=(0.55, 1.45, 6), k=(0.5, 1.0, 2)), x_l=0.55, k=0.5)
    assert sheet.found.all()
    x_l = np.repeat(sheet.axes[0], 3)
    np.testing.assert_allclose(np.cos(sheet.z[:, 0]), np.minimum(x_l, 1.0), rtol=1e-12)
