"""Compiled kernels of Newton's method on lanes: how a lane stands, and one correction of each."""

import numpy as np

from equimorph.linalg.compiled import njit, template
from equimorph.linalg.kernels import FLAGS, INNER
from equimorph.linalg.row_kernels import copy_row
from equimorph.linalg.simd import LANES
from equimorph.marching.tick_kernels import any_below

OPEN, FOUND, UNFINISHED, SINGULAR, TOO_LONG, NOT_SHRINKING = range(-1, 5)
"""How a lane stands after a step; `Status` of `equilibria.settle` says what these mean."""
NEAR = 1e-5
"""Last correction at whose start tangent space and index are those of its end."""


@njit(**INNER)
def stand_after(length, before, limits, too_long, free, last):
    """How a lane stands after a step of this length.

    before: length of the step before; limits: converged, following, contraction; too_long: length
    at which the lane is given up; free: whether the length need not shrink; last: whether no more
    steps are taken.
    """
    converged, following, contraction = limits
    small = length < converged
    if following > 0.0 and length < NEAR and before < np.inf:
        small = small or length * length * length < following * before * before
    state = FOUND if small else (UNFINISHED if last else OPEN)
    if not (small or free or length <= contraction * before):
        state = NOT_SHRINKING
    if too_long < np.inf and not length < too_long:
        state = TOO_LONG
    return state if length < np.inf else SINGULAR


@njit(**FLAGS)
def correct_lanes(step, work, count, result, guards, weights, limits, longest, rule):
    """Apply a Newton correction to each lane at work; return how many go on, moved to the front.

    step: dz, dt, index, tangent_z, tangent_t; work, a row each lane at work: number, length of the
    correction before, z, p, dp, row, corner; count: how many rows these are; result, a row each
    lane: z, p, status, size, first size, index, tangents (none or one); guards, a row each lane:
    too_long, and the index that need not contract, if any (none or one column); rule: whether
    lengths need not shrink yet, whether this is the last step, and whether it is the first one.
    """
    dz, dt, index, tangent_z, tangent_t = step
    lane, before, z, p, dp, row, corner = work
    out_z, out_p, status, size, first, out_index, tangents = result
    too_long, exempt = guards
    free, last, is_first = rule
    entries, parameters, left = z.shape[1], p.shape[1], 0
    along = dp.shape[1] > 0
    for i in range(count):
        own, squared = lane[i], 0.0
        for j in range(entries):
            squared += weights[j] * dz[i, j] * dz[i, j]
        if along:
            squared += dt[i] * dt[i]
        length = np.sqrt(squared)
        may = free or (exempt.shape[1] > 0 and index[i] == exempt[own, 0])
        state = stand_after(length, before[i], limits, too_long[own], may, last)
        size[own], out_index[own] = length, index[i]
        if is_first:
            first[own] = length
        share = longest / length if length > longest else 1.0
        if state == OPEN:
            for j in range(entries):
                z[left, j] = z[i, j] + share * dz[i, j]
            for j in range(parameters):
                p[left, j] = p[i, j]
            if along:
                for j in range(parameters):
                    p[left, j] += share * dt[i] * dp[i, j]
                    dp[left, j] = dp[i, j]
                for j in range(entries):
                    row[left, j] = row[i, j]
                corner[left] = corner[i]
            lane[left], before[left] = own, length
            left += 1
            continue
        status[own] = state
        for j in range(entries):
            out_z[own, j] = z[i, j]
        for j in range(parameters):
            out_p[own, j] = p[i, j]
        if state <= UNFINISHED:
            for j in range(entries):
                out_z[own, j] += share * dz[i, j]
            if along:
                for j in range(parameters):
                    out_p[own, j] += share * dt[i] * dp[i, j]
        if tangents.shape[1] > 0:
            for j in range(entries):
                tangents[own, 0, j] = tangent_z[i, j]
            tangents[own, 0, entries] = tangent_t[i]
    if left:
        # structures compute whole blocks of lanes: the rest of one goes with the first lane
        for i in range(left, min(len(z), LANES)):
            copy_row(z, 0, z, i)
            copy_row(p, 0, p, i)
            corner[i] = corner[0]
            if along:
                copy_row(dp, 0, dp, i)
                copy_row(row, 0, row, i)
    return left


def newton_of(step):
    """Newton's method as one loop, with the kernel of a structure's step.

    The kernel is as that of `marching.tick_kernels.march_of`.
    """

    @template(**FLAGS)
    def iterate(work, tables, guard, lanes, moves, ratio, progress, result, guards, weights,
                limits, rule):  # fmt: skip
        """Correct lanes until all are finished, or a pivot is unsafe; return those left, and steps.

        lanes, result, guards, weights, limits: see `correct_lanes`; moves and ratio: the step that
        was computed last, as there, and the ratios of its pivots; progress: lanes left and steps
        taken before; guard: least ratio of the pivots; rule: longest step, steps that need not
        shrink, and most steps. A step with an unsafe pivot is left to the caller.
        """
        z, p, dp, row, corner = lanes[2:]
        dz, dt, index, tangent_z, tangent_t = moves
        (left, number), (longest, free, most), (rows, size) = progress, rule, z.shape
        if dp.shape[1] == 0:  # at fixed parameters
            dp, row = np.zeros(p.shape), np.zeros((rows, size))
        none, residual, determinant = np.zeros(rows), np.empty(rows), np.empty((rows, 2))
        still = np.empty((0, size))
        while left > 0 and number < most:
            m = max(left, LANES)
            step(
                work, tables, z[:m], p[:m], dp, row, corner, none, still, still, dz, dt, tangent_z,
                tangent_t, residual, index, determinant, ratio,
            )  # fmt: skip
            if any_below(ratio, left, guard):
                break
            number += 1
            stage = (number <= free, number >= most, number == 1)
            left = correct_lanes(
                moves, lanes, left, result, guards, weights, limits, longest, stage
            )
        return left, number

    return iterate
