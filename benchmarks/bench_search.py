"""Searches for all equilibria over a point, and snap landings: the arch, max |κ| ≤ 20.

Each benchmark records how many equilibria were found and how many are estimated, so that a fast
search that overlooks some is seen; and the processor time, which two threads share.
"""

import platform
import time

import numpy as np
import pytest

from equimorph.equilibria import FoundStates, lift, search_points, snap_landing
from equimorph.structures import Rod

POINTS = 24


@pytest.fixture(scope="module")
def arch() -> Rod:
    return Rod()


def random_points() -> np.ndarray:
    """(Θ, Δ) anywhere in the part of the box with many equilibria, q = 2.5."""
    generator = np.random.default_rng(3)
    return np.stack(
        [
            generator.uniform(0.2, 1.6, POINTS),
            generator.uniform(-1.0, 1.0, POINTS),
            np.full(POINTS, 2.5),
            np.full(POINTS, np.sin(1.0)),
        ],
        axis=1,
    )


def note(benchmark, found: list[FoundStates], processor: float) -> None:
    benchmark.extra_info.update(
        machine=platform.processor() or platform.machine(),
        points=POINTS,
        processor_seconds_per_point=processor / POINTS,
        found=sum(states.completeness.found for states in found),
        estimated=sum(states.completeness.estimate for states in found),
        runs_per_point=np.mean([states.completeness.runs for states in found]),
        largest_residual=max(states.residual.max(initial=0.0) for states in found),
    )


@pytest.mark.parametrize("together", [False, True], ids=["one by one", "together"])
def bench_search(benchmark, arch, together):
    points, within = random_points(), [arch.max_curvature <= 20]
    batches = [points] if together else list(points[:, None])

    def search() -> list[FoundStates]:
        return [states for batch in batches for states in search_points(arch, batch, within=within)]

    search()  # compiles, or loads, the kernels
    begin = time.process_time()
    found = search()
    note(benchmark, found, time.process_time() - begin)
    benchmark.pedantic(search, rounds=5)


@pytest.mark.parametrize("Delta", [0.0, 0.02], ids=["branch point", "fold"])
def bench_snap_landing(benchmark, arch, Delta):
    critical = lift(arch.natural_state(Theta=0.9, Delta=Delta), {"q": 8.0}).end.state
    landings = benchmark(snap_landing, critical)
    landed = [landing for landing in landings if landing.landed]
    benchmark.extra_info.update(
        machine=platform.processor() or platform.machine(),
        landed=len(landed),
        points=sum(len(landing.way) for landing in landed),
        largest_residual=max(landing.state.residual for landing in landed),
    )
