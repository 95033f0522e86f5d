"""Compiled kernels of one tick of all lanes, and the loop over ticks that structures make theirs.

A tick is one Newton step of every lane and all that follows from it. `march` goes on by itself
until lanes need what is not compiled; its `state` tells where in a tick that was.
"""

import numpy as np

from equimorph.linalg.compiled import njit, template
from equimorph.linalg.kernels import FLAGS
from equimorph.linalg.simd import LANES
from equimorph.marching.constraint_kernels import (
    EARLIER,
    HERE,
    LAST,
    NEW,
    VALUES,
    beside,
    note_excess,
    note_slopes,
    weigh,
)
from equimorph.marching.event_kernels import file_events, file_points
from equimorph.marching.judgement_kernels import judge
from equimorph.marching.kernels import (
    ACCEPTED,
    BESIDE,
    BRANCH,
    CONVERGED,
    CORNER,
    DEFECT,
    EARLY,
    HELD,
    HIDDEN,
    LANE,
    NEARLY,
    STAGE,
    STARTING,
    SUMS,
    TRIAL,
    WAITS,
    WHAT,
    close_gaps,
    correct,
    correct_arrivals,
)
from equimorph.marching.step_kernels import enter, proceed

PHASE, ACTIVE, WAITING, EVENTS, POINTS, SPENT = range(6)
"""Entries of `state`: where in a tick; lanes on their way; how many of those that waited have
entered; steps with events, and points, that are filed; steps that lanes spent waiting."""
STEP, CORRECT, FINISH, CLOSE = range(4)
"""Parts of a tick: Newton step; correction, judgement and constraints; files and the next
prediction; closing of gaps."""
IDLE, UNSAFE, RARE, LOST = range(4)
"""Why `march` returns: nothing is left to do, or files are full; a pivot is unsafe; steps are
doubtful, may hide something or graze a constraint; lanes are given up."""
PATIENCE = 1000
"""Steps that lanes may spend waiting for others: as long as it takes to judge rare steps, or to
solve with unsafe pivots."""
ENOUGH = 4
"""Reciprocal share of free rows from which on more lanes are asked for."""


@njit(**{**SUMS, "_nrt": True})
def refill(start, weight, lanes, levels, places, numbers, counts, state):
    """Let waiting lanes into the free rows."""
    while state[ACTIVE] < places[2].shape[0] and state[WAITING] < lanes.shape[0]:
        at, i = state[WAITING], state[ACTIVE]
        enter(lanes[at], levels[at], i, start, weight, places, numbers, counts)
        state[WAITING], state[ACTIVE] = at + 1, i + 1


@njit(**{**SUMS, "_nrt": True})
def finish(move, mass, knobs, places, numbers, counts, values, files, state, rules):
    """File events and points of good steps, and take all lanes on to their next prediction.

    Returns how many lanes are finished, and how many of them are given up.
    """
    smallest, _, _, stops, records = rules
    active = state[ACTIVE]
    for k in range(0, values.shape[0], VALUES):
        for i in range(active):
            if counts[STAGE, i] == CONVERGED:
                values[k + EARLIER, i], values[k + LAST, i] = (
                    values[k + LAST, i],
                    values[k + HERE, i],
                )
                values[k + HERE, i] = values[k + NEW, i]
            elif counts[STAGE, i] == STARTING:
                values[k + HERE, i] = values[k + NEW, i]
    events, points = files
    state[EVENTS] = file_events(
        move[1], stops, places, numbers, counts, active, events, state[EVENTS]
    )
    if records:
        state[POINTS] = file_points(places[2], numbers, counts, active, points, state[POINTS])
    return proceed(move, mass, knobs, places, numbers, counts, active, smallest)


@njit(**{**FLAGS, "_nrt": False})
def _on_lines(line, times, counts, at, count, p):
    """Parameters of lanes `at` at their places `times` on straight lines.

    Products are stored before the sums: in one loop they would be rounded together, unlike those of
    the general path.
    """
    start, velocity = line[0], line[1]
    for i in range(count):
        lane, t = counts[LANE, at[i]], times[at[i]]
        for c in range(p.shape[1]):
            p[i, c] = t * velocity[lane, c]
    for i in range(count):
        lane = counts[LANE, at[i]]
        for c in range(p.shape[1]):
            p[i, c] += start[lane, c]


