"""The arch and the spring, each lifted once."""

import pytest

from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.model import Box
from equimorph.structures import Rod, Spring
from typecheck import unchecked

ARCH_BOX = Box(Theta=(0.2, 2.5), Delta=(-2, 2))


def lifted_arch(
    intervals: tuple[int, int], checks: int = 2, accuracy: float | None = None
) -> EquilibriumSet:
    arch = Rod()
    with unchecked():  # shapes are checked on small surfaces
        return equilibrium_set(
            arch,
            ARCH_BOX,
            fixed={"q": 2.5},
            within=[arch.max_curvature <= 20],
            intervals=intervals,
            checks=checks,
            accuracy=accuracy,
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
def refined_arch():
    """Refined sets of the arch by intervals and accuracy."""

    def refined(intervals: tuple[int, int], accuracy: float) -> EquilibriumSet:
        return lifted_arch(intervals, checks=0, accuracy=accuracy)

    return refined


@pytest.fixture(scope="session")
def even_arch_set() -> EquilibriumSet:
    return lifted_arch((8, 14), checks=0)


@pytest.fixture(scope="session")
def spring_set() -> EquilibriumSet:
    box = Box(x_l=(0.3, 1.3), F=(-0.5, 0.5))
    with unchecked():
        return equilibrium_set(Spring(), box, intervals=(12, 12))
