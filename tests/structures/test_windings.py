"""States that wind: a turn by 4π along a rod in space leaves both of its clamps as they are.

Planar rods whose clamps are 4π further apart are rods in space between the same clamps, so that the
states of the former, whose search knows of no windings, must be among those of the latter.
"""

import numpy as np
import pytest

import equimorph as em
from equimorph.structures.space_frame.guesses import random_guesses
from equimorph.structures.spatial.windings import most_windings, random_windings
from oracles.spatial_frames import bend

BOUND = 20.0
SLOW = pytest.mark.slow
ARCHES = [
    (0.7, {"Theta": 0.5, "Delta": 0.2, "nu": 0.15, "q": 1.0}, 33, 0),
    pytest.param(0.7, {"Theta": 0.5, "Delta": 0.2, "nu": 0.15, "q": 1.0}, 31, 1, marks=SLOW),
    pytest.param(1.4, {"Theta": 0.5, "nu": 0.2}, 18, 0, marks=SLOW),  # of 22
]
"""Bending stiffness across, parameters, states that are found at least, and a seed."""


def wound_in_plane(at: dict[str, float]) -> list[float]:
    """Energies of planar states whose clamps are 4π further apart, one way and the other."""
    rod = em.Rod(elements=18)
    return [
        energy
        for turn in (-2.0 * np.pi, 2.0 * np.pi)  # of each clamp
        for energy in em.find_equilibria(
            rod, at | {"Theta": at["Theta"] + turn}, within=[rod.max_curvature <= BOUND]
        ).energy.tolist()
    ]


@pytest.mark.parametrize(("lateral", "at", "states", "seed"), ARCHES)
def test_states_of_planar_rods_that_wind_are_found_in_space(lateral, at, states, seed):
    """Without windings 33 or 28, and 11 or 18 states; twice not all of those in a plane."""
    rod = em.SpatialRod(torsion=0.77, lateral=lateral).resolving(BOUND)
    found = em.find_equilibria(rod, at, within=[rod.max_curvature <= BOUND], seed=seed)
    in_plane = wound_in_plane(at)
    assert len(in_plane) == 2
    for energy in in_plane:
        assert np.abs(found.energy - energy).min() < 1e-6
    assert len(found) >= states


def test_a_bend_in_space_winds():
    """One state without windings, of those within the bound; mirror images have the same energy."""
    frame = bend(elements=6, degree=6)
    within = [frame.max_curvature <= 6.6]
    for seed in range(2):
        found = em.find_equilibria(frame, {"a": 0.3, "P": 0.0}, within=within, seed=seed)
        assert found.index.tolist() == [0, 1, 1, 2, 2]
        np.testing.assert_allclose(found.energy[[1, 3]], found.energy[[2, 4]], rtol=1e-9)


def test_rods_with_default_elements_do_not_wind():
    """They resolve no winding: guesses are what they were, and as many."""
    rod = em.SpatialRod(torsion=0.77, lateral=1.4)
    assert most_windings(*rod.resolution) == 0
    assert rod.guesses_per_start == 1.0
    assert rod.resolving(24.0).guesses_per_start > 2.0


def test_windings_of_guesses_are_even_around_zero():
    """Two thirds in space and a quarter in a plane, once or twice, one way or the other."""
    generator, planar = np.random.default_rng(2), np.arange(6000) % 2 == 0
    windings = random_windings(2, planar, generator)
    assert set(windings.tolist()) == {-2, -1, 0, 1, 2}
    assert (windings[planar] != 0).mean() == pytest.approx(0.25, abs=0.03)
    assert (windings[~planar] != 0).mean() == pytest.approx(2.0 / 3.0, abs=0.03)
    assert abs(windings.mean()) < 0.05
    assert not random_windings(0, planar, generator).any()


def test_guesses_of_frames_are_rotations_that_are_continuous():
    """Unit quaternions; neighbours along a member are near, where it winds, too."""
    frame = bend(elements=6, degree=6)
    q, _, _ = random_guesses(frame.model, 400, np.random.default_rng(3))
    np.testing.assert_allclose(np.linalg.norm(q, axis=-1), 1.0, atol=1e-12)
    whole = np.zeros((400, len(frame.model.turning), 4))
    whole[:, :, 0] = 1.0
    whole[:, frame.model.free] = q
    inner = whole[:, frame.model.piece_nodes]
    beside = (inner[:, :, 1:] * inner[:, :, :-1]).sum(axis=-1)
    assert beside.min() > 0.5
    assert (q[..., 0] < -0.9).any(axis=1).mean() > 0.2  # some bodies are at −q


@pytest.mark.slow
def test_sets_of_rods_that_wind_do_not_depend_on_the_seed():
    """27 states over the middle; without windings 5 of the 6 stable ones at most."""
    rod = em.SpatialRod(torsion=0.77, lateral=1.2).resolving(20.0)
    box, within = em.Box(tilt_A=(0.05, 0.15)), [rod.max_curvature <= 20.0]
    sets = [
        em.equilibrium_set(rod, box, fixed={"Theta": 0.8}, within=within, intervals=(8,), seed=seed)
        for seed in range(2)
    ]
    assert all(each.audit.clean for each in sets)
    for tilt in (0.06, 0.1, 0.14):
        assert len({len(each.at(tilt_A=tilt)) for each in sets}) == 1
