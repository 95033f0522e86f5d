"""Compiled kernels of the general rod, a vector of lanes at a time.

The Lagrangian is that of `model.RodModel`, its tables those of `packed.Packed`; `points` are the
nodes of every element, `nodes` those of the rod. At least eight lanes; where these are not a
multiple of eight the last block overlaps the one before.
"""

from equimorph.linalg.compiled import njit
from equimorph.linalg.coupled_kernels import coupled_arrays
from equimorph.linalg.kernels import FLAGS, INNER, read_lanes, write_lanes
from equimorph.linalg.simd import (
    LANES,
    entry,
    load,
    load2,
    repeat2,
    row_of,
    sincos,
    spread,
    store,
    work_rows,
)
from equimorph.structures.rod.pressure_kernels import (
    dot,
    enclosed_area,
    press_block,
    press_second,
)


@njit(**INNER)
def read_state(z, p, start, first, n, m, one, turned, theta, scalars):
    """Fill a block with nodal angles and scalars of lanes; `one` is 0 for directions.

    theta has as many rows as the rod has nodes; its unknown ones begin at `first`.
    """
    size, count = n + m, p.shape[1]
    last = theta.shape[0] - 1
    read_lanes(z, start * size, size, n, theta, first, 1)
    read_lanes(z, start * size + n, size, m, scalars, 0, 1)
    read_lanes(p, start * count, count, count, scalars, m, 1)
    store(scalars, m + count, spread(one))
    if first > 0:
        store(theta, 0, _mixed(turned, 0, scalars))
    if first + n <= last:
        store(theta, last, _mixed(turned, 1, scalars))


@njit(**INNER)
def _mixed(table, row, scalars):
    """Row of a table times the scalars."""
    total = spread(0.0)
    for j in range(table.shape[1]):
        total = total + spread(table[row, j]) * load(scalars, j)
    return total


@njit(**INNER)
def _pick(scalars, picks, picked, place, step):
    """Write the scalars that tables have coefficients of, `step` rows apart from `place` on."""
    for r in range(len(picks)):
        store(picked, place + r * step, load(scalars, picks[r]))


@njit(**INNER)
def _combined(table, at, count, picked, row):
    """Entries of a table from flat position `at` on, times picked scalars from `row` on."""
    total = spread(0.0)
    for r in range(count):
        total = total + spread(entry(table, at + r)) * load(picked, row + r)
    return total


@njit(**INNER)
def _combined_pair(table, at, count, picked, row):
    """As `_combined`, for a state and a velocity whose scalars alternate in `picked`."""
    total = repeat2(spread(0.0))
    for r in range(count):
        total = total + repeat2(spread(entry(table, at + r))) * load2(picked, 2 * (row + r))
    return total


@njit(**INNER)
def _add(target, row, value):
    store(target, row, load(target, row) + value)


@njit(**INNER)
def _bend(stiffness, theta, force):
    """Add K θ."""
    elements, order = stiffness.shape[0], stiffness.shape[1]
    for e in range(elements):
        base = e * (order - 1)
        for i in range(0, order, 2):
            other = min(i + 1, order - 1)
            first, second = spread(0.0), spread(0.0)
            for j in range(order):
                angle = load(theta, base + j)
                first = first + spread(stiffness[e, i, j]) * angle
                second = second + spread(stiffness[e, other, j]) * angle
            _add(force, base + i, first)
            if other > i:
                _add(force, base + other, second)


@njit(**INNER)
def _turn_ends(stiffness, velocity, turn):
    """Add K times the velocities of the two ends, zero where they are unknown."""
    elements, order = stiffness.shape[0], stiffness.shape[1]
    left, right = load(velocity, 0), load(velocity, 1)
    last = (elements - 1) * (order - 1)
    for i in range(order):
        _add(turn, i, spread(stiffness[0, i, 0]) * left)
        _add(turn, last + i, spread(stiffness[elements - 1, i, order - 1]) * right)


@njit(**INNER)
def _write(rows, first, n, m, constraints, target, start):
    """Put m constraints behind n unknown nodes and write both; rows has m rows to spare."""
    for c in range(m):
        store(rows, first + n + c, load(constraints, c))
    write_lanes(rows, first, 1, target, start * (n + m), n + m, n + m)


