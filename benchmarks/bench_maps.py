"""Maps over 93 × 160 intervals of (Θ, Δ) with their curves: the arch under both loads.

Each benchmark records how many settings ended in which way and how many curves were found, and the
CPU time of one more run: it hardly depends on what else the machine does.
"""

import platform
import time

import numpy as np
import pytest

from equimorph.model import Grid
from equimorph.structures import Rod
from equimorph.tasks.maps.curvature import curvature_map
from equimorph.tasks.maps.limit_load import limit_load_map

INTERVALS = (93, 160)
LOADS = ["uniform", "left-half"]


def over(intervals: tuple[int, int]) -> Grid:
    return Grid(Theta=(0.2, 2.5, intervals[0]), Delta=(-2, 2, intervals[1]))


def note(benchmark, computed, run) -> None:
    start = time.process_time()
    run()
    curves: dict[str, int] = {}
    for curve in computed.curves:
        curves[curve.kind] = curves.get(curve.kind, 0) + len(curve.points)
    benchmark.extra_info.update(
        machine=platform.processor() or platform.machine(),
        cpu_seconds=time.process_time() - start,
        settings=computed.value.size,
        statuses={kind: count for kind, count in computed.counts.items() if count},
        points_on_curves=curves,
        largest_residual=float(np.nanmax(computed.states.residual)),
    )


@pytest.mark.parametrize("load", LOADS)
def bench_limit_load_map(benchmark, load):
    arch = Rod(load=load)

    def run(intervals=INTERVALS):
        return limit_load_map(arch, over(intervals), "q", within=[arch.max_curvature <= 10])

    run((10, 16))  # compiles, or loads, the kernels
    note(benchmark, benchmark.pedantic(run, rounds=3, warmup_rounds=1), run)


@pytest.mark.parametrize("load", LOADS)
def bench_curvature_map(benchmark, load):
    arch = Rod(load=load)

    def run(intervals=INTERVALS):
        return curvature_map(arch, over(intervals), "q", 2.5, within=[arch.max_curvature <= 20])

    run((10, 16))
    note(benchmark, benchmark.pedantic(run, rounds=1), run)
