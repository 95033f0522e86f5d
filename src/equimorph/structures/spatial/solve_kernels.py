"""Compiled bordered solves with F_z of a rod in space, a vector of lanes at a time.

The elimination is that of `step_kernels`, with any columns: those of the closures come first, then
rows and columns of the border, and the right-hand sides. Columns by unknowns of a node are turned
into three by its rotation and one by the length of its quaternion.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.condensed_kernels import pivot_ratio, write_determinant
from equimorph.linalg.kernels import (
    FLAGS,
    INNER,
    factor_symmetric,
    read_lanes,
    solve_lanes,
    write_lanes,
)
from equimorph.linalg.simd import LANES, load, load4, repeat4, spread, store, work_rows
from equimorph.structures.spatial.chain_kernels import (
    balance_pivots,
    close_system,
    eliminate_vertex,
    note_closures,
    note_pivot,
    spring_vertices,
    to_vertices,
)
from equimorph.structures.spatial.element_kernels import assemble_element, reduce_rows
from equimorph.structures.spatial.force_kernels import BORDER
from equimorph.structures.spatial.node_kernels import (
    COUNT,
    INVERSE,
    PRODUCT,
    RADII,
    RADIUS,
    SOFT,
    hold_end,
    normalise,
    read_scalars,
    stretch_of,
    turn_row,
)
from equimorph.structures.spatial.step_kernels import (
    clear_block,
    element_work,
    hold_axes,
    start_closures,
)


@njit(**INNER)
def read_sides(source, start, free, first, stop, q, radii, sides, number):
    """Read the vectors of each lane as columns from `number` on: four rows a node."""
    count, entries, half = source.shape[1], source.shape[2], spread(0.5)
    for c in range(count):
        to = 4 * (stop * (number + c) + first)
        read_lanes(source, (start * count + c) * entries, count * entries, free, sides, to, 1)
        for i in range(first, stop):
            at = 4 * (stop * (number + c) + i)
            scale = half * load(radii, RADII * i + RADIUS)
            store(sides, at + 3, turn_row(q, 4 * i, sides, at, scale))


@njit(**INNER)
def column_of(c, node, stop, k, radii, slopes, sides):
    """Column c of the border at component k of a rotation, without the quaternion's length."""
    at = 4 * (stop * c + node)
    share = load(radii, RADII * node + INVERSE) * load(radii, RADII * node + SOFT)
    return load(sides, at + k) + load(sides, at + 3) * share * load(slopes, 3 * node + k)


@njit(**INNER)
def fill_inner(order, first, stop, places, radii, slopes, count, sides, width, matrix, base):
    """Take the lengths of inner nodes out of an element; write its columns of the border."""
    size, zero = 3 * order, spread(0.0)
    for i in range(order):
        node = first + places[i]
        inverse, soft = load(radii, RADII * node + INVERSE), load(radii, RADII * node + SOFT)
        square, stretch = inverse * inverse * soft, stretch_of(radii, node)
        for k in range(3):
            to = base + (3 * i + k) * width
            for c in range(3, width - size):
                store(matrix, to + size + c, zero)
            if i >= order - 2:  # a vertex: see `fill_vertex`
                continue
            slope = load(slopes, 3 * node + k)
            for j in range(k, 3):
                own = load(matrix, to + 3 * i + j) - square * slope * load(slopes, 3 * node + j)
                store(matrix, to + 3 * i + j, own + stretch if j == k else own)
            for c in range(count):
                value = column_of(c, node, stop, k, radii, slopes, sides)
                store(matrix, to + size + 3 + c, value)


@njit(**INNER)
def fill_vertex(v, node, stop, radii, slopes, count, sides, shares, vertices):
    """Take the length of a vertex out of its rows; add its columns of the border."""
    inverse, soft = load(radii, RADII * node + INVERSE), load(radii, RADII * node + SOFT)
    square, stretch = inverse * inverse * soft, stretch_of(radii, node)
    for k in range(3):
        slope, to = load(slopes, 3 * node + k), (3 * v + k) * shares
        for j in range(k, 3):
            own = load(vertices, to + j) - square * slope * load(slopes, 3 * node + j)
            store(vertices, to + j, own + stretch if j == k else own)
        for c in range(count):
            value = column_of(c, node, stop, k, radii, slopes, sides)
            store(vertices, to + 6 + c, load(vertices, to + 6 + c) + value)


