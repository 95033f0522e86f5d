"""Compiled kernels of lanes that march along curves: one lane a row, whatever the structure.

Every lane is a small machine with its own stage, step and iteration; a kernel takes each lane as
far as it gets without another Newton step of the structure. Scalars of the lanes are the rows of
`numbers` and `counts`, named below. Lanes do not look at each other, so that what a lane does is
the same, bit for bit, whichever lanes march beside it.
"""

from math import ldexp

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
    GAIN, BEND, UNIT,
) = range(29)  # fmt: skip
"""Rows of `numbers`: t and dt/ds here, one step before and two; where those two lie along the
tangent here, and the cosines of theirs; arclength of the step before; t, closing equation and
length of the step that is tried; way so far; last correction; squared weight of dt; knobs; dt/ds at
the end, length of the tangent and turning angle of a step that converged; determinant of F_z at the
step before, here and at the end; last correction over the square of the one before; turning angle
per length of the last step; power of two in which all determinants of the lane are measured."""
NUMBERS = 29

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
DIP, NEAR, WIDE = 0.3, 0.1, 1e-3
"""Least determinant inside a step, as a share of those at its ends, below which the step may hide
two events; below which it is searched for them; length from which on it is refused first."""
EARLY_NEAR, EARLY_DIP = 0.3, 0.5
"""Determinant at a start, and least one inside a first step, as shares of those at its ends, below
which the step is searched: what came before it is not known."""
SMALL, FAINT = 0.02, 1e-3
"""Determinant at the end of a step over that at its start, or in units of that at the start of the
lane, below which the index of a point as far away as the last correction may be another one."""
SLIGHT = 1e-3
"""Share of a step by which a fold inside is at least taken to be away from its ends."""
SLACK = 0.01
"""Slope of t that is no turn inside such a short step, as a share of those at its ends."""
ROUND_OFF = 1e-14
"""Change of t back inside such a step that is none: t lies between 0 and 1."""


BROAD = 0.05
"""Length of a step above which one that seems to pass a branch point is refused: most jump to
another branch, which a shorter one does not, and looking for the branch point costs more."""


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


@njit(**{**BRIEF, "_nrt": True})
def judge(index, determinant, numbers, counts, active, smallest, locates, plain):
    """Tell what happened in steps that converged, and refuse those that hide something.

    `plain`: whether dt/ds vanishes where the index changes, and only there; on other curves each
    has a meaning of its own. Returns how many steps are good, in how many of them something
    happened that only a branch point explains, and how many come close to a singular state.
    """
    good, doubtful, close = 0, 0, 0
    for i in range(active):
        if counts[STAGE, i] != CONVERGED:
            continue
        counts[NEW_INDEX, i], numbers[NEW_DET, i] = index[i], _in_units(i, determinant, numbers)
        old, new, length = numbers[SLOPE, i], numbers[NEW_SLOPE, i], numbers[LENGTH, i]
        start, end = numbers[T, i], numbers[TRIAL, i]
        flipped = np.sign(new) != np.sign(old)
        changed = abs(index[i] - counts[INDEX, i])
        if (flipped or changed > 0 or _is_small(i, numbers)) and _is_rough(i, numbers, counts):
            counts[STAGE, i], numbers[DEFECT, i] = CORRECTING, 0.0
            counts[ITERATION, i] += 1
            continue
        # a pair of eigenvalues that is always one by symmetry counts once in the determinant
        if changed == 2 and determinant[i, 0] * numbers[DET, i] < 0.0:
            changed = 1
        # at a fold the path turns and the index changes; at a branch point one without the other
        fold = flipped and (changed == 1 or not plain)
        what = FOLD if fold else (BRANCH if flipped or changed == 1 else 0)
        if not plain:
            what = (FOLD if flipped else 0) | (CRITICAL if changed == 1 else 0)
        what |= ARRIVAL if end >= 1.0 else 0
        what |= RETURN if end <= 0.0 else 0
        counts[WHAT, i] = what
        # a turn hides an arrival if t went beyond 1 (or below 0) and came back within the step;
        # a step this short cannot go beyond by more than round-off
        reach = start + old * length
        hidden = reach >= 1.0 if old > 0.0 else reach <= 0.0
        hidden = (hidden or (what & (ARRIVAL | RETURN)) != 0) and length > 10 * smallest
        bad = changed > 1 or (flipped and hidden) or _turns_twice(old, new, end - start, length)
        if plain and length > WIDE:
            bad = bad or (fold and _hides_pair(i, numbers))
            bad = bad or (changed == 0 and _dips(*_trio(i, numbers), DIP))
        bad = bad or (locates and length > BROAD and (what & BRANCH) != 0)
        if bad or (flipped and not fold and not locates):
            counts[STAGE, i] = REFUSED
            continue
        good += 1
        doubtful += (what & BRANCH) != 0
        if changed == 0 and plain and _is_close(i, numbers):
            counts[WHAT, i] |= HIDDEN
            close += 1
        if plain and numbers[TRAVELLED, i] <= numbers[ARC, i] and _hides_early(i, numbers):
            close += (counts[WHAT, i] & HIDDEN) == 0
            counts[WHAT, i] |= EARLY
    return good, doubtful, close


@njit(**INLINE)
def _in_units(i, determinant, numbers):
    """Determinant m·2^e over the power of two of that at the start of the lane."""
    power = determinant[i, 1] - numbers[UNIT, i]
    return determinant[i, 0] if power == 0.0 else ldexp(determinant[i, 0], int(power))


