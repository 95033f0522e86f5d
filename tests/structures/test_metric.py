"""Lengths in the structure's metric."""

import numpy as np

from equimorph import Rod
from equimorph.structures.metric import (
    distances,
    metric_coordinates,
    metric_length,
    metric_places,
    move_length,
    products_with,
)

ROD = Rod(elements=4)


def test_lengths_are_root_mean_squares_over_the_rod_whatever_the_multipliers() -> None:
    z = np.zeros((3, ROD.size))
    z[:, : ROD.unknowns] = np.array([[0.0], [1.0], [-2.0]])
    z[:, ROD.unknowns :] = 7.0
    # the ends are clamped; each has the weight 1/(p (p + 1)) of an element, of degree p = 9
    one = np.sqrt(1.0 - 2.0 / (9.0 * 10.0 * 4.0))
    assert np.allclose(metric_length(ROD, z), [0.0, one, 2.0 * one], rtol=1e-14)
    assert np.isclose(metric_length(ROD, z[1]), one, rtol=1e-14)
    assert metric_length(ROD, z[None, :0]).shape == (1, 0)


def test_a_length_has_the_same_bits_alone_and_among_others() -> None:
    z = np.random.default_rng(0).normal(size=(40, ROD.size))
    alone = [float(metric_length(ROD, each)) for each in z]
    assert np.array_equal(metric_length(ROD, z), alone)
    assert np.array_equal(metric_length(ROD, z.reshape(5, 8, -1)).ravel(), alone)


def test_euclidean_distances_of_places_are_those_of_points() -> None:
    generator = np.random.default_rng(1)
    z, other_z = generator.normal(size=(2, 6, ROD.size))
    p, other_p = generator.normal(size=(2, 6, len(ROD.parameters)))
    apart = metric_places(ROD, z, p) - metric_places(ROD, other_z, other_p)
    length = np.linalg.norm(apart, axis=1)
    assert np.allclose(distances(ROD, z, p, other_z, other_p), length, rtol=1e-13)
    assert np.allclose(move_length(ROD, z - other_z, p - other_p), length, rtol=1e-13)
    assert (move_length(ROD, z, p) > metric_length(ROD, z)).all()


def test_products_with_rows_are_those_of_coordinates() -> None:
    generator = np.random.default_rng(2)
    rows, z = generator.normal(size=(2, 3, ROD.unknowns)), generator.normal(size=ROD.size)
    products = products_with(ROD, rows) @ z
    assert np.allclose(products, rows @ metric_coordinates(ROD, z), rtol=1e-13)