@njit(**INNER)
def multiply_columns(inner, size, width, border, left, matrix, base, lower, products):
    """Add products over the inner rotations of an element: of the first `left` columns with all.

    Rows of products have `border` entries, a multiple of four.
    """
    for a in range(left):
        for c in range(0, border, 4):
            many = load4(products, border * a + c)
            for k in range(inner):
                factor = repeat4(load(lower, k * width + size + a))
                many = many + factor * load4(matrix, base + k * width + size + c)
            store(products, border * a + c, many)


@njit(**INNER)
def multiply_lengths(first, stop, rows, count, border, radii, sides, products):
    """Add products over the lengths of quaternions: of rows with all columns after them."""
    for i in range(first, stop):
        soft = load(radii, RADII * i + SOFT)
        for a in range(rows):
            by = soft * load(sides, 4 * (stop * a + i) + 3)
            for c in range(a, count):
                at = border * (3 + a) + 3 + c
                gain = by * load(sides, 4 * (stop * c + i) + 3)
                store(products, at, load(products, at) + gain)


@njit(**INNER)
def join_system(axes, products, border, k, free, columns, rows, corner, rhs, start, small):
    """Schur system of closures and border, with its right-hand sides; closures are there."""
    size, sides = 3 + k, rhs.shape[1]
    width, m = size + sides, rhs.shape[2] - free - k
    for lane in range(LANES):
        at = start + lane
        for b in range(k):
            for a in range(3):
                here = axes[a] >= 0
                small[a * width + 3 + b, lane] = columns[at, b, free + axes[a]] if here else 0.0
                small[(3 + b) * width + a, lane] = rows[at, b, free + axes[a]] if here else 0.0
            for c in range(k):
                small[(3 + b) * width + 3 + c, lane] = corner[at, b, c]
            for c in range(sides):
                small[(3 + b) * width + size + c, lane] = rhs[at, c, free + m + b]
        for a in range(3):
            for c in range(sides):
                given = rhs[at, c, free + axes[a]] if axes[a] >= 0 else 0.0
                small[a * width + size + c, lane] = given
    for a in range(size):
        if a < 3 and axes[a] < 0:
            continue
        for c in range(0 if a >= 3 else 3, width):
            if c < 3:  # columns: closures, rows, columns and right-hand sides
                product = load(products, border * c + a)
                product = product if axes[c] >= 0 else spread(0.0)
            else:
                product = load(products, border * a + c + k)
            store(small, a * width + c, load(small, a * width + c) - product)


@njit(**INNER)
def note_pinned(small, system, square, extremes):
    """Count negative eigenvalues of closures, condition and spring together; det."""
    for lane in range(LANES):
        for a in range(len(square)):
            for c in range(len(square)):
                square[a, c] = small[a * system + c, lane]
        negative, determinant = factor_symmetric(square)
        extremes[COUNT, lane] += negative
        extremes[PRODUCT, lane] = determinant / extremes[PRODUCT, lane]


@njit(**INNER)
def reduced_side(matrix, at, k, side, small):
    """Reduced column of a right-hand side, less those of closures and border by their results."""
    size = 3 + k
    width = side[1]
    value = load(matrix, at + 3 + 2 * k + side[0])
    for c in range(3):
        value = value - load(matrix, at + c) * load(small, c * width + size + side[0])
    for c in range(k):
        by = load(small, (3 + c) * width + size + side[0])
        value = value - load(matrix, at + 3 + k + c) * by
    return value


