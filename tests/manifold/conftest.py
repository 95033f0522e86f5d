"""The arch and the spring, each lifted once."""

import pytest

from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.model import Box
from equimorph.structures import Rod, Spring

ARCH_BOX = Box(Theta=(0.2, 2.5), Delta=(-2, 2))


def lifted_arch(intervals: tuple[int, int]) -> EquilibriumSet:
    arch = Rod()
    return equilibrium_set(
        arch,
        ARCH_BOX,
        fixed={"q": 2.5},
        within=[arch.max_curvature <= 20],
        intervals=intervals,
    )


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
    return lifted_arch(request.param)


@pytest.fixture(scope="session")
def even_arch_set() -> EquilibriumSet:
    return lifted_arch((8, 14))


@pytest.fixture(scope="session")
def spring_set() -> EquilibriumSet:
    return equilibrium_set(Spring(), Box(x_l=(0.3, 1.3), F=(-0.5, 0.5)), intervals=(12, 12))
