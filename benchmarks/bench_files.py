"""Saving and loading a set of 100 000 vertices: the arch at q = 2.5 on 199 × 339 intervals."""

import platform

import pytest

from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.model import Box
from equimorph.storage import load_set, save_set
from equimorph.structures import Rod


@pytest.fixture(scope="module")
def large_set() -> EquilibriumSet:
    arch = Rod()
    return equilibrium_set(
        arch,
        Box(Theta=(0.2, 2.5), Delta=(-2, 2)),
        fixed={"q": 2.5},
        within=[arch.max_curvature <= 20],
        intervals=(199, 339),
        checks=0,
    )


def note(benchmark, eset: EquilibriumSet, path) -> None:
    benchmark.extra_info.update(
        machine=platform.processor() or platform.machine(),
        vertices=len(eset.points),
        cells=len(eset.cells),
        megabytes=path.stat().st_size / 1e6,
    )


def bench_save(benchmark, large_set, tmp_path):
    path = tmp_path / "set.h5"
    benchmark.pedantic(save_set, (path, large_set), rounds=5, warmup_rounds=1)
    note(benchmark, large_set, path)


def bench_load(benchmark, large_set, tmp_path):
    path = save_set(tmp_path / "set.h5", large_set)
    back = benchmark.pedantic(load_set, (path,), rounds=5, warmup_rounds=1)
    note(benchmark, back, path)