@njit(**{**FLAGS, "_nrt": False})
def lay_out(line, trial, row, numbers, counts, active, scratch):
    """Parameters of trial points and their velocities; copies of the last lane fill a vector.

    Where forces act, also these, and how they grow: from `line[2]` at t = 0 to `line[3]` at t = 1.
    """
    p, dp, at, force, growth = scratch[0], scratch[1], scratch[4], scratch[6], scratch[7]
    for i in range(active):
        at[i] = i
    _on_lines(line, numbers[TRIAL], counts, at, active, p)
    for i in range(active):
        lane = counts[LANE, i]
        for c in range(p.shape[1]):
            dp[i, c] = line[1][lane, c]
    last = active - 1
    if force.shape[0] > 0:
        for i in range(max(active, LANES)):
            lane, t = counts[LANE, min(i, last)], numbers[TRIAL, min(i, last)]
            for j in range(force.shape[1]):
                force[i, j], growth[i, j] = (1.0 - t) * line[2][lane, j], t * line[3][lane, j]
        for i in range(max(active, LANES)):
            lane = counts[LANE, min(i, last)]
            for j in range(force.shape[1]):
                force[i, j] += growth[i, j]
                growth[i, j] = line[3][lane, j] - line[2][lane, j]
    for i in range(active, LANES):
        for j in range(row.shape[1]):
            trial[i, j], row[i, j] = trial[last, j], row[last, j]
        for c in range(p.shape[1]):
            p[i, c], dp[i, c] = p[last, c], dp[last, c]
        numbers[CORNER, i], numbers[DEFECT, i] = numbers[CORNER, last], numbers[DEFECT, last]


@njit(**{**FLAGS, "_nrt": False})
def gather(line, trial, numbers, counts, active, z, p, at):
    """Copy starts and the ends of good steps, to fill a vector at least; return how many."""
    count = 0
    for i in range(active):
        if counts[STAGE, i] == CONVERGED or counts[STAGE, i] == STARTING:
            for j in range(z.shape[1]):
                z[count, j] = trial[i, j]
            at[count] = i
            count += 1
    return fill(line, numbers[TRIAL], counts, count, z, p, at)


@njit(**{**FLAGS, "_nrt": False})
def fill(line, times, counts, count, z, p, at):
    """Parameters at places on lines, and copies of the last one to fill a vector; how many."""
    if count == 0:
        return 0
    _on_lines(line, times, counts, at, count, p)
    for i in range(count, LANES):
        for j in range(z.shape[1]):
            z[i, j] = z[count - 1, j]
        for c in range(p.shape[1]):
            p[i, c] = p[count - 1, c]
        at[i] = at[count - 1]
    return max(count, LANES)


@njit(**{**FLAGS, "_nrt": False})
def any_below(ratio, active, least):
    """Whether the ratio of any lane is below the least one, or none."""
    below = 0
    for i in range(active):
        below += not ratio[i] >= least
    return below > 0


@njit(**{**FLAGS, "_nrt": False})
def _hold(counts, ratio, guard, state):
    """Let lanes with unsafe pivots wait for others; whether all that wait are to be solved now.

    Nobody looks at the pivots of lanes that wait to be judged.
    """
    held, waiting, active = 0, 0, state[ACTIVE]
    for i in range(active):
        stage = counts[STAGE, i]
        if stage == WAITS:
            waiting, ratio[i] = waiting + 1, np.inf
        elif not ratio[i] >= guard:
            held += 1
            if stage > WAITS:
                counts[STAGE, i] = HELD - stage
    if held == 0 or (held + waiting < active and state[SPENT] < PATIENCE):
        return False
    state[SPENT] = 0 if waiting == 0 else state[SPENT]
    for i in range(active):
        if counts[STAGE, i] <= HELD:
            counts[STAGE, i] = HELD - counts[STAGE, i]
    return True


@njit(**{**FLAGS, "_nrt": False})
def _assemble(tangent, row, counts, grazing, state, locates):
    """Let rare steps wait for others; whether all that wait are to be judged now.

    That is so as soon as waiting has cost as much as judging will, or no lane is left to wait for.
    Tangents wait in the rows of closing equations, which lanes get anew after their judgement.
    """
    waiting, held, active = 0, 0, state[ACTIVE]
    for i in range(active):
        if counts[STAGE, i] == CONVERGED:
            rare = locates and (counts[WHAT, i] & (BRANCH | HIDDEN | EARLY)) != 0
            for k in range(grazing.shape[0]):
                rare = rare or grazing[k, i]
            if rare:
                counts[STAGE, i] = WAITS
                for j in range(row.shape[1]):
                    row[i, j] = tangent[i, j]
        waiting += counts[STAGE, i] == WAITS
        held += counts[STAGE, i] <= HELD
    state[SPENT] += waiting + held
    if waiting == 0 or (waiting + held < active and state[SPENT] < PATIENCE):
        return False
    state[SPENT] = 0
    for i in range(active):
        if counts[STAGE, i] == WAITS:
            counts[STAGE, i] = CONVERGED
            for j in range(row.shape[1]):
                tangent[i, j] = row[i, j]
    return True


