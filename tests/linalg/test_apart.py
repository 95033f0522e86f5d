"""Different points among many, against a comparison of all with all."""

import numpy as np
import pytest

from equimorph.linalg.apart import firsts_apart


def all_with_all(places, tolerance, known):
    kept = list(range(known))
    for k in range(known, len(places)):
        if all(np.linalg.norm(places[j] - places[k]) > tolerance for j in kept):
            kept.append(k)
    return kept


@pytest.mark.parametrize("seed", range(12))
def test_points_are_different_as_all_are_compared_with_all(seed):
    rng = np.random.default_rng(seed)
    centres = rng.normal(size=(int(rng.integers(1, 30)), int(rng.integers(1, 40))))
    places = centres[rng.integers(len(centres), size=200)]
    places = places + rng.choice([0.0, 0.4, 1.5], size=(200, 1)) * 1e-3 * rng.normal(
        size=places.shape
    ) / np.sqrt(places.shape[1])
    for known in (0, 1, len(centres)):
        first = np.concatenate([centres[:known], places])
        assert firsts_apart(first, 1e-3, known).tolist() == all_with_all(first, 1e-3, known)


def test_points_on_a_lattice_and_none_at_all():
    lattice = np.stack(np.meshgrid(*[np.arange(4.0)] * 3), axis=-1).reshape(-1, 3)
    assert len(firsts_apart(np.concatenate([lattice, lattice]), 0.5)) == 64
    assert len(firsts_apart(np.concatenate([lattice, lattice]), 1.0, known=64)) == 64
    assert len(firsts_apart(np.zeros((0, 3)), 1.0)) == 0
