"""Judgement of steps that converged: what happened in them, and which may hide something.

Zeros of the determinant of F_z, and turns of t, that the ends of a step do not show, are told by
its values at the last three places and the cubic through t.
"""

from math import ldexp

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.marching.kernels import (
    ARC,
    ARRIVAL,
    BRANCH,
    BRIEF,
    CONVERGED,
    CORRECTING,
    CRITICAL,
    DEFECT,
    DET,
    DET_OLD,
    EARLY,
    EXACT,
    FOLD,
    HIDDEN,
    INDEX,
    INLINE,
    ITERATION,
    LAST,
    LENGTH,
    MOST_ITERATIONS,
    NEW_DET,
    NEW_INDEX,
    NEW_SLOPE,
    REFUSED,
    RETURN,
    SLOPE,
    STAGE,
    TRAVELLED,
    TRIAL,
    UNIT,
    WHAT,
    T,
)

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
