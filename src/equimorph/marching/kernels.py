"""Compiled kernels of lanes that march along curves: one lane a row, whatever the structure.

Every lane is a small machine with its own stage, step and iteration; a kernel takes each lane as
far as it gets without another Newton step of the structure. Scalars of the lanes are the rows of
`numbers` and `counts`, named below. Lanes do not look at each other, so that what a lane does is
the same, bit for bit, whichever lanes march beside it.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS

SUMS = {**FLAGS, "fastmath": {"contract", "reassoc"}, "_nrt": False}
"""Sums over the entries of one lane may be reordered: always in the same way."""
BRIEF = {**SUMS, "nogil": False}
"""Of kernels too short to let another thread in: taking turns would cost more than they do."""
INLINE = {**SUMS, "forceinline": True}
"""Of parts of the work on one lane: their many arrays, passed on the stack, would take longer."""

(
    T, SLOPE, T_1, SLOPE_1, T_2, SLOPE_2, X_1, RATE_1, X_2, RATE_2, ARC, TRIAL, CORNER, DEFECT,
    LENGTH, TRAVELLED, LAST, WEIGHT, LARGEST, TURNING, NEW_SLOPE, NORM, TURN, DET_OLD, DET, NEW_DET,
    GAIN, BEND, UNIT, BESIDE,
) = range(30)  # fmt: skip
"""Rows of `numbers`: t and dt/ds here, one step before and two; where those two lie along the
tangent here, and the cosines of theirs; arclength of the step before; t, closing equation and
length of the step that is tried; way so far; last correction; squared weight of dt; knobs; dt/ds at
the end, length of the tangent and turning angle of a step that converged; determinant of F_z at the
step before, here and at the end; last correction over the square of the one before; turning angle
per length of the last step; power of two in which all determinants of the lane are measured; t
beside an end of the step."""
NUMBERS = 30

LANE, STAGE, ITERATION, INDEX, NEW_INDEX, WHAT, STEPS, MOST, LEVEL, HEAD, KNOWN = range(11)
"""Rows of `counts`: number of the lane; stage; Newton steps so far; index here and at the end of
the step; events in the step; steps so far and their limit; number of retries; which of three
remembered points is the present one; how many points before it are known."""
COUNTS = 11

STARTING, CORRECTING, AIMING, CONVERGED, REFUSED, ENDED, SHORT, LONG, STUCK = range(9)
"""Stages: at t = 0, before the first step; in Newton's iteration; in that of a step to the end of
t; step converged; step refused; lane finished; given up: step too short, too many steps, or a
singular start."""
WAITS, HELD = -1, -2
"""Stage of a step that converged and waits to be judged together with others; less its stage, that
of a lane whose pivot is unsafe and that waits for others."""

ARRIVAL, RETURN, FOLD, BRANCH, CONSTRAINT, CRITICAL = 1, 2, 4, 8, 16, 32
"""Bits of what can happen in a step."""
HIDDEN, ENDING, EARLY = 64, 128, 256
"""Bits of steps with events that their ends do not show, of those that such an event ends, and of
second steps after a first one that may hide some."""

LEVEL_SLOPE = 1e-6
"""Slope of a start that counts as zero: it lies on a fold, and leads nowhere in t. Per length of
the curve's own part of the metric, if that is longer than 1."""

ACCEPTED, EXACT = 1e-7, 1e-10
"""Size of the last correction on the way, and where events are: Newton is quadratic, so that the
point itself is good to the square, but the tangent belongs to the point before."""
NEARLY, NEXT = 1e-5, 1e-11
"""Last correction on the way if the next one would be below: Newton squares it, times a gain that
the last two corrections show."""
DOUBT = 4.0
"""Factor of the gain where an earlier step showed it: the first correction is the last then."""
ARRIVED = 1e-9
"""Last correction at the end of t, after which the point is exact to round-off."""
MOST_ITERATIONS = 7
FIRST_SHARE = 0.25
"""First correction over the step: more could lead to another branch."""
LEAST_COSINE = 0.9
"""Of the angle between the tangents at both ends of a step."""
MULTIPLIER_WEIGHT = 1e-2
"""Weight of the multipliers' squares in the norm of corrections (they are not in the metric)."""
BACK = 0.4
"""Factor of a step's length after a refusal."""


@njit(**SUMS)
def squared_lengths(dz, dt, weight, mass, light, out):
    """Squared lengths of steps; multipliers count with the factor `light`."""
    n = mass.shape[0]
    for i in range(dz.shape[0]):
        total, extra = 0.0, 0.0
        for j in range(n):
            total += mass[j] * dz[i, j] * dz[i, j]
        for j in range(n, dz.shape[1]):
            extra += dz[i, j] * dz[i, j]
        along = weight[i] * dt[i]
        out[i] = total + along * along + light * extra


@njit(**{**SUMS, "_nrt": True})
def row_sums(a, b):
    """Sum of products of the entries of each lane."""
    out = np.empty(a.shape[0])
    for i in range(a.shape[0]):
        total = 0.0
        for j in range(a.shape[1]):
            total += a[i, j] * b[i, j]
        out[i] = total
    return out


@njit(**INLINE)
def _size(i, dz, dt, mass, weight):
    """Length of a correction, with the multipliers included lightly."""
    n = mass.shape[0]
    total, extra = 0.0, 0.0
    for j in range(n):
        total += mass[j] * dz[i, j] * dz[i, j]
    for j in range(n, dz.shape[1]):
        extra += dz[i, j] * dz[i, j]
    return np.sqrt(total + weight * dt * dt + MULTIPLIER_WEIGHT * extra)


