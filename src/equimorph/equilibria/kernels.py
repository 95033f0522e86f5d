"""Compiled kernels of lanes that march along curves: one lane a row, whatever the structure.

Every lane is a small machine with its own stage, step and iteration; a kernel takes each lane as
far as it gets without another Newton step of the structure. Scalars of the lanes are the rows of
`numbers` and `counts`, named below. Lanes do not look at each other, so that what a lane does is
the same, bit for bit, whichever lanes march beside it.
"""

import numpy as np
from numba import njit

from equimorph.linalg.kernels import FLAGS

SUMS = {**FLAGS, "fastmath": {"contract", "reassoc"}, "_nrt": False}
"""Sums over the entries of one lane may be reordered: always in the same way."""

(
    T, SLOPE, T_OLD, SLOPE_OLD, ARC, TRIAL, CORNER, DEFECT, LENGTH, TRAVELLED, LAST, WEIGHT,
    LARGEST, TURNING, NEW_SLOPE, NORM, TURN, DET_OLD, DET, NEW_DET,
) = range(20)  # fmt: skip
"""Rows of `numbers`: t and dt/ds here and at the step before, its arclength; t, closing equation
and length of the step that is tried; way so far; last correction; squared weight of dt; knobs;
dt/ds at the end, length of the tangent and turning angle of a step that converged; determinant of
F_z at the step before, here and at the end."""
NUMBERS = 20

LANE, STAGE, ITERATION, INDEX, NEW_INDEX, WHAT, STEPS, MOST, LEVEL = range(9)
"""Rows of `counts`: number of the lane; stage; Newton steps so far; index here and at the end of
the step; events in the step; steps so far and their limit; number of retries."""
COUNTS = 9

CORRECTING, CONVERGED, REFUSED, ENDED, SHORT, LONG, STUCK = range(7)
"""Stages: in Newton's iteration; step converged; step refused; lane finished; given up because its
step is too short, it took too many, or its start is singular."""

ARRIVAL, RETURN, FOLD, BRANCH, CONSTRAINT = 1, 2, 4, 8, 16
"""Bits of what can happen in a step."""

LEVEL_SLOPE = 1e-6
"""Slope dt/ds of a start that counts as zero: it lies on a fold, and leads nowhere in t."""

ACCEPTED, EXACT = 1e-7, 1e-10
"""Size of the last correction on the way, and where events are: Newton is quadratic, so that the
point itself is good to the square, but the tangent belongs to the point before."""
NEARLY, NEXT = 1e-5, 1e-11
"""Last correction on the way if the next one, by the rate of the last two, would be below."""
MOST_ITERATIONS = 7
FIRST_SHARE = 0.25
"""First correction over the step: more could lead to another branch."""
LEAST_COSINE = 0.9
"""Of the angle between the tangents at both ends of a step."""
MULTIPLIER_WEIGHT = 1e-2
"""Weight of the multipliers' squares in the norm of corrections (they are not in the metric)."""
BACK = 0.4
"""Factor of a step's length after a refusal."""
DIP, WIDE = 0.1, 1e-3
"""Least determinant inside a step, as a share of those at its ends, below which the step may hide
two events; length from which on it is refused then."""


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


@njit(**SUMS)
def correct(dz, dt, tangent, slope, mass, trial, numbers, counts, active, accepted, nearly):
    """Apply a Newton correction to each lane in its iteration; tell whether it converged.

    The first correction has to be below a quarter of the step and each later one below half of the
    one before; at the end the tangents have to agree. The last one is below `accepted`, or up to
    `nearly` if the next one would be below `NEXT`, by the rate of the last two.
    """
    n, size = mass.shape[0], trial.shape[1]
    for i in range(active):
        if counts[STAGE, i] != CORRECTING:
            continue
        total, extra = 0.0, 0.0
        for j in range(n):
            total += mass[j] * dz[i, j] * dz[i, j]
        for j in range(n, size):
            extra += dz[i, j] * dz[i, j]
        weight, last = numbers[WEIGHT, i], numbers[LAST, i]
        correction = np.sqrt(total + weight * dt[i] * dt[i] + MULTIPLIER_WEIGHT * extra)
        first = counts[ITERATION, i] == 0
        limit = FIRST_SHARE * numbers[LENGTH, i] if first else 0.5 * last
        if not correction <= max(limit, accepted):
            counts[STAGE, i] = REFUSED
            continue
        for j in range(size):
            trial[i, j] += dz[i, j]
        numbers[TRIAL, i] += dt[i]
        ratio = 1.0 if first else correction / last
        close = correction <= nearly and correction * ratio * ratio <= NEXT
        if not (correction <= accepted or close):
            counts[ITERATION, i] += 1
            numbers[LAST, i] = correction
            # the closing equation is linear: the correction has met it
            numbers[DEFECT, i] = 0.0
            if counts[ITERATION, i] == MOST_ITERATIONS:
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
        counts[STAGE, i] = CONVERGED
        numbers[NORM, i] = norm
        numbers[NEW_SLOPE, i] = slope[i] / norm
        numbers[TURN, i] = np.arccos(min(1.0 / norm, 1.0))


