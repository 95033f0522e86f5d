"""Seconds of tasks on 20 000 vertices: `python benchmarks/bench_tasks.py [--profile] [TASK …]`.

The set is the arch at q = 2.5. The second call of each task is the one that counts: the first makes
the tables of the set. CPU times hardly depend on other work.
"""

import cProfile
import pstats
import sys
from collections.abc import Callable
from time import perf_counter, process_time
from typing import Any

import numpy as np

import equimorph as em
from equimorph.charts import first_stable_on_path, highest, lowest, nearest, quasi_static
from equimorph.manifold import snap_graph, stability_distance

LIMITS = {"Theta": (0.2, 2.5), "Delta": (-2.0, 2.0)}
SQUARE = np.array([(0.15, 0.15), (0.1, 0.1), (0.2, 0.1), (0.2, 0.2), (0.1, 0.2), (0.1, 0.1)])


def arch_set(intervals: tuple[int, int] = (86, 149)) -> em.EquilibriumSet:
    """The arch at q = 2.5; 19 925 vertices by default."""
    arch = em.Rod()
    return em.equilibrium_set(
        arch,
        em.Box(**LIMITS),
        fixed={"q": 2.5},
        within=[arch.max_curvature <= 20],
        checks=0,
        intervals=intervals,
    )


def tasks(eset: em.EquilibriumSet) -> dict[str, Callable[[], Any]]:
    """Tasks by name."""
    arch = eset.structure
    height, energy = arch.height(0.5), arch.descriptor("energy")
    here = eset.at(Theta=1, Delta=0).stable
    up, down = max(here, key=height), min(here, key=height)
    thirds = [arch.height(1 / 3), arch.height(2 / 3)]
    quarter = [arch.height(0.5), arch.height(0.25)]
    rules = {
        "highest": highest(energy),
        "lowest": lowest(energy),
        "nearest": nearest(0),
        "quasi_static": quasi_static("q"),
        "first_stable": first_stable_on_path("q"),
    }
    out: dict[str, Callable[[], Any]] = {
        f"reduce {name}": lambda rule=rule: em.reduce(eset, prefer=rule)
        for name, rule in rules.items()
    }
    within = [arch.max_curvature <= 12]
    start = em.track(up, dict.fromkeys(thirds, 0.15), actuators=LIMITS).path.end.state
    legs = [dict(zip(thirds, each, strict=True)) for each in SQUARE[1:]]
    return out | {
        "reachable": lambda: em.reachable(eset, up, quarter),
        "dissect": lambda: em.dissect(eset),
        "components": lambda: em.attainable(eset, up, quarter),
        "snap_graph": lambda: snap_graph(eset),
        "stability_distance": lambda: stability_distance(eset, up),
        "least_snap": lambda: em.least_snap(eset, up),
        "plan": lambda: em.plan(eset, up, down),
        "alternatives": lambda: em.alternatives(eset, up, down),
        "optimise": lambda: em.optimise(eset, height, within=within),
        "track": lambda: em.track(start, legs, actuators=LIMITS),
        "robust_optimum": lambda: em.robust_optimum(eset, height, {"Theta": 0.02, "Delta": 0.02}),
    }


def main(names: list[str], profile: bool) -> None:
    """Print CPU and wall times of the first and the second call of each task."""
    every = tasks(arch_set())
    for name in names or every:
        sys.stdout.write(f"{name:20}")
        for call in ("first", "second"):
            start, wall = process_time(), perf_counter()
            every[name]()
            took, wall = process_time() - start, perf_counter() - wall
            sys.stdout.write(f"  {call} {took:6.3f} CPU {wall:6.3f} wall")
        sys.stdout.write("\n")
        if profile:
            run = cProfile.Profile(process_time)
            run.runcall(every[name])
            pstats.Stats(run).sort_stats("tottime").print_stats(22)
            pstats.Stats(run).sort_stats("cumulative").print_stats(60)


if __name__ == "__main__":
    arguments = sys.argv[1:]
    main([each for each in arguments if each != "--profile"], "--profile" in arguments)
