"""A small spring study, solved once: an equilibrium set and a route on it."""

import pytest

from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.model import Box
from equimorph.structures import Spring
from equimorph.tasks.planning.planner import plan
from equimorph.tasks.route import Route
from typecheck import unchecked


@pytest.fixture(scope="session")
def spring_set() -> EquilibriumSet:
    box = Box(x_l=(0.5, 1.3), F=(-0.2, 0.2))
    spring = Spring()
    with unchecked():  # the tests of sets check
        return equilibrium_set(
            spring, box, within=[spring.angle <= 1.4], intervals=(11, 11), checks=0
        )


@pytest.fixture(scope="session")
def spring_route(spring_set: EquilibriumSet) -> Route:
    here = spring_set.at(x_l=0.8, F=0.0).stable
    angles = spring_set.structure.descriptor("angle")(here)
    route = plan(spring_set, here[int(angles.argmax())], here[int(angles.argmin())])
    assert route.status == "arrived"
    return route
