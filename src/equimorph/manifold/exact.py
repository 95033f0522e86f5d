"""Newton at fixed parameters until states are exact to round-off."""

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.structures import Structure

ITERATIONS = 12
ROUND_OFF = 1e-14
"""Bound of the next Newton correction, in the metric, below which a state is exact."""
SETTLED = 2
"""Corrections after which a lane whose index is not the wanted one is given up."""
FEW = 16
"""Lanes that are corrected together to the end: to sort out the exact ones would cost more."""

Points = Float[np.ndarray, "points P"]
Lanes = Float[np.ndarray, "lanes size"]


def exact_states(
    structure: Structure, z: Lanes, p: Points, wanted: Int[np.ndarray, " lanes"] | None = None
) -> tuple[Lanes, Bool[np.ndarray, " lanes"], Int[np.ndarray, " lanes"]]:
    """Newton at fixed parameters until the next correction would be round-off; and the index.

    Corrections shrink quadratically: the one after sizes a and b is about b (b/a)². Where there is
    no state beyond a fold, Newton leaps over the fold again and again: lanes that do not get nearer
    and do not have the `wanted` index, if one is given, are given up.
    """
    n, count = structure.unknowns, len(z)
    out, good, index = z.copy(), np.zeros(count, bool), np.full(count, -1)
    still, fixed = np.zeros((count, structure.size)), np.zeros((count, p.shape[1]))
    none, one = np.zeros((2, count))
    one[:] = 1.0
    # lanes at work, their states and parameters, last corrections, and which are not yet done
    lane, z, before, left = np.arange(count), z.copy(), none, np.ones(count, bool)
    for number in range(ITERATIONS if count else 0):
        m = len(lane)
        step = structure.advance(z, p, fixed[:m], still[:m], one[:m], none[:m])
        size = np.sqrt(np.square(step.dz[:, :n]) @ structure.mass)
        left &= size < 1.0  # and no nan
        if wanted is not None and number >= SETTLED:
            left &= (step.index == wanted[lane]) | (size < 0.5 * before)
        whole = bool(left.all())
        if not whole:
            step.dz[~left] = 0.0
        z += step.dz
        bound = size * (size / np.maximum(np.maximum(before, size), 1e-300)) ** 2
        done = left & (bound < ROUND_OFF)
        if done.any():
            some = lane[done]
            out[some], good[some], index[some] = z[done], True, step.index[done]
            left &= ~done
            whole = False
        before = size
        if not whole and not left.any():
            break
        if m > FEW and not whole:
            lane, z, p, before = lane[left], z[left], p[left], before[left]
            left = left[left]
    return out, good, index
