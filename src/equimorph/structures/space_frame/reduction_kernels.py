"""Compiled elimination of the lengths of quaternions from solves with F_z, lane by lane.

At a node with the quaternion q = ρ u, coordinates are ρ and rotations: the directions are u and
½ρ u e_k. The second derivative by ρ alone is the pivot, that by ρ and a rotation is `mixed`.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER, balance_one
from equimorph.linalg.row_kernels import copy_row


@njit(**INNER)
def _set_node(lengths, masses, z, residual, shift, n, basis, mixed):
    """Directions u and u e_k, and mixed derivatives; ρ and the pivot are returned."""
    q0, q1, q2, q3 = z[4 * n], z[4 * n + 1], z[4 * n + 2], z[4 * n + 3]
    square = q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3
    radius = np.sqrt(square)
    q0, q1, q2, q3 = q0 / radius, q1 / radius, q2 / radius, q3 / radius
    basis[0, 0], basis[0, 1], basis[0, 2], basis[0, 3] = q0, q1, q2, q3
    basis[1, 0], basis[1, 1], basis[1, 2], basis[1, 3] = -q1, q0, q3, -q2
    basis[2, 0], basis[2, 1], basis[2, 2], basis[2, 3] = -q2, -q3, q0, q1
    basis[3, 0], basis[3, 1], basis[3, 2], basis[3, 3] = -q3, q2, -q1, q0
    for k in range(3):
        mixed[k] = 0.5 * _along(basis, k + 1, residual, 4 * n)
    return radius, 0.5 * lengths[n] * (3.0 * square - 1.0) - shift * masses[n]


@njit(**INNER)
def _along(basis, k, row, first):
    """Component of four entries of a row along a direction."""
    total = 0.0
    for c in range(4):
        total += basis[k, c] * row[first + c]
    return total


@njit(**INNER)
def _split(basis, mixed, radius, pivot, n, rows, along, out):
    """Components of rows along the length, and by rotations with the length eliminated."""
    for s in range(rows.shape[0]):
        along[s] = _along(basis, 0, rows[s], 4 * n)
        for k in range(3):
            across = 0.5 * radius * _along(basis, k + 1, rows[s], 4 * n)
            out[s, 3 * n + k] = across + mixed[k] / pivot * along[s]


@njit(**INNER)
def _copy_rest(free, size, rows, out):
    """Copy what belongs to no quaternion: `out` has one entry less a node."""
    for s in range(rows.shape[0]):
        for i in range(4 * free, size):
            out[s, i - free] = rows[s, i]


@njit(**FLAGS)
def eliminate_lengths(
    lengths, masses, z, residual, shift, columns, rows, corner, rhs,
    small_columns, small_rows, small_corner, small_rhs,
):  # fmt: skip
    """Borders and right-hand sides by rotations; z and F have 4 entries a node first."""
    free, borders, sides = len(lengths), columns.shape[1], rhs.shape[1]
    size = z.shape[1]
    basis, mixed, right = np.empty((4, 4)), np.empty(3), np.empty(sides)
    left, below = np.empty(borders), np.empty(borders)
    for lane in range(len(z)):
        for a in range(borders):
            copy_row(corner[lane], a, small_corner[lane], a)
        _copy_rest(free, size, columns[lane], small_columns[lane])
        _copy_rest(free, size, rows[lane], small_rows[lane])
        _copy_rest(free, size + borders, rhs[lane], small_rhs[lane])
        for n in range(free):
            radius, pivot = _set_node(
                lengths, masses, z[lane], residual[lane], shift[lane, 0], n, basis, mixed
            )
            _split(basis, mixed, radius, pivot, n, columns[lane], left, small_columns[lane])
            _split(basis, mixed, radius, pivot, n, rows[lane], below, small_rows[lane])
            _split(basis, mixed, radius, pivot, n, rhs[lane], right, small_rhs[lane])
            for a in range(borders):
                share = below[a] / pivot
                for b in range(borders):
                    small_corner[lane, a, b] -= share * left[b]
                for s in range(sides):
                    small_rhs[lane, s, size - free + a] -= share * right[s]


@njit(**FLAGS)
def restore_lengths(
    lengths, masses, z, residual, shift, columns, rhs, solution, x, negative, scale
):
    """Solutions by quaternions from those by rotations; negative pivots, factor of det as m, e."""
    free, borders, sides = len(lengths), columns.shape[1], rhs.shape[1]
    size = z.shape[1]
    basis, mixed, part = np.empty((4, 4)), np.empty(3), np.empty(4)
    for lane in range(len(z)):
        negative[lane], product, exponent = 0, 1.0, 0.0
        for n in range(free):
            radius, pivot = _set_node(
                lengths, masses, z[lane], residual[lane], shift[lane, 0], n, basis, mixed
            )
            negative[lane] += pivot < 0.0
            product *= pivot * (2.0 / radius) ** 6
            product, exponent = balance_one(product, exponent)
            for s in range(sides):
                part[0] = _along(basis, 0, rhs[lane, s], 4 * n)
                for k in range(3):
                    turn = solution[lane, s, 3 * n + k]
                    part[0] += mixed[k] * turn
                    part[k + 1] = 0.5 * radius * turn
                for a in range(borders):
                    force = solution[lane, s, size - free + a]
                    part[0] -= force * _along(basis, 0, columns[lane, a], 4 * n)
                part[0] /= pivot
                for c in range(4):
                    total = 0.0
                    for k in range(4):
                        total += basis[k, c] * part[k]
                    x[lane, s, 4 * n + c] = total
        scale[lane, 0], scale[lane, 1] = product, exponent
        for s in range(sides):
            for i in range(4 * free, size + borders):
                x[lane, s, i] = solution[lane, s, i - free]
