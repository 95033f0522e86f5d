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


ROUTES = {
    "length": {},
    "margin": {"margin": 0.3},
    "work": {"objective": "work"},
    "travel": {"objective": "travel"},
    "time": {"objective": em.Rates({"Theta": 1.0, "Delta": 0.5})},
    "clearance": {"objective": "clearance"},
    "sum": {"objective": [(1, "length"), (0.1, "clearance")]},
    "clearance, margin": {"objective": "clearance", "margin": 0.3},
}


@pytest.fixture(scope="module")
def fine():
    arch = em.Rod()
    box, within = em.Box(**LIMITS), [arch.max_curvature <= 20]
    return em.equilibrium_set(arch, box, fixed={"q": 2.5}, within=within, intervals=(87, 151))


@pytest.fixture(scope="module")
def turned(fine):
    here, rise = fine.at(Theta=1, Delta=0).stable, fine.structure.height(0.5)
    return max(here, key=rise), min(here, key=rise)


@pytest.mark.parametrize("name", ROUTES)
def test_route(benchmark, fine, turned, name):
    route = benchmark(em.plan, fine, *turned, **ROUTES[name])
    benchmark.extra_info["vertices"] = len(fine.points)
    benchmark.extra_info["cost"] = route.cost
    assert route.arrived


def test_route_within_a_curvature(benchmark, fine, turned):
    within = [fine.structure.max_curvature <= 11]
    route = benchmark(em.plan, fine, *turned, within=within)
    benchmark.extra_info["cost"] = route.cost
    assert route.arrived


def test_proof_of_a_route(benchmark, fine, turned):
    route = em.plan(fine, *turned, margin=0.3)
    found = benchmark(em.verify, route.schedule, turned[0], margin=0.3, proof=True)
    benchmark.extra_info["segments"] = len(found.proof.error)
    assert found.proof.status == "proved"


@pytest.mark.parametrize("load", ["uniform", "left-half"])
def test_strongest(benchmark, load):
    arch = em.Rod(load=load)
    grid = em.Grid(Theta=(0.2, 2.5, 46), Delta=(-2, 2, 80))
    lmap = em.limit_load_map(arch, grid, "q", within=[arch.max_curvature <= 10])
    found = benchmark(em.strongest, lmap)
    benchmark.extra_info["value"] = found.best.value
