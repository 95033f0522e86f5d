"""The spring's equilibrium set and two routes on it: small, and known in closed form."""

import pytest

from equimorph.manifold import equilibrium_set
from equimorph.model import Box
from equimorph.structures import Spring
from equimorph.tasks.planning.planner import plan
from typecheck import unchecked

AROUND = [{"F": -0.1}, {"x_l": 1.2}, {"F": 0.1}, {"x_l": 0.8}, {"F": 0.0}]
INTO_THE_FOLD = [{"F": 0.1}, {"x_l": 1.2}, {"F": -0.1}, {"x_l": 0.8}, {"F": 0.0}]


@pytest.fixture(scope="session")
def spring_set():
    """PHYSICS §2: a cusp at x_l = 1, F = 0; folds at F/k = ±(1 − x_l^⅔)^{3/2}."""
    box = Box(x_l=(0.3, 1.4), F=(-0.3, 0.3))
    with unchecked():  # the layers below check themselves
        return equilibrium_set(Spring(), box, fixed={"k": 1.0}, intervals=(12, 13), checks=0)


@pytest.fixture(scope="session")
def ends(spring_set):
    """Both stable states at x_l = 0.8 without force, the upper one first."""
    stable = spring_set.at(x_l=0.8, F=0.0).stable
    return sorted(stable, key=spring_set.structure.angle, reverse=True)


@pytest.fixture(scope="session")
def route(spring_set, ends):
    """From δ > 0 to δ < 0 around the cusp."""
    with unchecked():
        return plan(spring_set, *ends, via=AROUND)


@pytest.fixture(scope="session")
def refused(spring_set, ends):
    """The other way round, straight into the fold."""
    with unchecked():
        return plan(spring_set, *ends, via=INTO_THE_FOLD)
