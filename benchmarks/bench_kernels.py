"""Times of the compiled kernels, single thread unless said; compilation and warm-up apart.

`extra_info` records lanes and size; divide the median by `lanes` for the time of a lane.
"""

import numpy as np
import pytest

from equimorph.linalg import solve_bordered
from equimorph.structures import Rod
from equimorph.structures.rod.clamped_field_kernels import largest_lanes
from equimorph.structures.rod.clamped_kernels import advance_lanes

RESOLUTIONS = [(6, 9), (12, 6), (12, 8), (24, 8)]


def lanes_near_the_arch(rod, lanes):
    """Unknowns and parameters of slightly bent arches, a direction and a closing row."""
    generator = np.random.default_rng(0)
    p = np.array([1.0, 0.1, 1.0, 0.84]) + generator.normal(size=(lanes, 4)) * [0.1, 0.1, 0.3, 0.002]
    s = rod.mesh.nodes[1:-1]
    z = np.zeros((lanes, rod.size))
    z[:, :-2] = p[:, 1:2] + p[:, :1] * (1 - 2 * s) + 0.3 * np.sin(2 * np.pi * s)
    return z, p, generator.normal(size=p.shape), generator.normal(size=z.shape)


def record(benchmark, rod, lanes, residual=None):
    """Write down what was timed."""
    benchmark.extra_info |= {
        "lanes": lanes,
        "size": rod.size,
        "elements": rod.mesh.elements,
        "degree": rod.mesh.degree,
        "us per lane": 1e6 * benchmark.stats.stats.median / lanes if benchmark.stats else None,
        "us per lane at best": 1e6 * benchmark.stats.stats.min / lanes if benchmark.stats else None,
        "largest residual": residual,
    }


@pytest.mark.parametrize("lanes", [100, 4096])
@pytest.mark.parametrize(("elements", "degree"), RESOLUTIONS)
def bench_newton_step_on_one_thread(benchmark, elements, degree, lanes):
    rod = Rod(elements=elements, degree=degree)
    z, p, dp, row = lanes_near_the_arch(rod, lanes)
    numbers = [np.empty(lanes) for _ in range(5)]
    index = np.empty(lanes, np.int64)
    outputs = (np.empty_like(z), numbers[0], np.empty_like(z), numbers[1], numbers[2], index)
    shared = (
        rod.mechanics.layout.stiffness,
        rod.mechanics.layout.ends,
        rod.mesh.weights,
        rod.mechanics.loads,
    )
    inputs = (z, p, dp, row, np.ones(lanes), np.zeros(lanes))
    benchmark.pedantic(
        advance_lanes,
        (*shared, *inputs, *outputs, *numbers[3:]),
        rounds=40,
        iterations=max(1, 4096 // lanes // 4),
        warmup_rounds=2,
    )
    record(benchmark, rod, lanes, float(numbers[2].max()))


@pytest.mark.parametrize("lanes", [100, 4096])
@pytest.mark.parametrize("what", ["index", "margin"])
def bench_stability_in_space(benchmark, what, lanes):
    """Lateral index and margin, with as many threads as there are."""
    rod = Rod(torsion=0.77, lateral=1.0)
    z, p, _, _ = lanes_near_the_arch(rod, lanes)
    ask = getattr(rod.out_of_plane(), what)
    benchmark.pedantic(ask, (z, p), rounds=20, warmup_rounds=2)
    record(benchmark, rod, lanes)


@pytest.mark.parametrize("lanes", [100, 4096])
def bench_newton_step_through_the_contract(benchmark, lanes):
    """With checks and allocation, and as many threads as there are."""
    rod = Rod()
    z, p, dp, row = lanes_near_the_arch(rod, lanes)
    arguments = (z, p, dp, row, np.ones(lanes), np.zeros(lanes))
    step = benchmark.pedantic(rod.advance, arguments, rounds=60, warmup_rounds=2)
    record(benchmark, rod, lanes, float(step.residual.max()))


@pytest.mark.parametrize("lanes", [100, 4096])
def bench_largest_curvature_on_one_thread(benchmark, lanes):
    rod = Rod()
    z, p, _, _ = lanes_near_the_arch(rod, lanes)
    shared = rod.mechanics.recovery.extremum_data
    largest, place = np.empty(lanes), np.empty(lanes)
    benchmark.pedantic(largest_lanes, (*shared, z, p, largest, place), rounds=60, warmup_rounds=2)
    record(benchmark, rod, lanes)


@pytest.mark.parametrize("lanes", [100, 4096])
def bench_general_bordered_solve(benchmark, lanes):
    """The plain route of extended systems and margins: one bordered column, two right sides."""
    rod = Rod()
    z, p, _, row = lanes_near_the_arch(rod, lanes)
    border = (row[:, None], row[:, None], np.zeros((lanes, 1, 1)))
    rhs = np.ones((lanes, 2, rod.size + 1))
    benchmark.pedantic(rod.solve, (z, p, rhs, border), rounds=10, warmup_rounds=1)
    record(benchmark, rod, lanes)


def bench_dense_bordered_solve(benchmark):
    """The fall-back of lanes with an unsafe pivot."""
    rod, lanes = Rod(), 100
    z, p, _, row = lanes_near_the_arch(rod, lanes)
    full = rod.mechanics.layout.dense(*rod.mechanics.kkt(z, p))
    rhs = np.ones((lanes, 2, rod.size + 1))
    arguments = (full, row[:, None], row[:, None], np.zeros((lanes, 1, 1)), rhs)
    benchmark.pedantic(solve_bordered, arguments, rounds=5, warmup_rounds=1)
    record(benchmark, rod, lanes)


@pytest.mark.parametrize("lanes", [100, 4096])
@pytest.mark.parametrize("what", ["residual", "parameter_derivative", "second_derivative"])
def bench_derivatives(benchmark, what, lanes):
    """Parts of extended systems, through the contract."""
    rod = Rod()
    z, p, dp, row = lanes_near_the_arch(rod, lanes)
    arguments = {
        "residual": (),
        "parameter_derivative": (dp,),
        "second_derivative": ((row, dp), (row, dp)),
    }[what]
    benchmark.pedantic(getattr(rod, what), (z, p, *arguments), rounds=30, warmup_rounds=1)
    record(benchmark, rod, lanes)


@pytest.mark.parametrize("points", [1, 101])
def bench_fields(benchmark, points):
    """A height between vertices, and a shape to draw."""
    rod, lanes = Rod(), 4096
    z, p, _, _ = lanes_near_the_arch(rod, lanes)
    s = np.linspace(0.05, 0.95, points)
    benchmark.pedantic(rod.fields, (z, p, s), rounds=10, warmup_rounds=1)
    record(benchmark, rod, lanes)


def bench_natural_states(benchmark):
    """10⁴ natural states over the box of limit-load maps."""
    rod, generator = Rod(), np.random.default_rng(0)
    p = generator.uniform((0.2, -1.5, 0.0, 0.84), (2.0, 1.5, 0.0, 0.85), (10_000, 4))
    benchmark.pedantic(rod.natural_states, (p,), rounds=3, warmup_rounds=1)
    record(benchmark, rod, len(p))
