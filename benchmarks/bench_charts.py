"""Speed of charts: wanted are an atlas of 20 000 vertices in 2 s and 10⁴ states in 0.5 s."""

from time import process_time

import numpy as np
import pytest

import equimorph as em
from equimorph.manifold import part

BOX = em.Box(Theta=(0.2, 2.5), Delta=(-2, 2))


def arch_set(intervals):
    arch = em.Rod()
    within = [arch.max_curvature <= 20]
    return em.equilibrium_set(
        arch, BOX, fixed={"q": 2.5}, within=within, checks=0, intervals=intervals
    )


@pytest.fixture(scope="module")
def large():
    return arch_set((86, 149))


@pytest.fixture(scope="module")
def stable(large):
    return part(large, large.cell_index == 0)


def bench_atlas_of_20_000_vertices(benchmark, large):
    atlas = benchmark.pedantic(em.dissect, (large,), rounds=3, warmup_rounds=1)
    benchmark.extra_info.update(vertices=len(large.points), charts=len(atlas))
    assert all(chart.single_valued for chart in atlas.charts)


def bench_states_of_a_projection(benchmark, stable):
    at = np.random.default_rng(0).uniform(BOX.lower, BOX.upper, (10_000, 2))
    chart = em.Projection(stable)
    chart.state(at[:10])
    found = benchmark.pedantic(chart.state, (at,), rounds=3, warmup_rounds=1)
    benchmark.extra_info.update(inside=int(found.inside.sum()))


def bench_states_of_a_descriptor_chart(benchmark, stable):
    chart = em.DescriptorChart(stable, [stable.structure.height(0.5), "Delta"])
    generator = np.random.default_rng(0)
    corners = chart.cells.values[chart.cells.corners]
    weights = generator.dirichlet(np.ones(3), 10_000)
    at = np.einsum("nk,nkd->nd", weights, corners[generator.integers(len(corners), size=10_000)])
    chart.state(at[:10])
    found = benchmark.pedantic(chart.state, (at,), rounds=3, warmup_rounds=1)
    benchmark.extra_info.update(inside=int(found.inside.sum()))


def bench_states_of_a_reduction(benchmark, large):
    chart = em.reduce(large, prefer=em.charts.lowest(large.structure.descriptor("energy")))
    at = np.random.default_rng(0).uniform(BOX.lower, BOX.upper, (10_000, 2))
    benchmark.pedantic(chart.state, (at,), rounds=3, warmup_rounds=1)


RULES = {
    "lowest": lambda arch: em.charts.lowest(arch.descriptor("energy")),
    "highest": lambda arch: em.charts.highest(arch.descriptor("energy")),
    "nearest": lambda _: em.charts.nearest(0),
    "quasi_static": lambda _: em.quasi_static("q"),
    "first_stable": lambda _: em.first_stable_on_path("q"),
}


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("intervals", [(24, 41), (86, 149)], ids=str)
def bench_reductions(benchmark, rule, intervals):
    """1938 and 19 925 vertices; the CPU time of the last run hardly depends on other work."""
    eset, took = arch_set(intervals), []

    def run():
        start = process_time()
        chart = em.reduce(eset, prefer=RULES[rule](eset.structure))
        took.append(process_time() - start)
        return chart

    chart = benchmark.pedantic(run, rounds=2)
    benchmark.extra_info.update(cpu_seconds=took[-1], barriers=len(chart.barriers), lost=chart.lost)
