"""Sets that charts are tested on, each lifted once."""

import pytest

import sets
from equimorph.manifold import EquilibriumSet


@pytest.fixture(scope="session")
def spring_set() -> EquilibriumSet:
    return sets.spring_set()


@pytest.fixture(scope="session")
def arch_set() -> EquilibriumSet:
    return sets.arch_set((24, 41))
