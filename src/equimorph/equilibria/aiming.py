"""Newton for equilibria whose descriptors take given values."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.equilibria.lifting.pieces import interpolated
from equimorph.equilibria.lifting.tracked import TrackedCurve
from equimorph.model import Descriptor
from equimorph.structures import Structure

Lanes = Float[np.ndarray, "lanes size"]
Parameters = Float[np.ndarray, "lanes parameters"]

EXACT = 1e-10
"""Last correction, in the metric and scaled parameters, of a point that counts as found."""
ITERATIONS, LONGEST = 30, 0.3
"""Most steps, and the length, in the metric and scaled parameters, to which they are shortened."""


def newton_at_targets(
    structure: Structure,
    guesses: tuple[Lanes, Parameters],
    free: Int[np.ndarray, " k"],
    descriptors: Sequence[Descriptor],
    targets: Float[np.ndarray, "lanes k"],
) -> tuple[Lanes, Parameters, Bool[np.ndarray, " lanes"]]:
    """Solve F(z; p) = 0 and S(z, p) = S* for z and some of the parameters.

    Regular at folds, where the parameters alone would not do. Long steps are shortened.

    Parameters
    ----------
    guesses
        z and p to start from.
    free
        Places of the unknown parameters, as many as descriptors.
    targets
        S* for each lane.

    Returns
    -------
    z, p, and whether the last correction was at round-off.
    """
    z, p = guesses
    given = np.concatenate([p, targets], axis=1)
    lanes = len(z)
    still = interpolated(np.array([0.0, 1.0]), lambda _: given, lanes, 0)
    whole = TrackedCurve(structure, still, free, tuple(descriptors), np.ones(lanes))
    x, found, todo = whole.begin(z, p), np.zeros(lanes, bool), np.arange(lanes)
    n, mass = whole.metric.unknowns, whole.metric.mass
    for _ in range(ITERATIONS):
        curve, here = whole.take(todo), x[todo]
        none, one = np.zeros(len(todo)), np.ones(len(todo))
        step = curve.advance(here, none, np.zeros_like(here), one, none).dz
        size = np.sqrt(step[:, :n] ** 2 @ mass)
        alive = np.isfinite(step).all(axis=1)
        share = np.minimum(1.0, LONGEST / np.maximum(size, 1e-300))
        x[todo[alive]] += share[alive, None] * step[alive]
        small = alive & (size < EXACT)
        found[todo[small]] = True
        todo = todo[alive & ~small]
        if len(todo) == 0:
            break
    z, p = whole.states(x, np.zeros(lanes))
    return z, p, found
