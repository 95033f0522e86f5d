"""Rows of the benchmark report: limit loads, paths, equilibrium sets and tasks of the arch.

A group makes what its rows work on, and loads the kernels, before time is taken.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import equimorph as em
from bench_lift import LARGEST, natural_states
from bench_sets import lifted
from bench_tasks import tasks
from equimorph.equilibria import ParameterLine, TraceOptions, trace
from equimorph.structures import States

AHEAD = 20.0
"""Load up to which paths are followed."""
SINGLE = 40
"""Calls of a row that computes one limit load each time."""


@dataclass(frozen=True)
class Row:
    """Something to be timed.

    rounds: how often; count: of a result, how many equilibria, limit loads or states it took.
    """

    name: str
    work: Callable[[], Any]
    rounds: int
    count: Callable[[Any], int] = lambda _: 1


def limit_loads() -> Iterator[Row]:
    """Limit loads of natural states at random settings, up to max |κ| = 10."""
    states = natural_states(10_000)
    within = [states.structure.max_curvature <= LARGEST]

    def some(count: int) -> Any:
        # fresh: states keep what was once computed of them
        fresh = States(states.structure, states.z[:count].copy(), states.p[:count].copy())
        return em.limit_load(fresh, "q", within=within)

    def single() -> None:
        for k in range(SINGLE):
            em.limit_load(states[k], "q", within=within)

    some(500)
    yield Row("limit loads 1e4", lambda: some(10_000), 5, lambda _: 10_000)
    yield Row("limit loads 100", lambda: some(100), 9, lambda _: 100)
    yield Row("one limit load x40", single, 5, lambda _: SINGLE)


def paths() -> Iterator[Row]:
    """Paths along the load through many states, and through one."""
    states = natural_states(10_000)

    def row(name: str, lanes: int, step: float | None) -> Row:
        some = states[np.arange(lanes)]
        velocity = np.tile([0.0, 0.0, AHEAD, 0.0], (lanes, 1))
        line = ParameterLine(states.structure, some.p, velocity)
        steps = {} if step is None else {"largest_step": step}
        count = len(trace(line, some.z, (), TraceOptions(**steps)).points.t) + lanes
        options = TraceOptions(record=lanes == 1, **steps)
        rounds = 15 if lanes == 1 else 5
        return Row(name, lambda: trace(line, some.z, (), options), rounds, lambda _: count)

    yield row("paths 1e4 default", 10_000, None)
    yield row("paths 1e4 small", 2_000, 0.01)
    yield row("one lane default", 1, None)
    yield row("one lane small", 1, 0.005)


def over_three(intervals: tuple[int, int, int] = (18, 24, 15)) -> em.EquilibriumSet:
    """Set of the arch over Θ, Δ and q, up to max |κ| = 20."""
    arch = em.Rod(load="uniform")
    box = em.Box(Theta=(0.6, 1.4), Delta=(-0.6, 0.6), q=(0, 3))
    within = [arch.max_curvature <= 20]
    return em.equilibrium_set(arch, box, within=within, intervals=intervals, checks=0)


def sets() -> Iterator[Row]:
    """Sets over two and three parameters, with and without random checks and refinement."""
    lifted((5, 9), 1)
    lifted((5, 9), 0, 0.1)
    over_three((3, 3, 2))

    def row(name: str, rounds: int, work: Callable[[], Any]) -> Row:
        return Row(name, work, rounds, lambda eset: int(eset.audit.vertices))

    yield row("set lifted 86x149", 5, lambda: lifted((86, 149)))
    yield row("set checked 93x161", 3, lambda: lifted((93, 161), 2))
    yield row("set refined .0006", 3, lambda: lifted((24, 41), 0, 0.0006))
    yield row("set refined .00068", 3, lambda: lifted((24, 41), 0, 0.00068))
    yield row("set 111k", 1, lambda: lifted((205, 353)))
    yield row("set d3", 3, over_three)


def tasks_on_a_set() -> Iterator[Row]:
    """Tasks on 20 000 vertices, states over points, and inverse kinematics."""
    eset = lifted((86, 149))
    arch, every = eset.structure, tasks(eset)
    up = max(eset.at(Theta=1, Delta=0).stable, key=arch.height(0.5))
    target = {arch.height(1 / 3): 0.15, arch.height(2 / 3): 0.15}
    points = np.random.default_rng(0).uniform([0.2, -2.0], [2.5, 2.0], (10_000, 2))
    for name, work in every.items():
        yield Row(name, work, 3)
    yield Row("solve_shape one", lambda: em.solve_shape(eset, target, start=up), 9)
    yield Row(
        "at",
        lambda: [eset.at(Theta=x, Delta=y) for x, y in points[:100]],
        9,
        len,
    )
    yield Row(
        "over 1e4", lambda: eset.over(Theta=points[:, 0], Delta=points[:, 1]), 3, lambda _: 10_000
    )


GROUPS: dict[str, Callable[[], Iterator[Row]]] = {
    "limits": limit_loads,
    "paths": paths,
    "sets": sets,
    "tasks": tasks_on_a_set,
}
"""Rows by group."""