@njit(**{**SUMS, "_nrt": True})
def judge(index, determinant, numbers, counts, active, smallest, locates):
    """Tell what happened in steps that converged, and refuse those that hide something.

    Returns how many steps are good, and in how many of them something happened that only a branch
    point explains.
    """
    good, doubtful = 0, 0
    for i in range(active):
        if counts[STAGE, i] != CONVERGED:
            continue
        counts[NEW_INDEX, i], numbers[NEW_DET, i] = index[i], determinant[i]
        old, new, length = numbers[SLOPE, i], numbers[NEW_SLOPE, i], numbers[LENGTH, i]
        start, end = numbers[T, i], numbers[TRIAL, i]
        flipped = np.sign(new) != np.sign(old)
        changed = abs(index[i] - counts[INDEX, i])
        # at a fold the path turns and the index changes; at a branch point one without the other
        fold = flipped and changed == 1
        what = FOLD if fold else (BRANCH if flipped or changed == 1 else 0)
        what |= ARRIVAL if end >= 1.0 else 0
        what |= RETURN if end < 0.0 else 0
        counts[WHAT, i] = what
        # a turn hides an arrival if t went beyond 1 (or below 0) and came back within the step;
        # a step this short cannot go beyond by more than round-off
        reach = start + old * length
        hidden = reach >= 1.0 if old > 0.0 else reach <= 0.0
        hidden = (hidden or (what & (ARRIVAL | RETURN)) != 0) and length > 10 * smallest
        bad = changed > 1 or (flipped and hidden) or _turns_twice(old, new, end - start, length)
        bad = bad or (length > WIDE and changed == 0 and _dips(i, numbers))
        if bad or (flipped and not fold and not locates):
            counts[STAGE, i] = REFUSED
            continue
        good += 1
        doubtful += (what & BRANCH) != 0
    return good, doubtful


@njit(**SUMS)
def _turns_twice(old, new, gain, length):
    """Whether t runs back inside a step that leaves it rising, or falling, at both ends.

    By the least slope of the cubic through both ends and slopes: near a cusp two folds lie close
    together, with the same index before and behind.
    """
    sign = np.sign(old)
    rise, a, b = sign * gain / length, sign * old, sign * new
    if not b > 0.0:
        return False
    # slope at share s: a + 2 s (3 rise - 2 a - b) + 3 s² (a + b - 2 rise)
    bend, bow = 3 * rise - 2 * a - b, a + b - 2 * rise
    share = min(max(-bend / (3 * bow), 0.0), 1.0) if bow > 0.0 else 0.0
    return a + 2 * share * bend + 3 * share * share * bow < 0.0


@njit(**SUMS)
def _dips(i, numbers):
    """Whether the determinant may touch zero, or cross it twice, inside a step.

    By the parabola through its values at both ends and at the end of the step before.
    """
    before, length = numbers[ARC, i], numbers[LENGTH, i]
    here, there = numbers[DET, i], numbers[NEW_DET, i]
    if not (before > 0.0 and here * there > 0.0):
        return False
    sign = np.sign(here)
    last, here, there = sign * numbers[DET_OLD, i], sign * here, sign * there
    rise, next_rise = (here - last) / before, (there - here) / length
    bow = (next_rise - rise) / (before + length)
    slope = rise + bow * before
    # the least value lies inside if the parabola falls at the start and rises at the end
    if not (slope < 0.0 and slope + 2.0 * bow * length > 0.0):
        return False
    return here - slope * slope / (4.0 * bow) < DIP * min(here, there)


@njit(**SUMS)
def file_events(new_tangent, stops, places, numbers, counts, active, buffer, filled):
    """Copy the steps in which something happened behind others; end lanes; return how many."""
    _, _, z, tangent, trial, _ = places
    z0, tangent0, z1, tangent1, values, names = buffer
    for i in range(active):
        what = counts[WHAT, i]
        if counts[STAGE, i] != CONVERGED or what == 0:
            continue
        norm = 1.0 / numbers[NORM, i]
        for j in range(z.shape[1]):
            z0[filled, j], tangent0[filled, j] = z[i, j], tangent[i, j]
        for j in range(z.shape[1]):
            z1[filled, j], tangent1[filled, j] = trial[i, j], new_tangent[i, j] * norm
        values[0, filled], values[1, filled] = numbers[T, i], numbers[SLOPE, i]
        values[2, filled], values[3, filled] = numbers[TRIAL, i], numbers[NEW_SLOPE, i]
        values[4, filled], values[5, filled] = numbers[LENGTH, i], numbers[TRAVELLED, i]
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
    """Guess the end of the next step of lane i: the cubic through the last two points, continued.

    At first the tangent. Prepares the closing equation of the pseudo-arclength as well.
    """
    z_old, tangent_old, z, tangent, trial, row = places
    n, size, length, arc = mass.shape[0], z.shape[1], numbers[LENGTH, i], numbers[ARC, i]
    if arc > 0.0:
        s = 1.0 + length / arc
        a = 2 * s * s * s - 3 * s * s + 1
        c, d = (s * s * s - 2 * s * s + s) * arc, (s * s * s - s * s) * arc
        for j in range(size):
            trial[i, j] = z[i, j] + a * (z_old[i, j] - z[i, j])
        for j in range(size):
            trial[i, j] += c * tangent_old[i, j] + d * tangent[i, j]
        step = a * (numbers[T_OLD, i] - numbers[T, i]) + c * numbers[SLOPE_OLD, i]
        numbers[TRIAL, i] = numbers[T, i] + step + d * numbers[SLOPE, i]
    else:
        for j in range(size):
            trial[i, j] = z[i, j] + length * tangent[i, j]
        numbers[TRIAL, i] = numbers[T, i] + length * numbers[SLOPE, i]
    along = 0.0
    for j in range(n):
        row[i, j] = mass[j] * tangent[i, j]
    for j in range(n):
        along += row[i, j] * (trial[i, j] - z[i, j])
    for j in range(n, size):
        row[i, j] = 0.0
    numbers[CORNER, i] = numbers[WEIGHT, i] * numbers[SLOPE, i]
    along += numbers[CORNER, i] * (numbers[TRIAL, i] - numbers[T, i])
    numbers[DEFECT, i] = along - length
    numbers[LAST, i] = np.inf
    counts[ITERATION, i], counts[STAGE, i] = 0, CORRECTING


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


@njit(**SUMS)
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
