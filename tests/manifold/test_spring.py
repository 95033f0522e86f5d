"""The spring over (x_l, F) in closed form: F/k = (1 − x_l/cos δ) sin δ, stable for x_l > cos³ δ."""

import numpy as np
import pytest

from oracles.complexes import assert_faithful, assert_folds_are_singular


def test_spring_surface_is_a_disc_with_one_fold_curve(spring_set):
    """The set is the graph F(δ, x_l); its fold curve runs through the cusp at (1, 0)."""
    assert_faithful(spring_set)
    assert_folds_are_singular(spring_set, 1e-8)
    main = spring_set.components[0]
    assert (len(spring_set.components), main.euler_characteristic, main.loops) == (1, 1, 1)
    assert main.indices == (0, 1)
    assert len(spring_set.folds) == 1


def test_vertices_of_the_spring_lie_on_its_surface(spring_set):
    delta, x = spring_set.points.z[:, 0], spring_set.points["x_l"]
    force = (1 - x / np.cos(delta)) * np.sin(delta)
    np.testing.assert_allclose(spring_set.points["F"], force, rtol=0, atol=1e-12)


def test_folds_of_the_spring_lie_on_the_stability_boundary(spring_set):
    """x_l = cos³ δ and |F|/k = (1 − x_l^(2/3))^(3/2); 1e-9 because δ is a root of a cubic."""
    folded = spring_set.kinds == 1
    delta, x = spring_set.points.z[folded, 0], spring_set.points["x_l"][folded]
    np.testing.assert_allclose(x, np.cos(delta) ** 3, rtol=0, atol=1e-9)
    load = np.maximum(1 - np.cbrt(x) ** 2, 0.0) ** 1.5
    np.testing.assert_allclose(np.abs(spring_set.points["F"][folded]), load, rtol=0, atol=1e-9)


def test_index_of_the_spring_follows_the_stability_boundary(spring_set):
    regular = spring_set.kinds != 1
    delta, x = spring_set.points.z[regular, 0], spring_set.points["x_l"][regular]
    assert np.array_equal(spring_set.index[regular], (x < np.cos(delta) ** 3).astype(int))


@pytest.mark.parametrize(("x", "force"), [(0.8, 0.009908), (0.5, 0.1), (0.9, 0.0), (1.2, -0.3)])
def test_states_over_a_point_are_all_roots(spring_set, x, force):
    """Equilibrium is a polynomial in w = e^{iδ}: all its roots on the unit circle, cos δ > 0."""
    here = spring_set.at(x_l=x, F=force)
    # (1 − x/c) s = F ⇔ s c − x s − F c = 0 with c = (w + 1/w)/2, s = (w − 1/w)/2i, times 4i w²
    roots = np.roots([1, -2 * x - 2j * force, 0, 2 * x - 2j * force, -1])
    delta = np.angle(roots[np.abs(np.abs(roots) - 1) < 1e-9])
    delta = np.sort(delta[np.cos(delta) > 1e-9])
    np.testing.assert_allclose(np.sort(here.z[:, 0]), delta, rtol=0, atol=1e-9)


def test_mirror_images_of_the_spring_are_in_the_set(spring_set):
    for x, force in ((0.55, 0.07), (0.93, 0.004), (1.1, 0.2)):
        here, there = spring_set.at(x_l=x, F=force), spring_set.at(x_l=x, F=-force)
        np.testing.assert_allclose(
            np.sort(here.z[:, 0]), np.sort(-there.z[:, 0]), rtol=0, atol=1e-12
        )
