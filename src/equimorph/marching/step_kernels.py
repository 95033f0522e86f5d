"""Compiled kernels that take lanes from step to step: start, length and prediction."""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.marching.kernels import (
    AIMING,
    ARC,
    BACK,
    BEND,
    CONVERGED,
    CORNER,
    CORRECTING,
    COUNTS,
    DEFECT,
    DET,
    DET_OLD,
    ENDED,
    HEAD,
    INDEX,
    INLINE,
    ITERATION,
    KNOWN,
    LANE,
    LARGEST,
    LAST,
    LENGTH,
    LEVEL,
    LEVEL_SLOPE,
    LONG,
    MOST,
    NEW_DET,
    NEW_INDEX,
    NEW_SLOPE,
    NORM,
    NUMBERS,
    RATE_1,
    RATE_2,
    REFUSED,
    SHORT,
    SLOPE,
    SLOPE_1,
    SLOPE_2,
    STAGE,
    STARTING,
    STEPS,
    STUCK,
    SUMS,
    T_1,
    T_2,
    TRAVELLED,
    TRIAL,
    TURN,
    TURNING,
    UNIT,
    WEIGHT,
    X_1,
    X_2,
    T,
)

MEMORY = 3
"""Points that a lane remembers, the present one included."""
LEAST_RATE = 0.3
"""Cosine of the angle between the present tangent and one before, above which a point counts."""


@njit(**{**SUMS, "_nrt": True})
def proceed(move, mass, knobs, places, numbers, counts, active, smallest):
    """Take over starts and accepted steps, shorten refused ones, and try the next step of lanes.

    `move`: corrections, tangents, dt/ds, index and determinants. Returns how many lanes are
    finished, and how many of them are given up.
    """
    finished, given_up = 0, 0
    for i in range(active):
        stage = counts[STAGE, i]
        if stage == STARTING:
            _start(i, move, mass, knobs, places, numbers, counts)
        elif stage in (CONVERGED, REFUSED):
            if stage == CONVERGED:
                _take_over(i, move[1], places, numbers, counts)
            else:
                numbers[LENGTH, i] *= BACK
            counts[STEPS, i] += 1
            if not numbers[LENGTH, i] >= smallest:
                counts[STAGE, i] = SHORT
            elif counts[STEPS, i] >= counts[MOST, i]:
                counts[STAGE, i] = LONG
        else:
            finished += stage == ENDED
            continue
        if counts[STAGE, i] > ENDED:
            finished, given_up = finished + 1, given_up + 1
        else:
            _predict(i, mass, places, numbers, counts)
    return finished, given_up


@njit(**INLINE)
def _take_over(i, new_tangent, places, numbers, counts):
    """Make the end of an accepted step the place of the lane, and choose the next length."""
    z, tangent, trial, _ = places
    size, norm = trial.shape[1], 1.0 / numbers[NORM, i]
    counts[HEAD, i] = counts[HEAD, i] + 1 if counts[HEAD, i] < MEMORY - 1 else 0
    counts[KNOWN, i] = min(counts[KNOWN, i] + 1, MEMORY - 1)
    here = counts[HEAD, i]
    # loops over few arrays, so that the compiler can tell that they do not overlap
    for j in range(size):
        z[i, here, j] = trial[i, j]
    for j in range(size):
        tangent[i, here, j] = new_tangent[i, j] * norm
    turn, length = numbers[TURN, i], numbers[LENGTH, i]
    # arclength over its part along the tangent, as on a circle
    arc = length * turn / np.sin(turn) if turn > 1e-4 else length
    numbers[T_2, i], numbers[SLOPE_2, i] = numbers[T_1, i], numbers[SLOPE_1, i]
    numbers[T_1, i], numbers[SLOPE_1, i] = numbers[T, i], numbers[SLOPE, i]
    numbers[T, i], numbers[SLOPE, i] = numbers[TRIAL, i], numbers[NEW_SLOPE, i]
    counts[INDEX, i] = counts[NEW_INDEX, i]
    numbers[DET_OLD, i], numbers[DET, i] = numbers[DET, i], numbers[NEW_DET, i]
    numbers[TRAVELLED, i] += length
    growth = numbers[TURNING, i] / max(turn, 1e-3)
    length = min(length * min(max(growth, 0.5), 2.0), numbers[LARGEST, i])
    numbers[LENGTH, i] = _before_bends(i, length, arc, turn / arc, numbers)
    numbers[ARC, i], numbers[BEND, i] = arc, turn / arc


