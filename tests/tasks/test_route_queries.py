"""Random route queries: what is returned holds, and what is refused is parted."""

import numpy as np
import pytest

import equimorph as em
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.queries.locate import pieces_of
from equimorph.structures import State
from equimorph.tasks.planning.planner import plan
from equimorph.tasks.verification.schedule_check import verify
from sets import arch_set, spring_set
from typecheck import unchecked

TEN_TIMES = em.TraceOptions(largest_step=0.002, first_step=0.001, turning=0.005, steps=400000)
"""Ten times finer than the final check of a route."""


def _stable_states(eset: EquilibriumSet) -> list[State]:
    at = np.flatnonzero((eset.index == 0) & (eset.kinds == 0))
    return list(eset.points[at])


def _query(eset: EquilibriumSet, finer: EquilibriumSet, queries: int, seed: int) -> tuple[int, int]:
    """Numbers of routes that held and of refusals that were right."""
    generator = np.random.default_rng(seed)
    stable = _stable_states(eset)
    held = right = 0
    for _ in range(queries):
        start, goal = (stable[int(k)] for k in generator.integers(len(stable), size=2))
        if np.array_equal(start.p, goal.p):
            continue
        route = plan(eset, start, goal)
        if route.arrived:
            again = verify(route.way_points, start, options=TEN_TIMES)
            assert again.verified, again.why
            np.testing.assert_allclose(again.states.z[-1], goal.z, rtol=0, atol=1e-6)
            held += 1
        else:
            assert "different stable components" in route.why
            assert pieces_of(finer, start)[0] != pieces_of(finer, goal)[0]
            right += 1
    return held, right


def test_routes_of_the_spring_hold_and_refusals_are_right():
    with unchecked():
        held, right = _query(spring_set((12, 13), 0.95), spring_set((24, 26), 0.95), 20, 1)
    assert held > 0
    assert right > 0


@pytest.mark.slow
def test_two_hundred_routes_hold_or_are_rightly_refused():
    with unchecked():
        spring = _query(spring_set((12, 13), 0.95), spring_set((24, 26), 0.95), 100, 2)
        arch = _query(arch_set((12, 21)), arch_set((24, 42)), 100, 3)
    assert sum(spring) + sum(arch) >= 190
    assert min(spring) > 0
    assert arch[0] > 50
