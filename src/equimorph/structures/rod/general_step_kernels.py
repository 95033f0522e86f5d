"""Compiled kernel of the fused Newton step of general rods, a vector of lanes at a time."""

import numpy as np

from equimorph.linalg.bordered_kernels import (
    close_border,
    reduce_block,
    restore_pair,
    row_of_column,
    subtract_products,
    tiles_of,
)
from equimorph.linalg.compiled import njit
from equimorph.linalg.condensed_kernels import TILE, pivot_ratio, work_arrays, write_determinant
from equimorph.linalg.coupled_kernels import coupled_arrays
from equimorph.linalg.kernels import FLAGS, INNER, read_lanes, solve_lanes, write_lanes
from equimorph.linalg.simd import LANES, absolute, load, spread, store, where_less, work_rows
from equimorph.structures.rod.general_kernels import assemble_block

COLUMNS, SIDES = np.int64(1), np.int64(2)
"""One column borders F_z; step and tangent are solved side by side."""


@njit(**INNER)
def _fill_columns(m, first, n, nodes, force, turn, edges, work):
    """Write the constraints' gradients, F_p·dp and −F into their slots; the tangent's is zero."""
    zero = spread(0.0)
    for i in range(nodes):
        for c in range(m):
            store(work, row_of_column(c, i, nodes), load(edges, c * nodes + i))
        known = i < first or i >= first + n
        store(work, row_of_column(m, i, nodes), zero if known else load(turn, i))
        pull = zero if known else zero - load(force, i)
        store(work, row_of_column(m + COLUMNS, i, nodes), pull)
        store(work, row_of_column(m + COLUMNS + 1, i, nodes), zero)


@njit(**INNER)
def _fill_small(m, closure, moved, corner, row, inner, defect, start, n, small):
    """Rows of the multipliers and the closing row, with their two right-hand sides."""
    width, zero = m + COLUMNS + SIDES, spread(0.0)
    for a in range(m):
        for b in range(m):
            store(small, a * width + b, load(corner, a * m + b))
        store(small, a * width + m, load(moved, a))
        store(small, a * width + m + 1, zero - load(closure, a))
        store(small, a * width + m + 2, zero)
    store(small, m * width + m + 2, spread(1.0))
    for k in range(LANES):
        at = start + k
        for b in range(m):
            small[m * width + b, k] = row[at, n + b]
        small[m * width + m, k] = inner[at]
        small[m * width + m + 1, k] = -defect[at]


@njit(**INNER)
def _largest(force, closure, first, n, m):
    """Largest residual; not a number if one of them is not, which comparisons would pass over."""
    worst, total = spread(0.0), spread(0.0)
    for i in range(first, first + n):
        size = absolute(load(force, i))
        worst, total = where_less(worst, size, size, worst), total + size
    for c in range(m):
        size = absolute(load(closure, c))
        worst, total = where_less(worst, size, size, worst), total + size
    return worst + (total - total)


@njit(**FLAGS)
def advance_lanes(
    ends, stiffness, points, softness, slope, picks, splits, quadratic, turned, first, coupling,
    pressure, z, p, dp, row, corner, defect,
    dz, dt, tangent_z, tangent_t, residual, index, determinant, ratio,
):  # fmt: skip
    """Newton step, tangent and inertia of every lane; see `structures.contract.Advance`."""
    elements, inner = stiffness.shape[0], stiffness.shape[1] - 2
    nodes, count = elements * (inner + 1) + 1, len(quadratic)
    m = count - 1 - p.shape[1]
    size, n = z.shape[1], z.shape[1] - m
    border, width, tiles = m + COLUMNS, m + COLUMNS + SIDES, tiles_of(m, COLUMNS, SIDES)
    theta, scalars, velocity = work_rows(nodes), work_rows(count), work_rows(count)
    moving, trailing = work_rows(2), work_rows(m * m)
    picked, own = work_rows(2 * len(picks)), work_rows(2 * m)
    force, turn, curved = work_rows(nodes + m), work_rows(nodes + m), work_rows(nodes)
    edges, closure, moved = work_rows(m * nodes), work_rows(m), work_rows(m)
    lower, vertices, work, extremes = work_arrays(elements, inner, tiles)
    arrays = coupled_arrays(coupling[0].shape[0], inner, tiles)
    left, products = work_rows(border * nodes), work_rows(border * tiles * TILE)
    small, solution, square = (
        work_rows(border * width),
        work_rows(2 * (nodes + m)),
        np.empty((m, m)),
    )
    worst = work_rows(1)
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        assemble_block(
            stiffness, points, softness, slope, picks, splits, quadratic, turned, first, coupling,
            pressure, z, p, dp, start, theta, scalars, velocity, picked, own, moving, force, turn,
            curved, edges, closure, moved, trailing, arrays,
        )  # fmt: skip
        store(worst, 0, _largest(force, closure, first, n, m))
        _fill_columns(m, first, n, nodes, force, turn, edges, work)
        at = row_of_column(width, first, nodes)
        read_lanes(row, start * size, size, n, work, at, TILE)
        reduce_block(
            stiffness, ends, coupling, arrays, curved, m, COLUMNS, SIDES, lower, vertices, work,
            extremes, left, products,
        )  # fmt: skip
        _fill_small(m, closure, moved, trailing, row, corner, defect, start, n, small)
        subtract_products(products, tiles, border, width, small)
        close_border(small, m, width, square, extremes)
        solve_lanes(small, border, width)
        restore_pair(
            stiffness, ends, coupling, arrays, border, width, 0, 1, lower, vertices, work, small,
            solution,
        )  # fmt: skip
        for c in range(m):
            store(solution, 2 * (first + n + c), load(small, c * width + border))
            store(solution, 2 * (first + n + c) + 1, load(small, c * width + border + 1))
        write_lanes(solution, 2 * first, 2, dz, start * size, size, size)
        write_lanes(solution, 2 * first + 1, 2, tangent_z, start * size, size, size)
        for k in range(LANES):
            at = start + k
            dt[at], tangent_t[at] = small[m * width + border, k], small[m * width + border + 1, k]
            residual[at], index[at] = worst[0, k], np.int64(extremes[0, k]) - m
            write_determinant(extremes, k, determinant, at)
            ratio[at] = pivot_ratio(extremes, k)
