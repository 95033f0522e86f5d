"""The arch and the spring, each lifted once."""

import pytest

import sets
from equimorph.manifold import EquilibriumSet


@pytest.fixture(
    scope="session",
    params=[
        (12, 21),
        (24, 41),
        # a grid line would lie on Δ = 0
        pytest.param((24, 40), marks=pytest.mark.slow),
        pytest.param((47, 81), marks=pytest.mark.slow),
        pytest.param((93, 161), marks=pytest.mark.slow),
    ],
    ids="{0[0]}x{0[1]}".format,
)
def arch_set(request) -> EquilibriumSet:
    return sets.arch_set(request.param, checks=2)


@pytest.fixture(scope="session")
def refined_arch():
    """Refined sets of the arch by intervals and accuracy."""
    return lambda intervals, accuracy: sets.arch_set(intervals, accuracy=accuracy)


@pytest.fixture(scope="session")
def even_arch_set() -> EquilibriumSet:
    return sets.arch_set((8, 14))


@pytest.fixture(scope="session")
def spring_set() -> EquilibriumSet:
    return sets.spring_set(checks=2)
