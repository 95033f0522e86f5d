"""Compiled forces and stiffness of frames in space, a vector of lanes at a time.

Elements are those of `element_kernels`.
"""

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER, read_lanes, write_lanes
from equimorph.linalg.simd import LANES, load, spread, store, work_rows
from equimorph.structures.space_frame.element_kernels import (
    add_to,
    bend,
    fill_moments,
    fill_turns,
    mirror,
    pull,
    relate,
    scale_general,
    turn_moments,
)
from equimorph.structures.space_frame.node_kernels import (
    finish_nodes,
    hinge_turns,
    lean_on_parent,
    set_turns,
    turn_held,
    vector_sums,
)
from equimorph.structures.spatial.element_kernels import stiffen


@njit(**INNER)
def scatter(
    order, width, count, dofs, slots, edges, corners, ties, numbers, start, held_rates, gradient,
    rates, matrix, border, sums, force, turn, entries,
):  # fmt: skip
    """Add what an element contributes to forces, their rates, and the entries.

    dofs: number of each of its coordinates; below 0: held by number −2 − dof, or −1: none.
    """
    size = 3 * order + 2
    for a in range(size):
        if dofs[a] < -1:
            rate = load(held_rates, -2 - dofs[a])
            for b in range(size):
                add_to(rates, b, load(matrix, b * width + a) * rate)
            for c in range(3):
                add_to(sums, 3 + c, spread(0.0) - load(border, 3 * a + c) * rate)
    for a in range(size):
        if dofs[a] < 0:
            continue
        add_to(force, dofs[a], load(gradient, a))
        add_to(turn, dofs[a], load(rates, a))
        for b in range(a + 1):
            if dofs[b] >= 0:
                add_to(entries, slots[a, b], load(matrix, a * width + b))
        for r in range(ties):
            total = spread(0.0)
            for c in range(3):
                if start[r, c] != 0.0:
                    total = total + spread(start[r, c]) * load(border, 3 * a + c)
            add_to(entries, edges[r, a], total)
    for r in range(ties):
        work, change = spread(0.0), spread(0.0)
        for c in range(3):
            work = work + spread(start[r, c]) * load(sums, c)
            change = change + spread(start[r, c]) * load(sums, 3 + c)
        add_to(force, count + numbers[r], spread(0.0) - work)
        add_to(turn, count + numbers[r], spread(0.0) - change)
        for q in range(r + 1):
            total = spread(0.0)
            for c in range(3):
                for d in range(3):
                    size_of = start[r, c] * start[q, d]
                    if size_of != 0.0:
                        high, low = max(c, d), min(c, d)
                        at = 6 + high * (high + 1) // 2 + low
                        total = total + spread(size_of) * load(sums, at)
            if corners[r, q] >= 0:
                add_to(entries, corners[r, q], spread(0.0) - total)