@njit(**INNER)
def assemble_block(
    stiffness, points, softness, slope, picks, splits, quadratic, turned, first, coupling, pressure,
    z, p, dp, start, theta, scalars, velocity, picked, own, ends, force, turn, curved, edges,
    closure, moved, corner, arrays,
):  # fmt: skip
    """F, F_p·dp and F_z of a block of lanes from `start` on.

    force, turn (nodes + m): forces and their change by dp; curved (nodes): diagonal beside the
    stiffness; edges (m · nodes): gradients of the constraints; closure, moved (m): constraints and
    their change; corner (m · m): the trailing block. picked (2 · picks) and own (2 m) are work;
    arrays: those of `coupled_arrays`, of which a rod under pressure has the first three filled.
    """
    elements, order = stiffness.shape[0], stiffness.shape[1]
    nodes, m, count = theta.shape[0], closure.shape[0], len(quadratic)
    n, zero = z.shape[1] - m, spread(0.0)
    read_state(z, p, start, first, n, m, 1.0, turned, theta, scalars)
    for j in range(m):
        store(velocity, j, zero)
    read_lanes(dp, start * (count - 1 - m), count - 1 - m, count - 1 - m, velocity, m, 1)
    store(velocity, count - 1, zero)
    store(ends, 0, _mixed(turned, 0, velocity))
    store(ends, 1, _mixed(turned, 1, velocity))
    _pick(scalars, picks, picked, 0, 2)
    _pick(velocity, picks, picked, 1, 2)
    bends = slope.shape[1]
    for i in range(nodes):
        pair = _combined_pair(slope, i * bends, bends, picked, splits[2])
        store(force, i, zero - row_of(pair, 0))
        store(turn, i, zero - row_of(pair, 1))
        store(curved, i, zero)
    edges[:] = 0.0
    for c in range(m):
        store(closure, c, _mixed(quadratic, c, scalars))
        store(moved, c, _mixed(quadratic, c, velocity))
        for d in range(m):
            store(corner, c * m + d, spread(quadratic[c, d]))
    across, along, pulled, width = splits[0], splits[1], splits[2], points.shape[1]
    for e in range(elements):
        for i in range(order):
            node, point = e * (order - 1) + i, e * order + i
            at = point * width
            s, c = sincos(load(theta, node))
            k = spread(entry(softness, point))
            # of the loads; forces of the supports, which a velocity has none of, follow
            a = _combined_pair(points, at + m, across - m, picked, m)
            b = _combined_pair(points, at + across + m, along - across - m, picked, across + m)
            pull = _combined_pair(points, at + along, pulled - along, picked, along)
            rate = row_of(a, 1) * s + row_of(b, 1) * c + row_of(pull, 1)
            normal = row_of(a, 0) * s + row_of(b, 0) * c
            shear = row_of(a, 0) * c - row_of(b, 0) * s
            for j in range(m):
                sj, cj = spread(entry(points, at + j)), spread(entry(points, at + across + j))
                force_j, straight, turned_j = load(scalars, j), sj * s + cj * c, sj * c - cj * s
                normal, shear = normal + force_j * straight, shear + force_j * turned_j
                store(own, 2 * j, straight)
                store(own, 2 * j + 1, turned_j)
            stretch = spread(1.0) - k * (normal + row_of(pull, 0))
            soft = k * shear
            _add(force, node, stretch * shear)
            _add(curved, node, zero - normal * stretch - soft * shear)
            _add(turn, node, stretch * (row_of(a, 1) * c - row_of(b, 1) * s) - soft * rate)
            for j in range(m):
                straight = load(own, 2 * j)
                _add(edges, j * nodes + node, stretch * load(own, 2 * j + 1) - soft * straight)
                _add(closure, j, stretch * straight)
                straight = k * straight
                _add(moved, j, zero - rate * straight)
                for d in range(j + 1):
                    _add(corner, j * m + d, zero - straight * load(own, 2 * d))
    for j in range(m):
        change = load(edges, j * nodes) * load(ends, 0)
        change = change + load(edges, j * nodes + nodes - 1) * load(ends, 1)
        _add(moved, j, change)
        for d in range(j):
            store(corner, d * m + j, load(corner, j * m + d))
    _bend(stiffness, theta, force)
    _turn_ends(stiffness, ends, turn)
    if coupling[0].shape[0] > 0:
        press_block(
            coupling, pressure, theta, scalars, velocity, ends, arrays[0], arrays[1], arrays[2],
            force, turn, curved,
        )  # fmt: skip