@njit(**INNER)
def restore_side(
    k, side, begin, last, shares, vertices, ties, elements, order, width, places, matrix,
    pivots, small, turns,
):  # fmt: skip
    """Back-substitute one side, its number and the width of `small`: three rows a node."""
    size, inner, degree = 3 * order, 3 * (order - 2), order - 1
    for v in range(last, begin - 1, -1):
        node = v * degree
        for r in range(2, -1, -1):
            row = (3 * v + r) * shares
            value = reduced_side(vertices, row + 3, k, side, small)
            for j in range(r + 1, 3):
                value = value - load(vertices, row + j) * load(turns, 3 * node + j)
            if v < last:
                for j in range(3):
                    tie = load(ties, 9 * v + 3 * r + j)
                    value = value - tie * load(turns, 3 * (node + degree) + j)
            store(turns, 3 * node + r, value * load(vertices, row + r))
    for e in range(elements):
        base, first = e * size * width, e * degree
        for i in range(inner - 1, -1, -1):
            row = base + i * width
            value = reduced_side(matrix, row + size, k, side, small)
            for j in range(i + 1, size):
                at = 3 * (first + places[j // 3]) + j % 3
                value = value - load(matrix, row + j) * load(turns, at)
            store(turns, 3 * (first + places[i // 3]) + i % 3, value * load(pivots, e * inner + i))


@njit(**INNER)
def write_side(first, stop, k, side, q, radii, slopes, sides, small, turns, out):
    """Changes of the quaternions of one solution, four rows a node."""
    half, size, width = spread(0.5), 3 + k, side[1]
    for i in range(first, stop):
        q0, q1, q2, q3 = load(q, 4 * i), load(q, 4 * i + 1), load(q, 4 * i + 2), load(q, 4 * i + 3)
        radius, inverse = load(radii, RADII * i + RADIUS), load(radii, RADII * i + INVERSE)
        w0, w1, w2 = load(turns, 3 * i), load(turns, 3 * i + 1), load(turns, 3 * i + 2)
        grow = load(slopes, 3 * i) * w0 + load(slopes, 3 * i + 1) * w1
        grow = inverse * (grow + load(slopes, 3 * i + 2) * w2)
        grow = grow + load(sides, 4 * (stop * (2 * k + side[0]) + i) + 3)
        for c in range(k):
            by = load(small, (3 + c) * width + size + side[0])
            grow = grow - load(sides, 4 * (stop * (k + c) + i) + 3) * by
        grow = grow * load(radii, RADII * i + SOFT)
        w0, w1, w2 = half * radius * w0, half * radius * w1, half * radius * w2
        store(out, 4 * i, grow * q0 - w0 * q1 - w1 * q2 - w2 * q3)
        store(out, 4 * i + 1, grow * q1 + w0 * q0 - w1 * q3 + w2 * q2)
        store(out, 4 * i + 2, grow * q2 + w0 * q3 + w1 * q0 - w2 * q1)
        store(out, 4 * i + 3, grow * q3 - w0 * q2 + w1 * q1 + w2 * q0)


@njit(**FLAGS)
def solve_bordered_lanes(
    places, slopes, weights, stiff, moments, moment_picks, torsion, torsion_picks, forces,
    force_picks, tension, tension_picks, softness, turned, held, axes, closing_table, compliance,
    lengths, z, p, shift, springs, columns, rows, corner, rhs, x, negative, determinant, ratio,
):  # fmt: skip
    """Solve ``[F_z − shift·mass C; R D] x = rhs``; see `linalg.dense.BorderedSolution`.

    columns, rows (lanes, k, size); corner (lanes, k, k); rhs, x (lanes, sides, size + k); shift: by
    half the stiffness of a length over the mass.

    springs: none, or of each lane the number of a vertex v and w, for a spring ``½ (w·φ_v)²``. It
    makes F_z regular that a condition makes so. The first column of the border is then that of the
    condition, the second w·φ_v with 1 in the corner, which takes the spring out again: inertia and
    determinant are those of F_z with the condition.
    """
    elements, order = slopes.shape[0], slopes.shape[1]
    k, many, entries = columns.shape[1], rhs.shape[1], z.shape[1]
    degree, size, inner, count = order - 1, 3 * order, 3 * (order - 2), 2 * k + many
    border = (max(3 + count, BORDER) + 3) // 4 * 4
    width = (size + 3) // 4 * 4 + border
    nodes, left, shares = elements * degree + 1, 3 + k, 3 + border
    first, stop = held[0], nodes - held[1]
    begin, last = held[0], elements - held[1]
    free, system = 4 * (stop - first), 3 + k + many
    q, none, radii = work_rows(4 * nodes + 8), work_rows(4 * nodes + 8), work_rows(RADII * nodes)
    scalars, rates = work_rows(p.shape[1] + 1), work_rows(p.shape[1] + 1)
    velocity, pulls, closing = work_rows(6), work_rows(3), work_rows(3)
    closing_rates, sums, extremes = work_rows(3), work_rows(3), work_rows(6)
    gradient, compliant, total = work_rows(4 * order), work_rows(9), work_rows(3 * nodes)
    tables = (
        places, slopes, weights, stiff, moments, moment_picks, torsion, torsion_picks, forces,
        force_picks, tension, tension_picks, softness,
    )  # fmt: skip
    work = element_work(order, gradient)
    matrix, lower = work_rows((elements * size + 1) * width + 8), work_rows((size + 1) * width)
    pivots, vertices = work_rows(elements * inner), work_rows((elements + 1) * 3 * shares)
    ties, products = work_rows(elements * 9), work_rows(left * border)
    small, turns = work_rows((3 + k) * system), work_rows(3 * nodes)
    square = np.empty((5, 5))
    sides, out, lowered = work_rows(4 * stop * max(count, 1)), work_rows(4 * nodes), work_rows(1)
    matrix[:], lower[:], none[:] = 0.0, 0.0, 0.0
    lanes = z.shape[0]
    for block in range(0, lanes, LANES):
        start = min(block, lanes - LANES)
        read_scalars(p, p, start, scalars, rates)
        rates[:], total[:], turns[:], sums[:], sides[:] = 0.0, 0.0, 0.0, 0.0, 0.0
        read_lanes(z, start * entries, entries, free, q, 4 * first, 1)
        for lane in range(LANES):
            at = start + lane
            lowered[0, lane] = shift[at]
            for c in range(3):
                pulls[c, lane] = z[at, free + axes[c]] if axes[c] >= 0 else 0.0
        clear_block(vertices, products, extremes)
        start_closures(
            closing_table, scalars, rates, compliance, pulls, closing, closing_rates, compliant
        )
        normalise(lengths, lowered, first, stop, q, none, radii, extremes, sums)
        read_sides(rows, start, free, first, stop, q, radii, sides, 0)
        read_sides(columns, start, free, first, stop, q, radii, sides, k)
        read_sides(rhs, start, free, first, stop, q, radii, sides, 2 * k)
        for side in range(2):
            if held[side]:
                hold_end(turned, side, scalars, rates, q, side * (nodes - 1), velocity)
        for e in range(elements):
            base = e * size * width
            assemble_element(
                e, tables, width, scalars, rates, pulls, q, matrix, base, closing, closing_rates,
                compliant, total, work,
            )  # fmt: skip
            fill_inner(
                order, e * degree, stop, places, radii, total, count, sides, width, matrix, base
            )
            reduce_rows(inner, size, width, matrix, base, lower, pivots, e * inner)
            for i in range(inner):
                note_pivot(load(pivots, e * inner + i), extremes)
            balance_pivots(extremes)
            multiply_columns(inner, size, width, border, left, matrix, base, lower, products)
            to_vertices(e, inner, size, width, matrix, base, border, vertices, ties)
        for v in range(begin, last + 1):
            fill_vertex(v, v * degree, stop, radii, total, count, sides, shares, vertices)
        if springs.shape[1] > 0:
            spring_vertices(springs, start, shares, vertices)
        for v in range(begin, last + 1):
            eliminate_vertex(v, last, border, left, vertices, ties, products, extremes)
            balance_pivots(extremes)
        multiply_lengths(first, stop, k, count, border, radii, sides, products)
        hold_axes(axes, compliant)
        close_system(axes, compliant, products, border, system, small)
        join_system(axes, products, border, k, free, columns, rows, corner, rhs, start, small)
        if springs.shape[1] > 0:
            note_pinned(small, system, square, extremes)
        else:
            note_closures(small, system, extremes)
        solve_lanes(small, 3 + k, system)
        for c in range(many):
            side = (c, system)
            restore_side(
                k, side, begin, last, shares, vertices, ties, elements, order, width, places,
                matrix, pivots, small, turns,
            )  # fmt: skip
            write_side(first, stop, k, side, q, radii, total, sides, small, turns, out)
            wide = rhs.shape[2]
            position = (start * many + c) * wide
            write_lanes(out, 4 * first, 1, x, position, many * wide, free)
            for lane in range(LANES):
                for a in range(3):
                    if axes[a] >= 0:
                        value = small[a * system + 3 + k + c, lane]
                        x[start + lane, c, free + axes[a]] = value
                for b in range(k):
                    value = small[(3 + b) * system + 3 + k + c, lane]
                    x[start + lane, c, entries + b] = value
        for lane in range(LANES):
            at = start + lane
            negative[at] = np.int64(extremes[COUNT, lane])
            write_determinant(extremes, lane, determinant, at)
            ratio[at] = pivot_ratio(extremes, lane)