@njit(**INLINE)
def _is_small(i, numbers):
    """Whether the determinant at the end of a step is much smaller than before."""
    return abs(numbers[NEW_DET, i]) < max(SMALL * abs(numbers[DET, i]), FAINT)


@njit(**INLINE)
def _is_rough(i, numbers, counts):
    """Whether the last correction of a step was so large that its tangent is that of elsewhere."""
    return numbers[LAST, i] > EXACT and counts[ITERATION, i] < MOST_ITERATIONS - 1


@njit(**INLINE)
def _turns_twice(old, new, gain, length):
    """Whether t runs back inside a step that leaves it rising, or falling, at both ends.

    By the least slope of the cubic through both ends and slopes: near a cusp two folds lie close
    together, with the same index before and behind. In a long step the cubic may miss them where
    its slope is nearly zero, in a short one that may be an error where the slope touches zero.
    """
    sign = np.sign(old)
    rise, a, b = sign * gain / length, sign * old, sign * new
    if not b > 0.0:
        return False
    # slope at share s: a + 2 s (3 rise - 2 a - b) + 3 s² (a + b - 2 rise)
    bend, bow = 3 * rise - 2 * a - b, a + b - 2 * rise
    share = min(max(-bend / (3 * bow), 0.0), 1.0) if bow > 0.0 else 0.0
    least = a + 2 * share * bend + 3 * share * share * bow
    if length > WIDE:
        return least < NEAR * min(a, b)
    return least < -max(SLACK * min(a, b), ROUND_OFF / length)


@njit(**INLINE)
def _parabola(before, length, last, here, there):
    """Slope at the second of three places, and half the curvature, of a parabola."""
    rise = (here - last) / before
    bow = ((there - here) / length - rise) / (before + length)
    return rise + bow * before, bow


@njit(**INLINE)
def _trio(i, numbers):
    """Lengths of the last two steps; the determinant at their ends, not negative between them."""
    last, here, there = numbers[DET_OLD, i], numbers[DET, i], numbers[NEW_DET, i]
    sign = 1.0 if here >= 0.0 else -1.0
    return numbers[ARC, i], numbers[LENGTH, i], sign * last, sign * here, sign * there


@njit(**INLINE)
def _beside_fold(i, numbers):
    """`_trio` with sizes divided by the distance from the fold in the step: of one sign, too.

    The fold is where the cubic through both ends and slopes of t turns.
    """
    before, length, last, here, there = _trio(i, numbers)
    a, b = numbers[SLOPE, i], numbers[NEW_SLOPE, i]
    rise = (numbers[TRIAL, i] - numbers[T, i]) / length
    bend, bow = 3 * rise - 2 * a - b, a + b - 2 * rise
    under = np.sqrt(max(bend * bend - 3 * bow * a, 0.0))
    share = min(max(a / (np.sign(a) * under - bend), SLIGHT), 1.0 - SLIGHT)
    return before, length, last / (share + before / length), here / share, there / (share - 1.0)


@njit(**INLINE)
def _dips(before, length, last, here, there, share):
    """Whether what has such sizes may touch zero, or cross it twice, inside the last step."""
    if not (before > 0.0 and here * there > 0.0):
        return False
    slope, bow = _parabola(before, length, last, here, there)
    # the least value lies inside if the parabola falls at the start and rises at the end
    if not (slope < 0.0 and slope + 2.0 * bow * length > 0.0):
        return False
    return here - slope * slope / (4.0 * bow) < share * min(here, there)


@njit(**INLINE)
def _passed_least(before, length, last, here, there):
    """Whether it may touch zero, or cross it twice, just before or after the second place.

    It is much smaller here than one step before and at the end, or the parabola is least in the
    step before, which the end of that did not show.
    """
    if not (before > 0.0 and last * there > 0.0):
        return False
    slope, bow = _parabola(before, length, last, here, there)
    inside = slope > 0.0 and slope < 2.0 * bow * before
    least = here - slope * slope / (4.0 * bow) if inside else here
    return least < NEAR * min(abs(last), abs(there))


@njit(**INLINE)
def _is_close(i, numbers):
    """Whether two zeros of the determinant may hide in a step that shows none, or before it."""
    trio = _trio(i, numbers)
    return _dips(*trio, NEAR) or _passed_least(*trio)


@njit(**INLINE)
def _hides_pair(i, numbers):
    """Whether two more zeros of the determinant may hide in a step over a fold, or before it."""
    trio = _beside_fold(i, numbers)
    return _dips(*trio, 1.0) or _passed_least(*trio)


@njit(**INLINE)
def _hides_early(i, numbers):
    """Whether the determinant may touch zero, or cross it twice, in the first step of a lane."""
    before, start, here = numbers[ARC, i], numbers[DET_OLD, i], numbers[DET, i]
    if not (before > 0.0 and start * here > 0.0):
        return False
    start, here = abs(start), abs(here)
    if start < EARLY_NEAR * here:
        return True
    slope, bow = _parabola(*_trio(i, numbers))
    slope -= 2.0 * bow * before
    if not (slope < 0.0 and slope + 2.0 * bow * before > 0.0):
        return False
    return start - slope * slope / (4.0 * bow) < EARLY_DIP * min(start, here)


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
