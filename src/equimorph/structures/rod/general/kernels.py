"""Compiled kernels of the general rod, eight lanes at a time.

The Lagrangian is that of `model.RodModel`; tables have one row per scalar (multipliers, parameters,
1) and one column per node of every element (`points`) or per node of the rod. At least eight lanes;
where these are not a multiple of eight the last block overlaps the one before.
"""

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER, read_lanes, write_lanes
from equimorph.linalg.simd import LANES, load, sincos, spread, store, work_rows


@njit(**INNER)
def read_state(z, p, start, first, n, m, one, turned, theta, scalars):
    """Fill a block with nodal angles and scalars of lanes; `one` is 0 for directions.

    theta has as many rows as the rod has nodes; its unknown ones begin at `first`.
    """
    size, count = n + m, p.shape[1]
    last = theta.shape[0] - 1
    read_lanes(z, start * size, size, n, theta, first, 1)
    for k in range(LANES):
        for c in range(m):
            scalars[c, k] = z[start + k, n + c]
        for j in range(count):
            scalars[m + j, k] = p[start + k, j]
        scalars[m + count, k] = one
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
def _combined(table, rows, at, scalars):
    """Column of a table times the scalars; other rows than `rows` are zero."""
    total = spread(0.0)
    for r in range(len(rows)):
        total = total + spread(table[rows[r], at]) * load(scalars, rows[r])
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
    stiffness, sine, cosine, tension, softness, slope, sine_rows, cosine_rows, tension_rows,
    slope_rows, quadratic, turned, first, z, p, dp, start, theta, scalars, velocity, ends,
    force, turn, curved, edges, closure, moved, corner,
):  # fmt: skip
    """F, F_p·dp and F_z of a block of lanes from `start` on.

    force, turn (nodes + m): forces and their change by dp; curved (nodes): diagonal beside the
    stiffness; edges (m · nodes): gradients of the constraints; closure, moved (m): constraints and
    their change; corner (m · m): the trailing block.
    """
    elements, order = stiffness.shape[0], stiffness.shape[1]
    nodes, m, count = theta.shape[0], closure.shape[0], len(quadratic)
    n, zero = z.shape[1] - m, spread(0.0)
    read_state(z, p, start, first, n, m, 1.0, turned, theta, scalars)
    for k in range(LANES):
        for j in range(count):
            inside = m <= j < count - 1
            velocity[j, k] = dp[start + k, j - m] if inside else 0.0
    store(ends, 0, _mixed(turned, 0, velocity))
    store(ends, 1, _mixed(turned, 1, velocity))
    for i in range(nodes):
        store(force, i, zero - _combined(slope, slope_rows, i, scalars))
        store(turn, i, zero - _combined(slope, slope_rows, i, velocity))
        store(curved, i, zero)
    edges[:] = 0.0
    for c in range(m):
        store(closure, c, _mixed(quadratic, c, scalars))
        store(moved, c, _mixed(quadratic, c, velocity))
        for d in range(m):
            store(corner, c * m + d, spread(quadratic[c, d]))
    for e in range(elements):
        for i in range(order):
            node, at = e * (order - 1) + i, e * order + i
            s, c = sincos(load(theta, node))
            k = spread(softness[at])
            a = _combined(sine, sine_rows, at, scalars)
            b = _combined(cosine, cosine_rows, at, scalars)
            normal, shear = a * s + b * c, a * c - b * s
            stretch = spread(1.0) - k * (normal + _combined(tension, tension_rows, at, scalars))
            soft = k * shear
            a = _combined(sine, sine_rows, at, velocity)
            b = _combined(cosine, cosine_rows, at, velocity)
            change = a * s + b * c + _combined(tension, tension_rows, at, velocity)
            _add(force, node, stretch * shear)
            _add(curved, node, zero - normal * stretch - soft * shear)
            _add(turn, node, stretch * (a * c - b * s) - soft * change)
            for j in range(m):
                sj, cj = spread(sine[j, at]), spread(cosine[j, at])
                own = sj * s + cj * c
                _add(edges, j * nodes + node, stretch * (sj * c - cj * s) - soft * own)
                _add(closure, j, stretch * own)
                _add(moved, j, zero - k * change * own)
                for d in range(m):
                    other = spread(sine[d, at]) * s + spread(cosine[d, at]) * c
                    _add(corner, j * m + d, zero - k * own * other)
    for j in range(m):
        change = load(edges, j * nodes) * load(ends, 0)
        change = change + load(edges, j * nodes + nodes - 1) * load(ends, 1)
        _add(moved, j, change)
    _bend(stiffness, theta, force)
    _turn_ends(stiffness, ends, turn)