@njit(**FLAGS)
def linearise_lanes(
    turns_of_held, nodes, owner, derivative, inverse, weights, tangents, arclengths, stiff,
    moment_of_strain, soft, counts, ties, numbers, start, drop, strains, elongation, free,
    place, held, hinged, parents, hinge_axes, hinges_of, lengths, masses, dofs, slots, edges,
    corners, node_slots, quadratic_at, quadratic_by, constant, z, p, dp, shift, residual,
    column, entries,
):  # fmt: skip
    """F, F_p·dp and the entries of F_z − shift·mass after the lengths; see `Tables`."""
    lanes, size = z.shape
    elements, order = nodes.shape
    width, given, length = 3 * order + 2, p.shape[1], entries.shape[1]
    unknown, hinges = len(free), len(hinged)
    count, multipliers = 3 * unknown + hinges, size - 4 * unknown - hinges
    scalar_count = multipliers + given + 1
    y, dy, rows = work_rows(scalar_count), work_rows(scalar_count), work_rows(size)
    w, radii, turned = (
        work_rows(4 * len(place)),
        work_rows(2 * unknown + 2),
        work_rows(4 * hinges + 4),
    )
    held_q, held_v = work_rows(4 * len(held) + 4), work_rows(3 * len(held) + 3)
    relative, sums_of, strain = (
        work_rows(4 * order * order),
        work_rows(4 * order),
        work_rows(3 * order),
    )
    turns, scaled = work_rows(4 * order * order), work_rows(9 * order * order)
    moment, change = work_rows(3 * order), work_rows(3 * order)
    gradient, rates = work_rows(width + 3), work_rows(width)
    matrix, border, sums = work_rows(width * width), work_rows(3 * width), work_rows(12)
    force, turn = work_rows(count + multipliers), work_rows(count + multipliers)
    values, own, own_rate, moved = work_rows(length), work_rows(4), work_rows(4), work_rows(1)
    for block in range(0, lanes, LANES):
        lane = min(block, lanes - LANES)
        read_lanes(z, lane * size, size, size, rows, 0, 1)
        dy[:] = 0.0
        read_lanes(p, lane * given, given, given, y, multipliers, 1)
        read_lanes(dp, lane * given, given, given, dy, multipliers, 1)
        for c in range(multipliers):
            store(y, c, load(rows, size - multipliers + c))
        store(y, scalar_count - 1, spread(1.0))
        turn_held(turns_of_held, multipliers, y, dy, held_q, held_v)
        read_lanes(shift, lane, 1, 1, moved, 0, 1)
        set_turns(free, held, rows, held_q, w, radii)
        hinge_turns(hinged, parents, hinge_axes, 4 * unknown, rows, w, turned)
        force[:] = 0.0
        turn[:] = 0.0
        for e in range(length):
            store(values, e, spread(constant[e]))
        for e in range(elements):
            k = owner[e]
            vector_sums(strains[k], multipliers, y, dy, own, own_rate)
            vector_sums(elongation[k], multipliers, y, dy, sums, border)
            stretch, slack = spread(1.0) + load(sums, 0), load(border, 0)
            matrix[:], border[:], sums[:], gradient[:], rates[:] = 0.0, 0.0, 0.0, 0.0, 0.0
            relate(e, nodes, derivative, inverse[e], w, relative, sums_of, strain)
            fill_turns(order, derivative, inverse[e], relative, sums_of, turns)
            fill_moments(
                e, order, weights, stiff, moment_of_strain, strain, own, own_rate, moment, change
            )
            bend(order, moment, change, turns, gradient, rates)
            scale_general(e, order, weights, stiff, turns, scaled)
            stiffen(order, width, turns, scaled, matrix, 0)
            mirror(3 * order, width, matrix)
            turn_moments(order, width, derivative, inverse[e], relative, strain, moment, matrix)
            pull(
                e, order, width, nodes, weights, tangents, arclengths, soft[k], counts[k], ties[k],
                numbers[k], start[k], drop[k], y, dy, w, stretch, slack, gradient, rates, matrix,
                border, sums,
            )  # fmt: skip
            for side in range(2):
                h = hinges_of[e, side]
                if h >= 0:
                    lean_on_parent(
                        side, order, width, h, hinge_axes, turned, gradient, rates, matrix, border
                    )
            scatter(
                order, width, count, dofs[e], slots[e], edges[e], corners[k], ties[k], numbers[k],
                start[k], held_v, gradient, rates, matrix, border, sums, force, turn, values,
            )  # fmt: skip
        for i in range(len(quadratic_by)):
            row, at = quadratic_at[i, 0], quadratic_at[i, 1]
            add_to(force, count + row, spread(quadratic_by[i]) * load(y, at))
            add_to(turn, count + row, spread(quadratic_by[i]) * load(dy, at))
        finish_nodes(free, lengths, masses, node_slots, moved, radii, force, values)
        for i in range(hinges + multipliers):
            store(rows, 4 * unknown + i, load(force, 3 * unknown + i))
        _write_nodes(free, w, radii, force, lengths, rows)
        write_lanes(rows, 0, 1, residual, lane * size, size, size)
        for i in range(hinges + multipliers):
            store(rows, 4 * unknown + i, load(turn, 3 * unknown + i))
        _write_rates(free, w, radii, turn, rows)
        write_lanes(rows, 0, 1, column, lane * size, size, size)
        write_lanes(values, 0, 1, entries, lane * length, length, length)


@njit(**INNER)
def _write_rates(free, w, radii, change, rows):
    """Rates of the slopes by quaternions, from those by rotations."""
    for i in range(len(free)):
        at, scale = 4 * free[i], spread(2.0) * load(radii, 2 * i + 1)
        w0, w1, w2, w3 = load(w, at), load(w, at + 1), load(w, at + 2), load(w, at + 3)
        c1, c2, c3 = load(change, 3 * i), load(change, 3 * i + 1), load(change, 3 * i + 2)
        store(rows, 4 * i, spread(0.0) - scale * (w1 * c1 + w2 * c2 + w3 * c3))
        store(rows, 4 * i + 1, scale * (w0 * c1 + w2 * c3 - w3 * c2))
        store(rows, 4 * i + 2, scale * (w0 * c2 + w3 * c1 - w1 * c3))
        store(rows, 4 * i + 3, scale * (w0 * c3 + w1 * c2 - w2 * c1))


@njit(**INNER)
def _write_nodes(free, w, radii, force, lengths, rows):
    """Slopes of L by quaternions, that of their lengths included."""
    _write_rates(free, w, radii, force, rows)
    for i in range(len(free)):
        size = load(radii, 2 * i)
        push = spread(0.5 * lengths[i]) * (size * size - spread(1.0)) * size
        for c in range(4):
            add_to(rows, 4 * i + c, push * load(w, 4 * free[i] + c))
