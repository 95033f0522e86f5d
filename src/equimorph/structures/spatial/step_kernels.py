"""Compiled Newton step of a rod in space, a vector of lanes at a time.

Lengths of quaternions are eliminated at the nodes (`node_kernels`), inner nodes in their elements
(`element_kernels`), vertices along the chain (`chain_kernels`); what remains are three closures
and the load.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.condensed_kernels import pivot_ratio, write_determinant
from equimorph.linalg.kernels import FLAGS, INNER, read_lanes, solve_lanes, write_lanes
from equimorph.linalg.simd import LANES, absolute, load, spread, store, where_less, work_rows
from equimorph.structures.spatial.chain_kernels import (
    SHARES,
    SYSTEM,
    balance_pivots,
    complete_vertex,
    eliminate_vertex,
    note_closures,
    note_pivot,
    restore_inner,
    restore_vertex,
    small_system,
    spring_vertices,
    to_vertices,
)
from equimorph.structures.spatial.element_kernels import assemble_element, reduce_rows
from equimorph.structures.spatial.force_kernels import BORDER
from equimorph.structures.spatial.node_kernels import (
    COUNT,
    DEFECT,
    LARGE,
    PUSH,
    RADII,
    SMALL,
    SUM,
    SUMS,
    TOTAL,
    WORST,
    add_products,
    complete_inner,
    finish_nodes,
    force_node,
    hold_end,
    mix,
    normalise,
    read_scalars,
    turn_forces,
    turn_held,
)


@njit(**INNER)
def start_closures(
    closing_table, scalars, rates, compliance, pulls, closing, closing_rates, compliant
):
    """Closures before the sum over nodes, their rates by the parameters and by themselves.

    compliant: nine rows.
    """
    for a in range(3):
        value = mix(a, closing_table, scalars)
        for c in range(3):
            value = value + spread(compliance[a, c]) * load(pulls, c)
        store(closing, a, value)
        store(closing_rates, a, mix(a, closing_table, rates))
        for c in range(3):
            store(compliant, 3 * a + c, spread(compliance[a, c]))


@njit(**INNER)
def hold_axes(axes, compliant):
    """Leave −1 on the diagonal of coordinates without a closure, nothing else."""
    for a in range(3):
        for c in range(3):
            if axes[a] < 0 or axes[c] < 0:
                store(compliant, 3 * a + c, spread(-1.0 if a == c else 0.0))


@njit(**INNER)
def clear_block(vertices, products, extremes):
    """Reset what elements and pivots are added to."""
    zero = spread(0.0)
    for i in range(vertices.shape[0]):
        store(vertices, i, zero)
    for i in range(products.shape[0]):
        store(products, i, zero)
    store(extremes, SMALL, spread(np.inf))
    store(extremes, LARGE, zero)
    store(extremes, TOTAL, zero)


@njit(**FLAGS)
def element_work(order, gradient):
    """Work arrays of `assemble_element`."""
    more = (
        work_rows(9), work_rows(3), work_rows(3), work_rows(3), work_rows(3), work_rows(3),
        work_rows(3), work_rows(3), work_rows(3), work_rows(3),
    )  # fmt: skip
    return (
        work_rows(4 * order * order), work_rows(4 * order), work_rows(order),
        work_rows(9 * order * order), gradient, work_rows(3), more,
    )  # fmt: skip


@njit(**FLAGS)
def advance_lanes(
    places, slopes, weights, stiff, moments, moment_picks, torsion, torsion_picks, forces,
    force_picks, tension, tension_picks, softness, turned, held, axes, closing_table, compliance,
    lengths, z, p, dp, row, corner, defect, springs, forces_now, forces_rate,
    dz, dt, tangent_z, tangent_t, residual, index, determinant, ratio,
):  # fmt: skip
    """Fused Newton step, tangent and inertia of a rod; see `structures.contract.Advance`.

    axes: number of the multiplier along x, y, z, or −1; moment rates are left out where nothing
    but forces changes with parameters. springs: none, or of each lane the number of a vertex v and
    w, for a spring ``½ (w·φ_v)²`` that counts in F_z only. forces_now, forces_rate: none, or what F
    is on the curve, and its rate. Entries of z behind the closures, and those of the results, are
    passed over.
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
    row_pulls, given, sums, extremes = work_rows(3), work_rows(2), work_rows(SUMS), work_rows(6)
    force, growth, shares = work_rows(4 * nodes + 8), work_rows(4 * nodes + 8), work_rows(2)
    forced = forces_now.shape[1] > 0
    force[:], growth[:], shares[:] = 0.0, 0.0, 0.0
    gradient, compliant, total = work_rows(4 * order), work_rows(9), work_rows(3 * nodes)
    tables = (
        places, slopes, weights, stiff, moments, moment_picks, torsion, torsion_picks, forces,
        force_picks, tension, tension_picks, softness,
    )  # fmt: skip
    work = element_work(order, gradient)
    lowered = work_rows(1)
    lowered[:] = 0.0
    matrix, lower = work_rows((elements * size + 1) * width + 8), work_rows((size + 1) * width)
    pivots, vertices = work_rows(elements * inner), work_rows((elements + 1) * 3 * SHARES)
    ties, products, small = work_rows(elements * 9), work_rows(36), work_rows(24)
    turns, out = work_rows(6 * nodes), work_rows(8 * nodes + 16)
    matrix[:], lower[:] = 0.0, 0.0
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
        clear_block(vertices, products, extremes)
        start_closures(
            closing_table, scalars, rates, compliance, pulls, closing, closing_rates, compliant
        )
        sums[:] = 0.0
        normalise(lengths, lowered, first, stop, q, row_q, radii, extremes, sums)
        if forced:
            read_lanes(forces_now, start * entries, entries, free, force, 4 * first, 1)
            read_lanes(forces_rate, start * entries, entries, free, growth, 4 * first, 1)
            turn_forces(first, stop, q, radii, force, growth, sums)
            for k in range(LANES):
                for c in range(3):
                    if axes[c] >= 0:
                        closing[c, k] -= forces_now[start + k, free + axes[c]]
                        closing_rates[c, k] -= forces_rate[start + k, free + axes[c]]
        store(given, 0, load(given, 0) + load(sums, PUSH))
        store(given, 1, load(given, 1) - load(sums, DEFECT))
        if held[0]:
            hold_end(turned, 0, scalars, rates, q, 0, velocity)
        if held[1]:
            hold_end(turned, 1, scalars, rates, q, nodes - 1, velocity)
        total[:] = 0.0
        for e in range(elements):
            node, base = e * degree, e * size * width
            assemble_element(
                e, tables, width, scalars, rates, pulls, q, matrix, base, closing, closing_rates,
                compliant, total, work,
            )  # fmt: skip
            if e == 0 and held[0]:
                turn_held(order, order - 2, 0, velocity, width, matrix, base, closing_rates)
            if e == elements - 1 and held[1]:
                turn_held(order, order - 1, 1, velocity, width, matrix, base, closing_rates)
            complete_inner(order, node, places, radii, row_q, gradient, width, matrix, base)
            if forced:
                for i in range(order - 2):
                    force_node(
                        node + places[i], radii, force, growth, gradient, 4 * i, matrix,
                        base + 3 * i * width + size, width,
                    )  # fmt: skip
            reduce_rows(inner, size, width, matrix, base, lower, pivots, e * inner)
            for k in range(inner):
                note_pivot(load(pivots, e * inner + k), extremes)
            balance_pivots(extremes)
            add_products(inner, size, width, matrix, base, lower, products)
            to_vertices(e, inner, size, width, matrix, base, BORDER, vertices, ties)
        for v in range(begin, last + 1):
            complete_vertex(v, v * degree, radii, row_q, total, vertices)
            if forced:
                force_node(
                    v * degree, radii, force, growth, total, 3 * v * degree, vertices,
                    3 * v * SHARES + 3, SHARES,
                )  # fmt: skip
        if springs.shape[1] > 0:
            spring_vertices(springs, start, SHARES, vertices)
        for v in range(begin, last + 1):
            eliminate_vertex(v, last, BORDER, BORDER, vertices, ties, products, extremes)
            balance_pivots(extremes)
        hold_axes(axes, compliant)
        small_system(axes, compliant, products, closing, closing_rates, row_pulls, given, small)
        note_closures(small, SYSTEM, extremes)
        solve_lanes(small, 4, 6)
        for v in range(last, begin - 1, -1):
            restore_vertex(v, last, v * degree, (v + 1) * degree, vertices, ties, small, turns)
        for e in range(elements):
            restore_inner(
                inner, size, e * degree, places, width, matrix, e * size * width, pivots,
                e * inner, small, turns,
            )  # fmt: skip
        if forced:
            store(shares, 0, load(small, 3 * SYSTEM + 4))
            store(shares, 1, load(small, 3 * SYSTEM + 5))
        finish_nodes(first, stop, q, radii, total, turns, force, growth, shares, sums, out)
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
            write_determinant(extremes, k, determinant, at)
            ratio[at] = pivot_ratio(extremes, k)