@njit(**FLAGS)
def linearise_lanes(
    stiffness, sine, cosine, tension, softness, slope, sine_rows, cosine_rows, tension_rows,
    slope_rows, quadratic, turned, first, z, p, dp, residual, column, diagonal, border, trailing,
):  # fmt: skip
    """F, F_p·dp and the parts of F_z of every lane.

    diagonal (lanes, nodes) beside the stiffness; border (lanes, m, nodes), gradients of the
    constraints; trailing (lanes, m, m).
    """
    nodes, m = diagonal.shape[1], border.shape[1]
    n, count = z.shape[1] - m, len(quadratic)
    theta, scalars, velocity = work_rows(nodes), work_rows(count), work_rows(count)
    ends, corner = work_rows(2), work_rows(m * m)
    force, turn, curved = work_rows(nodes + m), work_rows(nodes + m), work_rows(nodes)
    edges, closure, moved = work_rows(m * nodes), work_rows(m), work_rows(m)
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        assemble_block(
            stiffness, sine, cosine, tension, softness, slope, sine_rows, cosine_rows, tension_rows,
            slope_rows, quadratic, turned, first, z, p, dp, start, theta, scalars, velocity, ends,
            force, turn, curved, edges, closure, moved, corner,
        )  # fmt: skip
        write_lanes(curved, 0, 1, diagonal, start * nodes, nodes, nodes)
        write_lanes(edges, 0, 1, border, start * m * nodes, m * nodes, m * nodes)
        _write(force, first, n, m, closure, residual, start)
        _write(turn, first, n, m, moved, column, start)
        for k in range(LANES):
            for j in range(m):
                for d in range(m):
                    trailing[start + k, j, d] = corner[j * m + d, k]


@njit(**FLAGS)
def second_lanes(
    sine, cosine, tension, softness, sine_rows, cosine_rows, tension_rows, turned, elements, m,
    first, z, p, v_z, v_p, w_z, w_p, out,
):  # fmt: skip
    """D²F[v, w] of every lane."""
    order = len(softness) // elements
    nodes, n = elements * (order - 1) + 1, z.shape[1] - m
    count = turned.shape[1]
    theta, scalars = work_rows(nodes), work_rows(count)
    v, v_scalars, w, w_scalars = (
        work_rows(nodes),
        work_rows(count),
        work_rows(nodes),
        work_rows(count),
    )
    force, closure, zero = work_rows(nodes + m), work_rows(m), spread(0.0)
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        read_state(z, p, start, first, n, m, 1.0, turned, theta, scalars)
        read_state(v_z, v_p, start, first, n, m, 0.0, turned, v, v_scalars)
        read_state(w_z, w_p, start, first, n, m, 0.0, turned, w, w_scalars)
        force[:] = 0.0
        closure[:] = 0.0
        for e in range(elements):
            for i in range(order):
                node, at = e * (order - 1) + i, e * order + i
                s, c = sincos(load(theta, node))
                k, dv, dw = spread(softness[at]), load(v, node), load(w, node)
                a = _combined(sine, sine_rows, at, scalars)
                b = _combined(cosine, cosine_rows, at, scalars)
                normal, shear = a * s + b * c, a * c - b * s
                a = _combined(sine, sine_rows, at, v_scalars)
                b = _combined(cosine, cosine_rows, at, v_scalars)
                v_normal, v_shear = a * s + b * c, a * c - b * s
                a = _combined(sine, sine_rows, at, w_scalars)
                b = _combined(cosine, cosine_rows, at, w_scalars)
                w_normal, w_shear = a * s + b * c, a * c - b * s
                # second change of N and of N', then first changes of N + T and N'
                normal_vw = v_shear * dw + w_shear * dv - normal * dv * dw
                shear_vw = zero - shear * dv * dw - v_normal * dw - w_normal * dv
                shear_v, shear_w = v_shear - normal * dv, w_shear - normal * dw
                normal_v = v_normal + shear * dv + _combined(tension, tension_rows, at, v_scalars)
                normal_w = w_normal + shear * dw + _combined(tension, tension_rows, at, w_scalars)
                pull = _combined(tension, tension_rows, at, scalars)
                stretch = spread(1.0) - k * (normal + pull)
                mixed = normal_v * shear_w + normal_w * shear_v + shear * normal_vw
                _add(force, node, stretch * shear_vw - k * mixed)
                for j in range(m):
                    sj, cj = spread(sine[j, at]), spread(cosine[j, at])
                    own, across = sj * s + cj * c, sj * c - cj * s
                    mixed = across * (normal_v * dw + normal_w * dv) + own * normal_vw
                    _add(closure, j, zero - stretch * own * dv * dw - k * mixed)
        _write(force, first, n, m, closure, out, start)
