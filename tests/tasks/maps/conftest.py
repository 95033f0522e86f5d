"""Coarse maps of the arch under both loads."""

import pytest

import equimorph as em

AROUND = {"Theta": (0.3, 1.5, 12), "Delta": (-1.5, 1.5, 15)}


def load_map(load, **grid):
    rod = em.Rod(load=load)
    return em.limit_load_map(rod, em.Grid(**grid), "q", within=[rod.max_curvature <= 10])


@pytest.fixture(scope="session")
def uniform():
    """Uniform load; no grid line on Δ = 0."""
    return load_map("uniform", **AROUND)


@pytest.fixture(scope="session")
def half():
    """Load on the left half."""
    return load_map("left-half", **AROUND)
