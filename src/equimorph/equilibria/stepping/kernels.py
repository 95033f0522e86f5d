"""Compiled kernels that take lanes from step to step: start, length and prediction."""

import numpy as np
from numba import njit

from equimorph.equilibria.kernels import (
    AIMING,
    ARC,
    BACK,
    CONVERGED,
    CORNER,
    CORRECTING,
    COUNTS,
    DEFECT,
    DET,
    DET_OLD,
    ENDED,
    INDEX,
    ITERATION,
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
    REFUSED,
    SHORT,
    SLOPE,
    SLOPE_OLD,
    STAGE,
    STEPS,
    STUCK,
    SUMS,
    T_OLD,
    TRAVELLED,
    TRIAL,
    TURN,
    TURNING,
    WEIGHT,
    T,
)


@njit(**{**SUMS, "_nrt": True})
def proceed(new_tangent, mass, places, numbers, counts, active, smallest):
    """Take over accepted steps, shorten refused ones, and try the next step of each lane.

    Returns how many lanes are finished, and how many of them are given up.
    """
    finished, given_up = 0, 0
    for i in range(active):
        stage = counts[STAGE, i]
        if stage not in (CONVERGED, REFUSED):
            finished += stage == ENDED
            continue
        if stage == CONVERGED:
            _take_over(i, new_tangent, mass, places, numbers, counts)
        else:
            numbers[LENGTH, i] *= BACK
        counts[STEPS, i] += 1
        if not numbers[LENGTH, i] >= smallest:
            counts[STAGE, i] = SHORT
        elif counts[STEPS, i] >= counts[MOST, i]:
            counts[STAGE, i] = LONG
        else:
            predict(i, mass, places, numbers, counts)
            continue
        finished, given_up = finished + 1, given_up + 1
    return finished, given_up


@njit(**SUMS)
def _take_over(i, new_tangent, mass, places, numbers, counts):
    """Make the end of an accepted step the place of the lane, and choose the next length."""
    z_old, tangent_old, z, tangent, trial, _ = places
    n, norm = mass.shape[0], 1.0 / numbers[NORM, i]
    chord = 0.0
    for j in range(n):
        dz = trial[i, j] - z[i, j]
        chord += mass[j] * dz * dz
    # loops over few arrays, so that the compiler can tell that they do not overlap
    for j in range(z.shape[1]):
        z_old[i, j] = z[i, j]
    for j in range(z.shape[1]):
        z[i, j] = trial[i, j]
    for j in range(z.shape[1]):
        tangent_old[i, j] = tangent[i, j]
    for j in range(z.shape[1]):
        tangent[i, j] = new_tangent[i, j] * norm
    dt = numbers[TRIAL, i] - numbers[T, i]
    chord = np.sqrt(chord + numbers[WEIGHT, i] * dt * dt)
    half, length = 0.5 * numbers[TURN, i], numbers[LENGTH, i]
    # arclength over chord, as on a circle
    numbers[ARC, i] = chord * half / np.sin(half) if half > 1e-4 else chord
    numbers[T_OLD, i], numbers[SLOPE_OLD, i] = numbers[T, i], numbers[SLOPE, i]
    numbers[T, i], numbers[SLOPE, i] = numbers[TRIAL, i], numbers[NEW_SLOPE, i]
    counts[INDEX, i] = counts[NEW_INDEX, i]
    numbers[DET_OLD, i], numbers[DET, i] = numbers[DET, i], numbers[NEW_DET, i]
    numbers[TRAVELLED, i] += length
    growth = numbers[TURNING, i] / max(numbers[TURN, i], 1e-3)
    numbers[LENGTH, i] = min(length * min(max(growth, 0.5), 2.0), numbers[LARGEST, i])


@njit(**SUMS)
def predict(i, mass, places, numbers, counts):
    """Guess the end of the next step of lane i, and prepare the equation that closes it.

    That is the pseudo-arclength, or the end of t where the step would lead beyond it.
    """
    _, _, z, tangent, trial, row = places
    n, size = mass.shape[0], z.shape[1]
    numbers[LAST, i], counts[ITERATION, i] = np.inf, 0
    goal = 1.0 if numbers[SLOPE, i] > 0.0 else 0.0
    ahead = _predicted(i, numbers[LENGTH, i], numbers)
    if (ahead > goal) == (goal == 1.0):
        numbers[LENGTH, i] = _length_to(i, goal, numbers)
        _guess(i, places, numbers)
        for j in range(size):
            row[i, j] = 0.0
        numbers[TRIAL, i], numbers[CORNER, i], numbers[DEFECT, i] = goal, 1.0, 0.0
        counts[STAGE, i] = AIMING
        return
    _guess(i, places, numbers)
    along = 0.0
    for j in range(n):
        row[i, j] = mass[j] * tangent[i, j]
    for j in range(n):
        along += row[i, j] * (trial[i, j] - z[i, j])
    for j in range(n, size):
        row[i, j] = 0.0
    numbers[TRIAL, i] = ahead
    numbers[CORNER, i] = numbers[WEIGHT, i] * numbers[SLOPE, i]
    along += numbers[CORNER, i] * (ahead - numbers[T, i])
    numbers[DEFECT, i] = along - numbers[LENGTH, i]
    counts[STAGE, i] = CORRECTING