@njit(**SUMS)
def correct(dz, dt, tangent, slope, mass, trial, numbers, counts, active, accepted, nearly):
    """Apply a Newton correction to each lane in its iteration; tell whether it converged.

    The first correction has to be below a quarter of the step and each later one below half of the
    one before; the tangent has to agree with that of the start from the guess on, which tells at
    once where a step goes too far. The last one is below `accepted`, or up to `nearly` if the next
    one would be below `NEXT`.
    """
    n, size = mass.shape[0], trial.shape[1]
    for i in range(active):
        if counts[STAGE, i] != CORRECTING:
            continue
        weight, last = numbers[WEIGHT, i], numbers[LAST, i]
        correction = _size(i, dz, dt[i], mass, weight)
        first = counts[ITERATION, i] == 0
        limit = FIRST_SHARE * numbers[LENGTH, i] if first else 0.5 * last
        # beside another singular state round-off moves points by more than `accepted`
        rough = not first and limit < correction <= ACCEPTED
        if not (correction <= max(limit, accepted) or rough):
            counts[STAGE, i] = REFUSED
            continue
        total = 0.0
        for j in range(n):
            total += mass[j] * tangent[i, j] * tangent[i, j]
        norm = np.sqrt(total + weight * slope[i] * slope[i])
        # row·tangent = 1 by construction: the cosine of the turning is 1 over the new length
        if not LEAST_COSINE * norm <= 1.0:
            counts[STAGE, i] = REFUSED
            continue
        for j in range(size):
            trial[i, j] += dz[i, j]
        numbers[TRIAL, i] += dt[i]
        gain = DOUBT * numbers[GAIN, i]
        if not first:
            gain = correction / (last * last)
            numbers[GAIN, i] = max(gain, 1.0)
        close = correction <= nearly and 0.0 < gain * correction * correction <= NEXT
        if not (correction <= accepted or close or rough):
            counts[ITERATION, i] += 1
            numbers[LAST, i] = correction
            # the closing equation is linear: the correction has met it
            numbers[DEFECT, i] = 0.0
            if counts[ITERATION, i] == MOST_ITERATIONS:
                counts[STAGE, i] = REFUSED
            continue
        counts[STAGE, i], numbers[LAST, i] = CONVERGED, correction
        numbers[NORM, i] = norm
        numbers[NEW_SLOPE, i] = slope[i] / norm
        numbers[TURN, i] = np.arccos(min(1.0 / norm, 1.0))


@njit(**BRIEF)
def correct_arrivals(dz, tangent, slope, mass, places, numbers, counts, active):
    """`correct` for steps to the end of t, where t is fixed instead of the length."""
    z, here, trial, _ = places
    n = mass.shape[0]
    for i in range(active):
        if counts[STAGE, i] != AIMING:
            continue
        head = counts[HEAD, i]
        last, weight = numbers[LAST, i], numbers[WEIGHT, i]
        first = counts[ITERATION, i] == 0
        correction = _size(i, dz, 0.0, mass, weight)
        limit = FIRST_SHARE * numbers[LENGTH, i] if first else 0.5 * last
        if not correction <= max(limit, ARRIVED):
            counts[STAGE, i] = REFUSED
            continue
        for j in range(trial.shape[1]):
            trial[i, j] += dz[i, j]
        if correction > ARRIVED:
            counts[ITERATION, i] += 1
            numbers[LAST, i] = correction
            continue
        total, along, way = 0.0, 0.0, 0.0
        for j in range(n):
            total += mass[j] * tangent[i, j] * tangent[i, j]
        for j in range(n):
            along += mass[j] * here[i, head, j] * tangent[i, j]
        for j in range(n):
            way += mass[j] * here[i, head, j] * (trial[i, j] - z[i, head, j])
        along += weight * numbers[SLOPE, i] * slope[i]
        norm = np.sqrt(total + weight * slope[i] * slope[i])
        if not LEAST_COSINE * norm <= abs(along):
            counts[STAGE, i] = REFUSED
            continue
        numbers[TURN, i] = np.arccos(min(abs(along) / norm, 1.0))
        # the tangent of fixed t points towards growing t, that of the lane goes on as before
        norm = norm if along > 0.0 else -norm
        numbers[NORM, i], numbers[NEW_SLOPE, i] = norm, slope[i] / norm
        way += weight * numbers[SLOPE, i] * (numbers[TRIAL, i] - numbers[T, i])
        numbers[LENGTH, i], numbers[LAST, i], counts[STAGE, i] = way, 0.0, CONVERGED


@njit(**BRIEF)
def close_gaps(places, numbers, counts, values, active):
    """Move lanes from the end into the places of those that are finished; return how many stay."""
    i = 0
    while i < active:
        if counts[STAGE, i] <= REFUSED:
            i += 1
            continue
        active -= 1
        if i < active:
            for each in places:
                for j in range(each.shape[1]):
                    each[i, j] = each[active, j]
            for k in range(numbers.shape[0]):
                numbers[k, i] = numbers[k, active]
            for k in range(counts.shape[0]):
                counts[k, i] = counts[k, active]
            for k in range(values.shape[0]):
                values[k, i] = values[k, active]
    return active
