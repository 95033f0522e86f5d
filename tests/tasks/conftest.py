"""The arch at q = 2.5 and the spring over (x_l, F), each lifted once."""

import pytest

import sets
from equimorph.manifold import EquilibriumSet
from equimorph.structures import State


@pytest.fixture(scope="session")
def arch_set() -> EquilibriumSet:
    return sets.arch_set()


@pytest.fixture(scope="session")
def ends(arch_set) -> tuple[State, State]:
    """Upright and inverted arch at (Θ, Δ) = (1, 0)."""
    here = arch_set.at(Theta=1, Delta=0).stable
    rise = arch_set.structure.height(0.5)
    return max(here, key=rise), min(here, key=rise)


@pytest.fixture(scope="session")
def spring_set() -> EquilibriumSet:
    return sets.spring_set()


@pytest.fixture(scope="session")
def short_spring_set() -> EquilibriumSet:
    """Without the stretched states x_l > 1 around which the two stable components hang together."""
    return sets.spring_set((12, 13), 0.95)
