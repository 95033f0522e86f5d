"""Points with conditions by Newton's method, seven lanes at a time; the distance to instability.

Each benchmark records how many lanes were found, and how many steps a call takes.
"""

import platform

import numpy as np
import pytest

from equimorph.equilibria import limit_load
from equimorph.equilibria.newton_step import Points
from equimorph.equilibria.point_conditions import Fold, Plane
from equimorph.equilibria.settle import Guards, Held, Planes, free_directions, settle
from equimorph.manifold import equilibrium_set, stability_distance
from equimorph.model import Box
from equimorph.structures import Rod, States

LANES = 7
GUARDS = Guards(longest=0.5, converged=1e-9, following=1e-13)


@pytest.fixture(scope="module")
def arch() -> Rod:
    return Rod()


def problems(arch: Rod) -> dict[str, tuple]:
    """Guesses, directions, conditions and coordinates of each kind of points."""
    settings = np.zeros((LANES, 4))
    settings[:, 0], settings[:, 1] = np.linspace(0.6, 1.5, LANES), 0.1
    settings[:, 3] = np.sin(1.0)
    states, found = arch.natural_states(settings)
    z, p = states.z[found], states.p[found]
    generator, lanes = np.random.default_rng(2), len(z)
    by_z, by_p = generator.normal(size=(lanes, 2, arch.size)), generator.normal(size=(lanes, 2, 4))
    near, directions = z + 1e-2 * np.cos(z), free_directions(arch, np.array([0, 1]), lanes)
    ends = [limit_load(state, "q").state for state in states[found]]
    folds = States(arch, np.array([end.z for end in ends]), np.array([end.p for end in ends]))
    one, load = free_directions(arch, np.array([2]), lanes), Plane(z, p, by_z, by_p)
    return {
        "fixed parameters": (near, p, None, (), None),
        "given planes": (near, p, directions, (), Planes(by_z, by_p)),
        "conditions": (near, p, directions, (load,), None),
        "parameters held": (near, p, one, (), Held()),
        "folds": (folds.z + 1e-3 * np.cos(folds.z), folds.p, one, (Fold(),), None),
    }


@pytest.mark.parametrize(
    "kind", ["fixed parameters", "given planes", "conditions", "parameters held", "folds"]
)
def test_points(benchmark, arch, monkeypatch, kind):
    z, p, directions, conditions, frame = problems(arch)[kind]
    steps, step = [], Points.step
    monkeypatch.setattr(Points, "step", lambda here: steps.append(1) or step(here))
    found = settle(arch, z, p, directions, conditions, GUARDS, frame)
    monkeypatch.undo()
    benchmark.extra_info.update(
        machine=platform.processor() or platform.machine(),
        lanes=len(z),
        found=int(found.found.sum()),
        steps=len(steps),
    )
    benchmark(settle, arch, z, p, directions, conditions, GUARDS, frame)


def test_distance_to_instability(benchmark, arch):
    eset = equilibrium_set(
        arch,
        Box(Theta=(0.2, 2.5), Delta=(-2.0, 2.0)),
        fixed={"q": 2.5},
        within=[arch.max_curvature <= 20],
        intervals=(24, 41),
        checks=0,
    )
    state = max(eset.at(Theta=1.0, Delta=0.0).stable, key=arch.height(0.5))
    distance = benchmark(stability_distance, eset, state)
    benchmark.extra_info.update(
        machine=platform.processor() or platform.machine(),
        vertices=len(eset.points),
        in_parameters=distance.in_parameters,
        along_the_set=distance.along_the_set,
    )
