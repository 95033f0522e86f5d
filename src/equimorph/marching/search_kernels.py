"""The search for roots inside steps as one loop that structures make theirs; see `tick_kernels`."""

from equimorph.linalg.compiled import njit, template
from equimorph.linalg.kernels import FLAGS
from equimorph.linalg.simd import LANES
from equimorph.marching.event_kernels import begin, hand_out, shrink
from equimorph.marching.kernels import (
    CORNER,
    DEFECT,
    EXACT,
    NEW_SLOPE,
    SUMS,
    close_gaps,
    correct,
)
from equimorph.marching.tick_kernels import (
    ACTIVE,
    CORRECT,
    IDLE,
    PHASE,
    STEP,
    UNSAFE,
    WAITING,
    any_below,
    gather,
    lay_out,
)


@njit(**{**SUMS, "_nrt": True})
def admit(weight, mass, steps, places, numbers, counts, ends, state):
    """Let searches that wait begin in the free rows."""
    while state[ACTIVE] < places[0].shape[0] and state[WAITING] < weight.shape[0]:
        i, lane = state[ACTIVE], state[WAITING]
        begin(i, lane, weight, mass, steps, places, numbers, counts, ends)
        state[ACTIVE], state[WAITING] = i + 1, lane + 1


def search_of(step, excess):
    """Loop that finds folds, or violated constraints, with kernels as of `march_of`."""

    @template(**FLAGS)
    def measure(work, tables, bounds, line, block, scratch, values):
        """The scalars at trial points: dt/ds, or the largest excess over a constraint."""
        places, numbers, counts, _, state = block
        z, p, at, found = scratch[2:6]
        if bounds.shape[0] == 0:
            for i in range(state[ACTIVE]):
                values[i] = numbers[NEW_SLOPE, i]
            return
        count = gather(line, places[5], numbers, counts, state[ACTIVE], z, p, at)
        if count > 0:
            excess(work, tables, z[:count], p[:count], bounds, found)
            for i in range(count):
                values[at[i]] = found[0, i]
                for k in range(1, bounds.shape[0]):
                    values[at[i]] = max(values[at[i]], found[k, i])

    @template(**FLAGS)
    def search(work, tables, bounds, problem, steps, block, move, scratch, values, root):
        """Search until every lane is finished, or the structure has to take a step itself."""
        line, weight, mass, guard = problem
        places, numbers, counts, ends, state = block
        dz, dt, tangent, slope, residual, index, determinant, ratio = move
        trial, row = places[5], places[6]
        z, t, at, found = root
        p, dp, force, growth = scratch[0], scratch[1], scratch[6], scratch[7]
        while True:
            if state[PHASE] == STEP:
                admit(weight, mass, steps, places, numbers, counts, ends, state)
                active = state[ACTIVE]
                if active == 0:
                    return IDLE
                lay_out(line, trial, row, numbers, counts, active, scratch)
                n = max(active, LANES)
                step(
                    work, tables, trial[:n], p[:n], dp[:n], row[:n], numbers[CORNER, :n],
                    numbers[DEFECT, :n], force[:n], growth[:n], dz[:n], dt[:n], tangent[:n],
                    slope[:n], residual[:n], index[:n], determinant[:n], ratio[:n],
                )  # fmt: skip
                state[PHASE] = CORRECT
                if any_below(ratio, active, guard):
                    return UNSAFE
            active = state[ACTIVE]
            correct(dz, dt, tangent, slope, mass, trial, numbers, counts, active, EXACT, 0.0)
            measure(work, tables, bounds, line, block, scratch, values)
            shrink(values, tangent, mass, places, numbers, counts, ends, active)
            hand_out(places, counts, ends, active, z, t, at, found)
            state[ACTIVE] = close_gaps(places, numbers, counts, ends, active)
            state[PHASE] = STEP

    return search
