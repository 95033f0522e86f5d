"""Motions, reachable sets and estimates on the arch at q = 2.5.

Each benchmark records how many states there are and the largest residual.
"""

import numpy as np
import pytest

import equimorph as em

CORNERS = np.array([(0.15, 0.15), (0.1, 0.1), (0.2, 0.1), (0.2, 0.2), (0.1, 0.2), (0.1, 0.1)])
LIMITS = {"Theta": (0.2, 2.5), "Delta": (-2.0, 2.0)}


@pytest.fixture(scope="module")
def eset():
    arch = em.Rod()
    box, within = em.Box(**LIMITS), [arch.max_curvature <= 20]
    return em.equilibrium_set(arch, box, fixed={"q": 2.5}, within=within, intervals=(24, 41))


@pytest.fixture(scope="module")
def start(eset):
    arch = eset.structure
    upright = max(eset.at(Theta=1, Delta=0).stable, key=arch.height(0.5))
    heights = {arch.height(1 / 3): 0.15, arch.height(2 / 3): 0.15}
    return em.track(upright, heights, actuators=LIMITS).path.end.state


def test_tracking_of_a_thousand_targets(benchmark, start):
    left, right = start.structure.height(1 / 3), start.structure.height(2 / 3)
    share = np.linspace(0, 5, 1001)[1:]
    x, y = (np.interp(share, np.arange(6), column) for column in CORNERS.T)
    legs = [{left: a, right: b} for a, b in zip(x, y, strict=True)]
    found = benchmark(em.track, start, legs, actuators=LIMITS)
    benchmark.extra_info["states"] = len(found.states)
    benchmark.extra_info["residual"] = float(found.states.residual.max())
    assert found.arrived


def test_a_square_in_four_legs_with_three_actuators(benchmark, start):
    left, right = start.structure.height(1 / 3), start.structure.height(2 / 3)
    legs = [{left: a, right: b} for a, b in CORNERS[1:]]
    found = benchmark(em.track, start, legs, actuators=["Theta", "Delta", "nu"])
    benchmark.extra_info["states"] = len(found.states)
    benchmark.extra_info["end"] = found.path.end.kind


def test_reachable_set(benchmark, eset, start):
    arch = eset.structure
    descriptors = [arch.height(1 / 3), arch.height(2 / 3)]
    found = benchmark(em.reachable, eset, start, descriptors)
    benchmark.extra_info["states"] = len(found.states)
    assert len(found.boundary) > 0


def test_estimate(benchmark, eset, start):
    arch = eset.structure
    seen = {each: each(start) for each in (arch.height(1 / 3), arch.height(2 / 3))}
    errors = dict.fromkeys(seen, 1e-3)
    found = benchmark(em.estimate_state, eset, seen, errors)
    benchmark.extra_info["states"] = len(found.states)
