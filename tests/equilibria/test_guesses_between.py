"""Guesses between known states: means that are configurations, over points with new states."""

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria.curves import newton_homotopy
from equimorph.equilibria.random_search import WIDE_STEPS, Ground, Pools
from equimorph.equilibria.trace import trace
from equimorph.equilibria.trace_options import EventCode
from equimorph.tolerances import SAME_STATE
from oracles.spatial_rods import coaxial
from oracles.specimens import specimens

AT = {"twist_A": 0.1, "twist_B": 0.5, "P": 0.0, "nu": 0.85}


@pytest.fixture(scope="module")
def found():
    """States of a round rod between coaxial clamps, straight and buckled."""
    rod = coaxial()[0].resolving(15.0)
    return em.find_equilibria(rod, AT, within=[rod.max_curvature <= 15.0], starts=60)


def means(found, generator, count=100):
    """Means of three states each, and their parameters."""
    number = generator.integers(len(found), size=(count, 3))
    weights = generator.dirichlet(np.ones(3), count)
    return np.einsum("nk,nki->ni", weights, found.z[number]), np.repeat(found.p[:1], count, axis=0)


def arrived(structure, guess, p):
    """How many Newton homotopies arrive."""
    outcome = trace(newton_homotopy(structure, guess, p), guess, (), WIDE_STEPS)
    return int((outcome.code == EventCode.ARRIVED).sum())


def test_means_of_rotations_are_rotations(found):
    """The bare mean of two opposite quaternions is none, and curves from such rarely arrive."""
    rod = found.structure
    mean, p = means(found, np.random.default_rng(0))
    guess = rod.as_guess(mean)
    length = np.linalg.norm(guess[:, : rod.unknowns].reshape(len(guess), -1, 4), axis=-1)
    np.testing.assert_allclose(length, 1.0, atol=1e-12)
    good = rod.resolved(guess, p)
    most = arrived(rod, guess[good], p[good])
    assert most > 0.75 * good.sum()
    assert most > 2 * arrived(rod, mean[good], p[good])


@pytest.mark.parametrize("specimen", specimens(), ids=lambda each: each.name)
def test_guesses_at_states_are_the_states(specimen):
    structure = specimen.structure
    p = np.array(specimen.centre, float)[None]
    z, natural = structure.natural(p)
    away = (structure.as_guess(z) - z)[natural, : structure.unknowns]
    assert (np.sqrt(away**2 @ structure.mass) < SAME_STATE).all()


def test_nothing_is_tried_again_over_points_without_new_states(found, monkeypatch):
    """Over the first of two points all states are known from before."""
    states, group = np.tile(found.z, (2, 1)), np.repeat([0, 1], len(found))
    ground = Ground(found.structure, np.repeat(found.p[:1], 2, axis=0), ())
    pools, tried = Pools(ground, np.random.default_rng(0), states, group), []
    monkeypatch.setattr(pools, "_by_homotopy", lambda guess, over: tried.extend(over.tolist()))
    for begin, over in ((len(states), set()), (len(found), {1}), (0, {0, 1})):
        tried.clear()
        pools.start_between(20, begin)
        assert set(tried) == over
