"""Compiled kernels of Newton's method with conditions: small dense algebra, lane by lane."""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.dense_kernels import solve_by_rows
from equimorph.linalg.kernels import FLAGS, SUMS
from equimorph.linalg.row_kernels import copy_row
from equimorph.structures.newton_kernels import OPEN, SINGULAR, UNFINISHED, stand_after

DEPENDENT = 1e-14
"""Determinant of a small matrix, relative to its entries, that counts as zero."""


@njit(**FLAGS)
def judge_lanes(
    change, weights, factor, before, limits, too_long, longest, rule, size, status, share
):
    """Lengths of steps, how each lane stands after its step, and the share of the step to take.

    change (lanes, n) with weights (n) of the squares; factor: by which steps are lengthened;
    before: lengths of the steps before; limits and too_long, for each lane: see `stand_after`;
    longest: to which steps are shortened; rule: whether lengths need not shrink yet, and whether no
    more steps are taken.
    """
    free, last = rule
    for lane in range(change.shape[0]):
        squared = 0.0
        for i in range(change.shape[1]):
            squared += weights[i] * change[lane, i] * change[lane, i]
        length = np.sqrt(squared)
        taken, long = factor[lane], abs(factor[lane]) * length
        state = stand_after(length, before[lane], limits, too_long[lane], free, last)
        if not long < np.inf:
            state = SINGULAR
        elif long > longest:
            taken *= longest / long
        size[lane], status[lane] = length, state
        share[lane] = taken if state <= UNFINISHED else 0.0


@njit(**FLAGS)
def move_lanes(z, p, beta, change, directions, share, new_z, new_p, new_beta):
    """Points after shares of steps: of z, along the directions of the parameters, and of β.

    Lanes with no share stay where they are, even if their steps are no numbers.
    """
    size, (k, parameters) = z.shape[1], directions.shape[1:]
    for lane in range(z.shape[0]):
        part = share[lane]
        copy_row(z, lane, new_z, lane)
        copy_row(p, lane, new_p, lane)
        new_beta[lane] = beta[lane]
        if part == 0.0:
            continue
        for i in range(size):
            new_z[lane, i] += part * change[lane, i]
        for j in range(k):
            step = part * change[lane, size + j]
            for i in range(parameters):
                new_p[lane, i] += step * directions[lane, j, i]
        if change.shape[1] > size + k:
            new_beta[lane] += part * change[lane, size + k]


@njit(**FLAGS)
def amount_lanes(slopes, value, amount, regular):
    """Solve ``slopes·amount = −value`` (lanes, k, k), and tell where the slopes are regular."""
    k = slopes.shape[1]
    matrix = np.empty((k, k + 1))
    for lane in range(slopes.shape[0]):
        size = 0.0
        for i in range(k):
            for j in range(k):
                matrix[i, j] = slopes[lane, i, j]
                size = max(size, abs(matrix[i, j]))
            matrix[i, k] = -value[lane, i]
        determinant = solve_by_rows(matrix, k)
        regular[lane] = abs(determinant) > DEPENDENT * size**k
        for i in range(k):
            amount[lane, i] = matrix[i, k] if regular[lane] else np.nan


@njit(**FLAGS)
def null_lanes(x, size, k, b, null):
    """Vectors v and scalars g with ``F_z v + g b = 0`` and ``b·v = 1``: null (lanes, size + 1).

    From solutions x with columns C = F_p·directions (and b): the first k are tangents, the next one
    too if b is a column. Otherwise the last one has the right-hand side b, so that its β is −1. The
    combination of these without changes of the parameters is (v, g).
    """
    unfolded = x.shape[2] > size + k
    last = k if unfolded else x.shape[1] - 1
    matrix = np.empty((k + 1, k + 2))
    for lane in range(x.shape[0]):
        for j in range(k + 1):
            at = last if j == k else j
            for i in range(k):
                matrix[i, j] = x[lane, at, size + i]
            matrix[k, j] = 0.0
            for n in range(size):
                matrix[k, j] += b[lane, n] * x[lane, at, n]
        matrix[:, k + 1] = 0.0
        matrix[k, k + 1] = 1.0
        solve_by_rows(matrix, k + 1)
        null[lane] = 0.0
        for j in range(k + 1):
            at, share = last if j == k else j, matrix[j, k + 1]
            beta = x[lane, at, size + k] if unfolded else (-1.0 if j == k else 0.0)
            for n in range(size):
                null[lane, n] += share * x[lane, at, n]
            null[lane, size] += share * beta


