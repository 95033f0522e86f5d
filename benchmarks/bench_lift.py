"""Lifts of many lanes: equilibria along paths, limit loads, wavefronts, short lifts.

Times are those of all lanes together, on as many threads as there are processors; what a lane or an
equilibrium costs is recorded beside them, with how many lanes ended in which way.
"""

import platform
from functools import lru_cache

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria import ParameterLine, TraceOptions, trace
from equimorph.structures import Rod, States

BOX = ((0.2, 2.5), (-2.0, 2.0))
"""Theta and Delta of the published limit-load maps."""
LARGEST = 10.0
"""Bound of the curvature."""


@lru_cache(maxsize=8)
def natural_states(lanes: int, elements: int = 6, degree: int = 9) -> States:
    """So many natural states with max |κ| ≤ 10, from random settings in the box."""
    rod, generator = Rod(elements=elements, degree=degree), np.random.default_rng(5)
    parts: list[States] = []
    while sum(map(len, parts)) < lanes:
        p = np.zeros((4 * lanes, 4))
        p[:, 0], p[:, 1] = (generator.uniform(*sides, len(p)) for sides in BOX)
        p[:, 3] = np.sin(1.0)
        states, found = rod.natural_states(p)
        states = states[np.flatnonzero(found)]
        parts.append(states[np.flatnonzero(rod.max_curvature(states) <= LARGEST)])
    z, p = (np.concatenate([getattr(part, name) for part in parts])[:lanes] for name in "zp")
    return States(rod, z, p)


def record(benchmark, states, kinds, **more) -> None:
    names, counts = np.unique(kinds, return_counts=True)
    benchmark.extra_info.update(
        machine=platform.processor() or platform.machine(),
        unknowns=states.structure.size,
        lanes=len(states),
        microseconds_per_lane=1e6 * benchmark.stats["min"] / len(states),
        ends={str(name): int(count) for name, count in zip(names, counts, strict=True)},
        **more,
    )


@pytest.mark.parametrize("lanes", [1, 10, 100, 1000, 10_000, 100_000])
def bench_limit_loads(benchmark, lanes):
    """Natural states of the box with max |κ| ≤ 10, loaded to the first event."""
    states = natural_states(lanes)
    within = [states.structure.max_curvature <= LARGEST]
    em.limit_load(natural_states(1000), "q", within=within)
    found = benchmark.pedantic(
        em.limit_load, (states, "q"), {"within": within}, rounds=3 if lanes > 1000 else 7
    )
    record(benchmark, states, found.kind)


@pytest.mark.parametrize("recorded", [False, True], ids=["ends", "points"])
def bench_equilibria_along_paths(benchmark, recorded):
    """Rays to q = 20 without constraints: every step is a converged state with its index."""
    states = natural_states(10_000)
    z, line = (
        states.z,
        ParameterLine(states.structure, states.p, np.tile([0, 0, 20.0, 0], (10_000, 1))),
    )
    few = line.take(np.arange(1000))
    points = len(trace(line, z).points.t) + len(z)
    trace(few, z[:1000])
    ended = benchmark.pedantic(trace, (line, z, (), TraceOptions(record=recorded)), rounds=3)
    per_second = points / benchmark.stats["min"]
    record(benchmark, states, ended.code, equilibria=points, equilibria_per_second=per_second)


@pytest.mark.parametrize("lanes", [100, 30_000])
def bench_short_lifts(benchmark, lanes):
    """Edges of a grid of 93 × 161 intervals at q = 2.5, from random states."""
    loaded = em.lift(natural_states(30_000), {"q": 2.5})
    at = np.flatnonzero(loaded.arrived & (loaded.states.index == 0))
    starts = loaded.states[np.resize(at, lanes)]
    sides = [(high - low) / n for (low, high), n in zip(BOX, (93, 161), strict=True)]
    along = np.arange(lanes) % 2
    goal = {
        name: starts[name] + np.where(along == axis, side, 0.0)
        for axis, (name, side) in enumerate(zip(("Theta", "Delta"), sides, strict=True))
    }
    within = [starts.structure.max_curvature <= 20]
    starts = States(starts.structure, starts.z.copy(), starts.p.copy())
    found = benchmark.pedantic(em.lift, (starts, goal), {"within": within}, rounds=7)
    record(benchmark, starts, found.kind)


def bench_curves_with_unknown_parameters(benchmark):
    """Both heights at s = 1/3 and 2/3 of many arches moved by a hundredth: Θ and Δ are unknown."""
    starts = em.lift(natural_states(1000), {"q": 1.0})
    starts = starts.states[np.flatnonzero(starts.arrived)]
    rod = starts.structure
    left, right = rod.height(1 / 3), rod.height(2 / 3)
    goal = {left: left(starts) + 0.01, right: right(starts) + 0.01, "Theta": None, "Delta": None}
    found = benchmark.pedantic(em.lift, (starts, goal), rounds=3)
    record(benchmark, starts, found.kind)


def bench_equilibria_of_a_rod_in_space(benchmark):
    """20 000 states of the default rod in space, lifted from one to random angles and loads."""
    rod = em.SpatialRod(torsion=0.77, lateral=1.0)
    one = em.lift(rod.natural_state(Theta=0.9), {"q": 1.0}).end.state
    count, generator = 20_000, np.random.default_rng(1)
    states = em.States(rod, one.z[None].repeat(count, axis=0), one.p[None].repeat(count, axis=0))
    to = {"Theta": generator.uniform(0.8, 1.0, count), "q": generator.uniform(0.5, 1.4, count)}
    em.lift(states[:64], {"q": 1.1})
    found = benchmark.pedantic(em.lift, (states, to), rounds=3)
    record(benchmark, states, found.kind)
    assert set(found.kind.tolist()) == {"arrived"}