@njit(**FLAGS)
def linearise_lanes(
    stiffness, points, softness, slope, picks, splits, quadratic, turned, first, coupling, pressure,
    z, p, dp, residual, column, diagonal, border, trailing,
):  # fmt: skip
    """F, F_p·dp and the parts of F_z of every lane.

    diagonal (lanes, nodes) beside the stiffness; border (lanes, m, nodes), gradients of the
    constraints; trailing (lanes, m, m).
    """
    nodes, m = diagonal.shape[1], border.shape[1]
    n, count = z.shape[1] - m, len(quadratic)
    theta, scalars, velocity = work_rows(nodes), work_rows(count), work_rows(count)
    picked, own = work_rows(2 * len(picks)), work_rows(2 * m)
    ends, corner = work_rows(2), work_rows(m * m)
    force, turn, curved = work_rows(nodes + m), work_rows(nodes + m), work_rows(nodes)
    edges, closure, moved = work_rows(m * nodes), work_rows(m), work_rows(m)
    arrays = coupled_arrays(coupling[0].shape[0], stiffness.shape[1] - 2, 0)
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        assemble_block(
            stiffness, points, softness, slope, picks, splits, quadratic, turned, first, coupling,
            pressure, z, p, dp, start, theta, scalars, velocity, picked, own, ends, force, turn,
            curved, edges, closure, moved, corner, arrays,
        )  # fmt: skip
        write_lanes(curved, 0, 1, diagonal, start * nodes, nodes, nodes)
        write_lanes(edges, 0, 1, border, start * m * nodes, m * nodes, m * nodes)
        _write(force, first, n, m, closure, residual, start)
        _write(turn, first, n, m, moved, column, start)
        for k in range(LANES):
            for j in range(m):
                for d in range(m):
                    trailing[start + k, j, d] = corner[j * m + d, k]


@njit(**INNER)
def _acting(points, splits, at, picked, row):
    """Forces of a point along its sine and its cosine, and the pull of cables."""
    across, along, pulled = splits[0], splits[1], splits[2]
    a = _combined(points, at, across, picked, row)
    b = _combined(points, at + across, along - across, picked, row + across)
    return a, b, _combined(points, at + along, pulled - along, picked, row + along)


