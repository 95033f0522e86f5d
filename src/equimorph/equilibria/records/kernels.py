"""Compiled kernels that copy what lanes leave behind as they march."""

from equimorph.equilibria.kernels import (
    BRIEF,
    CONVERGED,
    ENDED,
    HEAD,
    INDEX,
    LANE,
    LENGTH,
    LEVEL,
    NEW_INDEX,
    NEW_SLOPE,
    NORM,
    SLOPE,
    STAGE,
    SUMS,
    TRAVELLED,
    TRIAL,
    WHAT,
    T,
)
from equimorph.linalg.compiled import njit


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
