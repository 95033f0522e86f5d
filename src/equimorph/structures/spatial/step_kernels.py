"""Compiled Newton step of a rod in space, eight lanes at a time.

Lengths of quaternions are eliminated at the nodes (`node_kernels`), inner nodes in their elements
(`element_kernels`), vertices along the chain (`chain_kernels`); what remains are three closures
and the load.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.condensed_kernels import pivot_ratio
from equimorph.linalg.kernels import FLAGS, INNER, read_lanes, solve_lanes, write_lanes
from equimorph.linalg.simd import LANES, absolute, load, spread, store, where_less, work_rows
from equimorph.structures.spatial.chain_kernels import (
    SHARES,
    SYSTEM,
    complete_vertex,
    eliminate_vertex,
    note_closures,
    note_pivot,
    restore_inner,
    restore_vertex,
    small_system,
    to_vertices,
)
from equimorph.structures.spatial.element_kernels import (
    BORDER,
    add_moment_rates,
    own_moments,
    pair_moments,
    pull_nodes,
    reduce_rows,
    relate,
    stiffen,
)
from equimorph.structures.spatial.node_kernels import (
    COUNT,
    DEFECT,
    LARGE,
    PRODUCT,
    RADII,
    SMALL,
    SUM,
    TOTAL,
    WORST,
    add_products,
    complete_inner,
    finish_nodes,
    hold_end,
    mix,
    normalise,
    read_scalars,
    turn_held,
)


@njit(**INNER)
def _start_block(closing_table, scalars, rates, compliance, pulls, closing, closing_rates, sums):
    """Closures before the sum over nodes, and their rates by the parameters themselves."""
    zero = spread(0.0)
    for a in range(3):
        value = mix(a, closing_table, scalars)
        for c in range(3):
            value = value + spread(compliance[a, c]) * load(pulls, c)
        store(closing, a, value)
        store(closing_rates, a, mix(a, closing_table, rates))
    store(sums, WORST, zero)
    store(sums, SUM, zero)


@njit(**INNER)
def _clear_block(vertices, products, extremes):
    """Reset what elements and pivots are added to."""
    zero = spread(0.0)
    for i in range(vertices.shape[0]):
        store(vertices, i, zero)
    for i in range(products.shape[0]):
        store(products, i, zero)
    store(extremes, SMALL, spread(np.inf))
    store(extremes, LARGE, zero)
    store(extremes, TOTAL, zero)


@njit(**INNER)
def _keep_slopes(order, first, places, gradient, slopes):
    """Add an element's ∂L/∂φ to its nodes."""
    for i in range(order):
        to = 3 * (first + places[i])
        for k in range(3):
            store(slopes, to + k, load(slopes, to + k) + load(gradient, 4 * i + k))


