"""Equilibrium sets, states over a point, and routes: the arch at q = 2.5, max |κ| ≤ 20.

Each benchmark records the size of the set, what the audit found and the largest residual, so that
a fast answer that is wrong is seen.
"""

import platform
from time import perf_counter

import numpy as np
import pytest

from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.model import Box
from equimorph.structures import Rod
from equimorph.tasks.planning.planner import plan

VIA = [{"Theta": 1.3}, {"Delta": 1.3}, {"Theta": 1.0}, {"Delta": 0.0}]


def lifted(
    intervals: tuple[int, int], checks: int = 0, accuracy: float | None = None
) -> EquilibriumSet:
    arch = Rod()
    return equilibrium_set(
        arch,
        Box(Theta=(0.2, 2.5), Delta=(-2, 2)),
        fixed={"q": 2.5},
        within=[arch.max_curvature <= 20],
        intervals=intervals,
        checks=checks,
        accuracy=accuracy,
    )


def note(benchmark, eset: EquilibriumSet) -> None:
    audit = eset.audit
    benchmark.extra_info.update(
        machine=platform.processor() or platform.machine(),
        unknowns=eset.structure.size,
        vertices=audit.vertices,
        cells=audit.cells,
        clean=audit.clean,
        euler_characteristic=audit.euler_characteristic,
        retraced=audit.retraced,
        bisected=audit.bisected,
        largest_residual=audit.largest_residual,
    )


@pytest.fixture(scope="module")
def arch_set() -> EquilibriumSet:
    return lifted((24, 41))


@pytest.mark.parametrize("intervals", [(24, 41), (47, 81), (93, 161)], ids="{0[0]}x{0[1]}".format)
def bench_equilibrium_set(benchmark, intervals):
    lifted((5, 9))  # compiles, or loads, the kernels
    eset = benchmark.pedantic(lifted, (intervals,), rounds=3 if intervals[0] < 50 else 1)
    note(benchmark, eset)


@pytest.mark.parametrize("accuracy", [0.002, 0.0006, 0.00013])
def bench_refined_set(benchmark, accuracy):
    """From 24 × 41 intervals to about 6 600, 22 000 and 98 000 vertices, the lift included."""
    lifted((5, 9), accuracy=0.1)
    eset = benchmark.pedantic(lifted, ((24, 41), 0, accuracy), rounds=3 if accuracy > 2e-4 else 1)
    note(benchmark, eset)
    benchmark.extra_info.update(
        deviation=eset.audit.deviation, smallest_angle=eset.audit.smallest_angle
    )


@pytest.mark.parametrize(
    "intervals", [(10, 13, 8), (18, 24, 15)], ids="{0[0]}x{0[1]}x{0[2]}".format
)
def bench_set_over_three_parameters(benchmark, intervals):
    """(Θ, Δ, q): about 7 300 and 28 000 equilibria, 39 000 and 155 000 tetrahedra."""
    arch = Rod()
    box = Box(Theta=(0.6, 1.4), Delta=(-0.6, 0.6), q=(0, 3))

    def build(intervals):
        within = [arch.max_curvature <= 20]
        return equilibrium_set(arch, box, within=within, intervals=intervals, checks=0)

    build((3, 3, 2))
    note(benchmark, benchmark.pedantic(build, (intervals,), rounds=1))


def bench_completeness_checks(benchmark):
    """Two random points below the set, searched independently: the difference to `checks=0`."""
    lifted((5, 9), 1)
    note(benchmark, benchmark.pedantic(lifted, ((24, 41), 2), rounds=3))


def bench_states_over_a_point(benchmark, arch_set):
    here = benchmark(arch_set.at, Theta=1.0, Delta=0.0)
    benchmark.extra_info.update(states=len(here), largest_residual=float(here.residual.max()))


@pytest.fixture(scope="module", params=[None, 0.0006], ids=["24x41", "refined"])
def asked_set(request) -> EquilibriumSet:
    return lifted((24, 41), accuracy=request.param)


def random_points(count: int) -> np.ndarray:
    return np.random.default_rng(0).uniform([0.2, -2], [2.5, 2], (count, 2))


def bench_states_over_single_points(benchmark, asked_set):
    """400 random points one by one; the median point counts."""
    points, took = random_points(400), np.zeros(400)
    asked_set.at(Theta=1.0, Delta=0.0)

    def ask_all():
        for k, (theta, delta) in enumerate(points):
            start = perf_counter()
            asked_set.at(Theta=theta, Delta=delta)
            took[k] = perf_counter() - start

    benchmark.pedantic(ask_all, rounds=3)
    for share in (0.5, 0.9, 1.0):
        benchmark.extra_info[f"milliseconds at {share:g}"] = 1e3 * float(np.quantile(took, share))


@pytest.mark.parametrize("via", [VIA, None], ids=["by way-points", "free"])
@pytest.mark.parametrize("margin", [0.0, 0.3])
def bench_plan(benchmark, arch_set, via, margin):
    here = arch_set.at(Theta=1.0, Delta=0.0).stable
    rise = arch_set.structure.height(0.5)
    ends = max(here, key=rise), min(here, key=rise)
    route = benchmark.pedantic(
        lambda: plan(arch_set, *ends, via=via, margin=margin), rounds=3, warmup_rounds=1
    )
    benchmark.extra_info.update(
        status=route.status,
        steps=len(route.schedule.progress),
        length=route.length,
        margin=route.margin,
    )


@pytest.mark.parametrize("objective", ["length", "work", "clearance"])
def bench_plan_by_objective(benchmark, arch_set, objective):
    here = arch_set.at(Theta=1.0, Delta=0.0).stable
    rise = arch_set.structure.height(0.5)
    ends = max(here, key=rise), min(here, key=rise)
    route = benchmark.pedantic(
        lambda: plan(arch_set, *ends, objective=objective), rounds=3, warmup_rounds=1
    )
    benchmark.extra_info.update(
        status=route.status, cost=route.cost, margin=route.margin, corners=len(route.way_points)
    )


def bench_states_over_many_points(benchmark, asked_set):
    """10⁴ random points in one call."""
    points = random_points(10_000)
    found = benchmark(asked_set.over, Theta=points[:, 0], Delta=points[:, 1])
    benchmark.extra_info.update(
        states=len(found.states),
        microseconds_each=benchmark.stats.stats.min * 100,
        largest_residual=float(found.states.residual.max()),
    )
