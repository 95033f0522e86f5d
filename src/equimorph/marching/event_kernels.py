"""Compiled kernels of events: copies of steps and points, and roots of scalars inside steps.

The scalar is known at both ends of a bracket and at the point before; a trial point between them is
predicted by the cubic through the ends and corrected like any step, then the bracket shrinks.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.marching.kernels import (
    BRIEF,
    CONVERGED,
    CORNER,
    CORRECTING,
    COUNTS,
    DEFECT,
    DET,
    ENDED,
    HEAD,
    INDEX,
    INLINE,
    ITERATION,
    LANE,
    LAST,
    LENGTH,
    LEVEL,
    NEW_DET,
    NEW_INDEX,
    NEW_SLOPE,
    NORM,
    NUMBERS,
    REFUSED,
    SLOPE,
    STAGE,
    STEPS,
    SUMS,
    TRAVELLED,
    TRIAL,
    UNIT,
    WEIGHT,
    WHAT,
    T,
)

(
    X1, F1, T1, SLOPE1, RATE1, X2, F2, T2, SLOPE2, RATE2, X3, F3, SHARE, SMALL, T0,
) = range(15)  # fmt: skip
"""Rows of `ends`: length from the start of the step, scalar, t, dt/ds and length along the first
tangent per arclength, at the newest and the other end; length and scalar at the third point; next
trial as a share of the way from the newest end to the other; scalar that counts as zero; t at the
start of the step."""
ENDS = 15
(
    STEP_LENGTH, AT_START, AT_END, T_START, T_END, SLOPE_START, SLOPE_END, GUESS,
) = range(8)  # fmt: skip
"""Values of steps that are searched: length; scalar, t and dt/ds at start and end; share of the
step that is tried first."""

TRIALS = 60
PLACE = 1e-14
"""Width of a bracket that ends the iteration."""
VALUE = 1e-13
"""Value of the scalar over that at the ends of the step that counts as zero."""


@njit(**INLINE)
def begin(i, lane, weight, mass, steps, places, numbers, counts, ends):
    """Let the search in step `lane` begin in row i: its closing equation, and the first trial.

    `steps`: points and tangents at both ends, and values, named below, of all steps.
    """
    z0, tangent0, z1, tangent1, values = steps
    start, one, slope_one, two, slope_two, _, row = places
    n = mass.shape[0]
    for k in range(NUMBERS):
        numbers[k, i] = 0.0
    for k in range(COUNTS):
        counts[k, i] = 0
    counts[LANE, i] = lane
    ends[X1, i], ends[X2, i] = values[STEP_LENGTH, lane], 0.0
    ends[F1, i], ends[F2, i] = values[AT_END, lane], values[AT_START, lane]
    ends[T1, i], ends[T2, i] = values[T_END, lane], values[T_START, lane]
    ends[SLOPE1, i], ends[SLOPE2, i] = values[SLOPE_END, lane], values[SLOPE_START, lane]
    ends[T0, i], ends[SHARE, i] = ends[T2, i], 1.0 - values[GUESS, lane]
    ends[SMALL, i] = VALUE * (abs(ends[F1, i]) + abs(ends[F2, i]))
    for j in range(row.shape[1]):
        start[i, j], two[i, j], slope_two[i, j] = z0[lane, j], z0[lane, j], tangent0[lane, j]
    numbers[WEIGHT, i] = weight[lane] * weight[lane]
    numbers[CORNER, i] = numbers[WEIGHT, i] * ends[SLOPE2, i]
    for j in range(n):
        row[i, j] = mass[j] * slope_two[i, j]
    for j in range(n, row.shape[1]):
        row[i, j] = 0.0
    rate = 0.0
    for j in range(n):
        rate += row[i, j] * tangent1[lane, j]
    ends[RATE1, i], ends[RATE2, i] = rate + numbers[CORNER, i] * ends[SLOPE1, i], 1.0
    ends[X3, i], ends[F3, i] = ends[X2, i], ends[F2, i]
    if ends[F2, i] == 0.0:
        for a, b in ((X1, X2), (F1, F2), (T1, T2), (SLOPE1, SLOPE2)):
            ends[a, i] = ends[b, i]
        _copy_row(i, one, lane, z0)
        _copy_row(i, slope_one, lane, tangent0)
    else:
        _copy_row(i, one, lane, z1)
        _copy_row(i, slope_one, lane, tangent1)
    _propose(i, mass, places, numbers, counts, ends)
    if not abs(ends[F1, i]) > ends[SMALL, i]:
        counts[STAGE, i] = ENDED


@njit(**INLINE)
def _copy_row(i, target, k, source):
    for j in range(source.shape[1]):
        target[i, j] = source[k, j]


@njit(**INLINE)
def _propose(i, mass, places, numbers, counts, ends):
    """Predict the trial point of lane i by the cubic through both ends."""
    start, one, slope_one, two, slope_two, trial, row = places
    s, width = ends[SHARE, i], ends[X2, i] - ends[X1, i]
    x = ends[X1, i] + s * width
    b, a = s * s * (3 - 2 * s), (1 - s) * (1 - s) * (1 + 2 * s)
    # derivatives by the length, which is measured along the tangent at the start of the step
    c = s * (1 - s) * (1 - s) * width / ends[RATE1, i]
    d = -s * s * (1 - s) * width / ends[RATE2, i]
    for j in range(trial.shape[1]):
        trial[i, j] = a * one[i, j] + b * two[i, j]
    for j in range(trial.shape[1]):
        trial[i, j] += c * slope_one[i, j] + d * slope_two[i, j]
    t = a * ends[T1, i] + b * ends[T2, i] + c * ends[SLOPE1, i] + d * ends[SLOPE2, i]
    along = 0.0
    for j in range(mass.shape[0]):
        along += row[i, j] * (trial[i, j] - start[i, j])
    numbers[TRIAL, i] = t
    numbers[DEFECT, i] = along + numbers[CORNER, i] * (t - ends[T0, i]) - x
    numbers[LENGTH, i], numbers[LAST, i] = x, np.inf
    counts[ITERATION, i], counts[STAGE, i] = 0, CORRECTING


@njit(**SUMS)
def shrink(values, new_tangent, mass, places, numbers, counts, ends, active):
    """Shrink the brackets of lanes whose trial converged, with the scalar there, and go on."""
    for i in range(active):
        if counts[STAGE, i] == CONVERGED:
            _replace_end(i, values[i], new_tangent, places, numbers, ends)
            counts[STEPS, i] += 1
            close = abs(ends[X1, i] - ends[X2, i]) <= PLACE or abs(values[i]) <= ends[SMALL, i]
            if close:
                counts[STAGE, i] = ENDED
            elif counts[STEPS, i] == TRIALS:
                counts[STAGE, i] = REFUSED
            else:
                ends[SHARE, i] = _next_share(i, ends)
                _propose(i, mass, places, numbers, counts, ends)


@njit(**INLINE)
def _replace_end(i, value, new_tangent, places, numbers, ends):
    """Make the trial point the newest end of the bracket; the old one may become the other."""
    _, one, slope_one, two, slope_two, trial, _ = places
    same = np.sign(value) == np.sign(ends[F1, i])
    third = (X1, F1) if same else (X2, F2)
    ends[X3, i], ends[F3, i] = ends[third[0], i], ends[third[1], i]
    if not same:
        _copy_row(i, two, i, one)
        _copy_row(i, slope_two, i, slope_one)
        for k in range(5):
            ends[X2 + k, i] = ends[X1 + k, i]
    _copy_row(i, one, i, trial)
    norm = 1.0 / numbers[NORM, i]
    for j in range(trial.shape[1]):
        slope_one[i, j] = new_tangent[i, j] * norm
    ends[X1, i], ends[F1, i] = numbers[LENGTH, i], value
    ends[T1, i], ends[SLOPE1, i] = numbers[TRIAL, i], numbers[NEW_SLOPE, i]
    # the row times the tangent is 1 before the tangent is made a unit vector
    ends[RATE1, i] = norm


@njit(**INLINE)
def _next_share(i, ends):
    """Inverse quadratic interpolation where the three points allow it, else bisection."""
    x1, f1, x2, f2 = ends[X1, i], ends[F1, i], ends[X2, i], ends[F2, i]
    x3, f3 = ends[X3, i], ends[F3, i]
    xi, phi = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2)
    if not 1 - np.sqrt(1 - xi) < phi < np.sqrt(xi):
        return 0.5
    share = f1 / (f2 - f1) * f3 / (f2 - f3)
    share += (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f3 - f2)
    return min(max(share, 1e-6), 1.0 - 1e-6) if np.isfinite(share) else 0.5


@njit(**SUMS)
def hand_out(places, counts, ends, active, z, t, at, found):
    """Write down the newest ends of lanes that are finished."""
    one = places[1]
    for i in range(active):
        stage = counts[STAGE, i]
        if stage in (CORRECTING, CONVERGED):
            continue
        lane = counts[LANE, i]
        for j in range(one.shape[1]):
            z[lane, j] = one[i, j]
        t[lane], at[lane], found[lane] = ends[T1, i], ends[X1, i], stage == ENDED
        counts[STAGE, i] = ENDED


@njit(**BRIEF)
def file_events(new_tangent, stops, places, numbers, counts, active, buffer, filled):
    """Copy the steps in which something happened behind others; end lanes; return how many."""
    z, tangent, trial, _ = places
    size = trial.shape[1]
    z0, tangent0, z1, tangent1, values, names = buffer
    for i in range(active):
        what = counts[WHAT, i]
        if counts[STAGE, i] != CONVERGED or what == 0:
            continue
        norm, here = 1.0 / numbers[NORM, i], counts[HEAD, i]
        for j in range(size):
            z0[filled, j], tangent0[filled, j] = z[i, here, j], tangent[i, here, j]
        for j in range(size):
            z1[filled, j], tangent1[filled, j] = trial[i, j], new_tangent[i, j] * norm
        values[0, filled], values[1, filled] = numbers[T, i], numbers[SLOPE, i]
        values[2, filled], values[3, filled] = numbers[TRIAL, i], numbers[NEW_SLOPE, i]
        values[4, filled], values[5, filled] = numbers[LENGTH, i], numbers[TRAVELLED, i]
        values[6, filled], values[7, filled] = numbers[DET, i], numbers[NEW_DET, i]
        values[8, filled] = numbers[UNIT, i]
        names[0, filled], names[1, filled] = counts[LANE, i], what
        names[2, filled], names[3, filled] = counts[INDEX, i], counts[NEW_INDEX, i]
        filled += 1
        if what & stops:
            counts[STAGE, i] = ENDED
    return filled


@njit(**SUMS)
def file_points(trial, numbers, counts, active, buffer, filled):
    """Copy the ends of good steps of lanes that go on behind other points; return how many."""
    z, values, names = buffer
    for i in range(active):
        if counts[STAGE, i] != CONVERGED:
            continue
        for j in range(trial.shape[1]):
            z[filled, j] = trial[i, j]
        values[0, filled] = numbers[TRAVELLED, i] + numbers[LENGTH, i]
        values[1, filled] = numbers[TRIAL, i]
        names[0, filled], names[1, filled] = counts[LANE, i], counts[NEW_INDEX, i]
        names[2, filled] = counts[LEVEL, i]
        filled += 1
    return filled


@njit(**SUMS)
def cubic_shares(start, stop, old, new, length, out):
    """Share of a step where the cubic with these end values and slopes vanishes, by bisection."""
    for i in range(start.shape[0]):
        low, high = 0.0, 1.0
        for _ in range(50):
            s = 0.5 * (low + high)
            a, b = (1 - s) * (1 - s) * (1 + 2 * s), s * s * (3 - 2 * s)
            c, d = s * (1 - s) * (1 - s) * length[i], -s * s * (1 - s) * length[i]
            value = a * start[i] + b * stop[i] + c * old[i] + d * new[i]
            if (value < 0.0) == (start[i] < 0.0):
                low = s
            else:
                high = s
        out[i] = 0.5 * (low + high)
