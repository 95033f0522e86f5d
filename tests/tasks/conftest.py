"""The arch at q = 2.5 and the spring over (x_l, F), each lifted once."""

import pytest

from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.model import Box
from equimorph.structures import Rod, Spring, State
from typecheck import unchecked


@pytest.fixture(scope="session")
def arch_set() -> EquilibriumSet:
    arch = Rod()
    with unchecked():  # the tests of sets check
        return equilibrium_set(
            arch,
            Box(Theta=(0.2, 2.5), Delta=(-2, 2)),
            fixed={"q": 2.5},
            within=[arch.max_curvature <= 20],
            intervals=(12, 21),
            checks=0,
        )


@pytest.fixture(scope="session")
def ends(arch_set) -> tuple[State, State]:
    """Upright and inverted arch at (Θ, Δ) = (1, 0)."""
    here = arch_set.at(Theta=1, Delta=0).stable
    rise = arch_set.structure.height(0.5)
    return max(here, key=rise), min(here, key=rise)


@pytest.fixture(scope="session")
def spring_set() -> EquilibriumSet:
    box = Box(x_l=(0.3, 1.3), F=(-0.5, 0.5))
    with unchecked():
        return equilibrium_set(Spring(), box, intervals=(12, 12), checks=0)


@pytest.fixture(scope="session")
def short_spring_set() -> EquilibriumSet:
    """Without the stretched states x_l > 1 around which the two stable components hang together."""
    box = Box(x_l=(0.3, 0.95), F=(-0.5, 0.5))
    with unchecked():
        return equilibrium_set(Spring(), box, intervals=(12, 13), checks=0)