@njit(**FLAGS)
def advance_lanes(
    places, slopes, weights, stiff, moments, moment_picks, torsion, torsion_picks, forces,
    force_picks, turned, held, axes, closing_table, compliance, lengths,
    z, p, dp, row, corner, defect,
    dz, dt, tangent_z, tangent_t, residual, index, determinant, ratio,
):  # fmt: skip
    """Fused Newton step, tangent and inertia of a rod; see `structures.contract.Advance`.

    axes: number of the multiplier along x, y, z, or −1; moment rates are left out where nothing
    but forces changes with parameters.
    """
    elements, order = slopes.shape[0], slopes.shape[1]
    degree, size, inner = order - 1, 3 * order, 3 * (order - 2)
    width = (size + BORDER + 3) // 4 * 4
    nodes, lanes, entries = elements * degree + 1, z.shape[0], z.shape[1]
    first, stop = held[0], nodes - held[1]
    begin, last = held[0], elements - held[1]
    free = 4 * (stop - first)
    q, row_q, radii = work_rows(4 * nodes + 8), work_rows(4 * nodes + 8), work_rows(RADII * nodes)
    scalars, rates = work_rows(p.shape[1] + 1), work_rows(p.shape[1] + 1)
    velocity, pulls, closing, closing_rates = (
        work_rows(6), work_rows(3), work_rows(3), work_rows(3)
    )  # fmt: skip
    row_pulls, given, sums, extremes = work_rows(3), work_rows(2), work_rows(3), work_rows(5)
    relative, strains, gradient = (
        work_rows(4 * order * order), work_rows(4 * order), work_rows(4 * order)
    )  # fmt: skip
    jacobian, scaled = work_rows((size + 1) * width), work_rows((size + 1) * width)
    twists, three, total = work_rows(order), work_rows(3), work_rows(3 * nodes)
    matrix, lower = work_rows((elements * size + 1) * width + 8), work_rows((size + 1) * width)
    pivots, vertices = work_rows(elements * inner), work_rows((elements + 1) * 3 * SHARES)
    ties, products, small = work_rows(elements * 9), work_rows(36), work_rows(24)
    turns, out = work_rows(6 * nodes), work_rows(8 * nodes + 16)
    jacobian[:], scaled[:], matrix[:], lower[:] = 0.0, 0.0, 0.0, 0.0
    turns[:] = 0.0
    for block in range(0, lanes, LANES):
        start = min(block, lanes - LANES)
        read_scalars(p, dp, start, scalars, rates)
        read_lanes(z, start * entries, entries, free, q, 4 * first, 1)
        read_lanes(row, start * entries, entries, free, row_q, 4 * first, 1)
        for k in range(LANES):
            at = start + k
            for c in range(3):
                there = axes[c] >= 0
                pulls[c, k] = z[at, free + axes[c]] if there else 0.0
                row_pulls[c, k] = row[at, free + axes[c]] if there else 0.0
            given[0, k], given[1, k] = corner[at], defect[at]
        _clear_block(vertices, products, extremes)
        _start_block(closing_table, scalars, rates, compliance, pulls, closing, closing_rates, sums)
        normalise(lengths, first, stop, q, row_q, radii, extremes, sums)
        store(given, 1, load(given, 1) - load(sums, DEFECT))
        if held[0]:
            hold_end(turned, 0, scalars, rates, q, 0, velocity)
        if held[1]:
            hold_end(turned, 1, scalars, rates, q, nodes - 1, velocity)
        total[:] = 0.0
        for e in range(elements):
            node, base = e * degree, e * size * width
            relate(e, order, node, places, slopes, q, relative, strains)
            own_moments(
                e, order, stiff, moments, moment_picks, torsion, torsion_picks, scalars, slopes,
                strains, twists, jacobian, width, gradient, three,
            )  # fmt: skip
            pair_moments(
                e, order, slopes, relative, strains, jacobian, width, gradient, matrix, base
            )
            pull_nodes(
                e, order, node, places, weights, forces, force_picks, scalars, rates, pulls, q,
                gradient, width, matrix, base, three, closing,
            )  # fmt: skip
            _keep_slopes(order, node, places, gradient, total)
            stiffen(
                e, order, width, stiff, torsion, torsion_picks, scalars, jacobian, scaled, matrix,
                base,
            )  # fmt: skip
            if len(moment_picks) > 0 or len(torsion_picks) > 0:
                add_moment_rates(
                    e, order, width, moments, moment_picks, torsion, torsion_picks, rates, twists,
                    jacobian, matrix, base, three,
                )  # fmt: skip
            if e == 0 and held[0]:
                turn_held(order, order - 2, 0, velocity, width, matrix, base, closing_rates)
            if e == elements - 1 and held[1]:
                turn_held(order, order - 1, 1, velocity, width, matrix, base, closing_rates)
            complete_inner(order, node, places, radii, row_q, gradient, width, matrix, base)
            reduce_rows(inner, size, width, matrix, base, lower, pivots, e * inner)
            for k in range(inner):
                note_pivot(load(pivots, e * inner + k), extremes)
            add_products(inner, size, width, matrix, base, lower, products)
            to_vertices(e, inner, size, width, matrix, base, vertices, ties)
        for v in range(begin, last + 1):
            complete_vertex(v, v * degree, radii, row_q, total, vertices)
        for v in range(begin, last + 1):
            eliminate_vertex(v, last, vertices, ties, products, extremes)
        small_system(axes, compliance, products, closing, closing_rates, row_pulls, given, small)
        note_closures(small, extremes)
        solve_lanes(small, 4, 6)
        for v in range(last, begin - 1, -1):
            restore_vertex(v, last, v * degree, (v + 1) * degree, vertices, ties, small, turns)
        for e in range(elements):
            restore_inner(
                inner, size, e * degree, places, width, matrix, e * size * width, pivots,
                e * inner, small, turns,
            )  # fmt: skip
        finish_nodes(first, stop, q, radii, total, turns, sums, out)
        for c in range(3):
            if axes[c] >= 0:
                at = 2 * (4 * stop + axes[c])
                store(out, at, load(small, c * SYSTEM + 4))
                store(out, at + 1, load(small, c * SYSTEM + 5))
                gap = absolute(load(closing, c))
                worst = load(sums, WORST)
                store(sums, WORST, where_less(worst, gap, gap, worst))
                store(sums, SUM, load(sums, SUM) + gap)
        write_lanes(out, 8 * first, 2, dz, start * entries, entries, entries)
        write_lanes(out, 8 * first + 1, 2, tangent_z, start * entries, entries, entries)
        for k in range(LANES):
            at, whole = start + k, sums[SUM, k]
            dt[at], tangent_t[at] = small[3 * SYSTEM + 4, k], small[3 * SYSTEM + 5, k]
            residual[at] = sums[WORST, k] if whole == whole else np.nan  # noqa: PLR0124
            index[at] = np.int64(extremes[COUNT, k]) - 3
            determinant[at], ratio[at] = extremes[PRODUCT, k], pivot_ratio(extremes, k)