@njit(**SUMS)
def _weights(length, arc):
    """Factors of the old point, its tangent and the present one in the cubic, continued."""
    s = 1.0 + length / arc
    a = 2 * s * s * s - 3 * s * s + 1
    return a, (s * s * s - 2 * s * s + s) * arc, (s * s * s - s * s) * arc


@njit(**SUMS)
def _predicted(i, length, numbers):
    """Predict t at the end of a step: on the cubic through the last two points, or the tangent."""
    t, slope, arc = numbers[T, i], numbers[SLOPE, i], numbers[ARC, i]
    if not arc > 0.0:
        return t + length * slope
    a, c, d = _weights(length, arc)
    return t + (a * (numbers[T_OLD, i] - t) + c * numbers[SLOPE_OLD, i] + d * slope)


@njit(**SUMS)
def _length_to(i, goal, numbers):
    """Length at which t is predicted to reach its end, by bisection."""
    low, high = 0.0, numbers[LENGTH, i]
    if not numbers[ARC, i] > 0.0:
        return (goal - numbers[T, i]) / numbers[SLOPE, i]
    for _ in range(40):
        length = 0.5 * (low + high)
        if (_predicted(i, length, numbers) > goal) == (goal == 1.0):
            high = length
        else:
            low = length
    return high


@njit(**SUMS)
def _guess(i, places, numbers):
    """Predict the point at the end of the step."""
    z_old, tangent_old, z, tangent, trial, _ = places
    size, length = z.shape[1], numbers[LENGTH, i]
    if not numbers[ARC, i] > 0.0:
        for j in range(size):
            trial[i, j] = z[i, j] + length * tangent[i, j]
        return
    a, c, d = _weights(length, numbers[ARC, i])
    for j in range(size):
        trial[i, j] = z[i, j] + a * (z_old[i, j] - z[i, j])
    for j in range(size):
        trial[i, j] += c * tangent_old[i, j] + d * tangent[i, j]


@njit(**{**SUMS, "_nrt": True})
def seat(lanes, levels, knobs, start, move, mass, weight, places, numbers, counts, active):
    """Start lanes behind the active ones at t = 0; return how many cannot be started.

    `start`: their points; `move`: their corrections, tangents, dt/ds, index and determinants;
    `knobs`: first and largest step, turning and most steps for each level of retries.
    """
    dz, tangent, slope, index, determinant = move
    _, _, z_here, tangent_here, _, _ = places
    n, size, stuck = mass.shape[0], start.shape[1], 0
    for k in range(lanes.shape[0]):
        i, level = active + k, levels[k]
        total = 0.0
        for j in range(n):
            total += mass[j] * tangent[k, j] * tangent[k, j]
        squared = weight[k] * weight[k]
        norm = 1.0 / np.sqrt(total + squared * slope[k] * slope[k])
        for j in range(size):
            z_here[i, j] = start[k, j] + dz[k, j]
            tangent_here[i, j] = tangent[k, j] * norm
        for row in range(NUMBERS):
            numbers[row, i] = 0.0
        for row in range(COUNTS):
            counts[row, i] = 0
        numbers[SLOPE, i], numbers[WEIGHT, i] = slope[k] * norm, squared
        numbers[DET, i] = determinant[k]
        numbers[LENGTH, i], numbers[LARGEST, i] = knobs[0, level], knobs[1, level]
        numbers[TURNING, i], counts[MOST, i] = knobs[2, level], int(knobs[3, level])
        counts[LANE, i], counts[INDEX, i], counts[LEVEL, i] = lanes[k], index[k], level
        if np.isfinite(total) and numbers[SLOPE, i] > LEVEL_SLOPE:
            predict(i, mass, places, numbers, counts)
        else:
            counts[STAGE, i] = STUCK
            stuck += 1
    return stuck
