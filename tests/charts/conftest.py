"""Sets that charts are tested on, each lifted once."""

import pytest

from equimorph.manifold import EquilibriumSet
from equimorph.model import Box
from equimorph.structures import Rod, Spring
from oracles.charted import lifted


@pytest.fixture(scope="session")
def spring_set() -> EquilibriumSet:
    return lifted(Spring(), Box(x_l=(0.3, 1.3), F=(-0.5, 0.5)), (12, 12))


@pytest.fixture(scope="session")
def arch_set() -> EquilibriumSet:
    arch = Rod()
    box = Box(Theta=(0.2, 2.5), Delta=(-2, 2))
    within = [arch.max_curvature <= 20]
    return lifted(arch, box, (24, 41), fixed={"q": 2.5}, within=within)