@njit(**INLINE)
def _before_bends(i, length, arc, bend, numbers):
    """Shorten a step that would turn too far if the curvature of the path grows on as it did.

    Towards a fold it grows within few steps, and those that go too far are the dearest.
    """
    old = numbers[BEND, i]
    if not (bend > old > 0.0):
        return length
    trend = np.log(bend / old) / (arc + numbers[ARC, i])
    for _ in range(8):
        if length * bend * np.exp(trend * (length + arc)) <= numbers[TURNING, i]:
            break
        length *= 0.8
    return length


@njit(**INLINE)
def _predict(i, mass, places, numbers, counts):
    """Guess the end of the next step of lane i, and prepare the equation that closes it.

    That is the pseudo-arclength, which the guess obeys already, or the end of t where the step
    would lead beyond it.
    """
    _look_back(i, mass, places, numbers, counts)
    numbers[LAST, i], counts[ITERATION, i] = np.inf, 0
    goal = 1.0 if numbers[SLOPE, i] > 0.0 else 0.0
    factors = _weights(i, numbers[LENGTH, i], numbers, counts)
    ahead = _predicted(i, factors, numbers)
    aims = (ahead > goal) == (goal == 1.0)
    if aims:
        numbers[LENGTH, i] = _length_to(i, goal, numbers, counts)
        factors = _weights(i, numbers[LENGTH, i], numbers, counts)
    _guess(i, factors, places, counts)
    numbers[TRIAL, i], numbers[DEFECT, i] = ahead, 0.0
    numbers[CORNER, i] = numbers[WEIGHT, i] * numbers[SLOPE, i]
    counts[STAGE, i] = AIMING if aims else CORRECTING
    if aims:
        row = places[3]
        for j in range(row.shape[1]):
            row[i, j] = 0.0
        numbers[TRIAL, i], numbers[CORNER, i] = goal, 1.0


@njit(**INLINE)
def _look_back(i, mass, places, numbers, counts):
    """Where the points before lie along the present tangent, whose row is left in `places`.

    With that coordinate x the curve is a graph, and its derivative at every point is the tangent
    there over the cosine of the angle between.
    """
    z, tangent, _, row = places
    n, size = mass.shape[0], row.shape[1]
    here = counts[HEAD, i]
    corner = numbers[WEIGHT, i] * numbers[SLOPE, i]
    for j in range(n):
        row[i, j] = mass[j] * tangent[i, here, j]
    for j in range(n, size):
        row[i, j] = 0.0
    for back in range(counts[KNOWN, i]):
        then, along, rate = _before(i, back + 1, counts), 0.0, 0.0
        for j in range(n):
            along += row[i, j] * (z[i, then, j] - z[i, here, j])
            rate += row[i, j] * tangent[i, then, j]
        along += corner * (numbers[T_1 + 2 * back, i] - numbers[T, i])
        rate += corner * numbers[SLOPE_1 + 2 * back, i]
        behind = along < (numbers[X_1, i] if back > 0 else 0.0)
        if not (behind and rate > LEAST_RATE):
            counts[KNOWN, i] = back
            return
        numbers[X_1 + 2 * back, i], numbers[RATE_1 + 2 * back, i] = along, rate


@njit(**INLINE)
def _before(i, steps, counts):
    """Which of the remembered points of lane i was the present one so many steps ago."""
    then = counts[HEAD, i] - min(steps, counts[KNOWN, i])
    return then if then >= 0 else then + MEMORY


@njit(**INLINE)
def _weights(i, x, numbers, counts):
    """Factors of a polynomial at x: of the points before less the present one, of all tangents.

    It has the values and slopes of all known points (Hermite's interpolation).
    """
    x1, x2 = numbers[X_1, i], numbers[X_2, i]
    if counts[KNOWN, i] == 0:
        return 0.0, 0.0, x, 0.0, 0.0
    if counts[KNOWN, i] == 1:
        first, other = 1.0 - x / x1, x / x1
        last = (3.0 - 2.0 * other) * other * other, (x - x1) * other * other
        return last[0], 0.0, x * first * first, last[1] / numbers[RATE_1, i], 0.0
    here = (x - x1) * (x - x2) / (x1 * x2)
    one, two = x * (x - x2) / (x1 * (x1 - x2)), x * (x - x1) / (x2 * (x2 - x1))
    slope_one, slope_two = 1.0 / x1 + 1.0 / (x1 - x2), 1.0 / x2 + 1.0 / (x2 - x1)
    one, two, here = one * one, two * two, here * here
    return (
        (1.0 - 2.0 * (x - x1) * slope_one) * one,
        (1.0 - 2.0 * (x - x2) * slope_two) * two,
        x * here,
        (x - x1) * one / numbers[RATE_1, i],
        (x - x2) * two / numbers[RATE_2, i],
    )


