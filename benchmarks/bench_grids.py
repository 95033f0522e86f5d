"""Frames in space by their number of pieces: construction, and a step with tangent and index."""

import numpy as np
import pytest

import equimorph as em

LANES = 8


def grid(columns: int, rows: int) -> em.SpatialFrame:
    """Rods along x that are hinged to rods along y, pinned at their ends."""
    joints = {
        f"j{i}x{j}": (float(i), float(j), 0.0)
        for i in range(columns + 2)
        for j in range(rows + 2)
        if 0 < i <= columns or 0 < j <= rows
    }
    along = [[f"j{i}x{j}" for i in range(columns + 2)] for j in range(1, rows + 1)]
    across = [[f"j{i}x{j}" for j in range(rows + 2)] for i in range(1, columns + 1)]
    members = [em.SpatialMember(rod, EA=2000.0) for rod in along]
    for rod in across:
        hinges = dict.fromkeys(rod[1:-1], (0.0, 0.0, 1.0))
        members.append(em.SpatialMember(rod, EA=2000.0, hinges=hinges))
    ends = [rod[k] for rod in (*along, *across) for k in (0, -1)]
    crossings = [joint for joint in joints if joint not in ends]
    return em.SpatialFrame(
        joints, members, dict.fromkeys(ends, "pinned"),
        {"w": dict.fromkeys(crossings, (0.0, 0.0, 1.0))}, elements=1, degree=5,
    )  # fmt: skip


@pytest.mark.parametrize(("columns", "rows"), [(2, 2), (3, 3), (4, 5), (6, 7)])
def bench_step_of_a_grid(benchmark, columns, rows):
    frame = grid(columns, rows)
    z, p = frame.natural_guess(np.zeros((LANES, 1))), np.zeros((LANES, 1))
    row, one = np.zeros_like(z), np.ones(LANES)
    step = benchmark(frame.advance, z, p, np.ones_like(p), row, one, one)
    benchmark.extra_info["pieces"], benchmark.extra_info["size"] = frame.model.pieces, frame.size
    assert np.isfinite(step.dz).all()


@pytest.mark.parametrize(("columns", "rows"), [(2, 2), (6, 7)])
def bench_construction_of_a_grid(benchmark, columns, rows):
    assert benchmark(grid, columns, rows).model.pieces > 0