@njit(**{**FLAGS, "fastmath": SUMS})
def along_lanes(step, tangents, rows, along, onto, steepness):
    """Directions along the set that rows see as unit vectors, and the step that they do not see.

    From a step (lanes, size) at fixed parameters, tangents (lanes, k, size), and rows (lanes, k,
    size + k): along (lanes, k, size + k) and onto (lanes, size + k); steepness: largest entry of
    tangents, not a number where one is not.
    """
    k, size = tangents.shape[1:]
    seen = np.empty((k, 2 * k))
    for lane in range(step.shape[0]):
        largest, total = 0.0, 0.0
        for i in range(k):
            for n in range(size):
                entry = abs(tangents[lane, i, n])
                largest, total = max(largest, entry), total + entry
        steepness[lane] = largest if total < np.inf else np.nan
        # Σⱼ cⱼ tangentⱼ, seen by row i, is entry (i, ·) times c
        for i in range(k):
            for j in range(k):
                value = rows[lane, i, size + j]
                for n in range(size):
                    value += rows[lane, i, n] * tangents[lane, j, n]
                seen[i, j], seen[i, k + j] = value, 1.0 if i == j else 0.0
        solve_by_rows(seen, k)
        for i in range(k):
            for n in range(size):
                along[lane, i, n] = 0.0
            for j in range(k):
                share = seen[j, k + i]
                for n in range(size):
                    along[lane, i, n] += share * tangents[lane, j, n]
                along[lane, i, size + j] = share
        for n in range(size):
            onto[lane, n] = step[lane, n]
        for n in range(k):
            onto[lane, size + n] = 0.0
        for i in range(k):
            share = 0.0
            for n in range(size):
                share += rows[lane, i, n] * step[lane, n]
            for n in range(size + k):
                onto[lane, n] -= share * along[lane, i, n]


@njit(**{**FLAGS, "fastmath": SUMS})
def correct_onto(moves, work, count, result, too_long, weights, limits, longest, rule):
    """Apply steps onto the set to the lanes at work; return how many go on, moved to the front.

    moves: orthonormal directions along the set (lanes, k, size + k), the step, the index, and
    whether that is sure; work, a row each lane at work: number, length of the step before, z, p,
    directions, rows that see those along the set; count: how many rows these are; result, a row
    each lane: z, p, status, size, first size, index, directions along the set, sure; weights: of
    squares in the metric, and of those in lengths; limits and too_long: see `stand_after`; longest:
    to which steps are shortened; rule: whether lengths need not shrink yet, whether this is the
    last step, whether it is the first one, and whether rows follow the directions, and steps are
    made orthogonal to these.
    """
    along, onto, index, sure = moves
    lane, before, z, p, directions, rows = work
    out_z, out_p, status, size, first, out_index, frames, out_sure = result
    metric, weight = weights
    free, last, is_first, follows = rule
    (k, width), entries, parameters, left = rows.shape[1:], z.shape[1], p.shape[1], 0
    for i in range(count):
        own, squared = lane[i], 0.0
        for j in range(k if follows else 0):
            share = 0.0
            for n in range(width):
                share += metric[n] * onto[i, n] * along[i, j, n]
            for n in range(width):
                onto[i, n] -= share * along[i, j, n]
        for n in range(width):
            squared += weight[n] * onto[i, n] * onto[i, n]
        length = np.sqrt(squared)
        state = stand_after(length, before[i], limits, too_long[own], free, last)
        size[own] = length
        if is_first:
            first[own] = length
        share = longest / length if length > longest else 1.0
        if state <= UNFINISHED:
            for n in range(entries):
                z[i, n] += share * onto[i, n]
            for j in range(k):
                for n in range(parameters):
                    p[i, n] += share * onto[i, entries + j] * directions[i, j, n]
        if state != OPEN:
            copy_row(z, i, out_z, own)
            copy_row(p, i, out_p, own)
            status[own], out_index[own], out_sure[own] = state, index[i], sure[i]
            for j in range(k):
                for n in range(width):
                    frames[own, j, n] = along[i, j, n]
            continue
        lane[left], before[left] = own, length
        copy_row(z, i, z, left)
        copy_row(p, i, p, left)
        for j in range(k):
            for n in range(parameters):
                directions[left, j, n] = directions[i, j, n]
            for n in range(width):
                rows[left, j, n] = metric[n] * along[i, j, n] if follows else rows[i, j, n]
        left += 1
    return left