@njit(**INLINE)
def _predicted(i, factors, numbers):
    """Predict t at the end of a step."""
    one, two, here, slope_one, slope_two = factors
    t = numbers[T, i]
    back = one * (numbers[T_1, i] - t) + two * (numbers[T_2, i] - t)
    slopes = slope_one * numbers[SLOPE_1, i] + slope_two * numbers[SLOPE_2, i]
    return t + (back + here * numbers[SLOPE, i] + slopes)


@njit(**SUMS)
def _length_to(i, goal, numbers, counts):
    """Length at which t is predicted to reach its end, by bisection."""
    low, high = 0.0, numbers[LENGTH, i]
    for _ in range(50):
        length = 0.5 * (low + high)
        ahead = _predicted(i, _weights(i, length, numbers, counts), numbers)
        if (ahead > goal) == (goal == 1.0):
            high = length
        else:
            low = length
    return high


@njit(**INLINE)
def _guess(i, factors, places, counts):
    """Predict the point at the end of the step."""
    z, tangent, trial, _ = places
    here, one, two = counts[HEAD, i], _before(i, 1, counts), _before(i, 2, counts)
    a, b, c, d, e = factors
    rest = 1.0 - a - b
    for j in range(trial.shape[1]):
        trial[i, j] = (
            rest * z[i, here, j] + a * z[i, one, j] + b * z[i, two, j]
            + (c * tangent[i, here, j] + d * tangent[i, one, j] + e * tangent[i, two, j])
        )  # fmt: skip


@njit(**SUMS)
def _start(i, move, mass, knobs, places, numbers, counts):
    """Take lane i over to its corrected start, which may lead nowhere.

    `knobs`: first and largest step, turning and most steps for each level of retries.
    """
    dz, tangent, slope, index, determinant = move
    z_here, tangent_here, trial, _ = places
    n, size, level = mass.shape[0], trial.shape[1], counts[LEVEL, i]
    total = 0.0
    for j in range(n):
        total += mass[j] * tangent[i, j] * tangent[i, j]
    norm = 1.0 / np.sqrt(total + numbers[WEIGHT, i] * slope[i] * slope[i])
    for j in range(size):
        z_here[i, 0, j] = trial[i, j] + dz[i, j]
    for j in range(size):
        tangent_here[i, 0, j] = tangent[i, j] * norm
    numbers[SLOPE, i] = slope[i] * norm
    numbers[DET, i], numbers[UNIT, i] = determinant[i, 0], determinant[i, 1]
    numbers[LENGTH, i], numbers[LARGEST, i] = knobs[0, level], knobs[1, level]
    numbers[TURNING, i], counts[MOST, i] = knobs[2, level], int(knobs[3, level])
    counts[INDEX, i] = index[i]
    # the slope per length, however far the goal is
    steep = numbers[SLOPE, i] * max(1.0, np.sqrt(numbers[WEIGHT, i]))
    if not (np.isfinite(total) and steep > LEVEL_SLOPE):
        counts[STAGE, i] = STUCK


@njit(**SUMS)
def enter(lane, level, i, start, weight, places, numbers, counts):
    """Place a lane in row i at t = 0, where its first Newton step is one at fixed t."""
    _, _, trial, row = places
    for j in range(row.shape[1]):
        trial[i, j], row[i, j] = start[lane, j], 0.0
    for k in range(NUMBERS):
        numbers[k, i] = 0.0
    for k in range(COUNTS):
        counts[k, i] = 0
    numbers[WEIGHT, i], numbers[CORNER, i] = weight[lane] * weight[lane], 1.0
    counts[LANE, i], counts[LEVEL, i], counts[STAGE, i] = lane, level, STARTING
