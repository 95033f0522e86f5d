"""Compiled kernels of pressure on a rod: its part of F, F_p·dp and F_z, lanes in vectors.

The area is that of `pressure.EnclosedArea` with a symmetric part of zero and real weights m. With
tangents u = c + i s at the nodes, d = Σ m u, and p the pressure, ``∂V/∂θ_i = −c_i (W c)_i −
s_i (W s)_i − m_i Im(q d u_i)``; for i ≠ j ``∂²V/∂θ_i∂θ_j = W_ij (c_i s_j − s_i c_j) −
m_i m_j Re(q u_i u_j)``. Lanes are at least as many as a vector has, see `general_kernels`.
"""

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER, read_lanes, write_lanes
from equimorph.linalg.simd import LANES, load, sincos, spread, store, work_rows
from equimorph.structures.rod.general_kernels import read_state


@njit(**INNER)
def _tangents(theta, nodes, cosine, sine):
    """Write cos θ and sin θ of all nodes."""
    for i in range(nodes):
        s, c = sincos(load(theta, i))
        store(sine, i, s)
        store(cosine, i, c)


@njit(**INNER)
def _dot(row, scalars):
    """Pressure, or its change, of scalars."""
    total = spread(0.0)
    for j in range(len(row)):
        total = total + spread(row[j]) * load(scalars, j)
    return total


@njit(**INNER)
def _times(re, im, x, y):
    """Product of a number and vectors, as real and imaginary part."""
    return spread(re) * x - spread(im) * y, spread(re) * y + spread(im) * x


@njit(**FLAGS)
def press_lanes(
    matrix, weights, closed, pressure, turned, first, z, p, dp, residual, column, diagonal
):
    """What pressure adds to F and F_p·dp of the unknown angles, and to the diagonal of F_z."""
    nodes, n, count = len(weights), residual.shape[1], len(pressure)
    m, last = z.shape[1] - n, len(weights) - 1
    theta, cosine, sine = work_rows(nodes), work_rows(nodes), work_rows(nodes)
    scalars, moved = work_rows(count), work_rows(count)
    force, change, own = work_rows(n), work_rows(n), work_rows(n)
    ends = work_rows(2)
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        read_state(z, p, start, first, n, m, 1.0, turned, theta, scalars)
        moved[:] = 0.0
        read_lanes(dp, start * dp.shape[1], dp.shape[1], dp.shape[1], moved, m, 1)
        _tangents(theta, nodes, cosine, sine)
        pull, growth = _dot(pressure, scalars), _dot(pressure, moved)
        store(ends, 0, _dot(turned[0], moved) if first > 0 else spread(0.0))
        store(ends, 1, _dot(turned[1], moved) if first + n <= last else spread(0.0))
        x, y, dx, dy = spread(0.0), spread(0.0), spread(0.0), spread(0.0)
        for j in range(nodes):
            x = x + spread(weights[j]) * load(cosine, j)
            y = y + spread(weights[j]) * load(sine, j)
        for k in range(2):
            at, by = k * last, load(ends, k)
            dx = dx - spread(weights[at]) * by * load(sine, at)
            dy = dy + spread(weights[at]) * by * load(cosine, at)
        re, im = _times(closed[0], closed[1], x, y)
        d_re, d_im = _times(closed[0], closed[1], dx, dy)
        for i in range(n):
            node = first + i
            c, s, weight = load(cosine, node), load(sine, node), spread(weights[node])
            along, across = spread(0.0), spread(0.0)
            for j in range(nodes):
                along = along + spread(matrix[node, j]) * load(cosine, j)
                across = across + spread(matrix[node, j]) * load(sine, j)
            work = spread(0.0) - c * along - s * across - weight * (re * s + im * c)
            turn = spread(0.0) - weight * (d_re * s + d_im * c)
            for k in range(2):
                at = k * last
                arm = c * load(sine, at) - s * load(cosine, at)
                turn = turn + spread(matrix[node, at]) * load(ends, k) * arm
            square_re, square_im = c * c - s * s, spread(2.0) * c * s
            bent, _ = _times(closed[0], closed[1], square_re, square_im)
            bend = s * along - c * across - weight * (weight * bent + re * c - im * s)
            store(force, i, spread(0.0) - pull * work)
            store(change, i, spread(0.0) - pull * turn - growth * work)
            store(own, i, spread(0.0) - pull * bend)
        write_lanes(force, 0, 1, residual, start * n, n, n)
        write_lanes(change, 0, 1, column, start * n, n, n)
        write_lanes(own, 0, 1, diagonal, start * n, n, n)


@njit(**FLAGS)
def press_entries(
    matrix, weights, closed, pressure, turned, first, stiffness, z, p, diagonal, border, trailing,
    entries,
):  # fmt: skip
    """Lower triangle of F_z, row by row: of the unknown angles, then of the multipliers.

    stiffness: of the unknown angles; diagonal (lanes, n), border (lanes, m, n) and trailing (lanes,
    m, m) are the other terms, that of the pressure on the diagonal among these.
    """
    nodes, n, m = len(weights), diagonal.shape[1], border.shape[1]
    theta, cosine, sine = work_rows(nodes), work_rows(nodes), work_rows(nodes)
    scalars, own, total = work_rows(len(pressure)), work_rows(n), entries.shape[1]
    rows, close = work_rows(total), closed[0] != 0.0 or closed[1] != 0.0
    for block in range(0, z.shape[0], LANES):
        start = min(block, z.shape[0] - LANES)
        read_state(z, p, start, first, n, m, 1.0, turned, theta, scalars)
        read_lanes(diagonal, start * n, n, n, own, 0, 1)
        _tangents(theta, nodes, cosine, sine)
        pull, at = _dot(pressure, scalars), 0
        for i in range(n):
            c, s = pull * load(cosine, first + i), pull * load(sine, first + i)
            weight = spread(weights[first + i])
            re, im = _times(closed[0], closed[1], weight * c, weight * s)
            for j in range(i):
                there, beside = load(cosine, first + j), load(sine, first + j)
                value = spread(matrix[first + i, first + j]) * (s * there - c * beside)
                if close:
                    value = value + spread(weights[first + j]) * (re * there - im * beside)
                store(rows, at, spread(stiffness[i, j]) + value)
                at += 1
            store(rows, at, spread(stiffness[i, i]) + load(own, i))
            at += 1
        for k in range(m):
            read_lanes(border, (start * m + k) * n, m * n, n, rows, at, 1)
            at += n
            for j in range(k + 1):
                for i in range(LANES):
                    rows[at, i] = trailing[start + i, k, j]
                at += 1
        write_lanes(rows, 0, 1, entries, start * total, total, total)
