"""Inverse kinematics and optima on a ready set of the arch."""

import numpy as np
import pytest

import equimorph as em


@pytest.fixture(scope="module")
def arch_set() -> em.EquilibriumSet:
    arch = em.Rod()
    return em.equilibrium_set(
        arch,
        em.Box(Theta=(0.2, 2.5), Delta=(-2, 2)),
        fixed={"q": 2.5},
        within=[arch.max_curvature <= 20],
        intervals=(24, 41),
        checks=0,
    )


def bench_one_shape(benchmark, arch_set):
    """All solutions of two heights."""
    arch = arch_set.structure
    targets = {arch.height(1 / 3): 0.15, arch.height(2 / 3): 0.14}
    found = benchmark(em.solve_shape, arch_set, targets)
    benchmark.extra_info["solutions"] = len(found)


def bench_two_hundred_shapes(benchmark, arch_set):
    """All solutions of 200 pairs of heights."""
    arch = arch_set.structure
    heights = arch.height(1 / 3), arch.height(2 / 3)
    picked = np.random.default_rng(0).integers(0, len(arch_set.points), 200)
    targets = {each: each(arch_set.points)[picked] for each in heights}
    found = benchmark(em.solve_shapes, arch_set, targets)
    benchmark.extra_info["solutions"] = sum(map(len, found))


def bench_optimum(benchmark, arch_set):
    """Least max |κ| of the uniform arch."""
    found = benchmark(em.optimise, arch_set, arch_set.structure.max_curvature)
    benchmark.extra_info["residual"] = found.best.certificate.residual
