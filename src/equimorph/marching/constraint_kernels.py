"""Compiled kernels that note violations of constraints, and steps that may hide one.

By values and, where these leave a doubt, slopes at both ends of a step.

See docs/decisions.md, "Short violations of constraints".
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS
from equimorph.marching.kernels import (
    BESIDE,
    CONSTRAINT,
    CONVERGED,
    HEAD,
    INLINE,
    KNOWN,
    LENGTH,
    NEW_SLOPE,
    NORM,
    SLOPE,
    STAGE,
    SUMS,
    TRIAL,
    TURN,
    WHAT,
    X_1,
    X_2,
    T,
)

EARLIER, LAST, HERE, NEW, RISE, NEW_RISE = range(6)
"""Rows of the values of each constraint: two steps before, one, here, and at the end of the step;
slopes per length here and at the end."""
VALUES = 6
WARY, WARY_FIRST = 16.0, 2.0
"""Factors of how far a step bulges, if its slopes differ as they did, and its chord if it is the
first: of 4 285 short violations none was beyond, and 4 % of ordinary steps are not."""
SURE = 4.0
"""Factor of the error of a cubic at places behind it; 2.5 did for 4 284 of the 4 285."""
BOTH_WAYS = 1e-5
"""Length of the differences, to both sides, that are slopes of constraints."""
TOUCH = 1e-9
"""Excess that is none, as on bounds of size 1 or less."""


@njit(**{**SUMS, "_nrt": True})
def note_excess(values, numbers, counts, active, grazing):
    """Note violated constraints; return how many steps may violate one unnoticed, by values."""
    found = 0
    for k in range(grazing.shape[0]):
        own = values[VALUES * k : VALUES * (k + 1)]
        for i in range(active):
            grazing[k, i] = False
            if counts[STAGE, i] == CONVERGED:
                if own[NEW, i] > 0.0:
                    counts[WHAT, i] |= CONSTRAINT
                grazing[k, i] = _may_exceed(i, own, numbers, counts)
                found += grazing[k, i]
    return found


@njit(**INLINE)
def _may_exceed(i, values, numbers, counts):
    """Whether a constraint may be violated inside a step, or more than once if it is at the end.

    By the control points of cubics whose slopes differ from that of the chord.
    """
    here, new, length = values[HERE, i], values[NEW, i], numbers[LENGTH, i]
    bulge, rise = WARY_FIRST * abs(new - here), new - here
    if counts[KNOWN, i] > 0:
        first, second = numbers[X_1, i], numbers[X_2, i]
        before = (values[LAST, i] - here) / first
        bow = (rise / length - before) / (length - first)
        change = abs(bow)
        if counts[KNOWN, i] > 1:
            earlier = (values[EARLIER, i] - values[LAST, i]) / (second - first)
            trend = (bow - (earlier - before) / second) / (length - second)
            change += abs(trend) * (length - first)
        bulge = WARY * change * length * length / 3.0
    one, two = here + rise / 3.0, new - rise / 3.0
    if new > 0.0:
        return one + bulge > 0.0 and two - bulge < 0.0
    return max(one, two) + bulge > 0.0


@njit(**{**FLAGS, "_nrt": False})
def beside(side, places, new_tangent, numbers, counts, active, grazing, z, at):
    """Points beside starts (sides 0, 1) or ends (2, 3) of steps in doubt; how many."""
    points, tangent, trial, _ = places
    h, count = BOTH_WAYS if side % 2 else -BOTH_WAYS, 0
    for i in range(active):
        doubt = False
        for k in range(grazing.shape[0]):
            doubt = doubt or grazing[k, i]
        if not doubt:
            continue
        if side < 2:
            head = counts[HEAD, i]
            for j in range(z.shape[1]):
                z[count, j] = points[i, head, j] + h * tangent[i, head, j]
            numbers[BESIDE, i] = numbers[T, i] + h * numbers[SLOPE, i]
        else:
            step = h / numbers[NORM, i]
            for j in range(z.shape[1]):
                z[count, j] = trial[i, j] + step * new_tangent[i, j]
            numbers[BESIDE, i] = numbers[TRIAL, i] + h * numbers[NEW_SLOPE, i]
        at[count] = i
        count += 1
    return count


@njit(**{**FLAGS, "_nrt": False})
def note_slopes(side, found, count, at, values):
    """Take up values on one side of ends of steps; from both sides the slope."""
    for k in range(found.shape[0]):
        row = VALUES * k + RISE + side // 2
        for i in range(count):
            if side % 2:
                values[row, at[i]] = (found[k, i] - values[row, at[i]]) / (2.0 * BOTH_WAYS)
            else:
                values[row, at[i]] = found[k, i]


@njit(**{**SUMS, "_nrt": True})
def weigh(values, numbers, counts, active, grazing):
    """Which steps in doubt may violate a constraint unnoticed, by slopes as well; how many."""
    found = 0
    for k in range(grazing.shape[0]):
        own = values[VALUES * k : VALUES * (k + 1)]
        for i in range(active):
            if grazing[k, i]:
                grazing[k, i] = _exceeds(i, own, numbers, counts)
                found += grazing[k, i]
    return found


@njit(**INLINE)
def _exceeds(i, values, numbers, counts):
    """`_may_exceed` by the cubic through both ends, and its error at the two places before."""
    here, new, length = values[HERE, i], values[NEW, i], numbers[LENGTH, i]
    a, b = values[RISE, i] * length, values[NEW_RISE, i] * length / np.cos(numbers[TURN, i])
    square, cube = 3.0 * (new - here) - 2.0 * a - b, a + b - 2.0 * (new - here)
    # the error over s² (1 − s)², which is of degree 0 at first
    error = abs(cube)
    if counts[KNOWN, i] > 0:
        s = numbers[X_1, i] / length
        gap = values[LAST, i] - (here + s * (a + s * (square + s * cube)))
        one = gap / (s * (1.0 - s)) ** 2
        error = SURE * abs(one)
        if counts[KNOWN, i] > 1:
            r = numbers[X_2, i] / length
            gap = values[EARLIER, i] - (here + r * (a + r * (square + r * cube)))
            trend = (one - gap / (r * (1.0 - r)) ** 2) / (s - r)
            error = max(abs(one), abs(one - s * trend) + abs(trend))
    error *= SURE / 16.0
    # control points of degree four: that in the middle holds the error
    left, right, slack = here + a / 4.0, new - b / 4.0, 8.0 / 3.0 * error
    middle = 0.5 * (here + new) + (a - b) / 6.0
    if new > 0.0:
        return here + a / 3.0 > -2.0 * slack and new - b / 3.0 < 2.0 * slack
    if max(left, right, middle + slack) <= TOUCH:
        return False
    root = np.sqrt(max(square * square - 3.0 * a * cube, 0.0)) - square
    top = max(here, new)
    if 0.0 < a < root:
        s = a / root
        top = max(top, here + s * (a + s * (square + s * cube)))
    return not top + error <= TOUCH