@njit(**FLAGS)
def second_lanes(
    points, softness, picks, splits, turned, elements, m, first, coupling, pressure,
    z, p, v_z, v_p, w_z, w_p, out,
):  # fmt: skip
    """D²F[v, w] of every lane."""
    order, width = len(softness) // elements, points.shape[1]
    nodes, n = elements * (order - 1) + 1, z.shape[1] - m
    count, picks_each = turned.shape[1], len(picks)
    theta, scalars, picked = work_rows(nodes), work_rows(count), work_rows(3 * picks_each)
    v, w = work_rows(nodes), work_rows(nodes)
    force, closure, zero = work_rows(nodes + m), work_rows(m), spread(0.0)
    cosine, sine, sums, pulls = work_rows(nodes), work_rows(nodes), work_rows(32), work_rows(3)
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        read_state(z, p, start, first, n, m, 1.0, turned, theta, scalars)
        _pick(scalars, picks, picked, 0, 1)
        store(pulls, 0, dot(pressure, scalars))
        read_state(v_z, v_p, start, first, n, m, 0.0, turned, v, scalars)
        _pick(scalars, picks, picked, picks_each, 1)
        store(pulls, 1, dot(pressure, scalars))
        read_state(w_z, w_p, start, first, n, m, 0.0, turned, w, scalars)
        _pick(scalars, picks, picked, 2 * picks_each, 1)
        store(pulls, 2, dot(pressure, scalars))
        force[:] = 0.0
        closure[:] = 0.0
        for e in range(elements):
            for i in range(order):
                node, point = e * (order - 1) + i, e * order + i
                at = point * width
                s, c = sincos(load(theta, node))
                k, dv, dw = spread(softness[point]), load(v, node), load(w, node)
                a, b, pull = _acting(points, splits, at, picked, 0)
                normal, shear = a * s + b * c, a * c - b * s
                a, b, v_pull = _acting(points, splits, at, picked, picks_each)
                v_normal, v_shear = a * s + b * c, a * c - b * s
                a, b, w_pull = _acting(points, splits, at, picked, 2 * picks_each)
                w_normal, w_shear = a * s + b * c, a * c - b * s
                # second change of N and of N', then first changes of N + T and N'
                normal_vw = v_shear * dw + w_shear * dv - normal * dv * dw
                shear_vw = zero - shear * dv * dw - v_normal * dw - w_normal * dv
                shear_v, shear_w = v_shear - normal * dv, w_shear - normal * dw
                normal_v, normal_w = v_normal + shear * dv + v_pull, w_normal + shear * dw + w_pull
                stretch = spread(1.0) - k * (normal + pull)
                mixed = normal_v * shear_w + normal_w * shear_v + shear * normal_vw
                _add(force, node, stretch * shear_vw - k * mixed)
                for j in range(m):
                    sj = spread(entry(points, at + j))
                    cj = spread(entry(points, at + splits[0] + j))
                    own, across = sj * s + cj * c, sj * c - cj * s
                    mixed = across * (normal_v * dw + normal_w * dv) + own * normal_vw
                    _add(closure, j, zero - stretch * own * dv * dw - k * mixed)
        if coupling[0].shape[0] > 0:
            press_second(coupling, theta, v, w, pulls, cosine, sine, sums, force)
        _write(force, first, n, m, closure, out, start)


@njit(**FLAGS)
def energy_lanes(
    stiffness, points, softness, slope, picks, splits, quadratic, turned, first, coupling, pressure,
    z, p, energy,
):  # fmt: skip
    """L of every lane without the multipliers' part, which is λ·∂L/∂λ."""
    elements, order = stiffness.shape[0], stiffness.shape[1]
    nodes, count = elements * (order - 1) + 1, len(quadratic)
    m, width, bends, half = count - 1 - p.shape[1], points.shape[1], slope.shape[1], spread(0.5)
    n, zero = z.shape[1] - m, spread(0.0)
    theta, scalars, picked = work_rows(nodes), work_rows(count), work_rows(len(picks))
    cosine, sine, bent, sums = work_rows(nodes), work_rows(nodes), work_rows(nodes), work_rows(1)
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        read_state(z, p, start, first, n, m, 1.0, turned, theta, scalars)
        _pick(scalars, picks, picked, 0, 1)
        bent[:] = 0.0
        _bend(stiffness, theta, bent)
        total = zero
        for i in range(nodes):
            couple = _combined(slope, i * bends, bends, picked, splits[2])
            total = total + load(theta, i) * (half * load(bent, i) - couple)
        for e in range(elements):
            for i in range(order):
                point = e * order + i
                at = point * width
                s, c = sincos(load(theta, e * (order - 1) + i))
                a, b, pull = _acting(points, splits, at, picked, 0)
                normal, held, k = a * s + b * c, zero, spread(softness[point])
                for j in range(m):
                    sj = spread(entry(points, at + j))
                    cj = spread(entry(points, at + splits[0] + j))
                    held = held + load(scalars, j) * (sj * s + cj * c)
                strain = k * (normal + pull)
                total = total + normal - half * strain * (normal + pull)
                total = total - (spread(1.0) - strain) * held
        for i in range(count):
            square = half * load(scalars, i) * _mixed(quadratic, i, scalars)
            total = total + (zero - square if i < m else square)
        if coupling[0].shape[0] > 0:
            area = enclosed_area(coupling, theta, cosine, sine)
            total = total - dot(pressure, scalars) * area
        store(sums, 0, total)
        for k in range(LANES):
            energy[start + k] = sums[0, k]