@njit(**{**FLAGS, "_nrt": False})
def _is_idle(state, lanes, files, rows, limits):
    """Whether no lane is left, files are full, or more lanes are wanted and may be there."""
    most_events, more, records = limits
    active = state[ACTIVE]
    if active == 0 or state[EVENTS] >= most_events:
        return True
    if records and state[POINTS] + active > files[1][0].shape[0]:
        return True
    return more and state[WAITING] == lanes.shape[0] and (rows - active) * ENOUGH >= rows


def march_of(step, excess):
    """Loop over ticks with the kernels of a structure.

    Parameters
    ----------
    step, excess
        Kernels ``step(work, tables, z, p, dp, row, corner, defect, force, growth, *move)``, and
        ``excess(work, tables, z, p, bounds, found)`` for values of constraints (constraints, rows),
        if there are any. They need at least a vector of rows; `work` are their arrays, `tables`
        what lanes share.
    """

    @template(**FLAGS)
    def measure(work, tables, bounds, line, block, tangent, scratch):
        """Values of constraints at starts and ends of good steps; which may hide a violation."""
        places, _, numbers, counts, values, grazing, state = block
        if grazing.shape[0] == 0:
            return
        z, p, at, found = scratch[2:6]
        count = gather(line, places[2], numbers, counts, state[ACTIVE], z, p, at)
        if count > 0:
            excess(work, tables, z[:count], p[:count], bounds, found)
            for k in range(grazing.shape[0]):
                for i in range(count):
                    values[VALUES * k + NEW, at[i]] = found[k, i]
        if note_excess(values, numbers, counts, state[ACTIVE], grazing) == 0:
            return
        for side in range(4):
            count = beside(side, places, tangent, numbers, counts, state[ACTIVE], grazing, z, at)
            n = fill(line, numbers[BESIDE], counts, count, z, p, at)
            excess(work, tables, z[:n], p[:n], bounds, found)
            note_slopes(side, found, count, at, values)
        weigh(values, numbers, counts, state[ACTIVE], grazing)

    @template(**FLAGS)
    def march(work, tables, bounds, problem, queue, block, move, files, scratch, rules):
        """March until nothing is left that is compiled; return why."""
        line, weight, mass, knobs, start, guard = problem
        lanes, levels, most_events, more = queue
        places, flat, numbers, counts, values, grazing, state = block
        dz, dt, tangent, slope, residual, index, determinant, ratio = move
        step_of = (dz, tangent, slope, index, determinant)
        _, _, trial, row = places
        p, dp, force, growth = scratch[0], scratch[1], scratch[6], scratch[7]
        smallest, locates, plain, _, records = rules
        while True:
            if state[PHASE] == STEP:
                refill(start, weight, lanes, levels, places, numbers, counts, state)
                if _is_idle(state, lanes, files, trial.shape[0], (most_events, more, records)):
                    return IDLE
                active = state[ACTIVE]
                lay_out(line, trial, row, numbers, counts, active, scratch)
                n = max(active, LANES)
                step(
                    work, tables, trial[:n], p[:n], dp[:n], row[:n], numbers[CORNER, :n],
                    numbers[DEFECT, :n], force[:n], growth[:n], dz[:n], dt[:n], tangent[:n],
                    slope[:n], residual[:n], index[:n], determinant[:n], ratio[:n],
                )  # fmt: skip
                state[PHASE] = CORRECT
                if _hold(counts, ratio, guard, state):
                    return UNSAFE
            active = state[ACTIVE]
            if state[PHASE] == CORRECT:
                around = mass, trial, numbers, counts, active
                correct(dz, dt, tangent, slope, *around, ACCEPTED, NEARLY)
                correct_arrivals(dz, tangent, slope, mass, places, numbers, counts, active)
                judge(index, determinant, numbers, counts, active, smallest, locates, plain)
                measure(work, tables, bounds, line, block, tangent, scratch)
                state[PHASE] = FINISH
                if _assemble(tangent, row, counts, grazing, state, locates):
                    note_excess(values, numbers, counts, active, grazing)
                    weigh(values, numbers, counts, active, grazing)
                    return RARE
            if state[PHASE] == FINISH:
                _, given_up = finish(
                    step_of, mass, knobs, places, numbers, counts, values, files, state, rules
                )
                state[PHASE] = CLOSE
                if given_up > 0:
                    return LOST
            state[ACTIVE] = close_gaps(flat, numbers, counts, values, state[ACTIVE])
            state[PHASE] = STEP

    return march
